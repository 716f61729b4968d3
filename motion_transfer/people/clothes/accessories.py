"""What is worn at the ends: collars, hoods and scarves around the neck, and shoes.

Around the neck, each is a profile (how far below the neck's base, how far out) that is swept around
it. Shoes are smooth hulls around the feet, with a sole, and what is painted on them.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array

from motion_transfer.people.clothes.fabrics import Fabric, paint_fabric
from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.skirts import tube_grid
from motion_transfer.people.clothes.surface import BodySurface, Limb
from motion_transfer.people.clothes.tailoring import Panel, band, creases
from motion_transfer.people.clothes.wardrobe import Scarf, Shoes, Top
from motion_transfer.people.figure.body import Body, Points, SkinWeights
from motion_transfer.people.figure.mesh import Material, Piece

_AROUND_NECK = 32
_TEXELS_PER_METRE = 240.0  # about as fine as the panels of other garments
_ROWS, _COLUMNS = 18, 28
_TEXTURE = (80, 128)  # rows from the opening over the upper down to the sole; columns around
_TEXTURE_METRES = (0.7, 0.25)  # about what it shows: around a foot, and from opening to sole
_DIRECTIONS = 200  # of planes that bound a hull; more change nothing that a photo shows
_TOP = 0.085  # height on the template up to which a foot is inside a low shoe
_THICKNESS = 0.012  # of upper and sole, metres


class _Profile(NamedTuple):
    """A section, from the inner edge over the fold to the outer edge.

    Attributes:
        rows: (below the neck's base, out from the skin) in metres; below is negative upwards.
        gap: Half the angle left open in front, radians; 0 closes the ring.
        tips: How much further down the outer edge reaches at its front ends, metres.
        behind: How much of the bulk is left at the front; 1 keeps all of it.
    """

    rows: tuple[tuple[float, float], ...]
    gap: float = 0.12
    tips: float = 0.0
    behind: float = 1.0


# Drawn by eye, each as a section through such a collar.
_PROFILES = {
    "shirt": _Profile(
        ((0.012, 0.002), (-0.012, 0.004), (-0.030, 0.007), (-0.027, 0.012), (-0.008, 0.015),
         (0.012, 0.015)), 0.22, 0.030,
    ),
    "polo": _Profile(
        ((0.010, 0.002), (-0.010, 0.004), (-0.022, 0.006), (-0.019, 0.011), (0.0, 0.014),
         (0.012, 0.013)), 0.25, 0.018,
    ),
    "lapels": _Profile(
        ((0.014, 0.003), (-0.008, 0.005), (-0.018, 0.009), (-0.015, 0.015), (0.010, 0.018),
         (0.032, 0.015)), 0.9, 0.02,
    ),
    "hood": _Profile(
        ((0.020, 0.004), (-0.012, 0.012), (-0.030, 0.030), (-0.024, 0.055), (0.010, 0.066),
         (0.055, 0.058), (0.085, 0.030), (0.085, 0.004)), 0.02, 0.0, 0.22,
    ),
    "scarf": _Profile(
        tuple((0.004 - 0.034 * np.cos(t), 0.026 + 0.026 * np.sin(t))
              for t in np.linspace(-2.6, 2.6, 9)), 0.0,
    ),
}  # fmt: skip


@cache
def _sweep(surface: BodySurface, kind: str) -> tuple[csr_array, SkinWeights, np.ndarray]:
    """Lay a profile on the skin of any body: places, their weights, how far out they go."""
    profile = _PROFILES[kind]
    angles = np.linspace(
        profile.gap, 2 * np.pi - profile.gap, _AROUND_NECK, endpoint=profile.gap > 0
    )
    rows = np.array(profile.rows)
    at_front = np.clip(1 - np.minimum(angles, 2 * np.pi - angles) / 0.9, 0, 1)
    outer = np.linspace(0, 1, len(rows))[:, None] ** 3  # tips hang from the outer edge alone
    level = rows[:, :1] + profile.tips * outer * at_front
    bulk = profile.behind + (1 - profile.behind) * (0.5 - 0.5 * np.cos(angles)) ** 1.5
    level = level * (0.4 + 0.6 * bulk)
    out = rows[:, 1:] * bulk + 0.004 * outer * at_front
    angle = np.broadcast_to(angles, level.shape)
    places = surface.neck_tube.at(level.ravel(), angle.ravel())
    weights = SkinWeights(csr_array(places @ surface.model.weights.matrix))
    return places, weights, out.ravel().astype(np.float32)


def _piece(
    name: str, kind: str, fitting: Fitting, fabric: Fabric, ease: float, gloss: float, folds: float
) -> Piece:
    places, weights, out = _sweep(fitting.surface, kind)
    skin = places @ fitting.body.points
    away = skin - skin.reshape(-1, _AROUND_NECK, 3).mean(1).repeat(_AROUND_NECK, 0)
    away[:, 2] = 0.25 * np.linalg.norm(away[:, :2], axis=1)  # a neck widens downwards
    away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-9
    points = skin + away * (out * np.float32(fitting.scale) + np.float32(ease))[:, None]
    rows = len(skin) // _AROUND_NECK
    faces, uv = tube_grid(rows, _AROUND_NECK)
    if _PROFILES[kind].gap > 0:  # leave out the last column, which would close the ring
        inside = np.tile(np.repeat(np.arange(_AROUND_NECK) < _AROUND_NECK - 1, 2), rows - 1)
        faces, uv = faces[inside], uv[inside]
    size = (0.5, 0.3 if kind in ("hood", "scarf") else 0.12)
    panel = Panel(paint_fabric(fabric, *size, _TEXELS_PER_METRE))
    panel.relief += creases(panel.shape, np.random.default_rng(fabric.seed), folds)
    return Piece(
        name=name,
        points=points.astype(np.float32),
        faces=faces,
        weights=weights,
        corner_uv=uv,
        material=Material(panel.texture(), size, gloss=gloss),
        keep=np.ones(len(points), np.float32),
        two_sided=True,
    )


def collar_piece(top: Top, fitting: Fitting, ease: float) -> Piece | None:
    """Make the collar or hood of a top; None where it has none.

    Args:
        ease: Between skin and the top at the neck, metres.
    """
    if top.collar not in _PROFILES:
        return None
    folds = 0.003 if top.collar == "hood" else 0.0005
    return _piece("collar", top.collar, fitting, top.fabric, ease * 0.7, top.gloss, folds)


def scarf_piece(scarf: Scarf, fitting: Fitting, ease: float) -> Piece:
    """Make a scarf wound around the neck; `ease` is that of `collar_piece`."""
    return _piece("scarf", "scarf", fitting, scarf.fabric, ease * 0.5 + 0.004, 0.0, 0.005)


@cache
def _planes() -> Points:
    """Directions that are evenly spread (a Fibonacci lattice on the sphere), N x 3."""
    index = np.arange(_DIRECTIONS) + 0.5
    height, angle = 1 - 2 * index / _DIRECTIONS, np.pi * (3 - np.sqrt(5)) * index
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), height], 1).astype(np.float32)


@cache
def _rays() -> Points:
    """Directions of the hull's grid: rows from the top down, columns around from the toes."""
    polar = np.linspace(0.02, np.pi - 0.02, _ROWS)[:, None]  # the poles would be one point each
    turn = np.arange(_COLUMNS) * 2 * np.pi / _COLUMNS
    x, y = np.sin(polar) * np.sin(turn), -np.sin(polar) * np.cos(turn)
    rays = np.stack([x, y, np.cos(polar) * np.ones_like(turn)], -1)
    return rays.reshape(-1, 3).astype(np.float32)


def _hull(points: Points, margin: float, stretch: Float32[np.ndarray, " 3"]) -> np.ndarray:
    """Wrap points in a rounded convex hull: a grid of _ROWS * _COLUMNS points.

    Args:
        margin: Between points and hull, metres.
        stretch: Rays are spread over a box of these proportions, so that long hulls are evenly
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
    """Make both shoes; none for bare feet."""
    if shoes.kind == "bare":
        return []
    own = body.points[surface.is_limb(Limb.FOOT_L) & (surface.z < _TOP)]
    margin = _THICKNESS * body.height / surface.model.template.height
    # one in three vertices is enough for a hull
    points = _hull(own[::3], margin, np.array([0.5, 1.0, 0.5], np.float32))
    low = float(own[:, 2].min())
    ground = low - margin
    near = points[:, 2] < low + _THICKNESS
    points[near, 2] = np.maximum(points[near, 2], ground)  # straight down to the sole
    points = points.astype(np.float32)
    texture = _painted(shoes, points, ground, low)
    material = Material(texture, _TEXTURE_METRES, gloss=shoes.gloss)
    keep = _cut(shoes, points, ground)
    return [_shoe(points, material, keep, surface, side) for side in "LR"]


def _shoe(
    points: Points, material: Material, keep: np.ndarray, surface: BodySurface, side: str
) -> Piece:
    """Fix the left shoe, or its mirror image, to its foot."""
    faces, uv = tube_grid(_ROWS, _COLUMNS)
    if side == "R":
        points = points * np.array([-1, 1, 1], np.float32)
        faces, uv = faces[:, ::-1].copy(), uv[:, ::-1].copy()
    bone = surface.model.skeleton.index[f"foot.{side}"]
    ones = np.ones(len(points), np.float32)
    place = np.arange(len(points)), np.full(len(points), bone)
    matrix = csr_array((ones, place), (len(points), len(surface.model.skeleton.names)))
    return Piece("shoes", points, faces, SkinWeights(matrix), uv, material, keep, two_sided=True)


def _height_and_along(
    places: np.ndarray, points: Points, ground: float
) -> tuple[np.ndarray, np.ndarray]:
    """Metres above the ground, and how far back: 0 at the toes, 1 at the heel."""
    toe, heel = points[:, 1].min(), points[:, 1].max()
    return places[..., 2] - ground, (places[..., 1] - toe) / (heel - toe)


def _painted(
    shoes: Shoes, points: Points, ground: float, low: float
) -> Float32[np.ndarray, "H W 4"]:
    """Paint the texture by where on the shoe each texel lies."""
    rows, columns = _TEXTURE
    grid = points.reshape(_ROWS, _COLUMNS, 3)
    grid = np.concatenate([grid, grid[:, :1]], 1)  # closed, as the texture is
    place = cv2.resize(grid.astype(np.float32), (columns, rows), interpolation=cv2.INTER_LINEAR)
    height, along = _height_and_along(place, points, ground)
    panel = Panel(np.tile(np.asarray(shoes.colour, np.float32), (rows, columns, 1)))
    middle = np.abs(np.mod(np.arange(columns) / columns + 0.5, 1) - 0.5)[None] * np.ones((rows, 1))
    if shoes.kind in ("sneakers", "trainers", "boots"):
        for at in 0.36 + 0.065 * np.arange(5):
            lace = band(along, at, at + 0.022, 0.01) * (place[..., 2] > low + 0.035)
            panel.tint(lace * (middle < 0.13) * 0.9, shoes.trim)
            panel.raise_by(lace, 0.001)
    if shoes.kind in ("sneakers", "trainers"):  # a toe cap, and a slanting stripe on the sides
        panel.tint(band(along, -1, 0.16, 0.01) * (height > 0.02) * 0.5, shoes.sole)
        panel.tint(band(along - 0.3 * (height - 0.05) * 4, 0.62, 0.70, 0.01) * 0.9, shoes.trim)
    panel.tint(band(height, -1, shoes.sole_height, 0.004), shoes.sole)
    # the welt: dirt and shadow where the upper meets the sole
    panel.dim(band(height, shoes.sole_height, shoes.sole_height + 0.004, 0.003), 0.35)
    return panel.texture()


def _cut(shoes: Shoes, points: Points, ground: float) -> Float32[np.ndarray, " V"]:
    """Tell where the hull is kept: all of it but the openings of flats and sandals."""
    height, along = _height_and_along(points, points, ground)
    keep = np.ones(len(points))
    if shoes.kind == "flats":  # the rim rises towards the toes and the heel
        rim = 0.038 + 0.25 * np.maximum(0.32 - along, 0) + 0.12 * np.maximum(along - 0.8, 0)
        keep = rim - height
    elif shoes.kind == "sandals":  # a sole, a strap over the toes and one around the ankle
        sole = shoes.sole_height + 0.004 - height
        strap = 0.035 - np.abs(along - 0.36) * 0.3
        around = 0.02 - np.abs(along - 0.72) * 0.25
        keep = np.maximum(sole, np.maximum(strap - 0.01, around - 0.006))
    return keep.astype(np.float32)


def shoe_keep(shoes: Shoes, surface: BodySurface) -> Float32[np.ndarray, " V"]:
    """Tell where the skin is seen beside the shoes, as a piece's `keep` does."""
    if shoes.kind in ("bare", "flats", "sandals"):
        return np.ones(len(surface.z), np.float32)
    feet = surface.is_limb(Limb.FOOT_L, Limb.FOOT_R)
    # as far as 2 cm below the opening, where nobody can look in
    return np.where(feet, surface.z - np.float32(_TOP - 0.02), 1).astype(np.float32)
