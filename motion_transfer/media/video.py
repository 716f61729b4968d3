"""Videos as people film them, one frame at a time."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
from av.error import FFmpegError
from jaxtyping import UInt8

from motion_transfer.errors import InputError

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv", ".webm", ".avi")


class PictureVideo:
    """A video whose frames are read by number, from any thread.

    Raises: InputError if the file is missing, is no video, or holds no frames.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise InputError(f"video {path} does not exist")
        try:
            with av.open(str(path)) as container:
                if not container.streams.video:
                    raise InputError(f"video {path} has no pictures in it")
                packets = container.demux(container.streams.video[0])
                self._timestamps = sorted(p.pts for p in packets if p.pts is not None)
        except FFmpegError as error:
            raise InputError(f"{path} is not a readable video: {error.strerror}") from error
        if not self._timestamps:
            raise InputError(f"video {path} holds no frames")

    @property
    def frame_count(self) -> int:
        return len(self._timestamps)

    def read(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """Frame `index`, RGB. Raises: InputError naming the frame that cannot be decoded."""
        wanted = self._timestamps[index]
        try:
            with av.open(str(self.path)) as container:
                stream = container.streams.video[0]
                container.seek(wanted, stream=stream, backward=True)
                for frame in container.decode(stream):
                    if frame.pts is not None and frame.pts >= wanted:
                        if frame.pts > wanted:
                            break
                        return frame.to_ndarray(format="rgb24")
        except FFmpegError as error:
            raise InputError(
                f"frame {index} of {self.path} is damaged ({error.strerror}); export it again"
            ) from error
        raise InputError(f"frame {index} of {self.path} cannot be decoded; export it again")
