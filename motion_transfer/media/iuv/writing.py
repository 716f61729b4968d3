"""Writing IUV without loss: a folder of PNG, one PNG, a lossless video, or a NumPy stack.

People's alpha, where frames have it, is written beside the IUV in the same form.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import av
import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.codecs import CODECS, LOSSLESS
from motion_transfer.media.container import open_output
from motion_transfer.media.iuv.formats import CHANNEL_ORDERS, ChannelOrder
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder

VIDEO_RATE = Fraction(30)
"""Frames per second of a video whose frames come without a rate."""

Frame = UInt8[np.ndarray, "H W C"]
Plane = UInt8[np.ndarray, "H W *C"]
"""A frame of one file: IUV with three channels, or alpha without a third axis."""

Write = Callable[[Plane], object]


@dataclass(frozen=True, kw_only=True)
class IuvOutput:
    """What a sequence of IUV frames is, and how it is written.

    Attributes:
        order: The channel order of the file's RGB, for pictures and video: `vui` as Caffe2's
            DensePose, or `iuv`. Arrays are always (I, U, V).
        frame_rate: The rate of a video; None for 30.
        force: Whether to replace an existing output.
        alpha: Whether frames have alpha as a fourth channel, which is written beside the IUV
            under the name that `name_alpha` says, in the same form.
    """

    frame_count: int
    height: int
    width: int
    order: ChannelOrder = "vui"
    frame_rate: Fraction | None = None
    force: bool = False
    alpha: bool = False


def name_alpha(iuv: Path) -> Path:
    """Name the alpha of an IUV file or folder: `me_IUV.png` -> `me_alpha.png` beside it."""
    stem = iuv.stem if iuv.suffix else iuv.name
    kept = stem[: -len("_IUV")] if stem.lower().endswith("_iuv") else stem
    return iuv.with_name(f"{kept}_alpha{iuv.suffix}")


def check_iuv_output(output: Path, settings: IuvOutput) -> None:
    """Refuse an output before any work is done.

    Raises: OutputError for an unknown ending, several frames for one PNG, or a place that cannot be
        written; InputError for an unknown channel order.
    """
    suffix = output.suffix.lower()
    if suffix not in FORMS:
        raise OutputError(
            f"cannot write {output}: IUV is written as a folder of PNG (no ending), .mkv (FFV1,"
            " lossless), .npy, or .png for one frame"
        )
    if settings.order not in CHANNEL_ORDERS:
        raise InputError(
            f"channel order {settings.order!r}; supported are {', '.join(CHANNEL_ORDERS)}"
        )
    if suffix == ".png" and settings.frame_count > 1:
        raise OutputError(
            f"{output} is one picture, but there are {settings.frame_count} frames; write a folder,"
            " .mkv or .npy"
        )
    check_destination(output, force=settings.force)
    if settings.alpha:
        check_destination(name_alpha(output), force=settings.force)


def write_iuv(
    frames: Iterable[Frame],
    output: Path,
    settings: IuvOutput,
    done: Callable[[int], object] = int,
) -> None:
    """Write frames (I, U, V), H x W x 3 uint8, one at a time; the file gets its name at the end.

    With alpha they are H x W x 4; both files get their names when both are finished, alpha first:
    where there is new IUV, there is its alpha.

    Args:
        done: Called with 1 after each frame.
    Raises: As `check_iuv_output`, and whatever `frames` raises; nothing half-written stays behind.
    """
    check_iuv_output(output, settings)
    suffix = output.suffix.lower()
    swapped = settings.order == "vui" and suffix != ".npy"
    with work_folder(output) as folder:
        finished, alpha = folder / f"finished{suffix}", folder / f"alpha{suffix}"
        with ExitStack() as opened:
            write = opened.enter_context(FORMS[suffix](finished, settings, (3,)))
            write_alpha = (
                opened.enter_context(FORMS[suffix](alpha, settings, ())) if settings.alpha else None
            )
            for frame in map(np.ascontiguousarray, _counted(frames, settings)):
                if write_alpha:
                    write_alpha(cv2.extractChannel(frame, 3))
                write(_colours(frame, swapped=swapped))
                done(1)
        if settings.alpha:
            publish(alpha, name_alpha(output))
        publish(finished, output)


def _colours(frame: Frame, *, swapped: bool) -> Plane:
    """Take (I, U, V) of a frame, or (V, U, I); NumPy alone would take several times as long."""
    if frame.shape[2] == 4:
        return cv2.cvtColor(frame, cv2.COLOR_RGBA2BGR if swapped else cv2.COLOR_RGBA2RGB)
    return cv2.cvtColor(frame, cv2.COLOR_RGB2BGR) if swapped else frame


def _counted(frames: Iterable[Frame], settings: IuvOutput) -> Iterator[Frame]:
    """Hold each frame to the promised size, and all of them to the promised number."""
    count, shape = 0, (settings.height, settings.width, 4 if settings.alpha else 3)
    for count, frame in enumerate(frames, 1):
        if count > settings.frame_count or frame.shape != shape:
            break
        yield frame
    else:
        if count == settings.frame_count:
            return
    raise ValueError(f"{settings} was promised, but frame {count} does not fit it")


@contextmanager
def _open_folder(path: Path, settings: IuvOutput, _channels: tuple[int, ...]) -> Iterator[Write]:
    path.mkdir()
    names = (path / f"{index:06d}.png" for index in range(settings.frame_count))
    yield lambda plane: write_png(next(names), plane)


@contextmanager
def _open_png(path: Path, _settings: IuvOutput, _channels: tuple[int, ...]) -> Iterator[Write]:
    yield lambda plane: write_png(path, plane)


@contextmanager
def _open_video(path: Path, settings: IuvOutput, channels: tuple[int, ...]) -> Iterator[Write]:
    codec = CODECS[LOSSLESS]
    stored = codec.pixel_format if channels else "gray"
    assert stored in ("bgr0", "gray")
    # or Matroska marks its segments with random numbers, and no two files are alike
    with open_output(path, options={"fflags": "+bitexact"}) as container:
        rate = settings.frame_rate or VIDEO_RATE
        stream = cast(av.VideoStream, container.add_stream(codec.encoder, rate, codec.options))
        stream.width, stream.height = settings.width, settings.height
        stream.pix_fmt = stored
        stream.codec_context.thread_count = 1  # FFV1's bytes depend on the number of threads

        def write(plane: Plane) -> None:
            picture = av.VideoFrame(settings.width, settings.height, stored)
            place: Any = picture.planes[0]  # a buffer, which its type does not tell
            memory = np.frombuffer(place, np.uint8)  # rows may be longer than needed
            if channels:
                pixels = memory.reshape(settings.height, -1, 4)[:, : settings.width]
                cv2.cvtColor(plane, cv2.COLOR_RGB2BGRA, dst=pixels)  # FFmpeg would be slower
            else:
                memory.reshape(settings.height, -1)[:, : settings.width] = plane
            container.mux(stream.encode(picture))

        yield write
        container.mux(stream.encode(None))


@contextmanager
def _open_array(path: Path, settings: IuvOutput, channels: tuple[int, ...]) -> Iterator[Write]:
    shape = (settings.frame_count, settings.height, settings.width, *channels)
    header = {"descr": "|u1", "fortran_order": False, "shape": shape}
    with path.open("wb") as file:  # a mapped file ends the process where the disk is full
        np.lib.format.write_array_header_1_0(file, header)
        yield lambda plane: file.write(plane.data)


FORMS = {"": _open_folder, ".png": _open_png, ".mkv": _open_video, ".npy": _open_array}
"""What opens a file of each ending, from its path, the settings, and the shape of a pixel."""
