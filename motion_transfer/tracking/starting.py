"""Where a fit begins: whose left is left, and postures from where limbs point.

BlazePose sometimes takes a person's front for the back and calls all left landmarks right ones. A
person does not turn about within a frame, so such frames are found and their names exchanged.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from motion_transfer.estimate.interface import LANDMARK, LANDMARK_NAMES, Landmarks
from motion_transfer.people import ARM_AT_ZERO, LEG_AT_ZERO
from motion_transfer.tracking.puppet import GROUPS, Matrices, Postures, Puppet, Vectors

TURN_DEGREES = 20.0
"""How far a quick dancer turns within a frame of a thirtieth of a second."""

EXCHANGED = np.array([0.0, 1.0])
"""What a frame costs: as BlazePose reads it, and with names exchanged."""

MOST_COST = 40.0
"""Of a turn from one frame to the next, in frames with exchanged names: a turn about that lasts
longer than twice that is believed."""

TO_WORLD = np.diag([1.09, 0.93, 1.09]) @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From BlazePose's metres (y down, z away) to the world of a level camera. The factors are those
that bring its metres nearest to the true ones of synthetic people: it takes them for small, and its
depths err, so that shallower ones err less."""


@dataclass(frozen=True)
class Observed:
    """The landmarks of N frames of one shot.

    Attributes:
        image: X and y, px.
        world: Metres from the middle of the hips, in the axes of a level camera's world.
        weight: Of each landmark, 0..1; all 0 in frames that show nobody.
    """

    image: Float64[np.ndarray, "N 33 2"]
    world: Float64[np.ndarray, "N 33 3"]
    weight: Float64[np.ndarray, "N 33"]

    def __len__(self) -> int:
        return len(self.image)

    def at(self, frames: slice | np.ndarray) -> Observed:
        """Take some of the frames."""
        return Observed(self.image[frames], self.world[frames], self.weight[frames])

    @property
    def seen(self) -> Bool[np.ndarray, " N"]:
        """Which frames show somebody."""
        return self.weight.max(axis=1) > 0


LEAST_WEIGHT = 0.05
"""Of a landmark that BlazePose guesses: behind something, or outside of the picture."""


def observe(found: list[Landmarks | None]) -> Observed:
    """Gather landmarks; frames without any repeat the nearest ones with weight 0.

    Raises: ValueError if there are none at all.
    """
    there = np.array([one is not None for one in found])
    if not there.any():
        raise ValueError("no landmarks")
    known = np.flatnonzero(there)
    nearest = known[np.abs(np.arange(len(found))[:, None] - known).argmin(1)]
    rows = [found[index] for index in nearest]
    image = np.array([row.image[:, :2] for row in rows if row], np.float64)
    world = np.array([row.world for row in rows if row], np.float64) @ TO_WORLD.T
    sure = np.array([row.visibility * row.presence for row in rows if row], np.float64)
    weight = LEAST_WEIGHT + (1 - LEAST_WEIGHT) * sure
    return Observed(image, world, weight * there[:, None])


OTHER_SIDE = [
    LANDMARK[name.replace("left", "?").replace("right", "left").replace("?", "right")]
    for name in LANDMARK_NAMES
]
"""For each landmark the same one of the other side."""


def find_flipped(observed: Observed, frame_rate: float) -> Bool[np.ndarray, " N"]:
    """Find the frames in which left and right are exchanged.

    Of both readings of each frame those are taken that need the least turning in all, and few
    exchanges (by dynamic programming).
    """
    facing = _facing(observed.world)
    readings = np.stack([facing, facing + np.pi], 1)
    width = np.radians(TURN_DEGREES) * 30 / frame_rate
    cost = np.zeros(2)
    came_from = np.zeros((len(observed), 2), int)
    for frame in range(len(observed)):
        if frame:
            away = readings[frame][None, :] - readings[frame - 1][:, None]
            away = (away + np.pi) % (2 * np.pi) - np.pi
            total = cost[:, None] + np.minimum((away / width) ** 2, MOST_COST)
            came_from[frame] = total.argmin(0)
            cost = total.min(0)
        cost = cost + EXCHANGED
    flipped = np.zeros(len(observed), bool)
    state = int(cost.argmin())
    for frame in reversed(range(len(observed))):
        flipped[frame] = state == 1
        state = int(came_from[frame, state])
    return flipped


def unflipped(observed: Observed, flipped: Bool[np.ndarray, " N"]) -> Observed:
    """Exchange left and right in some frames."""
    values = [observed.image, observed.world, observed.weight]
    shapes = [flipped[(slice(None), *([None] * (value.ndim - 1)))] for value in values]
    image, world, weight = (
        np.where(shape, value[:, OTHER_SIDE], value)
        for shape, value in zip(shapes, values, strict=True)
    )
    return Observed(image, world, weight)


def _facing(world: Float64[np.ndarray, "N 33 3"]) -> Float64[np.ndarray, " N"]:
    """Tell which way the left hand points, radians about the vertical."""
    left, right = (
        [LANDMARK[f"{side}-{name}"] for name in ("shoulder", "hip")] for side in ("left", "right")
    )
    across = (world[:, left] - world[:, right]).sum(1)
    return np.arctan2(across[:, 1], across[:, 0])


def first_postures(
    puppet: Puppet, observed: Observed, focal: float, centre: tuple[float, float]
) -> Postures:
    """Guess postures from BlazePose's metres, and places from how large the picture shows them."""
    world, rest = observed.world, puppet.landmarks

    def at(name: str) -> Vectors:
        return world[:, LANDMARK[name]]

    trunk = [
        LANDMARK[f"{side}-{name}"] for side in ("left", "right") for name in ("shoulder", "hip")
    ]
    pelvis = aligned(rest[trunk], world[:, trunk])
    head = aligned(rest[GROUPS["head"]], world[:, GROUPS["head"]])
    neck = Rotation.from_matrix(pelvis.swapaxes(1, 2) @ head).as_rotvec()
    # half of it: where the face is not seen, the guess may be anything
    neck *= 0.5
    arms, elbows, legs, knees = [], [], [], []
    for side in ("left", "right"):
        places = [at(f"{side}-{name}") for name in ("shoulder", "elbow", "wrist")]
        chain, bend = _limb(pelvis, places, ARM_AT_ZERO)
        arms.append(chain)
        elbows.append(bend)
        places = [at(f"{side}-{name}") for name in ("hip", "knee", "ankle")]
        chain, bend = _limb(pelvis, places, LEG_AT_ZERO)
        legs.append(chain)
        knees.append(bend)
    still = np.tile(np.eye(3), (len(world), 2, 1, 1))
    postures = Postures(
        place=np.zeros((len(world), 3)),
        pelvis=pelvis,
        spine=np.zeros((len(world), 3)),
        neck=neck,
        arm=np.stack(arms, 1),
        elbow=np.stack(elbows, 1),
        hand=still,
        leg=np.stack(legs, 1),
        knee=np.stack(knees, 1),
        foot=still.copy(),
    )
    return replace(postures, place=_places(puppet, postures, observed, focal, centre))


def _places(
    puppet: Puppet,
    postures: Postures,
    observed: Observed,
    focal: float,
    centre: tuple[float, float],
) -> Vectors:
    """Place postures so that they are as large and where the picture shows them."""
    model = puppet.place(postures).landmarks[..., [0, 2]] * [1, -1]
    weight = np.maximum(observed.weight, 1e-3)[..., None]
    total = weight.sum(1)
    middle, seen = ((weight * points).sum(1) / total for points in (model, observed.image))
    spread, tall = (
        np.sqrt((weight * (points - mean[:, None]) ** 2).sum((1, 2)))
        for points, mean in ((model, middle), (observed.image, seen))
    )
    depth = focal * spread / np.maximum(tall, 1e-6)
    known = observed.seen | ~observed.seen.any()  # a window may lie between two sights
    depth = np.where(known, depth, np.median(depth[known]))
    across = (seen - centre) * depth[:, None] / focal - middle
    return np.stack([across[:, 0], depth, -across[:, 1]], 1)


def aligned(rest: Float64[np.ndarray, "L 3"], seen: Float64[np.ndarray, "N L 3"]) -> Matrices:
    """Find the rotations that bring points nearest to others, middle on middle (Kabsch 1976)."""
    a, b = rest - rest.mean(0), seen - seen.mean(1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("nli,lj->nij", b, a))
    sign = np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= sign[:, None]
    return u @ vt


def _limb(
    carrier: Matrices, places: list[Vectors], zero: Float64[np.ndarray, "3 3"]
) -> tuple[Matrices, Float64[np.ndarray, " N"]]:
    """Find a limb's chain from where its parts point; its hinge, where it is bent."""
    near, far = (
        _unit(np.einsum("nji,nj->ni", carrier, end - begin)) for begin, end in pairwise(places)
    )
    swing = _shortest(zero[:, 0], near)
    hinge = np.cross(near, far)
    bend = np.linalg.norm(hinge, axis=1)
    trust = np.clip((bend - 0.15) / 0.35, 0, 1)[:, None]
    usual = swing @ zero[:, 1]
    hinge = trust * _unit(hinge) + (1 - trust) * usual
    second = _unit(hinge - (hinge * near).sum(1, keepdims=True) * near)
    frame = np.stack([near, second, np.cross(near, second)], -1)
    return frame @ zero.T, np.arctan2(bend, (near * far).sum(1))


def _shortest(start: np.ndarray, ends: Vectors) -> Matrices:
    """Turn one direction into others the shortest way."""
    axis = np.cross(start, ends)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine[:, 0], ends @ start)[:, None]
    return Rotation.from_rotvec(axis / np.maximum(sine, 1e-9) * angle).as_matrix()


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
