"""Shoes: smooth hulls around the feet, with a sole, and what is painted on them."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from scipy.sparse import csr_array

from motion_transfer.people.clothes.skirts import grid_faces, grid_uv
from motion_transfer.people.clothes.surface import BodySurface, Limb
from motion_transfer.people.clothes.tailoring import band, linear
from motion_transfer.people.clothes.wardrobe import Shoes
from motion_transfer.people.figure.body import Body, SkinWeights
from motion_transfer.people.figure.mesh import Material, Piece

_ROWS, _COLUMNS = 18, 28
_TEXTURE = (80, 128)  # rows from the opening over the upper down to the sole; columns around
_DIRECTIONS = 200


@cache
def _planes() -> np.ndarray:
    """Evenly spread directions, N x 3."""
    index = np.arange(_DIRECTIONS) + 0.5
    height, angle = 1 - 2 * index / _DIRECTIONS, np.pi * (3 - np.sqrt(5)) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), height], 1).astype(np.float32)


@cache
def _rays() -> np.ndarray:
    """Directions of the hull's grid: rows from the top down, columns around from the toes."""
    polar = np.linspace(0.02, np.pi - 0.02, _ROWS)[:, None]
    turn = np.arange(_COLUMNS) * 2 * np.pi / _COLUMNS
    x, y = np.sin(polar) * np.sin(turn), -np.sin(polar) * np.cos(turn)
    rays = np.stack([x, y, np.cos(polar) * np.ones_like(turn)], -1)
    return rays.reshape(-1, 3).astype(np.float32)


def hull(points: np.ndarray, margin: float, stretch: np.ndarray) -> np.ndarray:
    """A rounded convex hull as a grid of points.

    Args:
        stretch: 3; rays are spread over a box of these proportions, so that long hulls are evenly
            sampled.
    """
    low, high = points.min(0), points.max(0)
    middle = (low + high) / 2
    planes = _planes()
    reach = ((points - middle) @ planes.T).max(0) + margin
    rays = _rays() * stretch
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    closeness = np.maximum(rays @ planes.T, 0) / reach
    nearest = closeness.max(1, keepdims=True)
    power = closeness / nearest
    for _ in range(6):  # to the 64th: a smooth maximum
        power *= power
    rounded = nearest[:, 0] * power.sum(1) ** (1 / 64)
    return middle + rays / rounded[:, None]


def shoe_pieces(shoes: Shoes, surface: BodySurface, body: Body) -> list[Piece]:
    """Both shoes; empty for bare feet."""
    if shoes.kind == "bare":
        return []
    foot = surface.is_limb(Limb.FOOT_L) & (surface.z < _TOP)
    own = body.points[foot]
    scale = body.height / surface.model.template.height
    points = hull(own[::3], 0.012 * scale, np.array([0.5, 1.0, 0.5], np.float32))
    low = float(own[:, 2].min())
    # everything near the ground goes straight down to the sole
    ground = low - 0.012 * scale
    near = points[:, 2] < low + 0.012
    points[near, 2] = np.maximum(points[near, 2], ground)
    points = points.astype(np.float32)
    material = Material(_painted(shoes, points, ground, low), (0.7, 0.25), gloss=shoes.gloss)
    keep = _cut(shoes, points, ground)
    return [_shoe(points, material, keep, surface, side) for side in "LR"]


def _shoe(
    points: np.ndarray, material: Material, keep: np.ndarray, surface: BodySurface, side: str
) -> Piece:
    """The left shoe, or its mirror image."""
    faces, uv = grid_faces(_ROWS, _COLUMNS), grid_uv(_ROWS, _COLUMNS)
    if side == "R":
        points = points * np.array([-1, 1, 1], np.float32)
        faces, uv = faces[:, ::-1].copy(), uv[:, ::-1].copy()
    bone = surface.model.skeleton.index[f"foot.{side}"]
    ones = np.ones(len(points), np.float32)
    place = np.arange(len(points)), np.full(len(points), bone)
    matrix = csr_array((ones, place), (len(points), len(surface.model.skeleton.names)))
    return Piece("shoes", points, faces, SkinWeights(matrix), uv, material, keep, two_sided=True)


_TOP = 0.085  # height on the template up to which a foot is inside a low shoe


def _painted(shoes: Shoes, points: np.ndarray, ground: float, low: float) -> np.ndarray:
    """The texture, from where each texel lies."""
    rows, columns = _TEXTURE
    grid = points.reshape(_ROWS, _COLUMNS, 3)
    grid = np.concatenate([grid, grid[:, :1]], 1)  # closed, as the texture is
    place = cv2.resize(grid.astype(np.float32), (columns, rows), interpolation=cv2.INTER_LINEAR)
    height = place[..., 2] - ground
    toe, heel = grid[..., 1].min(), grid[..., 1].max()
    along = (place[..., 1] - toe) / (heel - toe)  # 0 at the toes, 1 at the heel
    colours = np.broadcast_to(np.asarray(shoes.colour, np.float32), (rows, columns, 3)).copy()
    relief = np.zeros((rows, columns), np.float32)

    def tint(cover: np.ndarray, colour: tuple[float, float, float]) -> None:
        colours[...] += cover[..., None] * (np.asarray(colour, np.float32) - colours)

    middle = np.abs(np.mod(np.arange(columns) / columns + 0.5, 1) - 0.5)[None] * np.ones((rows, 1))
    if shoes.kind in ("sneakers", "trainers", "boots"):
        for k in range(5):
            at = 0.36 + 0.065 * k
            lace = band(along, at, at + 0.022, 0.01) * (place[..., 2] > low + 0.035)
            tint(lace * (middle < 0.13) * 0.9, shoes.trim)
            relief += 0.001 * lace
    if shoes.kind in ("sneakers", "trainers"):
        tint(band(along, -1, 0.16, 0.01) * (height > 0.02) * 0.5, shoes.sole)
        tint(band(along - 0.3 * (height - 0.05) * 4, 0.62, 0.70, 0.01) * 0.9, shoes.trim)
    tint(band(height, -1, shoes.sole_height, 0.004), shoes.sole)
    colours *= (
        1 - 0.35 * band(height, shoes.sole_height, shoes.sole_height + 0.004, 0.003)[..., None]
    )
    return cv2.merge([*cv2.split(linear(colours.astype(np.float32))), relief])


def _cut(shoes: Shoes, points: np.ndarray, ground: float) -> np.ndarray:
    """Where the hull is kept: all of it but the openings of flats and sandals."""
    height = points[:, 2] - ground
    toe, heel = points[:, 1].min(), points[:, 1].max()
    along = (points[:, 1] - toe) / (heel - toe)
    if shoes.kind == "flats":
        rim = 0.038 + 0.25 * np.maximum(0.32 - along, 0) + 0.12 * np.maximum(along - 0.8, 0)
        return (rim - height).astype(np.float32)
    if shoes.kind == "sandals":
        sole = shoes.sole_height + 0.004 - height
        strap = 0.035 - np.abs(along - 0.36) * 0.3
        around = 0.02 - np.abs(along - 0.72) * 0.25
        return np.maximum(sole, np.maximum(strap - 0.01, around - 0.006)).astype(np.float32)
    return np.ones(len(points), np.float32)


def shoe_keep(shoes: Shoes, surface: BodySurface) -> np.ndarray:
    """Where the skin is seen beside the shoes; V, as a piece's `keep`."""
    if shoes.kind in ("bare", "flats", "sandals"):
        return np.ones(len(surface.z), np.float32)
    feet = surface.is_limb(Limb.FOOT_L, Limb.FOOT_R)
    return np.where(feet, surface.z - np.float32(_TOP - 0.02), 1).astype(np.float32)
