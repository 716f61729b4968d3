"""Several photos of one person become one partial texture: each gives what it sees best.

How well a photo sees a texel is measured where it was unfolded: how many of its pixels fall there,
which tells resolution and angle at once; how sharp the photo is; and how far away the nearest edge
is behind which something else begins, where IUV is least exact. Exposure and white balance are
brought to those of the first photo, colours blend over wide borders and patterns over narrow ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8
from numpy.lib.stride_tricks import sliding_window_view

from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.textures import average, enlarge, pick_nearest, twins
from motion_transfer.drawing.unfolding import texel_index, texture_coordinates
from nhrr_core import PART_COUNT, PART_GROUPS, load_uv_tables
from nhrr_core.uv_tables import TWIN_SIZE

HEAD = PART_GROUPS["head"]

RATED_SIZE = 64
"""Side of the texture, texels, in which pixels are counted: fewer would count noise."""

EDGE_METRES = 0.08
"""Neighbouring pixels farther apart on the body lie on the two sides of an edge."""

EDGE_SHARE = 0.02
"""Of the person's height: the width along edges where a photo is trusted less."""

EDGE_TRUST = 0.05
"""What is left of that at the very edge: where no other photo sees the place, it still counts."""

LEAD = 1.5
"""The first photo is preferred to others that see a texel up to so many times as well."""

FACE_LEAD = 4.0
"""One photo gives the head, as far as it sees it: a face mixed from several has double features."""

SURE_SHARE = 0.3
"""Of a photo's best rating on a part of the body: what all but the first see worse is left out."""

EARS_METRES = 0.02
"""What lies farther ahead on the head is the face; see `UVTables.position`."""

WIDE, NARROW = 4, 8
"""Powers of the ratings by which colours, and patterns on them, are mixed."""

BAND_SHARE = 1 / 32
"""Of the texture's side: waves longer than that are colours, shorter ones patterns."""

GAMMA = 2.2
"""Of sRGB, about: exposure and white balance are factors of light."""

DIM, BRIGHT = 8 / 255, 247 / 255
"""Colours beyond are black or burnt out, and tell nothing of the light."""

EXPOSURE_SPREAD, TINT_SPREAD = 0.25, 0.06
"""How much the light of photos differs, as standard deviations of its logarithm: of all channels,
and of one against the others."""

SHADE_SPREAD, TWIN_SPREAD = 0.15, 0.2
"""Likewise, how much one place differs in two photos under one light, by shades and IUV's faults;
and how much a place differs from that on the other face of its limb."""

TOLD_SHARE = 0.15
"""Of a photo's best rating: what it sees worse tells nothing of the light."""

COMMON_SHARE = 0.01
"""Of the texture: what two photos have in common is believed half where it is so large."""

LEAST_SHARE = 0.002
"""Likewise: less in common tells nothing."""

STRANGER = 0.12
"""Colours of one person in two photos differ less than that, of 1, once their light is the same."""

STRANGER_SHARE = 0.02
"""Of the texture: photos with less in common do not tell whether they show one person."""


@dataclass(frozen=True)
class View:
    """One photo, unfolded.

    Attributes:
        name: Of the photo, for messages.
        texture: 3 x T x T in [-1, 1], 0 where nothing is seen.
        visibility: 1 x T x T, 1 where the texture is seen.
        rating: 1 x T x T, how well each texel is seen, in pixels of the photo along the side of
            a texel of 256 x 256; 0 where it is not.
    """

    name: str
    texture: Float32[np.ndarray, "3 T T"]
    visibility: Float32[np.ndarray, "1 T T"]
    rating: Float32[np.ndarray, "1 T T"]


@dataclass(frozen=True)
class MergedViews:
    """What several photos show together.

    Attributes:
        texture, visibility: As those of a `View`.
        shares: K x T x T, how much of each texel's pattern comes from each photo; they add up to 1
            where anything is seen.
        strangers: The photos that seem to show somebody else, or other clothes, by index.
    """

    texture: Float32[np.ndarray, "3 T T"]
    visibility: Float32[np.ndarray, "1 T T"]
    shares: Float32[np.ndarray, "K T T"]
    strangers: tuple[int, ...] = ()


def merge_views(views: Sequence[View]) -> MergedViews:
    """Merge the photos of one person into one partial texture.

    One photo alone stays as it is, to the bit.

    Args:
        views: One or more of one size; the first decides the light.
    Source: two bands of Burt and Adelson's multiresolution spline (1983), as Brown and Lowe use
        them with gains for panoramas (IJCV 2007).
    """
    if len(views) == 1:
        only = views[0]
        return MergedViews(only.texture, only.visibility, only.visibility)
    first, *others = equalise_light(views)
    views = [first, *map(_keep_sure, others)]
    texture, seen, rating = (
        np.stack([getattr(view, name) for view in views])
        for name in ("texture", "visibility", "rating")
    )
    rating[0] *= LEAD
    head, face = _mark_head(texture.shape[-1])
    on_face = (rating * face).sum((1, 2, 3))
    rating[on_face.argmax()] *= np.where(head, np.float32(FACE_LEAD), 1)
    cells = round(1 / BAND_SHARE)
    colours, around = _smooth(texture, seen, cells)
    wide = _to_shares(_smooth(rating, np.ones_like(seen), cells)[0] * (around > 0), WIDE)
    narrow = _to_shares(rating, NARROW)
    shown = seen.max(0)
    patterns = (texture - colours) * seen
    merged = (wide * colours).sum(0) + (narrow * patterns).sum(0)
    return MergedViews(
        merged.clip(-1, 1) * shown, shown, narrow[:, 0] * shown, find_strangers(views)
    )


def _keep_sure(view: View) -> View:
    """Leave out what a photo sees much worse than the best of the same part: hands, backdrop."""
    part = pick_nearest(load_uv_tables().part, view.texture.shape[-1])
    best = np.zeros(PART_COUNT + 1, np.float32)
    np.maximum.at(best, part, view.rating[0])
    sure = (view.rating >= np.float32(SURE_SHARE) * best[part]) * view.visibility
    return replace(view, texture=view.texture * sure, visibility=sure, rating=view.rating * sure)


def _mark_head(size: int) -> tuple[Bool[np.ndarray, "T T"], Bool[np.ndarray, "T T"]]:
    """Mark the texels of the head, and those of its face."""
    tables = load_uv_tables()
    head = np.isin(tables.part, HEAD)
    face = head & (tables.position[..., 2] > EARS_METRES)
    return pick_nearest(head, size), pick_nearest(face, size)


def _smooth(
    values: Float32[np.ndarray, "K C T T"], weight: Float32[np.ndarray, "K 1 T T"], cells: int
) -> tuple[Float32[np.ndarray, "K C T T"], Float32[np.ndarray, "K 1 T T"]]:
    """Means over cells of what counts, and between them; and how much of it there is around."""
    counted = np.concatenate([values * weight, weight], axis=1)
    wide = np.stack([enlarge(average(each, cells), each.shape[-1]) for each in counted])
    mass = wide[:, -1:]
    return wide[:, :-1] / np.maximum(mass, 1e-6), mass


def _to_shares(
    rating: Float32[np.ndarray, "K 1 T T"], power: int
) -> Float32[np.ndarray, "K 1 T T"]:
    """Shares of each place that add up to 1; equal ones where nobody sees it."""
    best = rating.max(0)
    weight = np.where(best > 0, rating / np.maximum(best, 1e-9), 1) ** power
    return weight / weight.sum(0)


def equalise_light(views: Sequence[View]) -> list[View]:
    """Give all photos the exposure and white balance of the first, as far as they can be told.

    Each photo has one factor of light a channel. Two photos are compared by the median ratio of
    what both show: the same places, and the other faces of the same limbs, as a front and a back
    have hardly a place in common, but mostly the same clothes. Where ratios differ much among each
    other they move little.
    Source: gain compensation of Brown and Lowe (IJCV 2007), Sec. 6, of logarithms; twins are this
    project's.
    """
    count = len(views)
    logs = [_to_light(view).reshape(3, -1) for view in views]
    told = [_told(view).ravel() for view in views]
    size = views[0].texture.shape[-1]
    side, depth = twins(size)
    same = np.arange(size**2)
    # rows of least squares problems: each photo's light is near to the first's ...
    rows, wanted = [np.eye(count)[1:] / EXPOSURE_SPREAD], [np.zeros((count - 1, 3))]
    for one, other in combinations(range(count), 2):
        for places, spread in (((same,), SHADE_SPREAD), ((depth, side[depth]), TWIN_SPREAD)):
            both = [told[one] & told[other][place] for place in places]
            ratios = np.concatenate(
                [
                    logs[one][:, kept] - logs[other][:, place[kept]]
                    for place, kept in zip(places, both, strict=True)
                ],
                axis=1,
            )
            share = ratios.shape[1] / size**2
            if share < LEAST_SHARE:  # the few twins of head and trunk are skin and shirt
                continue
            # ... and two photos agree on what both show
            ratio = np.median(ratios, axis=1, keepdims=True)
            scatter = float(np.median(np.abs(ratios - ratio)))
            trust = (share / (share + COMMON_SHARE) / (spread**2 + scatter**2)) ** 0.5
            row = np.zeros((1, count))
            row[0, one], row[0, other] = trust, -trust
            rows.append(row)
            wanted.append(-trust * ratio.T.astype(np.float64))
    system, found = np.concatenate(rows)[:, 1:], np.concatenate(wanted)  # the first's light stays
    exposure = np.linalg.lstsq(system, found.mean(1, keepdims=True))[0]
    # cameras differ less in white balance than in exposure
    system[: count - 1] *= EXPOSURE_SPREAD / TINT_SPREAD
    tint = np.linalg.lstsq(system, found - found.mean(1, keepdims=True))[0]
    gains = exposure + tint
    return [views[0], *(_relight(view, gain) for view, gain in zip(views[1:], gains, strict=True))]


def _to_light(view: View) -> Float32[np.ndarray, "3 T T"]:
    """The logarithm of each place's light."""
    return GAMMA * np.log(np.maximum((view.texture + 1) / 2, 1e-6 ** (1 / GAMMA)))


def _told(view: View) -> Bool[np.ndarray, "T T"]:
    """Where a photo tells of the light: inside its edges, neither black nor burnt out."""
    rating, colours = view.rating[0], (view.texture + 1) / 2
    kept = ((colours > DIM) & (colours < BRIGHT)).all(0)
    return (rating > rating.max() * TOLD_SHARE) & (view.visibility[0] > 0) & kept


def _relight(view: View, gain: Float[np.ndarray, " 3"]) -> View:
    factors = np.exp(gain / GAMMA).astype(np.float32)[:, None, None]
    lit = ((view.texture + 1) / 2 * factors).clip(0, 1) * 2 - 1
    return replace(view, texture=lit * view.visibility)


def find_strangers(views: Sequence[View]) -> tuple[int, ...]:
    """Find the photos that seem to show somebody else than the first, or other clothes, by index.

    Compared are colours, over cells, where both see the body well; the back of a person has
    nothing in common with the front but the sides, and may not tell.

    Args:
        views: Under one light, see `equalise_light`.
    """
    cells = round(2 / BAND_SHARE)
    means = [average(view.texture * view.visibility, cells) for view in views]
    seen = [average(view.visibility, cells)[0] for view in views]
    found = []
    for index in range(1, len(views)):
        both = (seen[0] > 0.5) & (seen[index] > 0.5)
        if both.mean() < STRANGER_SHARE:
            continue
        one, other = (means[i][:, both] / seen[i][both] for i in (0, index))
        if np.median(np.abs(one - other).mean(0)) / 2 > STRANGER:
            found.append(index)
    return tuple(found)


def rate_texels(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> Float32[np.ndarray, "1 64 64"]:
    """Rate how well a photo sees each of RATED_SIZE x RATED_SIZE texels, see `View.rating`."""
    box = bounding_box(iuv)
    if not box.area:
        return np.zeros((1, RATED_SIZE, RATED_SIZE), np.float32)
    rgb, iuv = rgb[box.slices], iuv[box.slices]
    body = iuv[..., 0] > 0
    texel = texel_index(texture_coordinates(iuv[body]), RATED_SIZE)
    count, trusted = (
        np.bincount(texel, weights, RATED_SIZE**2) for weights in (None, trust_pixels(iuv)[body])
    )
    # means of three by three texels that are hit: 8-bit UV lays too many pixels into some
    sums = np.stack([count, trusted, count > 0]).reshape(3, RATED_SIZE, RATED_SIZE)
    around = sliding_window_view(np.pad(sums, ((0, 0), (1, 1), (1, 1))), (3, 3), axis=(1, 2))
    count, trusted, hit = around.mean((3, 4))
    side = np.sqrt(count / np.maximum(hit, 1e-9)) * RATED_SIZE / 256
    rating = side * trusted / np.maximum(count, 1e-9) * sums[2:]
    return (rating * measure_sharpness(rgb, iuv)).astype(np.float32)


def trust_pixels(iuv: UInt8[np.ndarray, "H W 3"]) -> Float32[np.ndarray, "H W"]:
    """Tell how far each pixel is to be trusted, EDGE_TRUST..1: less where an edge is near.

    An edge is the person's outline, and where one part of the body covers another.
    """
    body = iuv[..., 0] > 0
    texel = texel_index(texture_coordinates(iuv[body]), TWIN_SIZE)
    where = np.full((*iuv.shape[:2], 3), np.inf, np.float32)  # the background is far from all
    where[body] = load_uv_tables().position.reshape(-1, 3)[texel]
    inner = body.astype(np.uint8)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):  # background beside background
            far = np.linalg.norm(np.diff(where, axis=axis), axis=-1) > EDGE_METRES
        first = np.s_[:-1, :] if axis == 0 else np.s_[:, :-1]
        second = np.s_[1:, :] if axis == 0 else np.s_[:, 1:]
        inner[first][far] = 0
        inner[second][far] = 0
    width = max(1.0, bounding_box(iuv).height * EDGE_SHARE)
    away = cv2.distanceTransform(inner, cv2.DIST_L2, 3) / width
    return np.clip(away, EDGE_TRUST, 1).astype(np.float32)


def measure_sharpness(rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]) -> float:
    """Measure how sharp a person is in a photo, from 0 to 1, whatever their clothes.

    It is how much of the change between neighbouring pixels one more blur would take away: much
    from a sharp picture, little from one that is blurred already.
    Source: Crete et al., "The blur effect" (2007).
    """
    grey = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY).astype(np.float32)
    body = iuv[..., 0] > 0
    sharpness = []
    for axis, kernel in ((0, (1, 9)), (1, (9, 1))):
        blurred = cv2.blur(grey, kernel)
        inside = np.roll(body, 1, axis) & body
        change, left = (
            np.abs(image - np.roll(image, 1, axis))[inside] for image in (grey, blurred)
        )
        total = float(change.sum())
        sharpness.append(float(np.maximum(change - left, 0).sum()) / total if total else 1.0)
    return min(sharpness)  # one that moved is blurred along its way only
