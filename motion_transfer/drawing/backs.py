"""Backs of clothes that are open, or printed, in front.

What FeatureNet is given for a back that no photo shows is the mirror image of the front: a tie, the
shirt under a jacket, a print. Such things end before the flanks, and what the flanks show goes all
the way around. So where the middle of the front is another thing than both flanks, and these are
alike, the back gets their colour before the source is encoded.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Int64

from motion_transfer.drawing.source import Source, paint
from motion_transfer.drawing.textures import average, differ_in_any_light
from motion_transfer.drawing.tubes import CELL_METRES, TORSO, go_around
from nhrr_core import load_uv_tables

SIZE = 256  # texels a side, those of the tables: fine enough to find openings
SEEN_SHARE = 0.6  # of a texel of that size

SECTORS = 40  # of the way around, from the front by the left side: 9 degrees each
FLANKS = (slice(5, 10), slice(30, 35))  # 45 to 90 degrees from the front
MIDDLE = np.r_[0:4, 36:40]  # up to 36 degrees from the front
SPREAD = 3  # rows: the standard deviation of a Gaussian over which sectors are averaged
FEWEST_TEXELS, FEWEST_SECTORS = 0.5, 2  # of a sector, and of a flank, that tell its colour
BACK_SEEN = 0.15  # of a row of the back: if more of it is seen, it tells for itself

SHADES = (0.8, 1.8)  # the middle's light, in that of the flanks, which turn away from it
ITS_SHADES = (0.6, 1.7)  # of one cloth, in folds and beside an opening
OTHER = 0.09  # of 1, in the channel that differs most: another thing
VARIETY = 1.5  # times what the flanks differ in themselves, as patterned clothes do
ALIKE = 0.22  # flanks that wear the same, one of them lit from the side
LEAST_METRES = 0.12  # from top to bottom, that something is open
LEAST_NECKLINE_METRES, NECK_METRES = 0.03, 0.05  # likewise, if it reaches so near to the neck
MARGIN_METRES = 0.03  # above and below an opening
SAME_CLOTH = 0.08  # flanks of other rows, and those beside the opening
GAP_METRES = 0.05  # between rows of the same: straps, hands, shadows
SOFT = 6  # rows: as SPREAD, of what is painted

Marked = Bool[np.ndarray, " H"]
"""Some of the torso's rows, CELL_METRES high."""


def clothe_back(source: Source) -> Source:
    """Show the flanks' colour on the hidden back of somebody whose clothes are open in front.

    Most sources pass as they are. What is painted counts as seen for whoever completes a texture;
    who wants to know what photos show asks the source that was given.
    """
    torso = find_torso()
    share = average(source.visibility, SIZE).reshape(-1)[torso.texels]
    colours, told = _average(source, share, torso)
    known = np.all([told[each].sum(0) >= FEWEST_SECTORS for each in FLANKS], axis=0)
    if not known.any():
        return source
    flanks = [_look_at_flank(colours[each], told[each], known) for each in FLANKS]
    left, right = (flank.colours for flank in flanks)
    cloth = (left + right) / 2
    apart = differ_in_any_light(left, right, ITS_SHADES)
    alike = (apart < ALIKE) & ~_is_back_seen(share, torso)
    variety = np.maximum(apart, np.mean([flank.variety for flank in flanks], axis=0))
    middle = [differ_in_any_light(each, cloth, SHADES) for each in colours[MIDDLE]]
    stands_out = (np.stack(middle) * told[MIDDLE]).max(0)
    opened = known & alike & (stands_out > OTHER + VARIETY * variety)
    rows = _find_open_rows(cloth, alike, opened)
    return _paint(source, _blur(left, SOFT), _blur(right, SOFT), rows) if rows.any() else source


class Flank(NamedTuple):
    """One side of the front.

    Attributes:
        colours: Of each row; where it is not known, of the nearest row that is.
        variety: How far its sectors are from that.
    """

    colours: Float32[np.ndarray, "3 H"]
    variety: Float32[np.ndarray, " H"]


class Torso(NamedTuple):
    """The torso of a texture.

    Attributes:
        texels: Those of it.
        rows, turns: Of each of them, see `go_around`.
        back: Which of them face backwards.
    """

    texels: Int64[np.ndarray, " N"]
    rows: Int64[np.ndarray, " N"]
    turns: Float32[np.ndarray, " N"]
    back: Bool[np.ndarray, " N"]


@cache
def find_torso() -> Torso:
    """Find the torso of a texture of SIZE, up to the neck."""
    tables = load_uv_tables()
    texels = np.flatnonzero(np.isin(tables.part, TORSO))
    rows, turns, _ = go_around(tables.position.reshape(-1, 3)[texels].T)
    return Torso(texels, rows, turns, np.abs(turns - 0.5) < 0.25)


def _average(
    source: Source, share: Float32[np.ndarray, " N"], torso: Torso
) -> tuple[Float32[np.ndarray, "S 3 H"], Bool[np.ndarray, "S H"]]:
    """Average what is seen, 0 to 1, of each sector of each row; and tell where that is anything.

    Args:
        share: How much of each of the torso's texels is seen.
    """
    colours = average(source.texture, SIZE).reshape(3, -1)[:, torso.texels]
    seen = share > SEEN_SHARE
    height = int(torso.rows.max()) + 1
    sector = (torso.turns * SECTORS).astype(np.int64) % SECTORS
    place = sector[seen] * height + torso.rows[seen]
    levels = (colours[:, seen] / share[seen] + 1) / 2
    sums = [np.bincount(place, each, SECTORS * height) for each in (*levels, np.ones(len(place)))]
    *totals, count = (_blur(each.reshape(SECTORS, height), SPREAD) for each in sums)
    means = np.stack(totals, axis=1) / np.maximum(count, FEWEST_TEXELS)[:, None]
    return means, count >= FEWEST_TEXELS


def _is_back_seen(share: Float32[np.ndarray, " N"], torso: Torso) -> Marked:
    """Tell where so much of the back is seen that it tells for itself."""
    seen, there = (np.bincount(torso.rows, each * torso.back) for each in (share, share**0))
    return _blur(seen, SPREAD) > BACK_SEEN * _blur(there, SPREAD)


def _look_at_flank(
    colours: Float32[np.ndarray, "S 3 H"], told: Bool[np.ndarray, "S H"], known: Marked
) -> Flank:
    """Find a flank's colour in each row, the median of its sectors."""
    where = np.flatnonzero(known)
    nearest = where[np.abs(np.arange(len(known))[:, None] - where).argmin(1)]
    shown = np.where(told[:, None], colours, np.nan)[..., nearest]
    own = np.nanmedian(shown, axis=0)
    apart = np.stack([differ_in_any_light(each, own, ITS_SHADES) for each in shown])
    return Flank(own, _blur(np.nanmean(apart, axis=0), SPREAD))


def _find_open_rows(cloth: Float32[np.ndarray, "3 H"], alike: Marked, opened: Marked) -> Marked:
    """Find the rows, from the lowest to the highest, in which a garment is open."""
    least = np.full(len(opened), LEAST_METRES)
    least[-round(NECK_METRES / CELL_METRES) :] = LEAST_NECKLINE_METRES
    openings = [run for run in _list_runs(opened) if run.sum() * CELL_METRES >= least[run].min()]
    if not openings:
        return np.zeros_like(opened)
    opened = np.any(openings, axis=0)
    own = np.median(cloth[:, opened], axis=1, keepdims=True)
    same = alike & (differ_in_any_light(cloth, own, ITS_SHADES) < SAME_CLOTH)
    rows = np.zeros_like(opened)
    margin = round(MARGIN_METRES / CELL_METRES)
    for garment in _list_runs(same):
        where = np.flatnonzero(garment & opened)
        if len(where):
            around = slice(max(0, where[0] - margin), where[-1] + margin + 1)
            rows[around] |= garment[around]
    return rows


def _list_runs(rows: Marked) -> list[Marked]:
    """List runs of rows, across short gaps."""
    gap = np.ones((1, 2 * round(GAP_METRES / CELL_METRES / 2) + 1), np.uint8)
    closed = cv2.morphologyEx(rows.astype(np.uint8)[None], cv2.MORPH_CLOSE, gap)
    count, labels = cv2.connectedComponents(closed)
    return [labels[0] == label for label in range(1, count)]


def _blur(values: Float32[np.ndarray, "*C H"], rows: float) -> Float32[np.ndarray, "*C H"]:
    """Average over rows around, with weights of a Gaussian."""
    line = np.ascontiguousarray(values, np.float32).reshape(-1, values.shape[-1])
    border = cv2.BORDER_REPLICATE
    blurred = cv2.GaussianBlur(line, (0, 0), rows, sigmaY=1e-3, borderType=border)
    return blurred.reshape(values.shape)


def _paint(
    source: Source,
    left: Float32[np.ndarray, "3 H"],
    right: Float32[np.ndarray, "3 H"],
    rows: Marked,
) -> Source:
    """Colour the hidden back in those rows, from one flank's colour over to the other's."""
    torso = find_torso()
    here = rows[torso.rows] & torso.back
    texels, row = torso.texels[here], torso.rows[here]
    share = torso.turns[here] * 2 - 0.5  # of the right flank's
    colours, painted = np.zeros((3, SIZE, SIZE), np.float32), np.zeros((SIZE, SIZE), bool)
    colours.reshape(3, -1)[:, texels] = (left[:, row] * (1 - share) + right[:, row] * share) * 2 - 1
    painted.reshape(-1)[texels] = True
    return paint(source, colours, painted)
