"""Hair that falls: along the body's skin where it meets it, straight down where not.

A strand is marched from its root, one step at a time and all strands at once: each step goes on in
the strand's direction, turned towards the ground, and is pushed out of the nearest skin. What is
tied is here as well: pony tails and braids, which fall as one strand, and buns.

Lengths are metres. Weights and distances were chosen by eye, on bodies of all builds with the head
turned and the trunk bent, so that hair neither sinks into the skin nor stands off it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float32

# the stubs leave cKDTree out; its subclass KDTree takes twice as long a query
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from motion_transfer.people.figure.body import Body, BodyModel, Faces, Points, SkinWeights
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.brushes import ramp
from motion_transfer.people.head.hair.cap import hair_material, tie_place
from motion_transfer.people.head.hair.grid import Head, grid_faces, grid_piece, lumps
from motion_transfer.people.head.hair.styles import Hair
from motion_transfer.people.head.head_map import rigid
from motion_transfer.people.head.skin_atlas import components, unit, vertex_normals

Strands = Float32[np.ndarray, "steps strands 3"]
Numbers = Float32[np.ndarray, " strands"]
Vectors = Float32[np.ndarray, "strands 3"]

DOWN = np.array([0, 0, -1], np.float32)
LEAN = 0.15  # of the pull: how far strands lean forward or back besides falling
SLIDE = 0.9  # of the pull: how far they slide off what they lie on
SIDE_METRES = 0.10  # from the neck over which it becomes clear on which side of a shoulder hair is
PREFERENCE = 2.0  # which side a strand prefers counts like lying 20 cm on it
ARMS_METRES = 0.12  # from the neck sideways; further out hair would spread over the arms
FREE_METRES = 0.10  # below the neck, where hair in front of the shoulder takes its place
CLOSE = 0.6  # share of the way that a strand goes to the middle of its neighbours a step
TOUCH_METRES = 0.004  # hair that is so near the skin lies on it
_AROUND, _STEPS = 14, 14  # points around a tail, and along it after its root


@dataclass(frozen=True)
class Obstacle:
    """The skin that hair can meet: the head's lower part, neck, shoulders, upper arms and torso.

    Attributes:
        index: Which of the body's vertices.
        weights: Their weights.
        normals: Their outward normals at rest.
    """

    index: np.ndarray
    weights: SkinWeights
    normals: Points


def obstacle(body: Body, model: BodyModel) -> Obstacle:
    """Find what of a body's skin hair can meet."""
    index, weights, faces = _skin_vertices(model)
    return Obstacle(index, weights, vertex_normals(body.points, faces)[index])


@lru_cache(maxsize=1)
def _skin_vertices(model: BodyModel) -> tuple[np.ndarray, SkinWeights, Faces]:
    """Choose vertices that stand for the skin, evenly spread; and all triangles around them."""
    points, names = model.template.points, model.skeleton.names
    part = components(model.faces, len(points)) == 0
    starts = ("head", "neck", "clavicle", "shoulder", "upperarm", "spine")
    bones = np.flatnonzero([name.startswith(starts) for name in names])
    share = np.asarray(model.weights.matrix[:, bones].sum(1)).ravel()
    # hair lies over ears as if there were none
    ear = (np.abs(points[:, 0]) > 0.078) & (points[:, 2] > 1.66)
    wanted = np.flatnonzero(
        part & (share > 0.6) & (points[:, 2] < 1.80) & (points[:, 2] > 1.0) & ~ear
    )
    # not what faces inwards: nostrils, lips, armpits
    normals = vertex_normals(points, model.faces)
    middle = points[wanted] - [0, -0.05, 0]
    outward = (normals[wanted] * middle)[:, :2].sum(1) + 0.05 * normals[wanted, 2] > -0.02
    wanted = wanted[outward]
    # one vertex a cell: the face is much finer than hair needs
    cell = np.where(points[wanted, 2:] > 1.60, 0.020, 0.032)
    _, first = np.unique(np.floor(points[wanted] / cell).astype(int), axis=0, return_index=True)
    index = np.sort(wanted[first])
    return index, model.weights.rows(index), model.faces[np.isin(model.faces, index).any(1)]


@dataclass(frozen=True)
class Fall:
    """How strands hang.

    Attributes:
        step: Metres from one point of each strand to its next, one for each strand.
        steps: Points of a strand after its root.
        clear: Metres between skin and hair, one for each strand.
        front: One for each strand: -1 falls behind the shoulder, 1 in front of it.
        cohesion: Strands x strands, rows sum to 1: where each strand would be in the middle of its
            neighbours.
        aside: Metres to the torso's left of the neck at which strands in front of the shoulder come
            to lie; not used for the others.
        stiffness: How much of its direction a strand keeps a step, 0 .. 1.
        inward: How much the ends turn in (a bob) or, if negative, flip out.
    """

    step: Numbers
    steps: int
    clear: Numbers
    front: Numbers
    cohesion: Float32[np.ndarray, "strands strands"]
    aside: Numbers
    stiffness: float
    inward: float = 0.0


def drape(
    roots: Vectors, directions: Vectors, fall: Fall, skin: Obstacle, posed: PosedBody
) -> Strands:
    """March strands from their roots, which each leaves in a direction (a unit vector).

    Returns: the points after the roots.
    """
    points = posed.points[skin.index]
    turned = (skin.weights.matrix @ posed.transforms[:, :, :3].reshape(-1, 9)).reshape(-1, 3, 3)
    outward = unit((turned @ skin.normals[:, :, None])[..., 0])
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    bones = posed.body.skeleton.index
    neck = posed.joints[bones["neck02"]].astype(np.float32)
    torso = posed.transforms[bones["spine01"]]  # its frame tells front from back
    out = np.empty((fall.steps, len(roots), 3), np.float32)
    at, way = roots, directions
    touched = np.zeros(len(roots), np.float32)  # how much each strand lies on something
    for k in range(fall.steps):
        pull = _pull(at, touched, k, fall, neck, torso)
        way = unit(fall.stiffness * way + (1 - fall.stiffness) * pull)
        new = at + fall.step[:, None] * way
        new = new + CLOSE * (fall.cohesion @ new - new)
        _, near = tree.query(new)
        normal = outward[near]
        depth = fall.clear - ((new - points[near]) * normal).sum(1)
        new = new + np.maximum(depth, 0)[:, None] * normal
        # skin that faces up carries hair; what overhangs, by up to 17 degrees, carries a little
        carried = np.clip(normal[:, 2] + 0.3, 0, 1)
        touched = np.where(depth > -TOUCH_METRES, carried, 0).astype(np.float32)
        way = unit(new - at)
        at = out[k] = new.astype(np.float32)
    return out


def _pull(
    at: Vectors, touched: Numbers, step: int, fall: Fall, neck: np.ndarray, torso: np.ndarray
) -> Vectors:
    """Find where strands would go next if they were limp: down, off the shoulders and arms."""
    forward, left = -torso[:, 1], torso[:, 0]  # the person faces -y at rest
    # on the shoulder hair slides to the side it is on, or to the one it prefers
    ahead = (at - neck) @ forward
    side = np.tanh(ahead / SIDE_METRES + PREFERENCE * fall.front)
    pull = DOWN + (LEAN * fall.front + SLIDE * touched * side)[:, None] * forward
    # and does not spread over the arms: it is pushed back, with full strength from 3 cm on
    aside = (at - neck) @ left
    beyond = touched * (aside - np.clip(aside, -ARMS_METRES, ARMS_METRES)) / 0.03
    pull = pull - beyond.clip(-1, 1)[:, None] * left
    # in front of them it gathers where it belongs, drawn with full strength from 4 cm on
    below = np.clip((neck[2] - at[:, 2]) / FREE_METRES, 0, 1) * (fall.front > 0)
    pull = pull + (below * ((fall.aside - aside) / 0.06).clip(-0.7, 0.7))[:, None] * left
    late = fall.inward * max(0.0, (step + 1) / fall.steps - 0.5)
    if late:  # the lower half turns to the neck, or away from it
        home = (neck - at) * np.array([1, 1, 0], np.float32)
        pull = pull + late * home / np.maximum(np.linalg.norm(home, axis=1, keepdims=True), 1e-6)
    return pull


@dataclass(frozen=True)
class Tail:
    """Settles a tube around a strand that hangs from where it is tied.

    Attributes:
        radius: (STEPS + 1) x AROUND, metres from the strand.
        fall: How the strand hangs.
        skin: What it keeps clear of.
    """

    radius: Float32[np.ndarray, "rows around"]
    fall: Fall
    skin: Obstacle

    def __call__(self, points: Points, posed: PosedBody) -> Points:
        # the last three points belong to no triangle and move with the head
        root, ahead, beside = points[-3:]
        way = (ahead - root) / max(float(np.linalg.norm(ahead - root)), 1e-6)
        strand = drape(root[None], way[None], self.fall, self.skin, posed)[:, 0]
        line = np.concatenate([root[None], strand])
        tangent = unit(np.gradient(line, axis=0))
        first = beside - root
        first = unit(first - (tangent @ first)[:, None] * tangent)
        second = np.cross(tangent, first)
        turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)[None, :, None]
        circle = np.cos(turn) * first[:, None] + np.sin(turn) * second[:, None]
        out = line[:, None] + self.radius[..., None] * circle
        return np.concatenate([out.reshape(-1, 3), points[-3:]]).astype(np.float32)


def tail_piece(hair: Hair, head: Head, rest: PosedBody) -> Piece:
    """Make a pony tail, or a braid."""
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
    one = np.ones(1, np.float32)
    step = hair.length / _STEPS
    alone = np.eye(1, dtype=np.float32)
    fall = Fall(one * step, _STEPS, one * thick, -one, alone, 0 * one, stiffness=0.35)
    tail = Tail(radius.astype(np.float32), fall, obstacle(head.body, head.model))
    tube = np.zeros((radius.size, 3), np.float32)
    # three points at rest: where the tail begins, one further along, and one beside it
    at, normal, _ = head.map.at(np.array([[tie_place(hair)]], np.float32))
    # a low tail falls from its tie at once, a high one stands off first
    out = normal[0, 0] + np.array([0, 0, 0.1 - 0.6 * (1 - hair.tie)], np.float32)
    out /= np.linalg.norm(out)
    root = at[0, 0] + 0.5 * thick * out
    start = np.stack([root, root + 0.1 * out, root + np.array([0.1, 0, 0])])
    points = tail(np.concatenate([tube, start.astype(np.float32)]), rest)
    faces, uv = grid_faces(_STEPS + 1, _AROUND, closed=True)
    # ragged ends: some of the tube's columns stop short by a few hundredths of its length
    short = rng.gamma(1.3, 0.04, _AROUND) + 0.02
    keep = np.broadcast_to(1 - short - along, radius.shape)
    return Piece(
        name="hair_tail",
        points=points,
        faces=faces,
        weights=rigid(head.model, len(points)),
        corner_uv=uv,
        material=hair_material(hair, (0.25, hair.length)),
        keep=np.append(keep * hair.length, [-1, -1, -1]).astype(np.float32),
        two_sided=True,
        settle=tail,
    )


def bun_piece(hair: Hair, head: Head) -> Piece:
    """Make a knot of hair at the back of the head or on top of it."""
    rng = np.random.default_rng(hair.seed + 1)
    rows, columns = 12, 20
    at, normal, _ = head.map.at(np.array([[tie_place(hair)]], np.float32))
    size = 0.030 + 0.014 * rng.random() + 0.3 * hair.volume
    polar = np.linspace(0.05, np.pi - 0.05, rows)[:, None]  # not quite to the poles: no point twice
    turn = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None]
    around = np.stack(
        [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], -1
    )
    twist = 1 + 0.06 * np.sin(3 * turn + 4 * polar) + 0.05 * lumps(rng, rows, columns, 1.0)
    at, normal = at[0, 0], normal[0, 0]
    first = np.cross(normal, [0.0, 0.0, 1.0]) + np.array([1e-3, 0.0, 0.0])
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first), normal])
    axes *= np.array([[1.0], [1.0], [0.75]])  # flattened against the head
    points = at + 0.55 * size * normal + size * (twist[..., None] * around) @ axes
    keep = np.ones((rows, columns), np.float32)
    bun = grid_piece("hair_bun", head, points, keep, hair_material(hair, (0.2, 0.1)))
    # u and v change places: strands are wound around
    return replace(bun, corner_uv=np.ascontiguousarray(bun.corner_uv[..., ::-1]))
