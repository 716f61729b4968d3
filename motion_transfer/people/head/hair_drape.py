"""Lets strands of hair fall: along the body's skin where they meet it, straight down where not.

A strand is marched from its root, one step at a time and all strands at once: each step goes on in
the strand's direction, turned towards the ground, and is pushed out of the nearest skin.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float32

# the stubs leave it out; its subclass KDTree takes twice as long a query
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from motion_transfer.people.figure.body import Body, BodyModel, Faces, Points, SkinWeights
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.head.skin_atlas import components, vertex_normals

Strands = Float32[np.ndarray, "steps strands 3"]


@dataclass(frozen=True)
class Obstacle:
    """The skin that hair can meet: the head's lower part, neck, shoulders, upper arms and torso.

    Attributes:
        index: of the body's vertices.
        weights: of those.
        faces: all triangles around them.
        torso: index of the bone whose frame tells front from back.
        neck: index of the bone at the nape.
    """

    index: np.ndarray
    weights: SkinWeights
    faces: Faces
    torso: int
    neck: int


_OBSTACLES: WeakKeyDictionary[BodyModel, Obstacle] = WeakKeyDictionary()


def obstacle(model: BodyModel) -> Obstacle:
    """The vertices that stand for the skin, evenly spread; chosen once a model."""
    found = _OBSTACLES.get(model)
    if found is not None:
        return found
    points, names = model.template.points, model.skeleton.names
    part = components(model.faces, len(points)) == 0
    starts = ("head", "neck", "clavicle", "shoulder", "upperarm", "spine")
    bones = np.flatnonzero([name.startswith(starts) for name in names])
    share = np.asarray(model.weights.matrix[:, bones].sum(1)).ravel()
    ear = (np.abs(points[:, 0]) > 0.078) & (points[:, 2] > 1.66)
    wanted = np.flatnonzero(
        part & (share > 0.6) & (points[:, 2] < 1.80) & (points[:, 2] > 1.0) & ~ear
    )
    normals = vertex_normals(points, model.faces)
    middle = points[wanted] - [0, -0.05, 0]
    outward = (normals[wanted] * middle)[:, :2].sum(1) + 0.05 * normals[wanted, 2] > -0.02
    wanted = wanted[outward]
    # one vertex a cell: the face is much finer than hair needs
    cell = np.where(points[wanted, 2:] > 1.60, 0.020, 0.032)
    _, first = np.unique(np.floor(points[wanted] / cell).astype(int), axis=0, return_index=True)
    index = np.sort(wanted[first])
    around = model.faces[np.isin(model.faces, index).any(1)]
    found = Obstacle(
        index, model.weights.rows(index), around, names.index("spine01"), names.index("neck02")
    )
    _OBSTACLES[model] = found
    return found


@dataclass(frozen=True)
class Fall:
    """How strands hang.

    Attributes:
        step: metres from one point of each strand to its next, one for each strand.
        steps: points of a strand after its root.
        clear: metres between skin and hair, one for each strand.
        front: one for each strand: -1 falls behind the shoulder, 1 in front of it.
        cohesion: strands x strands, rows sum to 1: where each strand would be in the middle of its
            neighbours.
        aside: metres to the torso's left of the neck at which strands in front of the shoulder come
            to lie; not used for the others.
        stiffness: how much of its direction a strand keeps a step, 0 .. 1.
        inward: how much the ends turn in (a bob) or, if negative, flip out.
    """

    step: Float32[np.ndarray, " strands"]
    steps: int
    clear: Float32[np.ndarray, " strands"]
    front: Float32[np.ndarray, " strands"]
    cohesion: Float32[np.ndarray, "strands strands"]
    aside: Float32[np.ndarray, " strands"]
    stiffness: float = 0.55
    inward: float = 0.0


def rest_normals(body: Body, skin: Obstacle) -> Points:
    """Outward normals of the obstacle's vertices at rest."""
    return vertex_normals(body.points, skin.faces)[skin.index]


def drape(
    roots: Float32[np.ndarray, "strands 3"],
    directions: Float32[np.ndarray, "strands 3"],
    fall: Fall,
    skin: Obstacle,
    normals: Points,
    posed: PosedBody,
) -> Strands:
    """March strands from their roots.

    Args:
        directions: unit; in which each strand leaves its root.
        normals: of the obstacle's vertices at rest, see `rest_normals`.
    Returns: the points after the roots.
    """
    points = posed.points[skin.index]
    turned = (skin.weights.matrix @ posed.transforms[:, :, :3].reshape(-1, 9)).reshape(-1, 3, 3)
    outward = (turned @ normals[:, :, None])[..., 0]
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-6)
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    torso = posed.transforms[skin.torso]
    forward, left = -torso[:, 1], torso[:, 0]  # the person faces -y at rest
    neck = posed.joints[skin.neck].astype(np.float32)
    clear = fall.clear
    down = np.array([0, 0, -1], np.float32)
    out = np.empty((fall.steps, len(roots), 3), np.float32)
    at, way = roots, directions
    touched = np.zeros(len(roots), np.float32)
    for k in range(fall.steps):
        ahead = (at - neck) @ forward
        # on the shoulder hair slides to the side it is on, or to the one it prefers
        side = np.tanh(ahead / 0.10 + 2.0 * fall.front)
        pull = down + (0.15 * fall.front + 0.9 * touched * side)[:, None] * forward
        # and does not spread over the arms
        aside = (at - neck) @ left
        pull = (
            pull
            - (touched * (aside - np.clip(aside, -0.12, 0.12)) / 0.03).clip(-1, 1)[:, None] * left
        )
        below = np.clip((neck[2] - at[:, 2]) / 0.10, 0, 1) * (fall.front > 0)
        pull = pull + (below * ((fall.aside - aside) / 0.06).clip(-0.7, 0.7))[:, None] * left
        late = fall.inward * max(0.0, (k + 1) / fall.steps - 0.5)
        if late:
            home = (neck - at) * np.array([1, 1, 0], np.float32)
            pull = pull + late * home / np.maximum(
                np.linalg.norm(home, axis=1, keepdims=True), 1e-6
            )
        way = fall.stiffness * way + (1 - fall.stiffness) * pull
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
        new = at + fall.step[:, None] * way
        new = new + 0.6 * (fall.cohesion @ new - new)
        _, near = tree.query(new)
        normal = outward[near]
        depth = clear - ((new - points[near]) * normal).sum(1)
        new = new + np.maximum(depth, 0)[:, None] * normal
        touched = np.where(depth > -0.004, np.clip(normal[:, 2] + 0.3, 0, 1), 0).astype(np.float32)
        way = (new - at) / np.maximum(np.linalg.norm(new - at, axis=1, keepdims=True), 1e-6)
        at = out[k] = new.astype(np.float32)
    return out
