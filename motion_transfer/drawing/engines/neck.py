"""The neck's base, where the photo leaves a gap between neck and trunk.

Parts of the body meet there, a little elsewhere in each pose, so that another one shows what the
photo does not. FeatureNet guesses it texel by texel, and a necklace of grey dashes is drawn. At
other borders its guesses are better than what is done here, as measured on photos.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import fall, lay_out_body, weigh_nearest
from motion_transfer.media.nearest import nearest_points
from nhrr_core import PART_GROUPS

LOWEST, HIGHEST = 0.22, 0.32  # metres; see `UVTables.position`
HALF_WIDTH_METRES = (0.015, 0.03)  # up to the former a gap is closed, from the latter on it is none
EVERY, AROUND = 4, 32  # of the seen texels every fourth, of these the nearest
AROUND_METRES = 0.04  # these tell whether a gap has two sides
ONE_SIDED = (0.6, 0.9)  # of the directions to them the mean's length: 1 at the edge of what is seen
FALL_METRES = 0.002  # farther than the nearest, they count by so much less


def close_neck(guess: Guess) -> None:
    """Give hidden texels at the neck's base the colours of those seen on both sides of them."""
    texels, position = _find_base(len(guess.shown))
    hidden = guess.hidden.reshape(-1)[texels]
    seen, gap = np.flatnonzero(hidden < 0.5)[::EVERY], hidden >= 0.5
    if len(seen) < AROUND or not gap.any():
        return
    away, index = nearest_points(position[seen], position[gap], AROUND)
    steps = position[seen][index] - position[gap][:, None]
    share = fall(away[:, 0], *HALF_WIDTH_METRES) * fall(_lean(steps), *ONE_SIDED) * hidden[gap]
    weights = weigh_nearest(away, FALL_METRES)
    texture, colours = (each.reshape(len(each), -1) for each in (guess.texture, guess.colours))
    mean = (texture[:, texels[seen][index]] * weights).sum(2)
    colours[:, texels[gap]] += (mean - colours[:, texels[gap]]) * share


def _lean(steps: Float32[np.ndarray, "N K 3"]) -> Float32[np.ndarray, " N"]:
    """Tell how far steps that are short lie in one direction, 0 to 1."""
    lengths = np.maximum(np.linalg.norm(steps, axis=2), np.float32(1e-4))
    short = lengths < AROUND_METRES
    mean = (steps * (short / lengths)[..., None]).sum(1) / np.maximum(short.sum(1), 1)[:, None]
    return np.linalg.norm(mean, axis=1)


@lru_cache(maxsize=2)
def _find_base(size: int) -> tuple[Int64[np.ndarray, " N"], Float32[np.ndarray, "N 3"]]:
    """Find the texels around the neck's base, and where they are, metres."""
    part, position = lay_out_body(size)
    position = position.T
    own = np.isin(part, PART_GROUPS["head"] + PART_GROUPS["torso"])
    own &= (position[:, 1] > LOWEST) & (position[:, 1] < HIGHEST)
    return np.flatnonzero(own), np.ascontiguousarray(position[own])
