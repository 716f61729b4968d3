"""Output as GIF in two passes over lossless segments: one palette for all, then the frames."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import cast

import av
from av.container import OutputContainer
from av.filter import Graph
from av.filter.context import FilterContext

from motion_transfer.media.container import open_output
from motion_transfer.media.output.marks import MakeMark
from motion_transfer.media.output.segments import Segments
from motion_transfer.media.output.video import decode_segments
from motion_transfer.media.output.video import open_segment as open_segment
from motion_transfer.media.output.whole import digest_output as digest_output
from motion_transfer.media.output.whole import mark_file
from motion_transfer.media.output.whole import read_mark as read_mark

GIF_TICK = Fraction(1, 100)  # the format counts time in hundredths of a second


def join_segments(
    segments: Segments,
    destination: Path,
    _format: object,
    rate: Fraction,
    _audio: object = None,
    mark: MakeMark | None = None,
) -> None:
    """Encode segments as a looping GIF; frame times are rounded to the format's hundredths."""
    palette = _find_palette(segments, rate)
    with open_output(destination, format_name="gif", options={"loop": "0"}) as output:
        first = next(decode_segments(segments, rate))
        stream = output.add_stream("gif", rate=rate)
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, "pal8"
        stream.codec_context.time_base = GIF_TICK
        stream.time_base = GIF_TICK
        graph = Graph()
        pictures, colours = _add_buffer(graph, first, rate), _add_buffer(graph, palette, rate)
        use = graph.add("paletteuse", "dither=bayer:bayer_scale=4:diff_mode=rectangle")
        sink = graph.add("buffersink")
        pictures.link_to(use, 0, 0)
        colours.link_to(use, 0, 1)
        use.link_to(sink)
        graph.configure()
        colours.push(palette)
        colours.push(None)
        for frame in decode_segments(segments, rate):
            pictures.push(frame)
            _drain(sink, stream, output)
        pictures.push(None)
        _drain(sink, stream, output)
        output.mux(stream.encode(None))
    mark_file(destination, mark)


def _drain(sink: FilterContext, stream: av.VideoStream, output: OutputContainer) -> None:
    """Encode what the filters have ready."""
    while True:
        try:
            picture = cast(av.VideoFrame, sink.pull())
        except (BlockingIOError, EOFError):
            return
        picture.pts = round((picture.pts or 0) * (picture.time_base or GIF_TICK) / GIF_TICK)
        picture.time_base = GIF_TICK
        output.mux(stream.encode(picture))


def _find_palette(segments: Segments, rate: Fraction) -> av.VideoFrame:
    """Find the colours that suit all frames; none is spent on transparency."""
    graph = Graph()
    source = _add_buffer(graph, next(decode_segments(segments, rate)), rate)
    generate = graph.add("palettegen", "stats_mode=full:reserve_transparent=0")
    sink = graph.add("buffersink")
    source.link_to(generate)
    generate.link_to(sink)
    graph.configure()
    for frame in decode_segments(segments, rate):
        source.push(frame)
    source.push(None)
    return cast(av.VideoFrame, sink.pull())


def _add_buffer(graph: Graph, like: av.VideoFrame, rate: Fraction) -> FilterContext:
    """Add an entrance for frames such as one that is given."""
    return graph.add_buffer(
        width=like.width, height=like.height, format=like.format, time_base=1 / rate
    )
