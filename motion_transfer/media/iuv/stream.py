"""What every kind of IUV driver offers: a known length, and frames decoded when asked for.

A stream knows its length before anything is decoded, and any number of threads may read from it at
once, each its own range. Its frames are raw, their channels in the order of the file: Caffe2's
DensePose writes PNG files whose RGB is (V, U, I); others write (I, U, V). The part index is the
channel that never exceeds 24, so one frame with a larger value in a channel rules that channel out.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.formats import ChannelOrder
from motion_transfer.media.iuv.lookalikes import explain_picture, explain_scaled_uv
from nhrr_core.parts import PART_COUNT

OVERSHOOT = 32
"""Bicubic and Lanczos interpolation run beyond what lies at a border, by up to a quarter of it."""
OVERSHOT = "; if it was resized with interpolation, resize it by nearest neighbour instead"

Raw = UInt8[np.ndarray, "H W 3"]
"""An IUV image whose channels are still in the order of the file's RGB."""


class IuvStream(ABC):
    """Frames in the file's own channel order; `IuvReader` turns them to (I, U, V).

    Attributes:
        kind: What this driver is, for people.
        start_seconds: When the first frame is shown, on the clock of the file's sound.
        order: The channel order where the format itself settles it, else None.
        gaps: Numbers missing from a folder, each of whose places is filled.
        notes: What the user should know of how this driver is read, in sentences.
    """

    def __init__(self, path: Path, kind: str, frame_count: int) -> None:
        self.path = path
        self.kind = kind
        self.frame_count = frame_count
        self.frame_rate: Fraction | None = None
        self.start_seconds = Fraction(0)
        self.order: ChannelOrder | None = None
        self.gaps: tuple[int, ...] = ()
        self.notes: tuple[str, ...] = ()

    @abstractmethod
    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        """Read frames start..stop-1 in order. Raises: IuvFileError naming the broken frame."""

    def where(self, index: int) -> str:
        """Name the place of a frame, for messages."""
        return f"frame {index} of {self.path}"

    def closing_notes(self) -> tuple[str, ...]:
        """Tell what is known of the frames only when they have been read, in sentences."""
        return ()


class IuvReader:
    """A stream whose channel order is known: frames as (I, U, V), each checked."""

    def __init__(self, stream: IuvStream, order: ChannelOrder, height: int, width: int) -> None:
        self.stream = stream
        self.order: ChannelOrder = order
        self.height = height
        self.width = width

    def read(self, start: int, stop: int) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
        """Read frames start..stop-1.

        Raises: IuvFileError naming the frame that is broken, of another size, or not IUV.
        """
        for index, raw in enumerate(self.stream.read_raw(start, stop), start):
            if raw.shape[:2] != (self.height, self.width):
                raise IuvFileError(
                    f"{self.stream.where(index)} is {raw.shape[1]} x {raw.shape[0]}, but the driver"
                    f" began with {self.width} x {self.height}; all frames need one size"
                )
            yield to_iuv(raw, self.order, self.stream.where(index))


def decide_order(frames: Iterable[tuple[str, Raw]], what: str) -> ChannelOrder | None:
    """Find the channel order of a driver: read frames until one of the two is ruled out.

    Args:
        frames: Pairs of a place (for messages) and a raw frame, lazily.
        what: The driver or source, for messages.
    Returns: The order; None if every pixel of every frame is background.
    Raises: IuvFileError if neither order is possible, if both stay possible to the end, or if the
        frame that decides has its U and V scaled by their minimum and maximum.
    """
    seen = False
    for where, raw in frames:
        first, last = int(raw[..., 0].max()), int(raw[..., 2].max())
        if first > PART_COUNT and last > PART_COUNT:
            known = explain_picture(raw)
            raise IuvFileError(
                f"{where} is not an IUV image: neither its first nor its last channel stays within"
                f" 0..{PART_COUNT} (they reach {first} and {last})"
                + (f"; {known}" if known else OVERSHOT * (min(first, last) <= OVERSHOOT))
            )
        if first > PART_COUNT or last > PART_COUNT:
            order: ChannelOrder = "vui" if first > PART_COUNT else "iuv"
            scaled = explain_scaled_uv(raw if order == "iuv" else raw[..., ::-1])
            if scaled:
                raise IuvFileError(f"{where} is not an IUV image: {scaled}")
            return order
        seen = seen or bool(raw.any())
    if seen:
        raise IuvFileError(
            f"{what}: the channel order cannot be told, because both the first and the last channel"
            f" stay within 0..{PART_COUNT}; say it with --iuv-order iuv or vui"
        )
    return None


def to_iuv(raw: Raw, order: ChannelOrder, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """Turn a raw frame to (I, U, V). Raises: IuvFileError if a part index exceeds 24."""
    part = raw[..., 0 if order == "iuv" else 2]
    highest = int(part.max())
    if highest > PART_COUNT:
        raise IuvFileError(
            f"{where} has part index {highest}; DensePose has parts 1 to {PART_COUNT}, and other"
            f" frames say that channel {1 if order == 'iuv' else 3} holds them"
            + (OVERSHOT if highest <= OVERSHOOT else "")
        )
    # BGR2RGB swaps the outer channels, and is faster than a reversed copy by NumPy
    return raw if order == "iuv" else cv2.cvtColor(raw, cv2.COLOR_BGR2RGB)
