"""What is known of a person as the IUV network sees it: maps, and a row of numbers.

Convention: that of `body`. Of a tensor B x C x H x W the pixel centres lie at (i + 0.5) / W.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK, Landmarks
from motion_transfer.estimate.iuv.body import (
    FEATURE_SCALE,
    GRID,
    HIPS,
    LEAST_REACH,
    MOST_BESIDE,
    MOST_DEPTH,
    NEAR_METRES,
    REACH,
    SHOULDERS,
    body_arrays,
    bone_ends,
    cell_centres,
)


class BodyInput(NamedTuple):
    """What is known of B people, each in a window of their own, see `BodyArrays`."""

    points: Float[Tensor, "B 33 3"]
    world: Float[Tensor, "B 33 3"]
    visibility: Float[Tensor, "B 33"]
    mask: Float[Tensor, "B 1 256 256"]
    coarse: Float[Tensor, "B 64 64 48"]
    fine: Float[Tensor, "B 128 128 8"]


def body_input(
    landmarks: Landmarks,
    mask: Float32[np.ndarray, "H W"],
    features: tuple[Float32[np.ndarray, "64 64 48"], Float32[np.ndarray, "128 128 8"]] | None,
    window: Box,
) -> BodyInput:
    """Put together what is known of one person (B = 1), see `body_arrays`."""
    return BodyInput(*map(torch.from_numpy, body_arrays(landmarks, mask, features, window)))


def stack_inputs(inputs: list[BodyInput]) -> BodyInput:
    """Make one batch of several inputs."""
    return BodyInput(*(torch.cat(tensors) for tensors in zip(*inputs, strict=True)))


# positions do not bear the few bits of a lower precision
@torch.autocast("cpu", enabled=False)
def feature_vector(body: BodyInput) -> Float[Tensor, "B 231"]:
    """List what the landmarks say, as numbers around zero."""
    points = body.points - torch.tensor([0.5, 0.5, 0.0])
    world = body.world / NEAR_METRES
    return torch.cat([points.flatten(1) * 2, world.flatten(1), body.visibility * 2 - 1], 1)


@torch.autocast("cpu", enabled=False)
def feature_maps(body: BodyInput) -> Float[Tensor, "B C 64 64"]:
    """Draw bones, mask and features.

    For each bone: how near it is, on which side of it one is, and its depth there, the latter two
    weighted by nearness; then x and y, the mask's pixels, the coarse features and the fine ones'.
    """
    ends = _ends(body.points)  # B bones 2 3
    depth = _ends(body.world)[..., 2] / NEAR_METRES
    grid = _grid()
    start, along = ends[:, :, 0, :2], ends[:, :, 1, :2] - ends[:, :, 0, :2]
    length = along.square().sum(-1).clamp_min(1e-6)
    away = grid[None, None] - start[:, :, None]  # B bones cells 2
    share = ((away * along[:, :, None]).sum(-1) / length[..., None]).clamp(0, 1)
    rest = away - share[..., None] * along[:, :, None]
    reach = (REACH * _trunk(body.points)).clamp_min(LEAST_REACH)[:, None, None]
    # clamped, as the root has no gradient at 0
    near = torch.exp(-rest.square().sum(-1).clamp_min(1e-12).sqrt() / reach)
    beside = away[..., 0] * along[:, :, None, 1] - away[..., 1] * along[:, :, None, 0]
    beside = (beside / length.sqrt()[..., None] / reach).clamp(-MOST_BESIDE, MOST_BESIDE)
    depths = depth[:, :, None, 0] * (1 - share) + depth[:, :, None, 1] * share
    bones = torch.cat([near, near * beside, near * depths.clamp(-MOST_DEPTH, MOST_DEPTH)], 1)
    batch = bones.shape[0]
    places = (grid.T * 2 - 1).expand(batch, 2, -1)
    drawn = torch.cat([bones, places], 1).reshape(batch, -1, GRID, GRID)
    mask, fine = _cells(body.mask.permute(0, 2, 3, 1)), _cells(body.fine * FEATURE_SCALE)
    return torch.cat([drawn, mask, _cells(body.coarse * FEATURE_SCALE), fine], 1)


def _cells(maps: Float[Tensor, "B H W C"]) -> Float[Tensor, "B c 64 64"]:
    """Make channels of the pixels of each cell: row by row, all of a pixel's side by side."""
    batch, height, _, channels = maps.shape
    finer = height // GRID
    cells = maps.reshape(batch, GRID, finer, GRID, finer * channels).permute(0, 2, 4, 1, 3)
    return cells.reshape(batch, finer**2 * channels, GRID, GRID)


def _ends(points: Float[Tensor, "B 33 3"]) -> Float[Tensor, "B bones 2 3"]:
    return torch.einsum("bke,nsk->bnse", points, _membership())


@cache
@torch.inference_mode(False)  # what is kept has to serve training, too
def _membership() -> Float[Tensor, "bones 2 33"]:
    return torch.from_numpy(bone_ends())


@cache
@torch.inference_mode(False)
def _grid() -> Float[Tensor, "cells 2"]:
    return torch.from_numpy(cell_centres())


def _trunk(points: Float[Tensor, "B 33 3"]) -> Float[Tensor, " B"]:
    """Measure the trunk, or the shoulders' width where that is more (somebody bends forward)."""
    upper, lower = (points[:, [LANDMARK[n] for n in ends], :2] for ends in (SHOULDERS, HIPS))
    along, across = upper.mean(1) - lower.mean(1), upper[:, 0] - upper[:, 1]
    return torch.maximum(along.norm(dim=-1), across.norm(dim=-1))
