"""What a frame of the output shows: background, everybody in it, light and shadow, as a run has it.

Until a run's plan is known, the one who leads is shown alone. A driver of raw pictures is estimated
for that person only, and what is behind is filled from around: to look for more would take as long
as the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from motion_transfer.drawing.canvas import Canvas, Figure, Picture, Spot
from motion_transfer.drawing.light import match_light
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.source import Source
from motion_transfer.errors import InputError
from motion_transfer.preview.driver import FramePlans, PreviewedDriver, plan_frames
from motion_transfer.render.backdrop import (
    Backdrop,
    DriverPictures,
    OpenBackdrop,
    light_of,
    no_pictures,
)
from motion_transfer.render.options import DEFAULT_RATE, RenderOptions
from motion_transfer.render.placing import place_in_square, place_people
from motion_transfer.render.scene import make_backdrop, make_canvas, person_light

KEPT = 4  # results of each step: some options back and forth without waiting


@dataclass(frozen=True, eq=False)
class _Scene:
    """What is the same for all frames."""

    canvas: Canvas
    backdrop: Backdrop
    behind: OpenBackdrop
    frame_count: int


class Scenes:
    """Draws output frames; what many of them share is kept."""

    def __init__(
        self,
        source_of: Callable[[RenderOptions], Source],
        renderer_of: Callable[[RenderOptions], Renderer],
    ) -> None:
        """Draw nothing yet; the functions give source and renderer of one who is drawn."""
        self._source_of = source_of
        self._renderer_of = renderer_of
        self._scene = lru_cache(KEPT)(self._make_scene)
        self._table = lru_cache(KEPT)(self._make_table)
        self._partners: tuple[FramePlans | None, RenderOptions | None, list[FramePlans]]
        self._partners = (None, None, [])
        self._spots: tuple[tuple, list[tuple[Spot, ...]]] = ((), [])

    def frame(
        self, options: RenderOptions, driver: PreviewedDriver, plans: FramePlans, index: int
    ) -> Picture:
        """Draw an output frame. Raises: InputError, WeightsError."""
        everyone = [plans, *self._plan_partners(options, driver, plans)]
        lead_side = self._renderer_of(options).working_size(plans.largest_side)
        reader = driver.opened.reader
        rate = options.frame_rate or driver.opened.frame_rate or DEFAULT_RATE
        # the options that can be changed and leave what is behind as it is
        same = {"driver_person": "largest", "window": "auto", "frames": (None, None)}
        plain = replace(options, frame_rate=rate, place=None, **same)
        scene = self._scene(plain, driver, reader.height, reader.width, lead_side)
        spots = self._place(options, everyone, (reader.height, reader.width), scene.canvas)
        figures = []
        for member, known, places in zip(options.cast, everyone, spots, strict=False):
            window, renderer = known.window_at(index), self._renderer_of(member)
            crop = window.cut(known.read(index, driver), renderer.working_size(window.side))
            spot = places[known.place_in_plan(index)]
            table = self._table(member, scene) if options.match_colours else None
            figures.append(Figure(renderer.render(crop[None])[0], spot, table))
        number = max(0, index - plans.chosen.start)
        if options.background == "driver":
            number = index  # which has its own people in it
        background = next(iter(scene.behind.read(number, number + 1)))
        return scene.canvas.lay_out(background, figures, driver.read(index))

    def _plan_partners(
        self, options: RenderOptions, driver: PreviewedDriver, plans: FramePlans
    ) -> list[FramePlans]:
        if not (options.partners and plans.exact) or driver.opened.pictures is not None:
            return []
        of, for_options, known = self._partners
        if of is not plans or for_options != options:
            known = [plan_frames(driver, member) for member in options.cast[1:]]
            self._partners = plans, options, known
        return known

    def _place(
        self,
        options: RenderOptions,
        everyone: list[FramePlans],
        driver_size: tuple[int, int],
        canvas: Canvas,
    ) -> list[tuple[Spot, ...]]:
        plans = [known.plan for known in everyone]
        wish = (options.place, options.on_the_spot, options.size, options.background)
        words = (*wish, *map(id, plans))  # they are kept with their places, and none can be another
        if self._spots[0][:-1] != words:
            if options.size == "crop":
                places = [place_in_square(plans[0], canvas.height)]
            else:
                places = place_people(plans, options, driver_size, (canvas.height, canvas.width))
            self._spots = (*words, plans), places
        return self._spots[1]

    def _make_scene(
        self,
        options: RenderOptions,
        driver: PreviewedDriver,
        height: int,
        width: int,
        working_size: int,
    ) -> _Scene:
        source = self._source_of(options)
        canvas = make_canvas(options, height, width, working_size, source)
        size = canvas.height, canvas.width
        if options.background == "driver":
            if driver.opened.pictures is None:
                raise InputError(no_pictures(options.driver))
            people, plates = (driver.opened.file,), ((0, None),)
            fit, blur = options.background_fit, options.background_blur
            backdrop = DriverPictures(options.driver, people, 0, plates, size, fit, blur)
        else:
            rate = options.frame_rate or DEFAULT_RATE
            backdrop = make_backdrop(options, size, rate, source)
        return _Scene(canvas, backdrop, backdrop.open(), driver.frame_count)

    def _make_table(self, member: RenderOptions, scene: _Scene) -> np.ndarray:
        around = light_of(scene.backdrop, scene.frame_count)
        return match_light(person_light(self._source_of(member)), around)
