"""The crotch, in the colours of the clothes around it where no photo shows it.

A photo that ends at the thighs, or a hand before the trousers, hides little more than the crotch,
and of that FeatureNet guesses skin or underwear between white trousers. What a photo shows nearest
to it is mostly the same garment.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import fall, lay_out_body, weigh_nearest
from motion_transfer.media.nearest import nearest_points
from nhrr_core import PART_GROUPS

TOP_METRES = -0.19  # see `UVTables.position`; legs begin 5 cm lower
FADE_METRES = 0.03  # from there downwards: the guess of the belly goes over into it
FARTHEST_METRES = 0.15  # what is seen farther off may be another garment
EVERY, NEIGHBOURS = 3, 32  # of the seen texels every third, of these the nearest: their mean
ALIKE, APART = 0.1, 0.3  # colours of guess and clothes, in [-1, 1]: it stays; it is another thing
FALL_METRES = 0.015  # farther than the nearest, they count by so much less


def clothe_crotch(guess: Guess) -> None:
    """Give the hidden crotch the colours of what is seen nearest to it, if its own are others."""
    texels, around, position = _find_crotch(len(guess.shown))
    hidden = guess.hidden.reshape(-1)
    texels = texels[hidden[texels] > 0]
    near = around[guess.shown.reshape(-1)[around]]
    if not len(near):
        return
    away, index = nearest_points(position[near], position[texels], NEIGHBOURS)
    weights = weigh_nearest(away, FALL_METRES)
    texture, colours = (each.reshape(len(each), -1) for each in (guess.texture, guess.colours))
    change = (texture[:, near[index]] * weights).sum(2) - colours[:, texels]
    share = hidden[texels] * (1 - fall(np.abs(change).mean(0), ALIKE, APART))
    share *= fall(position[texels, 1], TOP_METRES - FADE_METRES, TOP_METRES)
    share *= away[:, 0] < FARTHEST_METRES
    colours[:, texels] += change * share


@lru_cache(maxsize=2)
def _find_crotch(
    size: int,
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " M"], Float32[np.ndarray, "L 3"]]:
    """Find the crotch's texels and those near it of trunk and thighs, and where all are, metres."""
    part, position = lay_out_body(size)
    position = position.T
    height = position[:, 1]
    trunk = np.isin(part, PART_GROUPS["torso"])
    crotch = trunk & (height < TOP_METRES)
    low, high = height[crotch].min() - FARTHEST_METRES, TOP_METRES + FARTHEST_METRES
    around = (trunk | np.isin(part, PART_GROUPS["upper-legs"])) & (low < height) & (height < high)
    return np.flatnonzero(crotch), np.flatnonzero(around)[::EVERY], np.ascontiguousarray(position)
