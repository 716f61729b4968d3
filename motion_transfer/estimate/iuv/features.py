"""Landmarks and mask as the IUV network sees them: pictures of bones, and a row of numbers.

Convention: the network looks at a square window around a person. Window coordinates run from (0, 0)
at its top left corner to (1, 1); depth is in the same unit. Of a tensor B x C x H x W the pixel
centres lie at (i + 0.5) / W.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Bone, Landmarks, both_sides

MASK_SIZE = 256
GRID = 64  # bones are drawn on 64 x 64 cells; the mask's finer pixels are channels of a cell
MARGIN = 0.06  # share of the window's side that is left free around the person
REACH = 0.2  # how far a bone is felt, in lengths of the trunk: a thigh's width
NEAR_METRES = 0.3  # the unit in which depths are seen

_SHOULDERS, _HIPS = ("left-shoulder", "right-shoulder"), ("left-hip", "right-hip")
_EARS = ("left-ear", "right-ear")
BONES: tuple[Bone, ...] = (
    *both_sides(
        *(("shoulder", "elbow"), ("elbow", "wrist")),
        *(("wrist", "index"), ("wrist", "pinky"), ("wrist", "thumb")),
        *(("hip", "knee"), ("knee", "ankle"), ("ankle", "heel"), ("heel", "foot-index")),
        ("shoulder", "hip"),
    ),
    *(((left,), (right,)) for left, right in (_SHOULDERS, _HIPS)),
    *((_SHOULDERS, _HIPS), (_SHOULDERS, _EARS), (("left-ear",), ("right-ear",))),
    *((_EARS, ("nose",)), (("nose",), ("mouth-left", "mouth-right"))),
)
"""What is drawn. The trained weights depend on the order."""

MAP_CHANNELS = 3 * len(BONES) + (MASK_SIZE // GRID) ** 2 + 2
VECTOR_LENGTH = 7 * LANDMARK_COUNT


class BodyInput(NamedTuple):
    """What is known of B people, each in a window of their own.

    Attributes:
        points: X, y and depth in window coordinates.
        world: Metres, as in `Landmarks`.
        visibility: As in `Landmarks`, 0..1.
        mask: How much of each pixel is the person, 0..1.
    """

    points: Float[Tensor, "B 33 3"]
    world: Float[Tensor, "B 33 3"]
    visibility: Float[Tensor, "B 33"]
    mask: Float[Tensor, "B 1 256 256"]


def body_window(landmarks: Landmarks, mask_box: Box | None) -> Box:
    """Lay a square around what the mask covers, and the landmarks that are in the picture.

    It may reach beyond the frame.
    """
    points = landmarks.image[landmarks.presence > 0.5, :2]  # in the picture rather than not
    if mask_box is not None:
        ends = [[mask_box.left, mask_box.top], [mask_box.right, mask_box.bottom]]
        points = np.concatenate([points, np.array(ends, np.float32)])
    if not len(points):
        points = landmarks.image[:, :2]
    low, high = points.min(0), points.max(0)
    side = max(2, int(np.ceil((high - low).max() / (1 - 2 * MARGIN))))
    left, top = (int(corner) for corner in np.floor((low + high - side) / 2))
    return Box(left, top, left + side, top + side)


def body_input(landmarks: Landmarks, mask: Float32[np.ndarray, "H W"], window: Box) -> BodyInput:
    """Put together what is known of one person (B = 1).

    Args:
        mask: 0..1 on the window, at any size.
    """
    points = landmarks.image.copy()
    points[:, :2] -= (window.left, window.top)
    points /= window.width
    way = cv2.INTER_AREA if mask.shape[0] > MASK_SIZE else cv2.INTER_LINEAR
    seen = cv2.resize(mask, (MASK_SIZE, MASK_SIZE), interpolation=way)
    return BodyInput(
        points=torch.from_numpy(points)[None],
        world=torch.from_numpy(np.ascontiguousarray(landmarks.world))[None],
        visibility=torch.from_numpy(np.ascontiguousarray(landmarks.visibility))[None],
        mask=torch.from_numpy(seen)[None, None],
    )


def stack_inputs(inputs: list[BodyInput]) -> BodyInput:
    """Make one batch of several inputs."""
    return BodyInput(*(torch.cat(tensors) for tensors in zip(*inputs, strict=True)))


def feature_vector(body: BodyInput) -> Float[Tensor, "B 231"]:
    """List everything but the mask, as numbers around zero."""
    points = body.points - torch.tensor([0.5, 0.5, 0.0])
    world = body.world / NEAR_METRES
    return torch.cat([points.flatten(1) * 2, world.flatten(1), body.visibility * 2 - 1], 1)


def feature_maps(body: BodyInput) -> Float[Tensor, "B C 64 64"]:
    """Draw bones and mask.

    For each bone: how near it is, on which side of it one is, and its depth there, the latter two
    weighted by nearness; then x and y, and the mask's pixels.
    """
    ends = _ends(body.points)  # B bones 2 3
    depth = _ends(body.world)[..., 2] / NEAR_METRES
    grid = _grid()
    start, along = ends[:, :, 0, :2], ends[:, :, 1, :2] - ends[:, :, 0, :2]
    length = along.square().sum(-1).clamp_min(1e-6)
    away = grid[None, None] - start[:, :, None]  # B bones cells 2
    share = ((away * along[:, :, None]).sum(-1) / length[..., None]).clamp(0, 1)
    rest = away - share[..., None] * along[:, :, None]
    # never less than a cell and a half: thinner bones would fall between the cells
    reach = (REACH * _trunk(body.points)).clamp_min(1.5 / GRID)[:, None, None]
    # clamped, as the root has no gradient at 0
    near = torch.exp(-rest.square().sum(-1).clamp_min(1e-12).sqrt() / reach)
    beside = away[..., 0] * along[:, :, None, 1] - away[..., 1] * along[:, :, None, 0]
    # bounded, here and for depth: far from a bone, how far it is says nothing more
    beside = (beside / length.sqrt()[..., None] / reach).clamp(-3, 3)
    depths = depth[:, :, None, 0] * (1 - share) + depth[:, :, None, 1] * share
    bones = torch.cat([near, near * beside, near * depths.clamp(-4, 4)], 1)
    batch = bones.shape[0]
    places = (grid.T * 2 - 1).expand(batch, 2, -1)
    drawn = torch.cat([bones, places], 1).reshape(batch, -1, GRID, GRID)
    finer = MASK_SIZE // GRID
    cells = body.mask.view(batch, GRID, finer, GRID, finer).permute(0, 2, 4, 1, 3)
    return torch.cat([drawn, cells.reshape(batch, finer**2, GRID, GRID)], 1)


def _ends(points: Float[Tensor, "B 33 3"]) -> Float[Tensor, "B bones 2 3"]:
    return torch.einsum("bke,nsk->bnse", points, _membership())


@cache
@torch.inference_mode(False)  # what is kept has to serve training, too
def _membership() -> Float[Tensor, "bones 2 33"]:
    """Tell which landmarks a bone's two ends are the middle of."""
    shares = torch.zeros(len(BONES), 2, LANDMARK_COUNT)
    for bone, ends in enumerate(BONES):
        for end, names in enumerate(ends):
            for name in names:
                shares[bone, end, LANDMARK[name]] = 1 / len(names)
    return shares


@cache
@torch.inference_mode(False)
def _grid() -> Float[Tensor, "cells 2"]:
    """List x and y of the cells' centres, row by row."""
    centres = (torch.arange(GRID) + 0.5) / GRID
    y, x = torch.meshgrid(centres, centres, indexing="ij")
    return torch.stack([x.flatten(), y.flatten()], 1)


def _trunk(points: Float[Tensor, "B 33 3"]) -> Float[Tensor, " B"]:
    """Measure the trunk, or the shoulders' width where that is more (somebody bends forward)."""
    upper, lower = (points[:, [LANDMARK[n] for n in ends], :2] for ends in (_SHOULDERS, _HIPS))
    along, across = upper.mean(1) - lower.mean(1), upper[:, 0] - upper[:, 1]
    return torch.maximum(along.norm(dim=-1), across.norm(dim=-1))
