"""Writing IUV without loss: a folder of PNG, one PNG, a lossless video, or a NumPy stack."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.alpha_writing import name_alpha, open_alpha
from motion_transfer.media.formats import CODECS
from motion_transfer.media.image import write_png
from motion_transfer.media.iuv_image import CHANNEL_ORDERS, ChannelOrder
from motion_transfer.media.publish import check_destination, publish, work_folder

IUV_ENDINGS = ("", ".png", ".mkv", ".npy")
VIDEO_RATE = Fraction(30)  # where the frames come without a rate

Frame = UInt8[np.ndarray, "H W C"]


@dataclass(frozen=True, kw_only=True)
class IuvFormat:
    """How a sequence of IUV frames is written.

    Attributes:
        order: the channel order of the file's RGB, for pictures and video: `vui` as Caffe2's
            DensePose, or `iuv`. Arrays are always (I, U, V).
        frame_rate: of a video; None: 30.
        force: replace an existing output.
        alpha: frames have alpha as a fourth channel, which is written beside the IUV under the
            name that `name_alpha` says, in the same form.
    """

    frame_count: int
    height: int
    width: int
    order: ChannelOrder = "vui"
    frame_rate: Fraction | None = None
    force: bool = False
    alpha: bool = False


def check_iuv_output(output: Path, settings: IuvFormat) -> None:
    """Refuse an output before any work is done.

    Raises: OutputError for an unknown ending, several frames for one PNG, or a place that cannot be
        written; InputError for an unknown channel order.
    """
    suffix = output.suffix.lower()
    if suffix not in IUV_ENDINGS:
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
    settings: IuvFormat,
    done: Callable[[int], object] = int,
) -> None:
    """Write frames (I, U, V), H x W x 3 uint8, one at a time; the file gets its name at the end.

    With alpha they are H x W x 4; both files get their names when both are finished, alpha first:
    where there is new IUV, there is its alpha.

    Args:
        done: called with 1 after each frame.
    Raises: as `check_iuv_output`, and whatever `frames` raises; nothing half-written stays behind.
    """
    check_iuv_output(output, settings)
    with work_folder(output) as folder:
        finished = folder / f"finished{output.suffix.lower()}"
        alpha = folder / f"alpha{output.suffix.lower()}"
        write = {"": _write_folder, ".png": _write_png, ".mkv": _write_video, ".npy": _write_array}
        counted = _counted(frames, settings, done)
        with closing(_without_alpha(counted, alpha, settings)) as iuv:
            write[output.suffix.lower()](iuv, finished, settings)
        if settings.alpha:
            publish(alpha, name_alpha(output))
        publish(finished, output)


def _counted(
    frames: Iterable[Frame], settings: IuvFormat, done: Callable[[int], object]
) -> Iterable[Frame]:
    """The frames, each held to the promised size, and as many as promised."""
    count, shape = 0, (settings.height, settings.width, 4 if settings.alpha else 3)
    for count, frame in enumerate(frames, 1):
        if count > settings.frame_count or frame.shape != shape:
            break
        yield frame
        done(1)
    else:
        if count == settings.frame_count:
            return
    raise ValueError(f"{settings} was promised, but frame {count} does not fit it")


def _without_alpha(
    frames: Iterable[Frame], path: Path, settings: IuvFormat
) -> Generator[Frame, None, None]:
    """The frames' IUV; their alpha, if they have one, is written on the way."""
    if not settings.alpha:
        yield from frames
        return
    with open_alpha(
        path,
        frame_count=settings.frame_count,
        height=settings.height,
        width=settings.width,
        frame_rate=settings.frame_rate or VIDEO_RATE,
    ) as write:
        for frame in frames:
            write(np.ascontiguousarray(frame[..., 3]))
            yield np.ascontiguousarray(frame[..., :3])


def _in_order(frame: Frame, order: ChannelOrder) -> Frame:
    return frame if order == "iuv" else np.ascontiguousarray(frame[..., ::-1])


def _write_folder(frames: Iterable[Frame], path: Path, settings: IuvFormat) -> None:
    path.mkdir()
    for index, frame in enumerate(frames):
        write_png(path / f"{index:06d}.png", _in_order(frame, settings.order))


def _write_png(frames: Iterable[Frame], path: Path, settings: IuvFormat) -> None:
    for frame in frames:
        write_png(path, _in_order(frame, settings.order))


def _write_video(frames: Iterable[Frame], path: Path, settings: IuvFormat) -> None:
    codec = CODECS["ffv1"]
    with av.open(str(path), "w") as container:
        rate = settings.frame_rate or VIDEO_RATE
        stream = cast(av.VideoStream, container.add_stream(codec.encoder, rate, codec.options))
        stream.width, stream.height = settings.width, settings.height
        stream.pix_fmt = codec.pixel_format
        stream.codec_context.thread_count = 1
        for frame in frames:
            rgb = av.VideoFrame.from_ndarray(_in_order(frame, settings.order), format="rgb24")
            container.mux(stream.encode(rgb.reformat(format=codec.pixel_format)))
        container.mux(stream.encode(None))


def _write_array(frames: Iterable[Frame], path: Path, settings: IuvFormat) -> None:
    shape = (settings.frame_count, settings.height, settings.width, 3)
    stack = np.lib.format.open_memmap(path, mode="w+", dtype=np.uint8, shape=shape)
    for index, frame in enumerate(frames):
        stack[index] = frame
    stack.flush()
