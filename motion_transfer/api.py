"""The Python API: the same run as on the command line, as a function."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any

from motion_transfer.render.events import Listener, ignore
from motion_transfer.render.options import Garment, RenderOptions, parse_frames, parse_rate
from motion_transfer.render.run import RenderReport, run

AnyPath = str | PathLike[str]


def render_video(
    source: AnyPath,
    driver: AnyPath,
    output: AnyPath,
    *,
    source_iuv: AnyPath | None = None,
    weights: AnyPath | None = None,
    estimator_model: AnyPath | None = None,
    sheet: AnyPath | None = None,
    audio: AnyPath | None = None,
    frames: str | tuple[int | None, int | None] | None = None,
    frame_rate: str | float | Fraction | None = None,
    garments: Sequence[Garment] = (),
    listener: Listener = ignore,
    **options: Any,
) -> RenderReport:
    """Render the person of a photo in the motion of a driver.

    Args:
        source: photo; its IUV is looked for beside it unless `source_iuv` is given, and estimated
            where there is none.
        driver: video, photo or folder of photos of a person; or folder of IUV images, IUV image,
            lossless IUV video, `.npy`, `.npz`; or a motion such as `people:walk`.
        output: `.mp4`, `.mov`, `.mkv`, `.webm`, `.gif`, `.png` (one frame), or a folder of PNG.
        audio: file whose sound is laid under, or `"none"`; else the driver's own, if it has any.
        frames: `"10:50"` or `(10, 50)`, half-open.
        frame_rate: frames per second, exact if given as a string or Fraction.
        garments: parts taken from other photos.
        listener: called with events (`motion_transfer.render.events`) as the work goes on, from
            several threads.
        **options: the other fields of `RenderOptions`, such as `background="photo"`.

    Returns: where the output is, what it holds and how long it took.
    Raises: MotionTransferError (`InputError` for input that cannot be used), saying what is wrong,
        where, and what to do. Nothing half-written is left behind.
    """
    return run(
        RenderOptions(
            source=Path(source),
            driver=Path(driver),
            output=Path(output),
            source_iuv=_path(source_iuv),
            weights=_path(weights),
            estimator_model=_path(estimator_model),
            sheet=_path(sheet),
            audio=_path(audio),
            frames=parse_frames(frames) if isinstance(frames, str) else frames or (None, None),
            frame_rate=None if frame_rate is None else parse_rate(str(frame_rate)),
            garments=tuple(garments),
            **options,
        ),
        listener,
    )


def _path(path: AnyPath | None) -> Path | None:
    return None if path is None else Path(path)
