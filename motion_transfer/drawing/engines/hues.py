"""Hidden sides in the hues that a photo shows around them.

A sleeve, a leg and bare skin go all the way around. Where a photo shows a limb from one side,
FeatureNet's guess of the other one has its light, but may be smeared with what lies next to it in
the photo: a red sleeve goes over into brown, skin is violet. So it is of a trunk that hands lie
before. Farther from what is seen a trunk may wear something else.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import (
    differ_in_any_light,
    fall,
    lay_out_body,
    light_between,
)
from motion_transfer.media.nearest import nearest_points
from nhrr_core import PART_GROUPS

TRUNK_METRES = 0.08  # from what is seen
STRETCHES = (
    (0, ("upper-arms", "lower-arms"), True, np.inf),
    (1, ("upper-legs", "lower-legs"), True, np.inf),
    (1, ("torso",), False, TRUNK_METRES),
)
"""The axis of `UVTables.position` that a piece of the body lies along, its parts, whether there is
one on each side, and how far from what is seen it has its hues."""

ALONG = 4.0  # times as far counts what lies along a piece, not around it: sleeves have ends
EVERY, AROUND = 4, 20  # of the seen texels every fourth, of these the nearest: their mean
BLUNT_METRES = 0.01  # added to their distance, by whose square they count less
FEWEST = 25  # texels that are seen, of those; fewer tell nothing
FARTHEST_METRES = 0.06  # along the piece: what is seen farther off may be another garment
ANY_LIGHT = (0.5, 2.0)  # of these, in that of their mean
PLAIN, PATTERNED = 0.08, 0.12  # of 1: how far they differ from it then
LIGHT = (0.75, 1.15)  # the guess's, in that of what is seen around it
ALIKE, APART = 0.04, 0.1  # of 1, in that light: the guess stays; it is another thing


class Piece(NamedTuple):
    """One arm or leg, or the trunk.

    Attributes:
        texels: Those of it.
        places: Where they are, metres, ALONG times as far along it as they are.
        axis: The one that it lies along.
        reach: How far from what is seen it has its hues, metres.
    """

    texels: Int64[np.ndarray, " N"]
    places: Float32[np.ndarray, "N 3"]
    axis: int
    reach: float


def keep_hues(guess: Guess) -> None:
    """Give hidden sides the hue of what is seen around them, if their own is far off."""
    texture, colours = (each.reshape(len(each), -1) for each in (guess.texture, guess.colours))
    # at the edges of what is seen, IUV often has another part's pixels
    sure = cv2.erode(guess.shown.astype(np.uint8), np.ones((3, 3), np.uint8)).reshape(-1) > 0
    hidden = guess.hidden.reshape(-1)
    for piece in find_pieces(len(guess.shown)):
        seen, asked = sure[piece.texels], hidden[piece.texels] > 0
        if np.isfinite(piece.reach):  # nor does its mirror image tell what it wears
            seen &= ~asked
        seen &= np.cumsum(seen) % EVERY == 0
        if np.count_nonzero(seen) < FEWEST:
            continue
        known, wanted = piece.places[seen], piece.places[asked]
        away, index = nearest_points(known, wanted, AROUND)
        near = away[:, 0] < piece.reach
        texels, away, index = piece.texels[asked][near], away[near], index[near]
        around, told = _average(to_levels(texture[:, piece.texels[seen]])[:, index], away)
        along = np.abs(known[index[:, 0], piece.axis] - wanted[near, piece.axis]) / ALONG
        told *= along < FARTHEST_METRES
        if np.isfinite(piece.reach):
            told *= fall(away[:, 0], piece.reach / 2, piece.reach)
        own = to_levels(colours[:, texels])
        change = around * light_between(own, around, LIGHT) - own
        share = hidden[texels] * told * (1 - fall(np.abs(change).max(0), ALIKE, APART))
        colours[:, texels] += 2 * change * share


def to_levels(colours: Float32[np.ndarray, "3 N"]) -> Float32[np.ndarray, "3 N"]:
    """Bring colours in [-1, 1] to [0, 1], where light multiplies them."""
    return (colours + 1) / 2


def _average(
    levels: Float32[np.ndarray, "3 N K"], away: Float32[np.ndarray, "N K"]
) -> tuple[Float32[np.ndarray, "3 N"], Float32[np.ndarray, " N"]]:
    """Average colours, those that are near more than others.

    Args:
        levels: 0 to 1.
        away: How far each of them is, metres.
    Returns: The means, and how much they tell, 0 to 1: little of several colours.
    """
    weights = np.square(away + np.float32(BLUNT_METRES)) ** -1
    weights /= weights.sum(1, keepdims=True)
    means = (levels * weights).sum(2)
    variety = (differ_in_any_light(levels, means[..., None], ANY_LIGHT) * weights).sum(1)
    return means, fall(variety, PLAIN, PATTERNED)


@lru_cache(maxsize=2)
def find_pieces(size: int) -> list[Piece]:
    """Find arms, legs and the trunk in a texture of that side."""
    part, position = lay_out_body(size)
    found = []
    for axis, groups, has_sides, reach in STRETCHES:
        own = np.isin(part, [each for group in groups for each in PART_GROUPS[group]])
        stretch = np.where(np.arange(3) == axis, np.float32(ALONG), np.float32(1))
        for side in (position[0] < 0, position[0] >= 0) if has_sides else (True,):
            texels = np.flatnonzero(own & side)
            found.append(Piece(texels, position[:, texels].T * stretch, axis, reach))
    return found
