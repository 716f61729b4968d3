"""From frames as they are drawn to pixels as codecs take them.

Alpha is copied, to the last level; FFmpeg's conversion of it is off by one in 8 bits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import av
import numpy as np
from av.video.format import VideoFormat
from av.video.reformatter import ColorRange, Colorspace, Interpolation, VideoReformatter
from jaxtyping import UInt8

from motion_transfer.media.alpha import (
    OPAQUE,
    Alpha,
    add_alpha,
    clear_colours,
    extend_colours,
    premultiply,
    split_alpha,
)
from motion_transfer.media.output.formats import OutputFormat

BT709 = 1  # H.273's number for primaries, transfer and matrix

Convert = Callable[[UInt8[np.ndarray, "H W C"]], av.VideoFrame]
"""Makes what an encoder takes of a frame, RGB, or RGBA where alpha is written."""


def make_converter(output_format: OutputFormat, *, mixes: bool | None = None) -> Convert:
    """Make what converts the frames of one segment.

    Args:
        mixes: Whether the colours of neighbours will be mixed, so that those under alpha 0 have to
            be theirs; None where the codec says it.
    """
    codec = output_format.codec
    deep = VideoFormat(codec.pixel_format).components[0].bits > 8
    conversion: dict[str, Any] = {"format": codec.pixel_format}
    if not codec.keeps_rgb:
        conversion["dst_colorspace"] = Colorspace.ITU709
        conversion["dst_color_range"] = ColorRange.MPEG
        conversion["interpolation"] = Interpolation.AREA
    if deep or output_format.transparent:
        conversion["threads"] = 1  # measured: in 10 bits, other bytes from run to run with more
    reformatter = VideoReformatter()  # kept: to make one takes longer than to use it

    def reformat(pixels: UInt8[np.ndarray, "H W C"], pixel_format: str) -> av.VideoFrame:
        picture = av.VideoFrame.from_ndarray(pixels, format=pixel_format)
        picture = reformatter.reformat(picture, **conversion)
        if not codec.keeps_rgb:
            picture.color_primaries = picture.color_trc = BT709  # ProRes asks every frame
        return picture

    if not output_format.transparent:
        return lambda frame: reformat(frame, "rgb24")
    if output_format.premultiplied:
        prepare = premultiply
    else:
        mixes = not codec.keeps_rgb if mixes is None else mixes
        prepare = extend_colours if mixes else clear_colours

    def convert(frame: UInt8[np.ndarray, "H W C"]) -> av.VideoFrame:
        colours, alpha = split_alpha(frame)
        colours = prepare(colours, alpha)
        if codec.keeps_rgb:
            return reformat(add_alpha(colours, alpha), "rgba")
        picture = reformat(colours, "rgb24")
        _put_alpha(picture, alpha)
        return picture

    return convert


def prepare_picture(frame: UInt8[np.ndarray, "H W C"]) -> UInt8[np.ndarray, "H W C"]:
    """Prepare a frame, RGB or RGBA, for a format that mixes nothing and holds straight alpha."""
    if frame.shape[-1] == 3:
        return frame
    colours, alpha = split_alpha(frame)
    return add_alpha(clear_colours(colours, alpha), alpha)


def _put_alpha(picture: av.VideoFrame, alpha: Alpha) -> None:
    """Fill the last plane, scaled to its bits and rounded to nearest."""
    bits = picture.format.components[-1].bits
    plane = picture.planes[-1]
    scaled = alpha
    if bits > 8:
        most = 2**bits - 1
        levels = (np.arange(OPAQUE + 1) * most + OPAQUE // 2) // OPAQUE
        scaled = levels.astype("<u2")[alpha]
    rows = np.zeros((plane.height, plane.line_size // scaled.itemsize), scaled.dtype)
    rows[:, : plane.width] = scaled
    plane.update(rows.tobytes())
