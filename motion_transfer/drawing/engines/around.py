"""Prints, checks and lace, continued around the body to where no photo shows them.

FeatureNet guesses what colour a hidden side has, but no pattern. Clothes look alike all the way
around at one height: a row of flowers, a stripe, a border of lace. So what stands out from its
surroundings is copied to the hidden side from the same height, mirrored at the edge of what is
seen, over and over: patterns go on, and nothing moves up or down, but across narrow gaps.
"""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64

from motion_transfer.drawing.engines.interface import Guess
from motion_transfer.drawing.textures import fall
from motion_transfer.drawing.tubes import CELL_METRES, unroll_body
from nhrr_core import load_uv_tables

SURROUNDINGS_METRES = 0.03  # of a texel: what a pattern stands out from
PLAIN, PATTERNED = 0.15, 0.25  # RMS of that, of colours in [-1, 1]: folds and shadows; prints, lace
ALIKE, APART = 0.1, 0.25  # colours of the ground that a pattern is copied from, and of the guess

DOUBTED_METRES = 0.01  # from the edge of what is seen: there IUV often has another part's pixels
LEAST_RUN = 4  # cells seen side by side; fewer tell no pattern
GAP_METRES = 0.04  # rows may lie so far from seen ones: seams between parts of the body
LEAST_SHARE = 0.15  # of the way around has to be seen


def continue_patterns(guess: Guess) -> None:
    """Add the patterns of a source's clothes to what a network guesses of their hidden sides."""
    ground, pattern = _take_apart(guess.texture, guess.shown)
    copied, gained = continue_around(np.concatenate([pattern, ground]), guess.shown)
    pattern, ground = np.split(copied, 2)
    apart = np.abs(ground - guess.colours).mean(0)
    guess.colours[:] += pattern * fall(apart, ALIKE, APART) * gained


def _take_apart(
    texture: Float32[np.ndarray, "3 T T"], shown: Bool[np.ndarray, "T T"]
) -> tuple[Float32[np.ndarray, "3 T T"], Float32[np.ndarray, "3 T T"]]:
    """Split clothes into a smooth ground and the pattern on it, which plain ones have none of."""
    size = len(shown)
    worn = np.zeros(size**2, bool)
    for tube in unroll_body(size):
        worn[tube.texels] = True
    known = (shown & worn.reshape(shown.shape)).astype(np.float32)
    reach = SURROUNDINGS_METRES / CELL_METRES * size / len(load_uv_tables().part)
    ground = _mean_nearby(texture, known, reach)
    pattern = (texture - ground) * known
    strength = np.sqrt(_mean_nearby(np.square(pattern).mean(0)[None], known, reach))
    return ground, pattern * (1 - fall(strength, PLAIN, PATTERNED))


def _mean_nearby(
    values: Float32[np.ndarray, "C T T"], known: Float32[np.ndarray, "T T"], reach: float
) -> Float32[np.ndarray, "C T T"]:
    """Average what is known around each texel, with weights of a Gaussian, reach in texels."""
    sums = [cv2.GaussianBlur(plane * known, (0, 0), reach) for plane in values]
    return np.stack(sums) / np.maximum(cv2.GaussianBlur(known, (0, 0), reach), np.float32(1e-3))


def continue_around(
    texture: Float32[np.ndarray, "C T T"], shown: Bool[np.ndarray, "T T"]
) -> tuple[Float32[np.ndarray, "C T T"], Bool[np.ndarray, "T T"]]:
    """Copy what a partial texture shows of torso and thighs around them.

    Returns: The texture, 0 where nothing was copied to; and where something was.
    """
    given, seen = texture.reshape(len(texture), -1), shown.reshape(-1)
    copied, gained = np.zeros_like(given), np.zeros_like(seen)
    for tube in unroll_body(len(shown)):
        trusted = _trust(seen[tube.cells])
        row = _nearest_row(trusted.sum(1) > 0)[tube.rows]
        column = _mirror_at_edges(trusted)[row, tube.columns]
        here = ~seen[tube.texels] & (column >= 0)
        texels = tube.texels[here]
        copied[:, texels] = given[:, tube.cells[row[here], column[here]]]
        gained[texels] = True
    return copied.reshape(texture.shape), gained.reshape(shown.shape)


def _trust(seen: Bool[np.ndarray, "H A"]) -> Bool[np.ndarray, "H A"]:
    """Leave out what is seen at the edge only, or in too small a part of a row."""
    width = seen.shape[1]
    reach = round(DOUBTED_METRES / CELL_METRES)
    around = np.tile(seen, 3).astype(np.uint8)
    inner = cv2.erode(around, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    runs = cv2.morphologyEx(inner, cv2.MORPH_OPEN, np.ones((1, LEAST_RUN), np.uint8))
    trusted = runs[:, width : 2 * width] > 0
    return trusted & (trusted.mean(1, keepdims=True) >= LEAST_SHARE)


def _nearest_row(trusted: Bool[np.ndarray, " H"]) -> Int64[np.ndarray, " H"]:
    """Find the row that each one takes its cells from: its own, or a mirrored one across a gap."""
    row = np.arange(len(trusted))
    below, from_below = (each[0] for each in _mirror_to_the_left(trusted[None]))
    above, from_above = (each[0, ::-1] for each in _mirror_to_the_left(trusted[None, ::-1]))
    found = np.where(below <= above, from_below, len(row) - 1 - from_above)
    return np.where(np.minimum(below, above) <= GAP_METRES / CELL_METRES, found, row)


def _mirror_at_edges(trusted: Bool[np.ndarray, "H A"]) -> Int64[np.ndarray, "H A"]:
    """Find the column that each cell is the mirror image of, at the nearer edge; -1: none."""
    width = trusted.shape[1]
    around = np.tile(trusted, 3)
    left, from_left = _mirror_to_the_left(around)
    right, from_right = (each[:, ::-1] for each in _mirror_to_the_left(around[:, ::-1]))
    found = np.where(left <= right, from_left, around.shape[1] - 1 - from_right) % width
    found[np.minimum(left, right) > around.shape[1]] = -1
    return found[:, width : 2 * width]


def _mirror_to_the_left(
    trusted: Bool[np.ndarray, "H W"],
) -> tuple[Int64[np.ndarray, "H W"], Int64[np.ndarray, "H W"]]:
    """Mirror each column at the nearest run up to it, to and fro within that run.

    Returns: How far the run's end is, more than W where there is none; and the columns.
    """
    column = np.arange(trusted.shape[1])
    begins = trusted & ~np.pad(trusted, ((0, 0), (1, 0)))[:, :-1]
    end = np.maximum.accumulate(np.where(trusted, column, -1), axis=1)
    start = np.maximum.accumulate(np.where(begins, column, -1), axis=1)
    away, length = column - end, end - start + 1
    step = np.maximum(away - 1, 0) % (2 * length)
    step = np.minimum(step, 2 * length - 1 - step)
    return np.where(end < 0, 2 * len(column), away), end - step
