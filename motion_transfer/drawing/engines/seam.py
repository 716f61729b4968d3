"""The middle of back and head behind, where the layout of the texture is cut.

The two halves lie far apart there, and what FeatureNet guesses of one does not know of the other:
a line runs down the spine of whoever is turned around.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import fall, lay_out_body
from motion_transfer.media.nearest import nearest_points
from nhrr_core import PART_GROUPS

REACH_METRES = 0.08  # from the cut, to either side
MIDDLE = 0.3  # of the layout, from its left: left of it lies the right half of torso and head
BEHIND_METRES = (-0.02, 0.02)  # forward: behind the former all of it, before the latter nothing


def join_halves(guess: Guess) -> None:
    """Bring both halves of what is hidden behind to one colour where they meet."""
    texels, others, nearness = _find_cut(len(guess.shown))
    colours, hidden = guess.colours.reshape(3, -1), guess.hidden.reshape(-1)
    own, other = hidden[texels], hidden[others]
    # half-way if both are guessed; all the way to what is seen; of what is half seen, half
    share = own * own / np.maximum(own + other, np.float32(1e-3))
    colours[:, texels] += (colours[:, others] - colours[:, texels]) * share * nearness


@lru_cache(maxsize=2)
def _find_cut(
    size: int,
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"], Float32[np.ndarray, " N"]]:
    """Find the texels beside the cut, their mirror images, and how near it they are, 0 to 1."""
    part, position = lay_out_body(size)
    nearness = fall(np.abs(position[0]), 0, REACH_METRES) * fall(position[2], *BEHIND_METRES)
    nearness *= np.isin(part, PART_GROUPS["torso"] + PART_GROUPS["head"])
    texels = np.flatnonzero(nearness)
    right = texels % size < MIDDLE * size
    halves = texels[right], texels[~right]
    mirrored = position.T * np.array([-1, 1, 1], np.float32)
    # not `side_twin`, which beside the cut may be the texel itself
    others = [
        opposite[nearest_points(position.T[opposite], mirrored[own], 1)[1][:, 0]]
        for own, opposite in zip(halves, halves[::-1], strict=True)
    ]
    texels = np.concatenate(halves)
    return texels, np.concatenate(others), nearness[texels]
