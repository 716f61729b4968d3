"""Hats: worn on the head like hair."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import noise, ramp, to_linear
from motion_transfer.people.head.hair_grid import Grid, Grid3, Head, grid_faces, rays
from motion_transfer.people.head.hair_styles import Hair

_COLUMNS, _ROWS = 56, 20
_CENTRE = ((0.0, 0.05), (0.0, 0.15))


def hat_edge(hat: str, place: Grid3) -> Grid:
    """Metres by which places of the template's head are inside a hat, negative outside."""
    front = {"beanie": 1.762, "cap": 1.775, "brim": 1.778}[hat]
    slope = {"beanie": 0.25, "cap": 0.18, "brim": 0.10}[hat]
    return (place[..., 2] - (front - slope * (place[..., 1] + 0.14))).astype(np.float32)


def hat_pieces(hair: Hair, head: Head) -> list[Piece]:
    """The hat's crown and, where it has one, its brim; none without a hat."""
    if hair.hat == "none":
        return []
    angles = np.linspace(0, 2 * np.pi, _COLUMNS, endpoint=False).astype(np.float32)
    rows = np.linspace(0, 1, _ROWS, dtype=np.float32)[:, None]
    turn = np.minimum(angles, 2 * np.pi - angles)
    reach = np.interp(turn, (0, 1.6, np.pi), (1.45, 1.60, 1.95))
    points, normals, place = head.map.at(
        rays(_CENTRE, angles, (0.02 + rows * reach).astype(np.float32))
    )
    inside = hat_edge(hair.hat, place)
    surface = points + _standing(hair, inside)[..., None] * normals
    if hair.hat == "brim":  # a flat crown: tall sides, and a dent on top
        surface[..., 2] += 0.035 * ramp(inside, 0.0, 0.05)
    faces, uv = grid_faces(_ROWS, _COLUMNS, closed=True)
    crown = Piece(
        name="hat",
        points=np.ascontiguousarray(surface.reshape(-1, 3), np.float32),
        faces=faces,
        weights=head.rigid(_ROWS * _COLUMNS),
        corner_uv=uv,
        material=Material(_cloth(hair), (0.6, 0.25), translucency=0.1),
        keep=inside.ravel(),
        two_sided=True,
    )
    return [crown] if hair.hat == "beanie" else [crown, _brim(hair, head, angles, reach)]


def _standing(hair: Hair, inside: Grid) -> Grid:
    if hair.hat == "beanie":
        turned_up = 0.004 * (1 - ramp(inside, 0.040, 0.046))
        return (0.012 + turned_up + 0.012 * ramp(inside, 0.05, 0.10)).astype(np.float32)
    return (0.010 + 0.010 * ramp(inside, 0.01, 0.06)).astype(np.float32)


def _brim(
    hair: Hair,
    head: Head,
    angles: Float32[np.ndarray, " columns"],
    reach: Float32[np.ndarray, " columns"],
) -> Piece:
    """A ring, or a cap's peak, from the crown's edge outward."""
    fine = np.linspace(0, 1, 60, dtype=np.float32)[:, None] * (0.02 + reach)
    points, normals, place = head.map.at(rays(_CENTRE, angles, fine.astype(np.float32)))
    last = np.argmax(hat_edge(hair.hat, place) < 0.003, axis=0)
    last = np.where(last == 0, len(fine) - 1, last)
    columns = np.arange(len(angles))
    edge = points[last, columns] + 0.010 * normals[last, columns]
    outward = edge - head.map.middle
    outward[:, 2] = 0
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    if hair.hat == "cap":
        ahead = np.clip(1.25 - np.minimum(angles, 2 * np.pi - angles), 0, None)
        width = 0.072 * np.clip(ahead / 0.5, 0, 1) ** 0.6
        way = np.array([0, -1, -0.30], np.float32) + 0.15 * outward
        bend = -0.35 * np.abs(edge[:, 0] - head.map.middle[0])
    else:
        width = np.full(len(angles), 0.07)
        way = outward + np.array([0, 0, -0.12], np.float32)
        bend = 0.0 * width
    steps = np.linspace(0, 1, 5)[:, None, None]
    rings = edge + steps * width[:, None] * way
    rings[..., 2] += steps[..., 0] ** 2 * bend * (width > 0)
    faces, uv = grid_faces(5, len(angles), closed=True)
    keep = np.broadcast_to(width - 0.004, (5, len(angles)))
    return Piece(
        name="hat_brim",
        points=np.ascontiguousarray(rings.reshape(-1, 3), np.float32),
        faces=faces,
        weights=head.rigid(5 * len(angles)),
        corner_uv=uv,
        material=Material(_cloth(hair), (0.6, 0.1), translucency=0.1),
        keep=np.ascontiguousarray(keep.ravel(), np.float32),
        two_sided=True,
    )


def _cloth(hair: Hair) -> Float32[np.ndarray, "96 256 4"]:
    texture = np.empty((96, 256, 4), np.float32)
    grain = cv2.GaussianBlur(noise("fine", hair.seed, 96, 256), (0, 0), 0.7)
    texture[..., :3] = to_linear(hair.hat_colour) * (1 + 0.10 * grain[..., None])
    ribs = np.sin(2 * np.pi * np.arange(256) / 256 * 64) if hair.hat == "beanie" else np.zeros(256)
    texture[..., :3] *= (1 + 0.15 * ribs)[None, :, None]
    texture[..., 3] = 0.0008 * ribs
    return texture
