"""From packets of a video to colours and alpha, in 8 bits.

FFmpeg's own decoders of VP8 and VP9 leave alpha out, where libvpx's take it from beside the packet;
and its conversion to 8 bits darkens by one or two levels, unless it is asked for precision.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.container import InputContainer
from av.video.codeccontext import VideoCodecContext
from av.video.format import VideoFormatComponent
from av.video.reformatter import Interpolation, VideoReformatter

from motion_transfer.media.alpha import (
    ALPHA_MODE,
    BESIDE,
    OPAQUE,
    Alpha,
    Colours,
    Picture,
    add_alpha,
    premultiply,
    split_alpha,
    unpremultiply,
)
from motion_transfer.media.container import LARGEST_PICTURE
from motion_transfer.media.pictures.hdr import HDR, to_sdr

ALPHA_DECODERS = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
"""What decodes alpha, too, by the codec's name."""

STRAIGHT_CODECS = ("gif", "png", "apng", "webp", "vp8", "vp9")
"""Those whose specification, or whose players, have colours that are not multiplied."""

PRECISE = Interpolation.BILINEAR | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT

UNSPECIFIED = 2  # H.273's number


def decode_frames(container: InputContainer, stream: av.VideoStream) -> Iterator[av.VideoFrame]:
    """Decode from where a container stands to its end, with alpha where there is some."""
    own = stream.codec_context
    name = ALPHA_DECODERS.get(own.name)
    if name not in av.codecs_available or _find_tag(stream.metadata) != BESIDE:
        yield from container.decode(stream)
        return
    decoder = cast(VideoCodecContext, av.CodecContext.create(name, "r"))
    decoder.options = {"max_pixels": str(LARGEST_PICTURE)}
    for packet in container.demux(stream):
        for frame in decoder.decode(packet if packet.size else None):
            if frame.colorspace == UNSPECIFIED:  # of these decoders only the codec may say it
                frame.colorspace = own.colorspace
            yield frame


def find_alpha_mode(container: InputContainer, stream: av.VideoStream) -> str | None:
    """Tell whether a file says that its colours are `straight` or `premultiplied`."""
    said = (_find_tag(stream.metadata), _find_tag(container.metadata))
    return next((word for word in said if word in ("straight", "premultiplied")), None)


def find_alpha(frame: av.VideoFrame) -> VideoFormatComponent | None:
    """Find a frame's alpha, if it has any."""
    return next((part for part in frame.format.components if part.is_alpha), None)


def describe_colours(
    path: Path, stream: av.VideoStream, frame: av.VideoFrame, alpha_mode: str | None
) -> tuple[str, ...]:
    """Say that a file is HDR, or that it does not say what its colours are."""
    notes = ()
    if transfer := HDR.get(frame.color_trc):
        notes += (
            f"{path} is HDR ({transfer}); its colours are brought to SDR (BT.709), which the output"
            " is, too",
        )
    if find_alpha(frame) and not alpha_mode and stream.codec_context.name not in STRAIGHT_CODECS:
        notes += (
            f"{path} has alpha and does not say whether its colours are multiplied by it; they are"
            " taken as straight",
        )
    return notes


def to_picture(frame: av.VideoFrame, size: tuple[int, int], *, premultiplied: bool) -> Picture:
    """Turn a frame into colours and alpha, stretched to (width, height)."""
    width, height = size
    part = find_alpha(frame)
    if part is None:
        if frame.format.components[0].bits <= 8 and frame.color_trc not in HDR:
            return Picture(frame.to_ndarray(format="rgb24", width=width, height=height))
        return Picture(_convert(frame, "rgb24", size))
    if frame.format.is_planar:
        colours = _convert(frame, "rgb24", (frame.width, frame.height))
        alpha = _read_plane(frame, part)
    else:
        colours, alpha = split_alpha(frame.to_ndarray(format="rgba"))
    if size != (frame.width, frame.height):  # colours under alpha 0 stay out
        colours = colours if premultiplied else premultiply(colours, alpha)
        whole = av.VideoFrame.from_ndarray(add_alpha(colours, alpha), format="rgba")
        colours, alpha = split_alpha(_convert(whole, "rgba", size))
        premultiplied = True
    return Picture(unpremultiply(colours, alpha) if premultiplied else colours, alpha)


def _convert(frame: av.VideoFrame, pixel_format: str, size: tuple[int, int]) -> Colours:
    """Convert without darkening, and the same way every time; HDR to SDR."""
    width, height = size
    convert = partial(VideoReformatter().reformat, frame, width, height, threads=1)
    if frame.color_trc in HDR and pixel_format == "rgb24":
        # in 16 bits FFmpeg is precise by itself, and wrong if it is asked to be
        return to_sdr(convert("rgb48le").to_ndarray(), frame.color_trc)
    return convert(pixel_format, interpolation=PRECISE).to_ndarray()


def _read_plane(frame: av.VideoFrame, part: VideoFormatComponent) -> Alpha:
    """Read alpha from a plane of its own, rounded to 8 bits."""
    plane = frame.planes[part.plane]
    values = np.frombuffer(bytes(plane), np.uint8 if part.bits <= 8 else np.dtype("<u2"))
    values = values.reshape(plane.height, -1)[:, : plane.width]
    if part.bits <= 8:
        return np.ascontiguousarray(values)
    most = 2**part.bits - 1
    levels = (np.arange(most + 1, dtype=np.uint32) * OPAQUE + most // 2) // most
    return levels.astype(np.uint8)[values]


def _find_tag(metadata: dict[str, str]) -> str | None:
    """Find what is said of alpha; Matroska writes its tags in capitals."""
    return next((said for key, said in metadata.items() if key.lower() == ALPHA_MODE), None)
