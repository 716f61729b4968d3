"""GIF in two passes over lossless segments: one palette for the whole clip, then the frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
from av.container import OutputContainer
from av.filter import Graph
from av.filter.context import FilterContext

GIF_TICK = Fraction(1, 100)  # the format counts time in hundredths of a second


def write_gif(segments: Sequence[Path], destination: Path, rate: Fraction) -> None:
    """Encode segments as a looping GIF; frame times are rounded to the format's hundredths."""
    palette = _find_palette(segments, rate)
    with av.open(str(destination), "w", format="gif", options={"loop": "0"}) as output:
        first = next(_frames(segments))
        stream = output.add_stream("gif", rate=rate)
        stream.width, stream.height, stream.pix_fmt = first.width, first.height, "pal8"
        stream.codec_context.time_base = GIF_TICK
        stream.time_base = GIF_TICK
        graph = Graph()
        pictures = graph.add_buffer(
            width=first.width, height=first.height, format=first.format, time_base=1 / rate
        )
        colours = graph.add_buffer(
            width=palette.width, height=palette.height, format=palette.format, time_base=1 / rate
        )
        use = graph.add("paletteuse", "dither=bayer:bayer_scale=4:diff_mode=rectangle")
        sink = graph.add("buffersink")
        pictures.link_to(use, 0, 0)
        colours.link_to(use, 0, 1)
        use.link_to(sink)
        graph.configure()
        colours.push(palette)
        colours.push(None)
        for index, frame in enumerate(_frames(segments)):
            frame.pts, frame.time_base = index, 1 / rate
            pictures.push(frame)
            _drain(sink, stream, output)
        pictures.push(None)
        _drain(sink, stream, output)
        output.mux(stream.encode(None))


def _drain(sink: FilterContext, stream: av.VideoStream, output: OutputContainer) -> None:
    while True:
        try:
            picture = cast(av.VideoFrame, sink.pull())
        except (BlockingIOError, EOFError):
            return
        picture.pts = round((picture.pts or 0) * (picture.time_base or GIF_TICK) / GIF_TICK)
        picture.time_base = GIF_TICK
        output.mux(stream.encode(picture))


def _find_palette(segments: Sequence[Path], rate: Fraction) -> av.VideoFrame:
    graph = Graph()
    first = next(_frames(segments))
    source = graph.add_buffer(
        width=first.width, height=first.height, format=first.format, time_base=1 / rate
    )
    generate = graph.add("palettegen", "stats_mode=full:reserve_transparent=0")
    sink = graph.add("buffersink")
    source.link_to(generate)
    generate.link_to(sink)
    graph.configure()
    for index, frame in enumerate(_frames(segments)):
        frame.pts, frame.time_base = index, 1 / rate
        source.push(frame)
    source.push(None)
    return cast(av.VideoFrame, sink.pull())


def _frames(segments: Sequence[Path]) -> Iterator[av.VideoFrame]:
    for path in segments:
        with av.open(str(path)) as container:
            yield from container.decode(video=0)
