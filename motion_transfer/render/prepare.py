"""Everything a run needs before its first frame: the plan, the source's appearance, the canvas."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.audio import AudioCut, choose_audio
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.formats import OutputFormat
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_stream import IuvReader, Missing, list_gaps, open_reader, open_stream
from motion_transfer.media.stream import IuvStream
from motion_transfer.people.motion_name import is_motion
from motion_transfer.render.canvas import Canvas
from motion_transfer.render.compose import Comparison, make_background
from motion_transfer.render.content import chunk_key, digest_weights, run_key, source_key
from motion_transfer.render.events import FramesDone, Listener, Notice, Stage
from motion_transfer.render.options import DEFAULT_RATE, RenderOptions, parse_window
from motion_transfer.render.picture_driver import PictureDriver, estimate_driver
from motion_transfer.render.plan import (
    DriverPlan,
    SeenFrame,
    frame_range,
    plan_path,
    scan_people,
)
from motion_transfer.render.recipe import Recipe, choose_recipe
from motion_transfer.render.source import Source
from motion_transfer.render.window import Window


@dataclass(frozen=True)
class DriverFile:
    """A driver that any process can open for itself.

    Attributes:
        missing: what a number missing from a folder does.
    """

    path: Path
    missing: Missing
    order: ChannelOrder

    def open(self) -> IuvReader:
        """Raises: InputError if it is gone, IuvFileError if it is not IUV."""
        return open_reader(_open_stream(self.path, self.missing), self.order)


@dataclass(frozen=True)
class DriverScan:
    """One look at a driver, which any number of runs may share.

    Attributes:
        chosen: the frames that were looked at, `seen` one for each.
        frame_rate: the driver's own, if it has one.
        where_first, where_found: the first of the frames, and the first of them with somebody (if
            there is one), for messages.
        pictures: where the driver is raw pictures: what was made of them.
    """

    file: DriverFile
    height: int
    width: int
    frame_rate: Fraction | None
    chosen: range
    seen: list[SeenFrame]
    where_first: str
    where_found: str
    pictures: PictureDriver | None = None


@dataclass(frozen=True)
class Prepared:
    """A run that can be rendered chunk by chunk, in any process.

    Attributes:
        chunk_keys: of the content that each chunk is made from.
    """

    driver: DriverFile
    plan: DriverPlan
    recipe: Recipe
    canvas: Canvas
    output_format: OutputFormat
    audio: AudioCut | None
    chunk_keys: tuple[str, ...]


def check_photos(options: RenderOptions) -> None:
    """Raises: InputError if a photo is missing."""
    photos = [("garment", garment.photo) for garment in options.garments]
    for what, photo in [("source", options.source), *photos]:
        if not photo.exists():
            raise InputError(f"{what} {photo} does not exist")


def scan_driver(options: RenderOptions, folder: Path, listener: Listener) -> DriverScan:
    """Decode a driver once; find its IUV first if it is raw pictures.

    Args:
        folder: where the IUV of pictures is kept.
    Raises: InputError; IuvFileError naming the frame that is broken.
    """
    if are_pictures(options):
        return _scan_pictures(options, folder, listener)
    missing = options.missing or "fail"
    stream = open_iuv_driver(options, missing, listener)
    reader = open_reader(stream, options.iuv_order)
    chosen = frame_range(options.frames, stream.frame_count, str(options.driver))
    listener(Stage("scan", len(chosen)))
    seen = scan_people(
        reader, chosen, options.worker_count, lambda count: listener(FramesDone(count))
    )
    found = next((i for i, frame in enumerate(seen) if frame.people.persons), 0)
    return DriverScan(
        DriverFile(options.driver, missing, reader.order),
        reader.height,
        reader.width,
        stream.frame_rate,
        chosen,
        seen,
        stream.where(chosen.start),
        stream.where(chosen.start + found),
    )


def open_iuv_driver(options: RenderOptions, missing: Missing, listener: Listener) -> IuvStream:
    """A driver that is IUV or a motion, with everything to be known of it said.

    Raises: InputError if it cannot be read, or an option does not go with it.
    """
    if options.fit_body:
        raise InputError(
            f"--fit-body compares landmarks, and IUV as in the driver {options.driver} has none;"
            " give the video or pictures that it was made from, or leave out --fit-body"
        )
    if is_motion(options.driver):
        from motion_transfer.people.figure.body import FIRST_USE, is_cached

        if not is_cached():
            listener(Notice(FIRST_USE))
    stream = _open_stream(options.driver, missing)
    if stream.gaps:
        filled = "shows nobody" if missing == "background" else "repeats the frame before it"
        listener(Notice(f"{list_gaps(stream.gaps)}; each {filled}"))
    for note in stream.notes:
        listener(Notice(note))
    return stream


def are_pictures(options: RenderOptions) -> bool:
    """Whether the driver is raw pictures, not IUV.

    Raises: InputError if there is no such driver, or it cannot be told what it is.
    """
    if is_motion(options.driver):
        return False
    if not options.driver.exists():
        raise InputError(f"driver {options.driver} does not exist")
    return (options.driver_kind or tell_kind(options.driver)) == "pictures"


def _scan_pictures(options: RenderOptions, folder: Path, listener: Listener) -> DriverScan:
    pictures = estimate_driver(options, folder, listener)
    file = DriverFile(pictures.iuv, "fail", "iuv")
    reader = file.open()
    chosen = frame_range(options.frames, reader.stream.frame_count, str(options.driver))
    listener(Stage("scan", len(chosen)))
    seen = scan_people(
        reader,
        chosen,
        options.worker_count,
        lambda count: listener(FramesDone(count)),
        one_person=True,
    )
    found = next((i for i, frame in enumerate(seen) if frame.people.persons), 0)
    return DriverScan(
        file,
        reader.height,
        reader.width,
        pictures.frame_rate,
        chosen,
        seen,
        f"frame {chosen.start} of {options.driver}",
        f"frame {chosen.start + found} of {options.driver}",
        pictures,
    )


def plan_run(options: RenderOptions, scan: DriverScan) -> DriverPlan:
    """Whom to follow and where the window lies. Raises: InputError, OutputError."""
    return plan_path(
        scan.seen,
        chosen=scan.chosen,
        frame_rate=options.frame_rate or scan.frame_rate or DEFAULT_RATE,
        person=None if scan.pictures else options.driver_person,
        where=str(options.driver),
        where_first=scan.where_first,
        where_found=scan.where_found,
        missing=options.missing,
        cuts=scan.pictures.cuts if scan.pictures else (),
        window=given_window(options),
    )


def given_window(options: RenderOptions) -> Window | None:
    """The crop window that the options name; None for one around the person."""
    window = parse_window(options.window)
    return Window(*window) if window else None


def choose_run_recipe(options: RenderOptions, plan: DriverPlan, listener: Listener) -> Recipe:
    """The renderer of a run. Raises: InputError, WeightsError."""
    sides = [shot.window.side for shot in plan.shots]
    return choose_recipe(options, len(plan.frames), digest_weights(options), listener, sides)


def prepare_run(
    options: RenderOptions,
    output_format: OutputFormat,
    scan: DriverScan,
    plan: DriverPlan,
    recipe: Recipe,
    source: Source,
) -> Prepared:
    """The parts put together. Raises: InputError, OutputError."""
    in_place = is_in_place(options, source)
    begins = scan.pictures.start_seconds if scan.pictures else 0
    key = run_key(
        options,
        source=source_key(options, recipe),
        recipe=recipe,
        output_format=output_format,
        plan=plan,
        in_place=in_place,
    )
    return Prepared(
        driver=scan.file,
        plan=plan,
        recipe=recipe,
        canvas=_checked_canvas(options, output_format, scan, plan, recipe, source),
        output_format=output_format,
        audio=choose_audio(
            options.audio,
            options.output,
            output_format,
            driver=options.driver,
            start_seconds=begins + plan.first / (scan.frame_rate or plan.frame_rate),
            duration_seconds=len(plan.frames) / plan.frame_rate,
        ),
        chunk_keys=tuple(chunk_key(key, plan, chunk) for chunk in plan.chunks),
    )


def check_length(options: RenderOptions, output_format: OutputFormat, plan: DriverPlan) -> None:
    """Raises: OutputError for several frames in one picture."""
    if output_format.kind == "image" and len(plan.frames) > 1:
        raise OutputError(
            f"{options.output} is one picture, but {len(plan.frames)} frames are asked for; choose"
            " one with --frames N, or write a video or a folder"
        )


def _open_stream(path: Path, missing: Missing) -> IuvStream:
    if not is_motion(path):
        return open_stream(path, missing=missing)
    from motion_transfer.people.stream import open_motion

    return open_motion(path)


def is_in_place(options: RenderOptions, source: Source) -> bool:
    """Whether the driver is the source itself, or its IUV: its surroundings then stay."""
    photo, iuv = options.source.resolve(), source.iuv_path and source.iuv_path.resolve()
    return options.driver.resolve() in (photo, iuv)


def frame_size(
    options: RenderOptions, height: int, width: int, working_size: int
) -> tuple[int, int]:
    """Height and width, px, of an output frame without a comparison; arguments as below."""
    if options.size == "crop":
        return working_size, working_size
    if options.size == "even":
        return height + height % 2, width + width % 2
    return height, width


def make_canvas(
    options: RenderOptions, height: int, width: int, working_size: int, source: Source
) -> Canvas:
    """An empty output for a driver of that size, px; `working_size` is the renderer's crop's."""
    height, width = frame_size(options, height, width, working_size)
    comparison = Comparison(source, height, width) if options.compare else None
    in_place = is_in_place(options, source)
    background = make_background(options.background, (height, width), source, in_place=in_place)
    return Canvas(background, crop=options.size == "crop", comparison=comparison)


def _checked_canvas(
    options: RenderOptions,
    output_format: OutputFormat,
    scan: DriverScan,
    plan: DriverPlan,
    recipe: Recipe,
    source: Source,
) -> Canvas:
    working_size = recipe.working_size(plan.largest_side)
    canvas = make_canvas(options, scan.height, scan.width, working_size, source)
    width, height = canvas.size
    even_only = output_format.kind == "video" and output_format.codec.needs_even_size
    if even_only and (width % 2 or height % 2):
        raise OutputError(
            f"{options.output}: {output_format.codec_name} cannot hold the odd size"
            f" {width} x {height}; add --size even or --size crop, or write PNG"
        )
    return canvas
