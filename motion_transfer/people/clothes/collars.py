"""Collars, hoods and scarves: small surfaces of their own around the neck.

Each is a profile (how far below the neck's base, how far out) swept around the neck.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.sparse import csr_array

from motion_transfer.people.clothes.fabrics import Fabric, paint_fabric
from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.skirts import grid_faces, grid_uv
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.clothes.tailoring import Panel, creases
from motion_transfer.people.clothes.wardrobe import Scarf, Top
from motion_transfer.people.figure.body import SkinWeights
from motion_transfer.people.figure.mesh import Material, Piece

_COLUMNS = 32
_TEXELS_PER_METRE = 240.0


@dataclass(frozen=True)
class _Profile:
    """A section, from the inner edge over the fold to the outer edge.

    Attributes:
        rows: (below the neck's base, out from the skin) in metres; below is negative upwards.
        gap: half the angle left open in front, radians; 0 closes the ring.
        tips: how much further down the outer edge reaches at its front ends, metres.
        behind: how much of the bulk is left at the front; 1 keeps all of it.
    """

    rows: tuple[tuple[float, float], ...]
    gap: float = 0.12
    tips: float = 0.0
    behind: float = 1.0


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


@dataclass(frozen=True)
class _Sweep:
    """A profile on the skin of any body: places, their weights, how far out they go."""

    places: csr_array
    weights: SkinWeights
    out: np.ndarray
    columns: int


@cache
def _sweep(surface: BodySurface, kind: str) -> _Sweep:
    profile = _PROFILES[kind]
    angles = np.linspace(profile.gap, 2 * np.pi - profile.gap, _COLUMNS, endpoint=profile.gap > 0)
    rows = np.array(profile.rows)
    at_front = np.clip(1 - np.minimum(angles, 2 * np.pi - angles) / 0.9, 0, 1)
    outer = np.linspace(0, 1, len(rows))[:, None] ** 3
    level = rows[:, :1] + profile.tips * outer * at_front
    bulk = profile.behind + (1 - profile.behind) * (0.5 - 0.5 * np.cos(angles)) ** 1.5
    level = level * (0.4 + 0.6 * bulk)
    out = rows[:, 1:] * bulk + 0.004 * outer * at_front
    angle = np.broadcast_to(angles, level.shape)
    places = surface.neck_tube.at(level.ravel(), angle.ravel())
    weights = SkinWeights(csr_array(places @ surface.model.weights.matrix))
    return _Sweep(places, weights, out.ravel().astype(np.float32), _COLUMNS)


def _piece(
    name: str, kind: str, fitting: Fitting, fabric: Fabric, ease: float, gloss: float, folds: float
) -> Piece:
    sweep = _sweep(fitting.surface, kind)
    skin = sweep.places @ fitting.body.points
    axis = skin.reshape(-1, sweep.columns, 3).mean(1).repeat(sweep.columns, 0)
    away = skin - axis
    away[:, 2] = 0.25 * np.linalg.norm(away[:, :2], axis=1)
    away /= np.linalg.norm(away, axis=1, keepdims=True) + 1e-9
    points = skin + away * (sweep.out * np.float32(fitting.scale) + np.float32(ease))[:, None]
    rows = len(skin) // sweep.columns
    closed = _PROFILES[kind].gap == 0
    faces, uv = grid_faces(rows, sweep.columns), grid_uv(rows, sweep.columns)
    if not closed:
        inside = np.tile(np.repeat(np.arange(sweep.columns) < sweep.columns - 1, 2), rows - 1)
        faces, uv = faces[inside], uv[inside]
    size = (0.5, 0.3 if kind in ("hood", "scarf") else 0.12)
    panel = Panel(paint_fabric(fabric, *size, _TEXELS_PER_METRE))
    rng = np.random.default_rng(fabric.seed)
    panel.relief += creases(panel.shape, rng, folds)
    return Piece(
        name=name,
        points=points.astype(np.float32),
        faces=faces,
        weights=sweep.weights,
        corner_uv=uv,
        material=Material(panel.texture(), size, gloss=gloss),
        keep=np.ones(len(points), np.float32),
        two_sided=True,
    )


def collar_piece(top: Top, fitting: Fitting, ease: float) -> Piece | None:
    """The collar or hood of a top, or None.

    Args:
        ease: between skin and the top at the neck, metres.
    """
    if top.collar not in _PROFILES:
        return None
    folds = 0.003 if top.collar == "hood" else 0.0005
    return _piece("collar", top.collar, fitting, top.fabric, ease * 0.7, top.gloss, folds)


def scarf_piece(scarf: Scarf, fitting: Fitting, ease: float) -> Piece:
    """A scarf wound around the neck."""
    return _piece("scarf", "scarf", fitting, scarf.fabric, ease * 0.5 + 0.004, 0.0, 0.005)
