"""Skirts and long hair of photographed items, moved as the project's own are: hanging, and clear.

A photographed skirt is hung into a cage: one of the project's skirts, a grid of the same size,
moves and is pushed out of the legs, and takes the cloth's points along. Long hair keeps to the
head down to the ears; below, it hangs down however the head is held, and is pushed out of neck,
shoulders and trunk. Lengths are metres, chosen by eye.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from scipy.sparse import coo_array, csr_array, diags_array

# the stubs leave cKDTree out; its subclass KDTree takes twice as long a query
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.skirts import COLUMNS, ROWS, SkirtShape, settler, skirt_weights
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.figure.body import Body, BodyModel, Faces, Points, SkinWeights
from motion_transfer.people.figure.mesh import PosedBody, Settle
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.hair.drape import Obstacle, obstacle
from motion_transfer.people.head.skin_atlas import unit

HINGE_METRES = 0.02  # above the head's joint, which lies between the ears
LOOSE_METRES = 0.10  # below the hinge, from where on hair hangs freely
CLEAR_METRES = 0.008  # between skin and hair
LONGEST_PUSH = 0.08  # in a round: what is deeper may be on the other side of the body
ROUNDS = 3  # of pushing out and smoothing
SPREADS = 4  # how far a push takes along what is around it, in edges of the mesh


@dataclass(frozen=True)
class HungSkirt:
    """A skirt's points in the cage that moves them.

    Attributes:
        weights: How the bones move the points.
        settle: Brings posed points to where gravity and the legs leave them.
    """

    weights: SkinWeights
    settle: Settle


def hang_skirt(points: Points, body: Body, surface: BodySurface) -> HungSkirt:
    """Make a cage around a skirt at rest and hang its points into it."""
    fitting = Fitting(surface, body)
    _, axis = fitting.trunk
    x, y, z = points[:, 0], points[:, 1] - axis, points[:, 2]
    angle = np.mod(np.arctan2(x, -y), 2 * np.pi)
    radius = np.hypot(x, y)
    heights = np.linspace(z.max(), z.min(), ROWS, dtype=np.float32)
    turns = np.arange(COLUMNS, dtype=np.float32) * np.float32(2 * np.pi / COLUMNS)
    # the cage is as wide as the points around each of its own; a turn counts like its arc
    wide = float(radius.mean())
    spots = np.stack([wide * np.sin(angle), wide * np.cos(angle), z], 1)
    row, turn = np.meshgrid(heights, turns, indexing="ij")
    cells = np.stack([wide * np.sin(turn), wide * np.cos(turn), row], -1)
    _, near = cKDTree(spots).query(cells, k=4)
    out = radius[near].mean(-1).astype(np.float32)
    outward = np.stack([np.sin(turn), -np.cos(turn), 0 * turn], -1).astype(np.float32)
    cage = outward * out[..., None]
    cage[..., 1] += axis
    cage[..., 2] = row
    down = np.concatenate([[0], np.cumsum(-np.diff(heights))]).astype(np.float32)
    hip = float(body.joint("upperleg01.L")[2]) - 0.07 * fitting.scale
    shape = SkirtShape(
        points=cage.reshape(-1, 3),
        outward=outward.reshape(-1, 3),
        weights=skirt_weights(fitting, heights, cage[..., 0], out, hip),
        down=down,
        around=2 * np.pi * wide,
    )
    into = _into_grid(angle, z, heights)
    move = settler(shape, surface)

    def settle(posed: Points, around: PosedBody) -> Points:
        hung = shape.weights.pose(shape.points, around.transforms)
        moved = _widened((move(hung, around) - hung).reshape(ROWS, COLUMNS, 3))
        return (posed + into @ moved.reshape(-1, 3)).astype(np.float32)

    return HungSkirt(SkinWeights(csr_array(into @ shape.weights.matrix)), settle)


def _into_grid(angle: np.ndarray, z: np.ndarray, heights: np.ndarray) -> csr_array:
    """Interpolate points between the grid's columns and rows: V x ROWS * COLUMNS, rows sum to 1."""
    across = angle * (COLUMNS / (2 * np.pi))
    along = (heights[0] - z) / (heights[0] - heights[-1]) * (ROWS - 1)
    column, row = across.astype(int), np.clip(along.astype(int), 0, ROWS - 2)
    right, below = across - column, np.clip(along - row, 0, 1)
    rows, columns, shares = [], [], []
    for k, share_k in ((0, 1 - below), (1, below)):
        for j, share_j in ((0, 1 - right), (1, right)):
            rows.append(np.arange(len(z)))
            columns.append((row + k) * COLUMNS + (column + j) % COLUMNS)
            shares.append(share_k * share_j)
    entries = (
        np.concatenate(shares).astype(np.float32),
        tuple(map(np.concatenate, (rows, columns))),
    )
    return csr_array(coo_array(entries, shape=(len(z), ROWS * COLUMNS)))


def _widened(
    moved: Float32[np.ndarray, "rows columns 3"],
) -> Float32[np.ndarray, "rows columns 3"]:
    """Move each column as far as the one within two of it that moves most.

    The cage is coarse: where a leg meets one column and just misses the next, it would show.
    """
    choices = np.stack([np.roll(moved, step, 1) for step in (0, 1, -1, 2, -2)])
    most = (choices**2).sum(-1).argmax(0)
    return np.take_along_axis(choices, most[None, ..., None], 0)[0]


def hang_hair(points: Points, faces: Faces, body: Body, model: BodyModel) -> Settle | None:
    """Make what lets long hair hang; None for hair that ends at the ears.

    Args:
        points: At rest; they are posed with the head.
    """
    hinge = body.joint("head") + np.array([0, 0, HINGE_METRES])
    below = (hinge[2] - points[:, 2]).astype(np.float32)
    if below.max() < LOOSE_METRES:
        return None
    loose = ramp(below, 0.0, LOOSE_METRES)
    down = np.maximum(below, 0)[:, None] * np.array([0, 0, -1], np.float32)
    head = model.skeleton.index["head"]
    skin = _Clearance(obstacle(body, model), _neighbours(faces, len(points)), loose)

    def settle(posed: Points, around: PosedBody) -> Points:
        # each point hangs from the one above it at the hinge's height, which goes with the head
        turned = around.transforms[head][:, :3]
        return skin.push(posed + loose[:, None] * (down - down @ turned.T), around)

    return settle


@dataclass(frozen=True)
class _Clearance:
    """Keeps posed points outside of the skin.

    Attributes:
        skin: What they keep clear of.
        mean: V x V, gives each point the mean of its neighbours.
        free: V, how far each may be pushed, 0 not at all .. 1.
    """

    skin: Obstacle
    mean: csr_array
    free: Float32[np.ndarray, " V"]

    def push(self, points: Points, body: PosedBody) -> Points:
        placed = body.points[self.skin.index]
        turns = self.skin.weights.matrix @ body.transforms[:, :, :3].reshape(-1, 9)
        outward = unit((turns.reshape(-1, 3, 3) @ self.skin.normals[:, :, None])[..., 0])
        tree = cKDTree(placed, balanced_tree=False, compact_nodes=False)
        own = np.flatnonzero(self.free > 0)
        out = points
        for _ in range(ROUNDS):
            _, near = tree.query(out[own])
            normal = outward[near]
            depth = CLEAR_METRES - ((out[own] - placed[near]) * normal).sum(1)
            push = np.zeros_like(out)
            push[own] = (np.clip(depth, 0, LONGEST_PUSH) * self.free[own])[:, None] * normal
            spread = push
            for _ in range(SPREADS):  # what is around goes along
                spread = self.mean @ spread
                further = (spread**2).sum(1) < (push**2).sum(1)
                spread = np.where(further[:, None], push, spread)
            out = out + spread
        return out.astype(np.float32)


def _neighbours(faces: Faces, count: int) -> csr_array:
    """Give each point the mean of itself and those that edges join it to."""
    start, end = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    own = np.arange(count)
    where = (np.concatenate([start, own]), np.concatenate([end, own]))
    links = csr_array(coo_array((np.ones(len(where[0]), np.float32), where), shape=(count, count)))
    links.data[:] = 1
    degree = np.asarray(links.sum(1)).ravel()
    return csr_array(diags_array(1 / degree, dtype=np.float32) @ links)
