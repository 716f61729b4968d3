"""From pictures as a video stores them to pictures as they are shown: whole, with square pixels."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.filter import Graph
from jaxtyping import UInt8

Image = UInt8[np.ndarray, "H W 3"]

LARGEST_RATIO = 4
"""Of a pixel's sides. Anamorphic films reach 2, video discs 3; headers that are wrong say more."""


def find_pixel_ratio(stream: av.VideoStream) -> Fraction:
    """Find width by height of a pixel; 1 where the file says nothing, or nothing sensible."""
    said = stream.sample_aspect_ratio
    return said if said and Fraction(1, LARGEST_RATIO) <= said <= LARGEST_RATIO else Fraction(1)


def square_size(width: int, height: int, pixel_ratio: Fraction) -> tuple[int, int]:
    """Tell the size, px, of a picture whose pixels are made square: it grows, and never shrinks.

    The side that grows becomes even, as most codecs want it.
    """
    grown = (
        2 * round(width * max(pixel_ratio, Fraction(1)) / 2),
        2 * round(height / min(pixel_ratio, Fraction(1)) / 2),
    )
    # a pixel's difference is a rounding in the header
    return (
        grown[0] if grown[0] > width + 1 else width,
        grown[1] if grown[1] > height + 1 else height,
    )


def stretch_whole(image: Image, size: tuple[int, int]) -> Image:
    """Stretch to (width, height) by repeating pixels: what has no values between its values.

    OpenCV would do it, but rounds halves up in some rows and down in others.
    """
    height, width = image.shape[:2]
    if size == (width, height):
        return image
    columns = (2 * np.arange(size[0]) + 1) * width // (2 * size[0])
    rows = (2 * np.arange(size[1]) + 1) * height // (2 * size[1])
    return image[rows[:, None], columns]


def describe_pixels(path: Path, stream: av.VideoStream) -> tuple[str, ...]:
    """Say that pixels are made square, or that what a file says of them is not believed."""
    width, height = stream.codec_context.width, stream.codec_context.height
    size = square_size(width, height, find_pixel_ratio(stream))
    said = stream.sample_aspect_ratio
    if size != (width, height):
        return (
            f"{path} stores {width} x {height} pixels that are not square ({_listed(said)}); they"
            f" are stretched to {size[0]} x {size[1]}, as players show them",
        )
    if said and said != 1 and find_pixel_ratio(stream) == 1:
        return (f"{path} says that its pixels are {_listed(said)}; they are taken as square",)
    return ()


def _listed(ratio: Fraction | None) -> str:
    return f"{ratio.numerator}:{ratio.denominator}" if ratio else "unknown"


def deinterlaced(frames: Iterable[av.VideoFrame]) -> Iterator[av.VideoFrame]:
    """Pass frames on, and from the first interlaced one on each whole again (FFmpeg's bwdif).

    Frames that are not interlaced are never changed; there are as many as before, at their times.
    """
    graph: Graph | None = None
    kind = ()
    base = None
    for frame in frames:
        if graph is None and not frame.interlaced_frame:
            yield frame
            continue
        if graph is None or kind != (frame.width, frame.height, frame.format.name):
            if graph is not None:
                yield from _drained(graph, base, end=True)
            kind, base = (frame.width, frame.height, frame.format.name), frame.time_base
            graph = _make_graph(frame)
        graph.push(frame)
        yield from _drained(graph, base)
    if graph is not None:
        yield from _drained(graph, base, end=True)


def _make_graph(like: av.VideoFrame) -> Graph:
    graph = Graph()
    buffer = graph.add_buffer(
        width=like.width,
        height=like.height,
        format=like.format,
        time_base=like.time_base or Fraction(1, av.time_base),
    )
    filters = graph.add("bwdif", "mode=send_frame:deint=interlaced")
    sink = graph.add("buffersink")
    buffer.link_to(filters)
    filters.link_to(sink)
    graph.configure()
    return graph


def _drained(graph: Graph, base: Fraction | None, *, end: bool = False) -> Iterator[av.VideoFrame]:
    """Take what a graph has ready, its times in their old unit: bwdif counts in half ticks."""
    if end:
        graph.push(None)
    while True:
        try:
            frame = cast(av.VideoFrame, graph.pull())
        except (BlockingIOError, EOFError):
            return
        if frame.pts is not None and frame.time_base and base:
            frame.pts, frame.time_base = round(frame.pts * frame.time_base / base), base
        yield frame
