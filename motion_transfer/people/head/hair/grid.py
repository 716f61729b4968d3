"""Hair as grids: columns of points that run along strands, laid on a head.

Convention: a grid's points come row by row (rows x columns), from the roots to the tips. Places on
the head's map are radians, see `head_map`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Body, BodyModel, Faces
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import bald_crown, hairline_height, ramp
from motion_transfer.people.head.faces import Hairline
from motion_transfer.people.head.head_map import HeadMap, rigid
from motion_transfer.people.head.skin_atlas import head_angle

Grid = Float32[np.ndarray, "rows columns"]
Grid3 = Float32[np.ndarray, "rows columns 3"]
Columns = Float32[np.ndarray, " columns"]
Places = Float32[np.ndarray, "columns 2"]
Parting = tuple[tuple[float, float], tuple[float, float]]
"""A parting's front and back end on the head's map."""


@dataclass(frozen=True)
class Head:
    """One body's head with what hair needs of it."""

    body: Body
    model: BodyModel
    map: HeadMap


def rays(
    part: Parting, angles: Columns, lengths: Grid, spread: tuple[float, float] = (0.7, 2.4)
) -> Float32[np.ndarray, "rows columns 2"]:
    """Find places on the head's map along rays that leave a parting sideways.

    Args:
        part: The parting.
        angles: The columns': 0 to the front, positive to the left, up to 2 pi.
        lengths: Along each ray, radians.
        spread: Rays at the first angle and before leave the front end, at the second the back end.
    """
    roots, ways = ray_roots(part, angles, spread)
    return (roots + ways * lengths[..., None]).astype(np.float32)


def ray_roots(part: Parting, angles: Columns, spread: tuple[float, float]) -> tuple[Places, Places]:
    """Find where rays leave a parting, and their unit directions; see `rays`."""
    front, back = np.array(part, np.float32)
    turn = np.abs(np.mod(angles + np.pi, 2 * np.pi) - np.pi)
    share = ramp(turn, *spread)[:, None]
    ways = np.stack([np.sin(angles), -np.cos(angles)], 1)
    return front + share * (back - front), ways


def until(roots: Places, ways: Places, radius: float) -> Columns:
    """Measure how far along each ray the map's circle of a radius is."""
    along = (roots * ways).sum(1)
    return -along + np.sqrt(np.maximum(along**2 - (roots**2).sum(1) + radius**2, 0))


@cache
def grid_faces(rows: int, columns: int, closed: bool) -> tuple[Faces, Float32[np.ndarray, "F 3 2"]]:
    """Make a grid's triangles and their corners' texture coordinates: u by column, v by row.

    Args:
        closed: The last column is joined to the first.
    Returns: arrays that all grids of this size share; not to be written to.
    """
    across = columns if closed else columns - 1
    row, column = np.divmod(np.arange((rows - 1) * across), across)
    uv_step = np.array([1 / across, 1 / (rows - 1)], np.float32)
    corners = []
    for down, right in ((0, 0), (1, 0), (1, 1), (0, 1)):
        index = (row + down) * columns + (column + right) % columns
        corners.append((index, np.stack([column + right, row + down], 1) * uv_step))
    order = [0, 1, 2, 0, 2, 3]
    faces = np.stack([corners[k][0] for k in order], 1).reshape(-1, 3)
    uv = np.stack([corners[k][1] for k in order], 1).reshape(-1, 3, 2)
    return np.ascontiguousarray(faces, np.int32), uv.astype(np.float32)


def grid_piece(name: str, head: Head, points: Grid3, keep: Grid, material: Material) -> Piece:
    """Make a piece out of a closed grid that moves with the head."""
    rows, columns = points.shape[:2]
    faces, uv = grid_faces(rows, columns, closed=True)
    return Piece(
        name=name,
        points=np.ascontiguousarray(points.reshape(-1, 3), np.float32),
        faces=faces,
        weights=rigid(head.model, rows * columns),
        corner_uv=uv,
        material=material,
        keep=np.ascontiguousarray(keep.ravel(), np.float32),
        two_sided=True,  # one looks under the edge of what stands off
    )


def inside_hairline(place: Grid3, line: Hairline) -> Grid:
    """Measure metres above the hairline, by template place; a bald crown is outside."""
    inside = place[..., 2] - hairline_height(head_angle(place), line)
    if line.crown > 0:
        # a little is left in the middle of all but the baldest crowns
        bald = bald_crown(place) - (1.02 - line.crown)
        inside = np.minimum(inside, -0.04 * bald)
    return inside.astype(np.float32)


def lumps(rng: np.random.Generator, rows: int, columns: int, size: float) -> Grid:
    """Draw smooth noise on a closed grid, deviation 1; `size` in cells."""
    grain = rng.standard_normal((rows, columns)).astype(np.float32)
    wide = np.concatenate([grain, grain, grain], 1)
    soft = cv2.GaussianBlur(wide, (0, 0), size, borderType=cv2.BORDER_REFLECT)
    soft = soft[:, columns : 2 * columns]
    return soft / max(float(soft.std()), 1e-6)
