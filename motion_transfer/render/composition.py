"""One way from options to something drawable; whoever draws takes its steps from here.

    options ─► scan ─► plan ─┐
        └───► recipe ─► source ─► prepared ─► frames

`compose` takes them all, for `mt run`. A batch takes each once for all jobs that share it, the
preview again and again as options change, and evaluation the drawing ones alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from pathlib import Path

from motion_transfer.drawing.canvas import Canvas
from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.drawing.renderers.interface import Appearance, Recipe
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError, OutputError
from motion_transfer.events import Listener, Notice
from motion_transfer.media.credentials import check_credentials
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.output.audio import AudioCut, choose_audio
from motion_transfer.media.output.formats import OutputFormat, choose_format
from motion_transfer.media.output.marks import Mark
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render.backdrop import (
    Backdrop,
    count_until_end,
    open_background,
)
from motion_transfer.render.content import chunk_key, read_contents, run_key
from motion_transfer.render.crew import Crew
from motion_transfer.render.driver import DriverScan, scan_driver
from motion_transfer.render.inputs import appearance_files, audio_files
from motion_transfer.render.options import (
    DEFAULT_RATE,
    OutputOptions,
    RendererOptions,
    RenderOptions,
    SceneOptions,
    parse_window,
)
from motion_transfer.render.plan import DriverPlan, plan_path
from motion_transfer.render.provenance import Record, describe_run, source_type_of
from motion_transfer.render.scene import Actor, is_in_place, make_actors, make_canvas, open_backdrop
from motion_transfer.render.source import check_photos, read_source


@dataclass(frozen=True)
class Scene:
    """All that frames are drawn from, but the appearances of those who are in them.

    Attributes:
        actors: Everybody who is drawn; the first one leads.
        crops: Whether the output is the square that was drawn, and no frame of the driver.
    """

    actors: tuple[Actor, ...]
    crops: bool
    recipe: Recipe
    canvas: Canvas
    backdrop: Backdrop

    @property
    def plan(self) -> DriverPlan:
        """The plan of who leads, which cuts the chunks."""
        return self.actors[0].plan

    def open_people(self) -> list[IuvReader]:
        """Open the IUV of each actor, once for those who share it. Raises: InputError."""
        readers = {actor.driver: actor.driver.open() for actor in self.actors}
        return [readers[actor.driver] for actor in self.actors]


@dataclass(frozen=True)
class Prepared(Scene):
    """A run that can be rendered chunk by chunk, in any process.

    Attributes:
        chunk_keys: Of the content that each chunk is made from.
        inputs: All files that it is made from.
        record: What the output says of itself.
    """

    output_format: OutputFormat
    audio: AudioCut | None
    chunk_keys: tuple[str, ...]
    inputs: Inputs
    record: Record


@dataclass(frozen=True)
class Composed:
    """All that comes before the first frame.

    Attributes:
        appearances: What the recipe's renderer knows of each actor's source.
    """

    prepared: Prepared
    appearances: tuple[Appearance, ...]


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
    check_early(options)
    with ThreadPoolExecutor(2) as beside:  # what can be made ready is, while files are read
        ready = [] if options.adapt else [beside.submit(open_recipe(options).make_ready, ())]
        scans = scan_cast(options, folder, listener, scanned=scanned, crew=crew)
        plans = plan_cast(options, scans)
        options = settle_weights(options, listener)
        inputs = Inputs(cast_files(options))
        recipe = open_recipe(options)
        sides = [shot.window.side for plan in plans for shot in plan.shots]
        ready.append(beside.submit(recipe.make_ready, sides))
        sources = read_cast(options, recipe, listener)
        for each in ready:
            each.result()
    for note in dict.fromkeys(note for source in sources for note in source.notes):
        listener(Notice(note))
    prepared = prepare_run(options, scans, plans, recipe, sources, inputs, folder, listener)
    return Composed(prepared, tuple(recipe.appearance_of(source) for source in sources))


def check_early(options: RenderOptions) -> None:
    """Refuse what can be refused at once: to find people may take long. Raises: InputError."""
    read_format(options)
    if options.credentials_cert is not None and options.credentials_key is not None:
        check_credentials(options.output, options.credentials_cert, options.credentials_key)
    check_photos(options)
    for partner in options.partners:
        if not partner.photo.exists():
            raise InputError(f"partner {partner.photo} does not exist")
    if options.background_file is not None:
        open_background(options.background_file)


def scan_cast(
    options: RenderOptions,
    folder: Path,
    listener: Listener,
    *,
    scanned: Callable[[DriverScan], object] = lambda _scan: None,
    workers: int | None = None,
    crew: Crew | None = None,
) -> list[DriverScan]:
    """Look through the driver for each of the cast, see `scan_driver`.

    IUV shows everybody at once, and is looked through once.
    """
    scans: list[DriverScan] = []
    for member in options.cast:
        if scans and scans[0].pictures is None:
            scans.append(scans[0])
            continue
        workers = workers or options.worker_count
        scans.append(scan_driver(member, folder, listener, workers=workers, crew=crew))
        scanned(scans[-1])
    return scans


def plan_cast(options: RenderOptions, scans: Sequence[DriverScan]) -> list[DriverPlan]:
    """Plan the way of each of the cast, see `plan_run`. Raises: InputError, also for two of one."""
    plans = [plan_run(*each) for each in zip(options.cast, scans, strict=True)]
    for number, plan in enumerate(plans[1:], 1):
        for earlier, other in enumerate(plans[:number]):
            if all(
                mine.person == its.person
                for mine, its in zip(plan.frames, other.frames, strict=True)
            ):
                who = "who leads" if earlier == 0 else str(options.partners[earlier - 1].photo)
                raise InputError(
                    f"partner {options.partners[number - 1].photo} and {who} follow the same person"
                    f" of {options.driver}; name another by --partner-person or --driver-person"
                )
    return plans


def read_cast(options: RenderOptions, recipe: Recipe, listener: Listener) -> list[Source]:
    """Read the source of each of the cast, see `read_source`."""
    return [read_source(member, recipe.texture_size, listener) for member in options.cast]


def cast_files(options: RenderOptions) -> Iterator[Path]:
    """List what the appearance of each of the cast is made from, and what is behind them.

    Raises: WeightsError if weights are missing.
    """
    for member in options.cast:
        yield from appearance_files(member)
    if options.background_file is not None:
        yield options.background_file


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
    transparent = isinstance(options, SceneOptions) and options.transparent
    if transparent and options.compare:
        raise OutputError("--compare shows panels, and they are not transparent; leave one out")
    return choose_format(
        options.output,
        codec=options.codec,
        crf=options.crf,
        transparent=transparent,
        alpha=options.alpha,
        pix_fmt=options.pix_fmt,
    )


def open_recipe(options: RendererOptions) -> Recipe:
    """Make the recipe of the renderer that the options name.

    Raises: InputError for weights that cannot be read, or not be run as the options say.
    """
    return RENDERERS[options.renderer].recipe(options.weights, options.wish)


def plan_run(options: RenderOptions, scan: DriverScan) -> DriverPlan:
    """Decide whom to follow and where the window lies. Raises: InputError if nobody is there."""
    window = parse_window(options.window)
    rate = options.frame_rate or scan.frame_rate or DEFAULT_RATE
    count = count_until_end(options, rate)
    if count is not None and count < len(scan.chosen):
        scan = replace(scan, chosen=scan.chosen[:count], seen=scan.seen[:count])
    return plan_path(
        scan.seen,
        chosen=scan.chosen,
        frame_rate=rate,
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
    scans: Sequence[DriverScan],
    plans: Sequence[DriverPlan],
    recipe: Recipe,
    sources: Sequence[Source],
    inputs: Inputs,
    folder: Path,
    listener: Listener,
) -> Prepared:
    """Put the parts together; the network is loaded.

    Args:
        scans, plans, sources: One for each of the cast.
        inputs: What recipe and sources were read from.
        folder: Where what is found in the driver's pictures is kept.
    Raises: InputError and its kinds, also if an input has changed since it was noted: chunks are
        keyed by what the files hold now; OutputError for an output that cannot hold the run.
    """
    scan, plan, source = scans[0], plans[0], sources[0]
    inputs |= Inputs(audio_files(options))
    for each in scans:
        inputs |= each.inputs
    output_format = replace(read_format(options), mark=Mark(source_type_of(options)))
    _check_length(options, output_format, plan)
    canvas = open_canvas(options, scans, plans, recipe, source)
    _check_size(options, output_format, canvas)
    contents = read_contents(options)
    scene = set_scene(options, scans, plans, recipe, sources, canvas, folder, listener)
    key = run_key(
        options,
        contents,
        recipe=recipe,
        output_format=output_format,
        plans=plans,
        in_place=is_in_place(options, source),
    )
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
        **{each.name: getattr(scene, each.name) for each in fields(scene)},
        output_format=output_format,
        audio=audio,
        chunk_keys=tuple(chunk_key(key, plans, chunk) for chunk in plan.chunks),
        inputs=inputs,
        record=describe_run(
            options,
            contents,
            recipe=recipe,
            output_format=output_format,
            size=canvas.size,
            plan=plan,
            inputs=inputs,
            audio=audio,
        ),
    )
    inputs.check()
    return prepared


def open_canvas(
    options: RenderOptions,
    scans: Sequence[DriverScan],
    plans: Sequence[DriverPlan],
    recipe: Recipe,
    source: Source,
) -> Canvas:
    """Make the empty output, see `make_canvas`; what draws is loaded. Raises: InputError."""
    recipe.make_ready([shot.window.side for plan in plans for shot in plan.shots])
    working_size = recipe.working_size(plans[0].largest_side)
    return make_canvas(options, scans[0].height, scans[0].width, working_size, source)


def set_scene(
    options: RenderOptions,
    scans: Sequence[DriverScan],
    plans: Sequence[DriverPlan],
    recipe: Recipe,
    sources: Sequence[Source],
    canvas: Canvas,
    folder: Path,
    listener: Listener,
) -> Scene:
    """Lay out what is behind, and everybody before it, see `prepare_run`. Raises: InputError."""
    backdrop = open_backdrop(options, scans, plans[0], canvas, sources[0], folder, listener)
    return Scene(
        actors=make_actors(options, scans, plans, sources, canvas, backdrop),
        crops=options.size == "crop",
        recipe=recipe,
        canvas=canvas,
        backdrop=backdrop,
    )


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
