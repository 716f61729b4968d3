"""What is tied: pony tails, braids and buns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.hair_cap import hair_material, tie_place
from motion_transfer.people.head.hair_drape import Fall, Obstacle, drape, obstacle, rest_normals
from motion_transfer.people.head.hair_grid import Head, grid_faces, lumps
from motion_transfer.people.head.hair_styles import Hair

_AROUND, _STEPS = 14, 14


@dataclass(frozen=True)
class Tail:
    """Settles a tube around a strand that hangs from where it is tied.

    Attributes:
        radius: (STEPS + 1) x AROUND, metres from the strand.
        fall: of the strand.
    """

    radius: Float32[np.ndarray, "rows around"]
    fall: Fall
    skin: Obstacle
    normals: Points

    def __call__(self, points: Points, posed: PosedBody) -> Points:
        # the last three points belong to no triangle and move with the head
        root, ahead, beside = points[-3:]
        way = (ahead - root) / max(float(np.linalg.norm(ahead - root)), 1e-6)
        strand = drape(root[None], way[None], self.fall, self.skin, self.normals, posed)[:, 0]
        line = np.concatenate([root[None], strand])
        tangent = np.gradient(line, axis=0)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-6)
        first = beside - root
        first = first - (tangent @ first)[:, None] * tangent
        first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-6)
        second_axis = np.cross(tangent, first)
        turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)[None, :, None]
        circle = np.cos(turn) * first[:, None] + np.sin(turn) * second_axis[:, None]
        out = line[:, None] + self.radius[..., None] * circle
        return np.concatenate([out.reshape(-1, 3), points[-3:]]).astype(np.float32)


def tail_piece(hair: Hair, head: Head, rest: PosedBody) -> Piece:
    """A pony tail, or a braid."""
    rng = np.random.default_rng(hair.seed + 1)
    along = np.linspace(0, 1, _STEPS + 1, dtype=np.float32)[:, None]
    thick = 0.021 + 0.35 * hair.volume
    if hair.style == "braid":
        # the plait's bulges alternate from side to side
        turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)[None]
        bulge = 0.25 * np.cos(turn + np.pi * (np.arange(_STEPS + 1)[:, None] % 2))
        radius = 0.8 * thick * (1 + bulge) * (1 - 0.45 * along)
    else:
        swell = ramp(along, 0.0, 0.30) * (1 - 0.55 * ramp(along, 0.45, 1.0))
        radius = thick * (0.45 + 0.75 * swell) * (1 + 0.10 * lumps(rng, _STEPS + 1, _AROUND, 1.0))
        radius = radius + hair.wave * np.sin(6 * np.pi * along)
    skin = obstacle(head.model)
    one = np.ones(1, np.float32)
    step = hair.length / _STEPS
    fall = Fall(
        one * step, _STEPS, one * thick, -one, np.eye(1, dtype=np.float32), 0 * one, stiffness=0.35
    )
    tail = Tail(radius.astype(np.float32), fall, skin, rest_normals(head.body, skin))
    tube = np.zeros((radius.size, 3), np.float32)
    points = tail(np.concatenate([tube, _start(hair, head, thick)]), rest)
    faces, uv = grid_faces(_STEPS + 1, _AROUND, closed=True)
    short = rng.gamma(1.3, 0.04, _AROUND) + 0.02
    keep = np.broadcast_to(1 - short - along, radius.shape)
    return Piece(
        name="hair_tail",
        points=points,
        faces=faces,
        weights=head.rigid(len(points)),
        corner_uv=uv,
        material=hair_material(hair, (0.25, hair.length)),
        keep=np.append(keep * hair.length, [-1, -1, -1]).astype(np.float32),
        two_sided=True,
        settle=tail,
    )


def _start(hair: Hair, head: Head, thick: float) -> Points:
    """Three points at rest: where the tail begins, one further along it, and one beside it."""
    at, normal, _ = head.map.at(np.array([[tie_place(hair)]], np.float32))
    at, normal = at[0, 0], normal[0, 0]
    out = normal + np.array([0, 0, 0.1 - 0.6 * (1 - hair.tie)], np.float32)
    out /= np.linalg.norm(out)
    root = at + 0.5 * thick * out
    beside = root + np.array([0.1, 0, 0])
    return np.stack([root, root + 0.1 * out, beside]).astype(np.float32)


def bun_piece(hair: Hair, head: Head) -> Piece:
    """A knot of hair at the back of the head or on top of it."""
    rng = np.random.default_rng(hair.seed + 1)
    rows, columns = 12, 20
    at, normal, _ = head.map.at(np.array([[tie_place(hair)]], np.float32))
    size = 0.030 + 0.014 * rng.random() + 0.3 * hair.volume
    polar = np.linspace(0.05, np.pi - 0.05, rows)[:, None]
    turn = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None]
    around = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], -1
    )
    twist = 1 + 0.06 * np.sin(3 * turn + 4 * polar) + 0.05 * lumps(rng, rows, columns, 1.0)
    axes = _frame(normal[0, 0]) * np.array([[1.0], [1.0], [0.75]])
    points = at[0, 0] + 0.55 * size * normal[0, 0] + size * (twist[..., None] * around) @ axes
    faces, uv = grid_faces(rows, columns, closed=True)
    return Piece(
        name="hair_bun",
        points=np.ascontiguousarray(points.reshape(-1, 3), np.float32),
        faces=faces,
        weights=head.rigid(rows * columns),
        corner_uv=np.ascontiguousarray(uv[..., ::-1]),  # strands are wound around
        material=hair_material(hair, (0.2, 0.1)),
        keep=np.ones(rows * columns, np.float32),
        two_sided=True,
    )


def _frame(normal: np.ndarray) -> np.ndarray:
    """Rows: two directions along a surface, and its normal."""
    first = np.cross(normal, [0.0, 0.0, 1.0]) + np.array([1e-3, 0.0, 0.0])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])
