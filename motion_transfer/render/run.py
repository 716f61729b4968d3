"""One run from options to a finished output: what `mt run` and `render_video` both call."""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.formats import OutputFormat, choose_format
from motion_transfer.media.image import write_png
from motion_transfer.media.iuv_stream import IuvReader, list_gaps, open_reader, open_stream
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.stream import IuvStream
from motion_transfer.people.stream import is_motion
from motion_transfer.render.compose import Comparison, make_background
from motion_transfer.render.engine import Canvas, Engine
from motion_transfer.render.events import (
    Finished,
    FramesDone,
    Listener,
    Notice,
    Stage,
    Started,
    ignore,
)
from motion_transfer.render.missing import list_stretches
from motion_transfer.render.options import DEFAULT_RATE, RenderOptions
from motion_transfer.render.plan import DriverPlan, frame_range, plan_driver
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.sheet import ContactSheet
from motion_transfer.render.source import Source, prepare_source

TEXTURE_SIZE = 256
COMPILE_PAYS_FRAMES = 300  # a driver this long earns back the half minute that compiling takes


@dataclass(frozen=True)
class RenderReport:
    """What a run made.

    Attributes:
        output: the finished file or folder.
        renderer: the one that drew it.
        wall_seconds: the whole run; render_seconds: without planning and loading.
        missing: half-open ranges of driver frames in which nobody was found.
    """

    output: Path
    renderer: str
    frame_count: int
    width: int
    height: int
    frame_rate: Fraction
    wall_seconds: float
    render_seconds: float
    missing: tuple[tuple[int, int], ...] = ()

    @property
    def duration_seconds(self) -> float:
        return float(self.frame_count / self.frame_rate)


def run(options: RenderOptions, listener: Listener = ignore) -> RenderReport:
    """Render a source with a driver's motion.

    Raises: InputError and its kinds for anything the caller gave that cannot be used, before
        rendering where it can be known; KeyboardInterrupt is passed on. In every case of failure
        nothing stays behind and an existing output is untouched.
    """
    began = time.perf_counter()
    output_format = choose_format(options.output, codec=options.codec, crf=options.crf)
    for path in filter(None, (options.output, options.sheet)):
        check_destination(path, force=options.force)
    reader, plan = _plan(options, listener)
    if output_format.kind == "image" and len(plan.frames) > 1:
        raise OutputError(
            f"{options.output} is one picture, but {len(plan.frames)} frames are asked for; choose"
            " one with --frames N, or write a video or a folder"
        )
    renderer, source = _open_renderer(options, len(plan.frames), listener)
    canvas = _canvas(options, output_format, reader, plan, renderer, source)
    width, height = canvas.size
    sheet = ContactSheet(len(plan.frames)) if options.sheet else None
    engine = Engine(
        reader=reader,
        plan=plan,
        renderer=renderer,
        canvas=canvas,
        output_format=output_format,
        workers=options.worker_count,
        sheet=sheet,
        listener=listener,
    )
    rate = plan.frame_rate
    listener(Started(renderer.name, len(plan.frames), width, height, str(rate)))
    listener(Stage("render", len(plan.frames)))
    render_began = time.perf_counter()
    with work_folder(options.output) as folder:
        finished = folder / f"finished{options.output.suffix.lower()}"
        engine.run(folder, finished)
        if sheet is not None and options.sheet is not None:
            _publish_sheet(sheet, options.sheet)
        publish(finished, options.output)
    ended = time.perf_counter()
    report = RenderReport(
        output=options.output,
        renderer=renderer.name,
        frame_count=len(plan.frames),
        width=width,
        height=height,
        frame_rate=rate,
        wall_seconds=ended - began,
        render_seconds=ended - render_began,
        missing=tuple(plan.missing),
    )
    _report_missing(options, plan, listener)
    listener(
        Finished(
            report.output,
            report.frame_count,
            report.duration_seconds,
            report.renderer,
            report.wall_seconds,
            report.render_seconds,
        )
    )
    return report


def _plan(options: RenderOptions, listener: Listener) -> tuple[IuvReader, DriverPlan]:
    stream = _open_driver(options, listener)
    if stream.gaps:
        filled = (
            "shows nobody" if options.missing == "background" else "repeats the frame before it"
        )
        listener(Notice(f"{list_gaps(stream.gaps)}; each {filled}"))
    for note in stream.notes:
        listener(Notice(note))
    reader = open_reader(stream, options.iuv_order)
    chosen = frame_range(options.frames, stream.frame_count, str(options.driver))
    listener(Stage("scan", len(chosen)))
    plan = plan_driver(
        reader,
        frames=options.frames,
        frame_rate=options.frame_rate or stream.frame_rate or DEFAULT_RATE,
        person=options.driver_person,
        workers=options.worker_count,
        done=lambda count: listener(FramesDone(count)),
        missing=options.missing,
    )
    return reader, plan


def _report_missing(options: RenderOptions, plan: DriverPlan, listener: Listener) -> None:
    stretches = plan.missing
    if stretches:
        count = sum(stop - start for start, stop in stretches)
        shown = "the frame before" if options.missing == "hold" else "background only"
        times = list_stretches(stretches, plan.first, plan.frame_rate)
        listener(Notice(f"nobody found in {count} of {len(plan.frames)} frames, {shown}: {times}"))


def _open_driver(options: RenderOptions, listener: Listener) -> IuvStream:
    if not is_motion(options.driver):
        return open_stream(options.driver, missing=options.missing or "fail")
    from motion_transfer.people.figure.body import FIRST_USE, is_cached
    from motion_transfer.people.stream import open_motion

    if not is_cached():
        listener(Notice(FIRST_USE))
    return open_motion(options.driver)


def _open_renderer(
    options: RenderOptions, frame_count: int, listener: Listener
) -> tuple[Renderer, Source]:
    """The renderer that the options name, with its source. Imports what it needs, when needed."""
    if options.renderer_name == "texture":
        from motion_transfer.render.texture_renderer import TextureRenderer

        source = prepare_source(options, TEXTURE_SIZE)
        return TextureRenderer(source), source
    from motion_transfer.render.neural_renderer import NeuralRenderer
    from motion_transfer.weights import load_checkpoint

    if options.weights is None:
        raise InputError("the nhrr renderer needs weights")
    model = load_checkpoint(options.weights)
    source = prepare_source(options, model.config.texture_size)
    if not _decide_compile(options.compile, frame_count):
        return NeuralRenderer(model, source, compile=False), source
    listener(Notice("compiling the network, half a minute at most; later runs find it done"))
    began = time.perf_counter()
    renderer = NeuralRenderer(model, source, compile=True)
    listener(Notice(f"compiled in {time.perf_counter() - began:.0f} s"))
    return renderer, source


def _decide_compile(wish: bool | None, frame_count: int) -> bool:
    """Whether to compile. Raises: InputError if it is asked for and there is no compiler."""
    compiler = os.environ.get("CXX") or next(filter(shutil.which, ("g++", "clang++")), None)
    if wish and compiler is None:
        raise InputError(
            "--compile needs a C++ compiler, g++ or clang++; install one, or leave it out"
        )
    if wish is None:
        return compiler is not None and frame_count >= COMPILE_PAYS_FRAMES
    return wish


def _canvas(
    options: RenderOptions,
    output_format: OutputFormat,
    reader: IuvReader,
    plan: DriverPlan,
    renderer: Renderer,
    source: Source,
) -> Canvas:
    if options.size == "crop":
        side = renderer.working_size(plan.window.side)
        height, width = side, side
    else:
        height, width = reader.height, reader.width
    if options.size == "even":
        height, width = height + height % 2, width + width % 2
    comparison = Comparison(source, height, width) if options.compare else None
    if output_format.kind == "video" and output_format.codec.needs_even_size:
        panel_height, panel_width = comparison.size if comparison else (height, width)
        if panel_height % 2 or panel_width % 2:
            raise OutputError(
                f"{options.output}: {output_format.codec_name} cannot hold the odd size"
                f" {panel_width} x {panel_height}; add --size even or --size crop, or write PNG"
            )
    in_place = options.driver.resolve() == source.iuv_path.resolve()
    background = make_background(options.background, (height, width), source, in_place=in_place)
    return Canvas(background, crop=options.size == "crop", comparison=comparison)


def _publish_sheet(sheet: ContactSheet, destination: Path) -> None:
    with work_folder(destination) as folder:
        picture = folder / "sheet.png"
        write_png(picture, sheet.picture())
        publish(picture, destination)
