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
from jaxtyping import Bool, Float, Float32, Int64, UInt8
from torch import Tensor

from motion_transfer.drawing.person import bounding_box
from nhrr_core import PART_GROUPS, load_uv_layout, texture_coordinates
from nhrr_core.texture import resize_twins

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
"""What lies farther ahead on the head is the face; see `UVLayout.position`."""

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
    first, *others = equalise_light(views)
    views = [first, *map(_keep_sure, others)]
    texture = torch.cat([view.texture for view in views])
    seen = torch.cat([view.visibility for view in views])
    rating = torch.cat([view.rating for view in views])
    rating[0] *= LEAD
    head, face = _mark_head(texture.shape[-1])
    on_face = (rating * face).sum((1, 2, 3))
    rating[on_face.argmax()] *= torch.where(head, FACE_LEAD, 1.0)
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


def _keep_sure(view: View) -> View:
    """Leave out what a photo sees much worse than the best of the same part: hands, backdrop."""
    part = _parts(view.texture.shape[-1])
    rating = view.rating.flatten()
    best = torch.zeros(int(part.max()) + 1).scatter_reduce(0, part.flatten(), rating, "amax")
    sure = (view.rating >= SURE_SHARE * best[part]) * view.visibility
    return replace(view, texture=view.texture * sure, visibility=sure, rating=view.rating * sure)


def _parts(size: int) -> Int64[Tensor, "T T"]:
    part = load_uv_layout().part[None, None].float()
    return F.interpolate(part, (size, size))[0, 0].long()


def _mark_head(size: int) -> tuple[Bool[Tensor, "T T"], Bool[Tensor, "T T"]]:
    """Mark the texels of the head, and those of its face."""
    layout = load_uv_layout()
    head = torch.isin(layout.part, torch.tensor(HEAD))
    both = torch.stack([head, head & (layout.position[..., 2] > EARS_METRES)])
    head, face = F.interpolate(both[None].float(), (size, size))[0] > 0
    return head, face


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

    Each photo has one factor of light a channel. Two photos are compared by the median ratio of
    what both show: the same places, and the other faces of the same limbs, as a front and a back
    have hardly a place in common, but mostly the same clothes. Where ratios differ much among each
    other they move little.
    Source: gain compensation of Brown and Lowe (IJCV 2007), Sec. 6, of logarithms; twins are this
    project's.
    """
    count = len(views)
    logs = [_to_light(view).flatten(1).clamp_min(1e-6).log() for view in views]
    told = [_told(view).flatten() for view in views]
    size = views[0].texture.shape[-1]
    layout = load_uv_layout()
    side, depth = (resize_twins(twin, size) for twin in (layout.side_twin, layout.depth_twin))
    same = torch.arange(size**2)
    # rows of least squares problems: each photo's light is near to the first's ...
    rows, wanted = [np.eye(count)[1:] / EXPOSURE_SPREAD], [np.zeros((count - 1, 3))]
    for one, other in combinations(range(count), 2):
        for places, spread in (((same,), SHADE_SPREAD), ((depth, side[depth]), TWIN_SPREAD)):
            both = [told[one] & told[other][place] for place in places]
            ratios = torch.cat(
                [
                    logs[one][:, kept] - logs[other][:, place[kept]]
                    for place, kept in zip(places, both, strict=True)
                ],
                dim=1,
            )
            share = ratios.shape[1] / size**2
            if share < LEAST_SHARE:  # the few twins of head and trunk are skin and shirt
                continue
            # ... and two photos agree on what both show
            ratio = ratios.median(1, keepdim=True).values
            scatter = float((ratios - ratio).abs().median())
            trust = (share / (share + COMMON_SHARE) / (spread**2 + scatter**2)) ** 0.5
            row = np.zeros((1, count))
            row[0, one], row[0, other] = trust, -trust
            rows.append(row)
            wanted.append(-trust * ratio.double().numpy().T)
    system, found = np.concatenate(rows)[:, 1:], np.concatenate(wanted)  # the first's light stays
    exposure = np.linalg.lstsq(system, found.mean(1, keepdims=True))[0]
    # cameras differ less in white balance than in exposure
    system[: count - 1] *= EXPOSURE_SPREAD / TINT_SPREAD
    tint = np.linalg.lstsq(system, found - found.mean(1, keepdims=True))[0]
    gains = exposure + tint
    return [views[0], *(_relight(view, gain) for view, gain in zip(views[1:], gains, strict=True))]


def _to_light(view: View) -> Float[Tensor, "3 T T"]:
    return ((view.texture[0] + 1) / 2).clamp_min(0) ** GAMMA


def _told(view: View) -> Bool[Tensor, "T T"]:
    """Where a photo tells of the light: inside its edges, neither black nor burnt out."""
    rating, colours = view.rating[0, 0], (view.texture[0] + 1) / 2
    kept = ((colours > DIM) & (colours < BRIGHT)).all(0)
    return (rating > rating.max() * TOLD_SHARE) & (view.visibility[0, 0] > 0) & kept


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
