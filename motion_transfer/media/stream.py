"""What every kind of IUV driver offers: a known length, and frames decoded when asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from motion_transfer.media.iuv_image import ChannelOrder, Raw


class IuvStream(ABC):
    """Frames in the file's own channel order; `IuvReader` turns them to (I, U, V).

    Attributes:
        order: the channel order where the format itself settles it, else None.
        gaps: numbers missing from a folder, each of whose places is filled.
        notes: what the user should know of how this driver is read, in sentences.
    """

    def __init__(self, path: Path, kind: str, frame_count: int) -> None:
        self.path = path
        self.kind = kind
        self.frame_count = frame_count
        self.frame_rate: Fraction | None = None
        self.order: ChannelOrder | None = None
        self.gaps: tuple[int, ...] = ()
        self.notes: tuple[str, ...] = ()

    @abstractmethod
    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        """Frames start..stop-1 in order. Raises: IuvFileError naming the frame that is broken."""

    @abstractmethod
    def where(self, index: int) -> str:
        """The place of a frame, for messages."""
