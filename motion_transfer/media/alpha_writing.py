"""Writing alpha beside IUV, without loss: grey pictures, a grey video, or a NumPy stack."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.formats import CODECS
from motion_transfer.media.image import write_png

Alpha = UInt8[np.ndarray, "H W"]
WriteAlpha = Callable[[Alpha], object]


def name_alpha(iuv: Path) -> Path:
    """Where the alpha of an IUV file or folder lies: `me_IUV.png` -> `me_alpha.png` beside it."""
    stem = iuv.stem if iuv.suffix else iuv.name
    kept = stem[: -len("_IUV")] if stem.lower().endswith("_iuv") else stem
    return iuv.with_name(f"{kept}_alpha{iuv.suffix}")


@contextmanager
def open_alpha(
    path: Path, *, frame_count: int, height: int, width: int, frame_rate: Fraction
) -> Iterator[WriteAlpha]:
    """Write alpha frame by frame: `.mkv` (FFV1), `.npy` (N x H x W), `.png`, or a folder of PNG.

    Yields: a function that takes the next frame, 0..255.
    """
    if path.suffix == ".mkv":
        with _open_video(path, height, width, frame_rate) as write:
            yield write
    elif path.suffix == ".npy":
        shape = (frame_count, height, width)
        stack = np.lib.format.open_memmap(path, mode="w+", dtype=np.uint8, shape=shape)
        rows = iter(stack)
        yield lambda alpha: np.copyto(next(rows), alpha)
        stack.flush()
    elif path.suffix == ".png":
        yield lambda alpha: write_png(path, alpha)
    else:
        path.mkdir()
        names = (path / f"{index:06d}.png" for index in range(frame_count))
        yield lambda alpha: write_png(next(names), alpha)


@contextmanager
def _open_video(path: Path, height: int, width: int, frame_rate: Fraction) -> Iterator[WriteAlpha]:
    codec = CODECS["ffv1"]
    with av.open(str(path), "w") as container:
        stream = cast(
            av.VideoStream, container.add_stream(codec.encoder, frame_rate, codec.options)
        )
        stream.width, stream.height = width, height
        stream.pix_fmt = "gray"
        stream.codec_context.thread_count = 1

        def write(alpha: Alpha) -> None:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(alpha, format="gray")))

        yield write
        container.mux(stream.encode(None))
