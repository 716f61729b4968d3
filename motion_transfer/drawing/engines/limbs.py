"""Arms and legs, in the colours that a photo shows of them at the same place along the limb.

A sleeve, a leg and bare skin go all the way around. Where a photo shows a limb from one side,
FeatureNet's guess of the other side may be smeared with what lies next to it in the photo.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import fall, pick_nearest
from nhrr_core import PART_GROUPS, load_uv_tables

LIMBS = (
    (0, ("upper-arms", "lower-arms", "hands")),
    (1, ("upper-legs", "lower-legs")),
)
"""The axis of `UVTables.position` that a limb lies along, and its parts on both sides."""

STEP_METRES = 0.01  # along a limb
SPREAD = 1.5  # steps: what is seen counts for its neighbours by a Gaussian of that width
LEAST_SEEN = 9.0  # texels of the map at a step, a tenth of an arm's; fewer tell nothing
ALIKE, APART = 0.3, 0.6  # colours of guess and limb, in [-1, 1]: it stays; it is another thing


class Limb(NamedTuple):
    """One arm or leg.

    Attributes:
        texels: Those of it.
        steps: How far along it each of them lies, in STEP_METRES from its beginning.
    """

    texels: Int64[np.ndarray, " N"]
    steps: Float32[np.ndarray, " N"]


def go_around_limbs(guess: Guess) -> None:
    """Give hidden sides of limbs the mean of what is seen around them, if their own is far off."""
    texture, colours = (each.reshape(len(each), -1) for each in (guess.texture, guess.colours))
    shown, hidden = guess.shown.reshape(-1), guess.hidden.reshape(-1)
    for limb in find_limbs(len(guess.shown)):
        seen = shown[limb.texels]
        means, counts = _average_along(texture[:, limb.texels[seen]], limb.steps[seen], limb.steps)
        change = means - colours[:, limb.texels]
        share = hidden[limb.texels] * (1 - fall(np.abs(change).mean(0), ALIKE, APART))
        colours[:, limb.texels] += change * share * (counts >= LEAST_SEEN)


def _average_along(
    values: Float32[np.ndarray, "C M"],
    steps: Float32[np.ndarray, " M"],
    wanted: Float32[np.ndarray, " N"],
) -> tuple[Float32[np.ndarray, "C N"], Float32[np.ndarray, " N"]]:
    """Average values along a limb, where it is wanted; and how many there are."""
    count, nearest = round(float(wanted.max())) + 1, np.rint(steps).astype(np.int64)
    rows = [np.bincount(nearest, each, count) for each in (*values, np.ones_like(steps))]
    sums = cv2.GaussianBlur(np.array(rows, np.float32), (0, 0), SPREAD, sigmaY=1e-3)
    *totals, counts = (np.interp(wanted, np.arange(count), row) for row in sums)
    return (np.stack(totals) / np.maximum(counts, 1e-3)).astype(np.float32), counts


@lru_cache(maxsize=2)
def find_limbs(size: int) -> list[Limb]:
    """Find the arms and legs of a texture of that side."""
    tables = load_uv_tables()
    part = pick_nearest(tables.part, size).reshape(-1)
    position = pick_nearest(tables.position.transpose(2, 0, 1), size).reshape(3, -1)
    found = []
    for axis, groups in LIMBS:
        own = np.isin(part, [each for group in groups for each in PART_GROUPS[group]])
        for side in (position[0] < 0, position[0] >= 0):
            texels = np.flatnonzero(own & side)
            along = np.abs(position[axis, texels])
            found.append(Limb(texels, (along - along.min()) / np.float32(STEP_METRES)))
    return found
