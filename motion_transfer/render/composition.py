"""One way from options to something drawable; whoever draws takes its steps from here.

    options ─► scan ─► plan ─┐
        └───► recipe ─► source ─► prepared ─► frames

`compose` takes them all, for `mt run`. A batch takes each once for all jobs that share it, the
preview again and again as options change, and evaluation the drawing ones alone.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.drawing.canvas import Canvas, Comparison, make_background
from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.drawing.renderers.interface import Appearance, Recipe
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import Window
from motion_transfer.errors import OutputError
from motion_transfer.events import Listener, Notice
from motion_transfer.media.output.audio import AudioCut, choose_audio
from motion_transfer.media.output.formats import OutputFormat, choose_format
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render.content import chunk_key, run_key
from motion_transfer.render.crew import Crew
from motion_transfer.render.driver import DriverFile, DriverScan, scan_driver
from motion_transfer.render.inputs import appearance_files, audio_files
from motion_transfer.render.options import (
    DEFAULT_RATE,
    OutputOptions,
    RendererOptions,
    RenderOptions,
    parse_window,
)
from motion_transfer.render.plan import DriverPlan, plan_path
from motion_transfer.render.source import check_photos, read_source


@dataclass(frozen=True)
class Prepared:
    """A run that can be rendered chunk by chunk, in any process.

    Attributes:
        chunk_keys: Of the content that each chunk is made from.
        inputs: All files that it is made from.
    """

    driver: DriverFile
    plan: DriverPlan
    recipe: Recipe
    canvas: Canvas
    output_format: OutputFormat
    audio: AudioCut | None
    chunk_keys: tuple[str, ...]
    inputs: Inputs


@dataclass(frozen=True)
class Composed:
    """All that comes before the first frame.

    Attributes:
        appearance: What the recipe's renderer knows of the source.
    """

    prepared: Prepared
    appearance: Appearance


def compose(
    options: RenderOptions,
    folder: Path,
    listener: Listener,
    *,
    scanned: Callable[[DriverScan], object] = lambda _scan: None,
    crew: Crew | None = None,
) -> Composed:
    """Take every step from options to a prepared run.

    Args:
        folder: Where the IUV of a driver is kept that is raw pictures.
        scanned: Called as soon as the driver was looked through, which may have taken long.
        crew: Processes that help to look through it.
    Raises: InputError and its kinds.
    """
    read_format(options)  # now, as the photos: to find a driver's people may take long
    check_photos(options)
    with ThreadPoolExecutor(2) as beside:  # what can be made ready is, while files are read
        ready = [] if options.adapt else [beside.submit(open_recipe(options).make_ready, ())]
        scan = scan_driver(options, folder, listener, workers=options.worker_count, crew=crew)
        scanned(scan)
        plan = plan_run(options, scan)
        options = settle_weights(options, listener)
        inputs = Inputs(appearance_files(options))
        recipe = open_recipe(options)
        sides = [shot.window.side for shot in plan.shots]
        ready.append(beside.submit(recipe.make_ready, sides))
        source = read_source(options, recipe.texture_size, listener)
        for each in ready:
            each.result()
    for note in source.notes:
        listener(Notice(note))
    prepared = prepare_run(options, scan, plan, recipe, source, inputs, listener)
    return Composed(prepared, recipe.appearance_of(source))


def settle_weights(options: RenderOptions, listener: Listener) -> RenderOptions:
    """Let the weights learn the person first, if that is asked for, or find them in the cache.

    Returns: The options, whose weights are then those that are drawn with.
    Raises: InputError and its kinds.
    """
    if not options.adapt:
        return options
    from motion_transfer.render.adapted import adapt_run  # what learns takes a while to import

    return adapt_run(options, listener)


def read_format(options: OutputOptions) -> OutputFormat:
    """Tell the format that the options mean. Raises: OutputError if it cannot be written."""
    return choose_format(options.output, codec=options.codec, crf=options.crf)


def open_recipe(options: RendererOptions) -> Recipe:
    """Make the recipe of the renderer that the options name.

    Raises: InputError for weights that cannot be read, or not be run as the options say.
    """
    return RENDERERS[options.renderer].recipe(options.weights, options.wish)


def plan_run(options: RenderOptions, scan: DriverScan) -> DriverPlan:
    """Decide whom to follow and where the window lies. Raises: InputError if nobody is there."""
    window = parse_window(options.window)
    return plan_path(
        scan.seen,
        chosen=scan.chosen,
        frame_rate=options.frame_rate or scan.frame_rate or DEFAULT_RATE,
        person=None if scan.pictures else options.driver_person,
        where=str(scan.path),
        where_first=scan.where_first,
        where_found=scan.where_found,
        missing=options.missing,
        cuts=scan.pictures.cuts if scan.pictures else (),
        window=Window(*window) if window else None,
    )


def prepare_run(
    options: RenderOptions,
    scan: DriverScan,
    plan: DriverPlan,
    recipe: Recipe,
    source: Source,
    inputs: Inputs,
    listener: Listener,
) -> Prepared:
    """Put the parts together; the network is loaded.

    Args:
        inputs: What recipe and source were read from.
    Raises: InputError and its kinds, also if an input has changed since it was noted: chunks are
        keyed by what the files hold now; OutputError for an output that cannot hold the run.
    """
    inputs |= scan.inputs | Inputs(audio_files(options))
    output_format = read_format(options)
    _check_length(options, output_format, plan)
    recipe.make_ready([shot.window.side for shot in plan.shots])
    key = run_key(
        options,
        recipe=recipe,
        output_format=output_format,
        plan=plan,
        in_place=is_in_place(options, source),
    )
    working_size = recipe.working_size(plan.largest_side)
    canvas = make_canvas(options, scan.height, scan.width, working_size, source)
    _check_size(options, output_format, canvas)
    audio = choose_audio(
        options.audio,
        options.output,
        output_format,
        track=options.audio_track,
        driver=options.driver,
        start_seconds=scan.start_seconds + plan.first / (scan.frame_rate or plan.frame_rate),
        duration_seconds=len(plan.frames) / plan.frame_rate,
    )
    for note in audio.notes if audio else ():
        listener(Notice(note))
    prepared = Prepared(
        driver=scan.file,
        plan=plan,
        recipe=recipe,
        canvas=canvas,
        output_format=output_format,
        audio=audio,
        chunk_keys=tuple(chunk_key(key, plan, chunk) for chunk in plan.chunks),
        inputs=inputs,
    )
    inputs.check()
    return prepared


def is_in_place(options: RenderOptions, source: Source) -> bool:
    """Tell whether the driver is the source itself, or its IUV: its surroundings then stay."""
    if len(options.source) != 1:
        return False
    photo, iuv = options.source[0].resolve(), source.iuv_path and source.iuv_path.resolve()
    return options.driver.resolve() in (photo, iuv)


def frame_size(
    options: OutputOptions, height: int, width: int, working_size: int
) -> tuple[int, int]:
    """Tell height and width, px, of an output frame without a comparison, see `make_canvas`."""
    if options.size == "crop":
        return working_size, working_size
    if options.size == "even":
        return height + height % 2, width + width % 2
    return height, width


def make_canvas(
    options: RenderOptions, height: int, width: int, working_size: int, source: Source
) -> Canvas:
    """Make an empty output.

    Args:
        height, width: Of the driver, px.
        working_size: Side of the renderer's crops, px.
    """
    height, width = frame_size(options, height, width, working_size)
    comparison = Comparison(source, height, width) if options.compare else None
    in_place = is_in_place(options, source)
    background = make_background(options.background, (height, width), source, in_place=in_place)
    return Canvas(background, crop=options.size == "crop", comparison=comparison)


def _check_length(options: OutputOptions, output_format: OutputFormat, plan: DriverPlan) -> None:
    if not output_format.row.several and len(plan.frames) > 1:
        raise OutputError(
            f"{options.output} is one picture, but {len(plan.frames)} frames are asked for; choose"
            " one with --frames N, or write a video or a folder"
        )


def _check_size(options: OutputOptions, output_format: OutputFormat, canvas: Canvas) -> None:
    width, height = canvas.size
    if output_format.codec.needs_even_size and (width % 2 or height % 2):
        raise OutputError(
            f"{options.output}: {output_format.codec_name} cannot hold the odd size"
            f" {width} x {height}; add --size even or --size crop, or write PNG"
        )
