"""Where each person is in the output, frame by frame, planned before any is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from motion_transfer.drawing.canvas import Spot
from motion_transfer.drawing.window import Window
from motion_transfer.render.options.scene import SceneOptions, parse_place
from motion_transfer.render.plan import DriverPlan

STEP_SECONDS = 0.4
"""Half of a step's time: within it one foot at least is on the ground, and a body sways."""

EDGE = cv2.BORDER_REPLICATE

Path = Float[np.ndarray, "N 2"]
"""Where somebody stands in each frame, x and y in px: under the body, on the ground."""


@dataclass(frozen=True)
class _Move:
    """From pixels of the driver to those of the output: `scale * p + shift`, one for each frame."""

    scale: float
    shift: Path


def place_people(
    plans: Sequence[DriverPlan],
    options: SceneOptions,
    driver_size: tuple[int, int],
    output_size: tuple[int, int],
) -> list[tuple[Spot, ...]]:
    """Tell where each person of a driver is in each output frame.

    Without wishes the driver's frame is fitted into the output's, centred, and everybody stays
    where the driver has them.

    Args:
        plans: One for each person, of equally many frames; the first one leads: it is that
            person's feet that stand at the place that is wished for.
        driver_size, output_size: (height, width), px.
    """
    paths = [_follow_ground(plan) for plan in plans]
    move = _plan_move(plans[0], paths[0], options, driver_size, output_size)
    return [
        _place(plan, path, move, on_the_spot=options.on_the_spot)
        for plan, path in zip(plans, paths, strict=True)
    ]


def place_in_square(plan: DriverPlan, side: int) -> tuple[Spot, ...]:
    """Tell where a person is in each output frame that is the window itself, of a side in px."""
    whole = Window(0, 0, side)
    spots = []
    grounds = _follow_ground(plan)[:, 1]
    for shot in plan.shots:
        own = grounds[shot.start : shot.stop]
        rows = (own - shot.window.y) * (side / shot.window.side)
        spots += [Spot(whole, ground) for ground in rows.round().astype(int).tolist()]
    return tuple(spots)


def _plan_move(
    lead: DriverPlan,
    path: Path,
    options: SceneOptions,
    driver_size: tuple[int, int],
    output_size: tuple[int, int],
) -> _Move:
    own, whole = np.array(driver_size[::-1], float), np.array(output_size[::-1], float)
    # an even frame may be a pixel larger, which is no reason to scale
    scale = 1.0 if (abs(whole - own) <= 1).all() else float((whole / own).min())
    place = parse_place(options.place)
    if place is None:
        shift = np.zeros(2) if scale == 1 else (whole - scale * own) / 2
        return _Move(scale, np.broadcast_to(shift, path.shape))
    scale *= place.scale
    return _Move(scale, whole * (place.x, place.y) - scale * _beginnings(lead, path))


def _place(plan: DriverPlan, path: Path, move: _Move, *, on_the_spot: bool) -> tuple[Spot, ...]:
    shift = move.shift
    if on_the_spot:
        shift = shift - move.scale * (path - _beginnings(plan, path))
    grounds = (move.scale * path + shift)[:, 1].round().astype(int).tolist()
    spots = []
    for shot in plan.shots:
        window = shot.window
        corner = np.array((window.x, window.y)) * move.scale
        side = max(1, round(window.side * move.scale))
        for index in range(shot.start, shot.stop):
            x, y = (corner + shift[index]).round().astype(int).tolist()
            spots.append(Spot(Window(x, y, side), grounds[index]))
    return tuple(spots)


def _beginnings(plan: DriverPlan, path: Path) -> Path:
    """Repeat for each frame where the person stands when its shot begins."""
    counts = [shot.stop - shot.start for shot in plan.shots]
    return np.repeat(path[[shot.start for shot in plan.shots]], counts, axis=0)


def _follow_ground(plan: DriverPlan) -> Path:
    """Follow where a person stands: steady while a step or a jump lasts."""
    frames = max(1, round(STEP_SECONDS * float(plan.frame_rate)))
    path = np.empty((len(plan.frames), 2))
    for shot in plan.shots:
        boxes = [frame.person and frame.person.box for frame in plan.frames[shot.start : shot.stop]]
        known = [index for index, box in enumerate(boxes) if box is not None]
        if not known:  # nobody is drawn there
            path[shot.start : shot.stop] = 0
            continue
        feet = np.array([((b.left + b.right) / 2, b.bottom) for b in boxes if b is not None])
        # where nobody is found, on the way from one place to the next
        every = np.stack([np.interp(range(len(boxes)), known, column) for column in feet.T])
        every[1:] = cv2.dilate(every[1:], np.ones((1, 2 * frames + 1), np.uint8))
        # as far as four times the sigma
        smooth = cv2.GaussianBlur(every, (8 * frames + 1, 1), frames, borderType=EDGE)
        path[shot.start : shot.stop] = smooth.T
    return path
