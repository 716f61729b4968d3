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
import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Float32, UInt8
from torch import Tensor

from motion_transfer.drawing.person import bounding_box
from nhrr_core import load_uv_layout, texture_coordinates

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

WIDE, NARROW = 2, 8
"""Powers of the ratings by which colours, and patterns on them, are mixed."""

BAND_SHARE = 1 / 32
"""Of the texture's side: waves longer than that are colours, shorter ones patterns."""

GAMMA = 2.2
"""Of sRGB, about: exposure and white balance are factors of light."""

DIM, BRIGHT = 8 / 255, 247 / 255
"""Colours beyond are black or burnt out, and tell nothing of the light."""

LIGHT_SPREAD = 0.25
"""How much photos' light differs, as the standard deviation of its logarithm."""

SHADE_SPREAD = 0.15
"""Likewise, how much one place differs in two photos under one light: shades and IUV's faults."""

COMMON_SHARE = 0.01
"""Of the texture: what two photos have in common is believed half where it is so large."""

STRANGER = 0.12
"""Colours of one person in two photos differ less than that, of 1, once their light is the same."""

STRANGER_SHARE = 0.02
"""Of the texture: photos with less in common do not tell whether they show one person."""


@dataclass(frozen=True)
class View:
    """One photo, unfolded.

    Attributes:
        name: Of the photo, for messages.
        texture: 1 x 3 x T x T in [-1, 1], 0 where nothing is seen.
        visibility: 1 x 1 x T x T, 1 where the texture is seen.
        rating: 1 x 1 x T x T, how well each texel is seen, in pixels of the photo along the side of
            a texel of 256 x 256; 0 where it is not.
    """

    name: str
    texture: Float[Tensor, "1 3 T T"]
    visibility: Float[Tensor, "1 1 T T"]
    rating: Float[Tensor, "1 1 T T"]


@dataclass(frozen=True)
class MergedViews:
    """What several photos show together.

    Attributes:
        texture, visibility: As those of a `View`.
        shares: K x T x T, how much of each texel's pattern comes from each photo; they add up to 1
            where anything is seen.
        strangers: The photos that seem to show somebody else, or other clothes, by index.
    """

    texture: Float[Tensor, "1 3 T T"]
    visibility: Float[Tensor, "1 1 T T"]
    shares: Float[Tensor, "K T T"]
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
        return MergedViews(only.texture, only.visibility, only.visibility[0])
    views = equalise_light(views)
    texture = torch.cat([view.texture for view in views])
    seen = torch.cat([view.visibility for view in views])
    rating = torch.cat([view.rating for view in views])
    rating[0] *= LEAD
    cell = round(texture.shape[-1] * BAND_SHARE)
    colours, around = _smooth(texture, seen, cell)
    wide = _to_shares(_smooth(rating, torch.ones_like(seen), cell)[0] * (around > 0), WIDE)
    narrow = _to_shares(rating, NARROW)
    shown = seen.amax(0, keepdim=True)
    patterns = (texture - colours) * seen
    merged = (wide * colours).sum(0, keepdim=True) + (narrow * patterns).sum(0, keepdim=True)
    return MergedViews(
        merged.clamp(-1, 1) * shown, shown, narrow[:, 0] * shown[0], find_strangers(views)
    )


def _smooth(
    values: Float[Tensor, "K C T T"], weight: Float[Tensor, "K 1 T T"], cell: int
) -> tuple[Float[Tensor, "K C T T"], Float[Tensor, "K 1 T T"]]:
    """Means over cells of what counts, and between them; and how much of it there is around."""
    total = F.avg_pool2d(torch.cat([values * weight, weight], dim=1), cell)
    wide = F.interpolate(total, scale_factor=cell, mode="bilinear", align_corners=False)
    mass = wide[:, -1:]
    return wide[:, :-1] / mass.clamp_min(1e-6), mass


def _to_shares(rating: Float[Tensor, "K 1 T T"], power: int) -> Float[Tensor, "K 1 T T"]:
    """Shares of each place that add up to 1; equal ones where nobody sees it."""
    best = rating.amax(0, keepdim=True)
    weight = torch.where(best > 0, rating / best.clamp_min(1e-9), 1.0) ** power
    return weight / weight.sum(0, keepdim=True)


def equalise_light(views: Sequence[View]) -> list[View]:
    """Give all photos the exposure and white balance of the first, as far as they can be told.

    Each channel of each photo has one factor of light. Those of two photos are compared by the
    median of their ratio where both see the body; little in common moves little.
    Source: gain compensation of Brown and Lowe (IJCV 2007), Sec. 6, of logarithms.
    """
    count = len(views)
    light = [_to_light(view) for view in views]
    # rows of a least squares problem: each photo's own light is near to the first's ...
    rows = [np.eye(count)[1:] / LIGHT_SPREAD]
    wanted = [np.zeros((count - 1, 3))]
    for one, other in combinations(range(count), 2):
        common = _told(views[one], light[one]) & _told(views[other], light[other])
        share = float(common.float().mean())
        if not share:
            continue
        # ... and two photos agree where both see
        ratio = (light[one][:, common].log() - light[other][:, common].log()).median(1).values
        trust = (share / (share + COMMON_SHARE)) ** 0.5 / SHADE_SPREAD
        row = np.zeros((1, count))
        row[0, one], row[0, other] = trust, -trust
        rows.append(row)
        wanted.append(-trust * ratio.double().numpy()[None])
    system = np.concatenate(rows)[:, 1:]  # the first photo's light stays
    gains = np.linalg.lstsq(system, np.concatenate(wanted))[0]
    return [views[0], *(_relight(view, gain) for view, gain in zip(views[1:], gains, strict=True))]


def _to_light(view: View) -> Float[Tensor, "3 T T"]:
    return ((view.texture[0] + 1) / 2).clamp_min(0) ** GAMMA


def _told(view: View, light: Float[Tensor, "3 T T"]) -> Bool[Tensor, "T T"]:
    """Where a photo tells of the light: inside its edges, neither black nor burnt out."""
    rating = view.rating[0, 0]
    kept = (light > DIM**GAMMA) & (light < BRIGHT**GAMMA)
    return (rating > rating.max() * 0.25) & (view.visibility[0, 0] > 0) & kept.all(0)


def _relight(view: View, gain: Float[np.ndarray, " 3"]) -> View:
    factors = torch.from_numpy(np.exp(gain / GAMMA)).float()[None, :, None, None]
    lit = ((view.texture + 1) / 2 * factors).clamp(0, 1) * 2 - 1
    return replace(view, texture=lit * view.visibility)


def find_strangers(views: Sequence[View]) -> tuple[int, ...]:
    """Find the photos that seem to show somebody else than the first, or other clothes, by index.

    Compared are colours, over cells, where both see the body well; the back of a person has
    nothing in common with the front but the sides, and may not tell.

    Args:
        views: Under one light, see `equalise_light`.
    """
    cell = round(views[0].texture.shape[-1] * BAND_SHARE / 2)
    means = [F.avg_pool2d(view.texture * view.visibility, cell)[0] for view in views]
    seen = [F.avg_pool2d(view.visibility, cell)[0, 0] for view in views]
    found = []
    for index in range(1, len(views)):
        both = (seen[0] > 0.5) & (seen[index] > 0.5)
        if float(both.float().mean()) < STRANGER_SHARE:
            continue
        one, other = (means[i][:, both] / seen[i][both] for i in (0, index))
        if float((one - other).abs().mean(0).median()) / 2 > STRANGER:
            found.append(index)
    return tuple(found)


def rate_texels(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> Float[Tensor, "1 1 64 64"]:
    """Rate how well a photo sees each of RATED_SIZE x RATED_SIZE texels, see `View.rating`."""
    box = bounding_box(iuv)
    if not box.area:
        return torch.zeros(1, 1, RATED_SIZE, RATED_SIZE)
    rgb, iuv = rgb[box.slices], iuv[box.slices]
    place, row, column = _body(iuv)
    texel = _texels(place, RATED_SIZE)
    trust = torch.from_numpy(trust_pixels(iuv)[row, column]).double()
    count, trusted = (
        torch.bincount(texel, weights=weight, minlength=RATED_SIZE**2)
        for weight in (torch.ones_like(trust), trust)
    )
    hit = (count > 0).double()
    # means of three by three texels that are hit: 8-bit UV lays too many pixels into some
    sums = torch.stack([count, trusted, hit]).view(1, 3, RATED_SIZE, RATED_SIZE)
    count, trusted, around = F.avg_pool2d(sums, 3, 1, 1).split(1, dim=1)
    side = (count / around.clamp_min(1e-9)).sqrt() * RATED_SIZE / 256
    rating = side * trusted / count.clamp_min(1e-9) * hit.view_as(side)
    return (rating * measure_sharpness(rgb, iuv)).float()


def _body(iuv: UInt8[np.ndarray, "H W 3"]) -> tuple[Tensor, np.ndarray, np.ndarray]:
    """The places in the texture, (x, y), of the body's pixels; and their rows and columns."""
    row, column = iuv[..., 0].nonzero()
    pixels = torch.from_numpy(np.ascontiguousarray(iuv[row, column].T))[None, :, None]
    return texture_coordinates(pixels, load_uv_layout().charts)[0, 0], row, column


def _texels(place: Float[Tensor, "N 2"], size: int) -> Tensor:
    column, row = (place * size).long().clamp_(0, size - 1).unbind(1)
    return row * size + column


def trust_pixels(iuv: UInt8[np.ndarray, "H W 3"]) -> Float32[np.ndarray, "H W"]:
    """Tell how far each pixel is to be trusted, EDGE_TRUST..1: less where an edge is near.

    An edge is the person's outline, and where one part of the body covers another.
    """
    place, row, column = _body(iuv)
    layout = load_uv_layout()
    size = layout.position.shape[0]
    where = np.full((*iuv.shape[:2], 3), np.inf, np.float32)  # the background is far from all
    where[row, column] = layout.position.view(-1, 3)[_texels(place, size)].numpy()
    inner = (iuv[..., 0] > 0).astype(np.uint8)
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
