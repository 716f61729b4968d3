"""Hair as pieces, off the head and with volume, and the hats worn on it.

    sample_hair -> Hair -> hair_pieces -> pieces

Short hair is a cap over the scalp, long hair hangs from a parting, and tails and buns are tied to
a cap. Lengths are metres, hats' chosen by eye.
"""

from __future__ import annotations

import cv2
import numpy as np

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.figure.mesh import Material, Piece, PosedBody
from motion_transfer.people.head.brushes import noise, ramp
from motion_transfer.people.head.hair.cap import cap_piece, under_piece
from motion_transfer.people.head.hair.drape import bun_piece, tail_piece
from motion_transfer.people.head.hair.grid import Columns, Grid, Grid3, Head, grid_piece, rays
from motion_transfer.people.head.hair.hang import hang_piece
from motion_transfer.people.head.hair.styles import HATS, STYLES, Hair, sample_hair
from motion_transfer.people.head.head_map import head_map
from motion_transfer.people.head.skin_atlas import unit
from motion_transfer.people.picture.paint import to_linear

__all__ = ["HATS", "STYLES", "Hair", "hair_pieces", "sample_hair"]

_HANGING = ("bob", "shoulder", "long")
_UNDER_HAT_METRES = 0.006  # that hair may stand off the head, thinner than any hat
_COLUMNS, _ROWS = 56, 20
_CENTRE = ((0.0, 0.05), (0.0, 0.15))  # where the columns begin: the top of the head
_FRONT = {"beanie": 1.762, "cap": 1.775, "brim": 1.778}  # height of the edge over the forehead
_SLOPE = {"beanie": 0.25, "cap": 0.18, "brim": 0.10}  # how fast the edge falls to the back


def hair_pieces(hair: Hair, body: Body, model: BodyModel) -> list[Piece]:
    """Make one head of hair and what is worn on it; nothing for a bald head without a hat.

    Raises: KeyError for an unknown style.
    """
    STYLES[hair.style]  # refuses an unknown style before any work
    head = Head(body, model, head_map(body, model))
    still = body.transforms({})
    rest = PosedBody(body, still, body.points, body.heads)
    limit = None if hair.hat == "none" else _UNDER_HAT_METRES
    pieces = hat_pieces(hair, head)
    if hair.style == "bald":
        return pieces
    if hair.style in _HANGING:
        pieces.append(hang_piece(hair, head, rest, limit))
        if hair.fringe == 0:
            pieces.append(under_piece(hair, head))
        return pieces
    pieces.append(cap_piece(hair, head, limit))
    if hair.style in ("ponytail", "braid"):
        pieces.append(tail_piece(hair, head, rest))
    if hair.style == "bun":
        pieces.append(bun_piece(hair, head))
    return pieces


def hat_edge(hat: str, place: Grid3) -> Grid:
    """Measure metres by which places of the template's head are inside a hat, negative outside."""
    edge = _FRONT[hat] - _SLOPE[hat] * (place[..., 1] + 0.14)  # the forehead lies at y = -0.14
    return (place[..., 2] - edge).astype(np.float32)


def hat_pieces(hair: Hair, head: Head) -> list[Piece]:
    """Make the hat's crown and, where it has one, its brim; nothing without a hat."""
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
    off = 0.010 + 0.010 * ramp(inside, 0.01, 0.06)
    if hair.hat == "beanie":
        turned_up = 0.004 * (1 - ramp(inside, 0.040, 0.046))
        off = 0.012 + turned_up + 0.012 * ramp(inside, 0.05, 0.10)
    surface = points + off.astype(np.float32)[..., None] * normals
    if hair.hat == "brim":  # a flat crown: tall sides, and a dent on top
        surface[..., 2] += 0.035 * ramp(inside, 0.0, 0.05)
    crown = grid_piece("hat", head, surface, inside, _cloth(hair, (0.6, 0.25)))
    return [crown] if hair.hat == "beanie" else [crown, _brim(hair, head, angles, reach)]


def _brim(hair: Hair, head: Head, angles: Columns, reach: Columns) -> Piece:
    """Make a ring, or a cap's peak, from the crown's edge outward."""
    fine = np.linspace(0, 1, 60, dtype=np.float32)[:, None] * (0.02 + reach)
    points, normals, place = head.map.at(rays(_CENTRE, angles, fine.astype(np.float32)))
    # the first row outside the hat; a column that never leaves it ends with its last row
    last = np.argmax(hat_edge(hair.hat, place) < 0.003, axis=0)
    last = np.where(last == 0, len(fine) - 1, last)
    columns = np.arange(len(angles))
    edge = points[last, columns] + 0.010 * normals[last, columns]
    outward = edge - head.map.middle
    outward[:, 2] = 0
    outward = unit(outward)
    if hair.hat == "cap":  # a tongue in front that bends down at its sides
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
    keep = np.broadcast_to(width - 0.004, rings.shape[:2])
    return grid_piece("hat_brim", head, rings, keep, _cloth(hair, (0.6, 0.1)))


def _cloth(hair: Hair, size_metres: tuple[float, float]) -> Material:
    texture = np.empty((96, 256, 4), np.float32)
    grain = cv2.GaussianBlur(noise("fine", hair.seed, 96, 256), (0, 0), 0.7)
    texture[..., :3] = to_linear(hair.hat_colour) * (1 + 0.10 * grain[..., None])
    ribs = np.sin(2 * np.pi * np.arange(256) / 256 * 64) if hair.hat == "beanie" else np.zeros(256)
    texture[..., :3] *= (1 + 0.15 * ribs)[None, :, None]
    texture[..., 3] = 0.0008 * ribs
    return Material(texture, size_metres, translucency=0.1)
