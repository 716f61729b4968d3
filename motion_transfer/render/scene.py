"""From options to a scene: the canvas, what is behind, and everybody who is in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from motion_transfer.drawing.backgrounds import Frame, blur_picture, make_background
from motion_transfer.drawing.canvas import Canvas, Comparison, Spot
from motion_transfer.drawing.light import Light, match_light, measure_light
from motion_transfer.drawing.person import occupancy
from motion_transfer.drawing.source import Source
from motion_transfer.events import Listener
from motion_transfer.render.backdrop import (
    Backdrop,
    Clip,
    Still,
    empty_driver,
    light_of,
    open_background,
    open_still,
)
from motion_transfer.render.driver import DriverIuv, DriverScan
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.placing import place_in_square, place_people
from motion_transfer.render.plan import DriverPlan


@dataclass(frozen=True)
class Actor:
    """One person of a scene, on the way through the driver.

    Attributes:
        spots: Where the person is in each output frame.
        table: Changes the light of what is drawn, see `match_light`.
    """

    driver: DriverIuv
    plan: DriverPlan
    spots: tuple[Spot, ...]
    table: np.ndarray | None = None


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
    return Canvas(height, width, options.transparent, options.shadow, comparison)


def frame_size(
    options: RenderOptions, height: int, width: int, working_size: int
) -> tuple[int, int]:
    """Tell height and width, px, of an output frame without a comparison, see `make_canvas`.

    Raises: InputError if the background, whose size it is, cannot be read.
    """
    if options.size == "crop":
        return working_size, working_size
    if options.size == "even":
        return height + height % 2, width + width % 2
    if options.size == "background" and options.background_file is not None:
        behind = open_background(options.background_file)
        return behind.height, behind.width
    return height, width


def is_in_place(options: RenderOptions, source: Source) -> bool:
    """Tell whether the driver is the source itself, or its IUV: its surroundings then stay."""
    if len(options.source) != 1:
        return False
    photo, iuv = options.source[0].resolve(), source.iuv_path and source.iuv_path.resolve()
    return options.driver.resolve() in (photo, iuv)


def open_backdrop(
    options: RenderOptions,
    scans: Sequence[DriverScan],
    plan: DriverPlan,
    canvas: Canvas,
    source: Source,
    folder: Path,
    listener: Listener,
) -> Backdrop:
    """Make what is behind, see `prepare_run`. Raises: InputError."""
    size = canvas.height, canvas.width
    if options.background == "driver":
        return empty_driver(options, scans, plan, size, folder, listener)
    return make_backdrop(options, size, plan.frame_rate, source)


def make_backdrop(
    options: RenderOptions, size: tuple[int, int], rate: Fraction, source: Source
) -> Backdrop:
    """Make a backdrop of (height, width) that is not the driver. Raises: InputError."""
    path = options.background_file
    picture = make_still(options, size, source)
    if path is None or picture is not None:
        return Still(picture)
    fit, end, blur = options.background_fit, options.background_end, options.background_blur
    return Clip(path, size, rate, fit, end, blur)


def make_still(options: RenderOptions, size: tuple[int, int], source: Source) -> Frame | None:
    """Make a background that is one picture of (height, width).

    Returns: None where nothing is behind, or pictures that move. Raises: InputError.
    """
    if options.background_file is not None:
        return open_still(options, size)
    if options.transparent:
        return None
    in_place = is_in_place(options, source)
    picture = make_background(
        options.background, size, source, in_place=in_place, redressed=options.redressed
    )
    return blur_picture(picture, options.background_blur)


def make_actors(
    options: RenderOptions,
    scans: Sequence[DriverScan],
    plans: Sequence[DriverPlan],
    sources: Sequence[Source],
    canvas: Canvas,
    backdrop: Backdrop,
) -> tuple[Actor, ...]:
    """Place each of the cast in the output, and bring them to its light."""
    size = canvas.height, canvas.width
    if options.size == "crop":
        # of the largest shot's window; others are enlarged to it
        spots = [place_in_square(plans[0], canvas.height)]
    else:
        spots = place_people(plans, options, (scans[0].height, scans[0].width), size)
    tables: list[np.ndarray | None] = [None] * len(plans)
    if options.match_colours:
        around = light_of(backdrop, len(plans[0].frames))
        tables = [match_light(person_light(source), around) for source in sources]
    return tuple(
        Actor(scan.file, plan, own_spots, table)
        for scan, plan, own_spots, table in zip(scans, plans, spots, tables, strict=True)
    )


def person_light(source: Source) -> Light:
    """Measure the light of the person of a photo."""
    return measure_light(source.photo.rgb, occupancy(source.iuv))
