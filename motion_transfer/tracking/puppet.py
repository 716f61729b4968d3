"""The body as a few joints, for many frames at once: where its landmarks are, and how they move.

Convention: world axes as in `people/figure/body.py` (metres, z up). Limbs hang from chest and
pelvis as in `people/motion/limbs.py`: a chain of rotations that is the identity where the limb
hangs straight down. Both sides are written in the person's own axes, none is mirrored.

A step is PARAMETERS numbers a frame: metres for the place, radians for all others. Rotations are
turned by a rotation vector in the axes of what carries them.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from motion_transfer.estimate.interface import LANDMARK_NAMES
from motion_transfer.people import (
    NECK,
    SPINE,
    Body,
    BodyModel,
    Bones,
    Rest,
    arm_bones,
    finger_bones,
    leg_bones,
    mirrored_matrix,
    whole_body,
)
from motion_transfer.tracking.landmarks import anchor_of, carrying_bones, rest_places

Points = Float64[np.ndarray, "N L 3"]
Slopes = Float64[np.ndarray, "N L 3 P"]
Vectors = Float64[np.ndarray, "N 3"]
Matrices = Float64[np.ndarray, "N 3 3"]
Sides = Float64[np.ndarray, "N 2 3 3"]

RELAXED = 0.3  # curl of the fingers; landmarks do not say it
HEAD = ("nose", "eye-inner", "eye-middle", "eye-outer", "ear", "mouth")
HANDS = ("pinky", "index", "thumb")
ARM_DOWN = np.array([0.0, 0.0, -1.0])
MIRROR = np.array([-1.0, 1.0, 1.0])
HEEL_BEHIND = 0.05  # metres that the heel lies behind the ankle joint
MOST_TURN = 0.6  # radians, of one step: farther away nothing is linear


def layout() -> dict[str, slice]:
    """Name what the numbers of a step turn or move."""
    sizes = {"place": 3, "pelvis": 3, "spine": 3, "neck": 3}
    for side in "LR":
        limbs = {"arm": 3, "elbow": 1, "hand": 3, "leg": 3, "knee": 1, "foot": 3}
        sizes |= {f"{name}.{side}": size for name, size in limbs.items()}
    ends = np.cumsum(list(sizes.values())).tolist()
    return {name: slice(end - sizes[name], end) for name, end in zip(sizes, ends, strict=True)}


LAYOUT = layout()
PARAMETERS = max(part.stop for part in LAYOUT.values())


@dataclass(frozen=True)
class Postures:
    """A body in N frames.

    Attributes:
        place: Of the root joint, world.
        pelvis: From the rest pose, world.
        spine, neck: Rotation vectors of chest against pelvis, and head against chest.
        arm, leg: Chains in the axes of chest and pelvis, left and right.
        elbow, knee: Bends.
        hand, foot: In the axes of forearm and shin, the identity in the zero pose.
    """

    place: Vectors
    pelvis: Matrices
    spine: Vectors
    neck: Vectors
    arm: Sides
    elbow: Float64[np.ndarray, "N 2"]
    hand: Sides
    leg: Sides
    knee: Float64[np.ndarray, "N 2"]
    foot: Sides

    def __len__(self) -> int:
        return len(self.place)

    def __getitem__(self, frames: slice | np.ndarray) -> Postures:
        """Take some of the frames."""
        return Postures(*(getattr(self, entry.name)[frames] for entry in fields(self)))

    def turned(self, step: Float64[np.ndarray, "N P"]) -> Postures:
        """Take a step, see LAYOUT; no joint turns farther than MOST_TURN."""

        def part(name: str) -> np.ndarray:
            found = step[:, LAYOUT[name]]
            if name == "place":
                return found
            size = np.linalg.norm(found, axis=1, keepdims=True)
            return found * np.minimum(1, MOST_TURN / np.maximum(size, 1e-9))

        def sides(name: str) -> Sides:
            old = getattr(self, name)
            new = [turns(part(f"{name}.{side}")) @ old[:, i] for i, side in enumerate("LR")]
            return np.stack(new, 1)

        def bends(name: str) -> np.ndarray:
            moves = [part(f"{name}.{side}")[:, 0] for side in "LR"]
            return getattr(self, name) + np.stack(moves, 1)

        return Postures(
            place=self.place + part("place"),
            pelvis=turns(part("pelvis")) @ self.pelvis,
            spine=self.spine + part("spine"),
            neck=self.neck + part("neck"),
            arm=sides("arm"),
            elbow=bends("elbow"),
            hand=sides("hand"),
            leg=sides("leg"),
            knee=bends("knee"),
            foot=sides("foot"),
        )

    def away_from(self, other: Postures) -> Float64[np.ndarray, "N P"]:
        """Find the step that leads here from other postures."""
        step = np.empty((len(self), PARAMETERS))
        step[:, LAYOUT["place"]] = self.place - other.place
        step[:, LAYOUT["pelvis"]] = vectors(self.pelvis @ other.pelvis.swapaxes(1, 2))
        for name in ("spine", "neck"):
            step[:, LAYOUT[name]] = getattr(self, name) - getattr(other, name)
        for i, side in enumerate("LR"):
            for name in ("arm", "hand", "leg", "foot"):
                mine, theirs = getattr(self, name)[:, i], getattr(other, name)[:, i]
                step[:, LAYOUT[f"{name}.{side}"]] = vectors(mine @ theirs.swapaxes(1, 2))
            for name in ("elbow", "knee"):
                bend = getattr(self, name)[:, i] - getattr(other, name)[:, i]
                step[:, LAYOUT[f"{name}.{side}"]] = bend[:, None]
        return step

    def moved(self, turn: Float64[np.ndarray, "3 3"], shift: np.ndarray) -> Postures:
        """Turn the world about its origin, then shift it."""
        return replace(self, place=self.place @ turn.T + shift, pelvis=turn @ self.pelvis)


def turns(rotation_vectors: Vectors) -> Matrices:
    """Make matrices of rotation vectors."""
    return Rotation.from_rotvec(rotation_vectors).as_matrix()


def vectors(matrices: Matrices) -> Vectors:
    """Find the shortest rotation vectors of matrices."""
    return Rotation.from_matrix(matrices).as_rotvec()


def about_x(angle: Float64[np.ndarray, " N"]) -> Matrices:
    """Turn about the x axis."""
    return turns(angle[:, None] * np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True)
class Handle:
    """What one number of a step does: it turns landmarks about an axis, or moves all of them.

    Attributes:
        pivot: None: the axis is a direction to move along.
    """

    number: int
    axis: Vectors
    pivot: Vectors | None
    landmarks: list[int]


@dataclass(frozen=True)
class Placed:
    """Landmarks in the world, and what moves them."""

    landmarks: Points
    handles: list[Handle]

    def slopes(self) -> Slopes:
        """Tell how each landmark moves with each number of a step."""
        count, landmarks = self.landmarks.shape[:2]
        out = np.zeros((count, landmarks, 3, PARAMETERS))
        for handle in self.handles:
            axis = handle.axis[:, None]
            if handle.pivot is None:
                out[..., handle.number] = axis
                continue
            arms = self.landmarks[:, handle.landmarks] - handle.pivot[:, None]
            out[:, handle.landmarks, :, handle.number] = _crossed(axis, arms).swapaxes(0, 1)
        return out


class Puppet:
    """A body's joints at rest, and its landmarks.

    Args:
        body: Of any shape.
    """

    def __init__(self, body: Body, model: BodyModel) -> None:
        self.body, self.rest = body, Rest.of(body)
        fingers = finger_bones(self.rest, RELAXED)
        left = {f"{name}.L": matrix for name, matrix in fingers.items()}
        right = {f"{name}.R": mirrored_matrix(matrix) for name, matrix in fingers.items()}
        matrices = body.transforms(left | right)[carrying_bones(body)].astype(np.float64)
        rest = rest_places(body, model)
        self.landmarks = np.einsum("lij,lj->li", matrices[..., :3], rest) + matrices[..., 3]

    def joint(self, name: str) -> np.ndarray:
        """Tell where a bone begins at rest."""
        return self.body.joint(name)

    def place(self, postures: Postures) -> Placed:
        """Place the landmarks in all frames."""
        out = np.empty((len(postures), len(LANDMARK_NAMES), 3))
        handles: list[Handle] = []
        root, pelvis = postures.place, postures.pelvis
        everything = list(range(len(LANDMARK_NAMES)))
        for axis in range(3):
            along = np.tile(np.eye(3)[axis], (len(postures), 1))
            handles.append(Handle(LAYOUT["place"].start + axis, along, None, everything))
            handles.append(Handle(LAYOUT["pelvis"].start + axis, along, root, everything))
        chest, chest_place, mean = _bent(self, SPINE, pelvis, root, postures.spine)
        above = [i for group in ("head", *ARM_GROUPS) for i in GROUPS[group]]
        _add(handles, "spine", pelvis, mean, above)
        neck_place = chest_place + _applied(chest, self.joint(NECK[0]) - self.joint(SPINE[-1]))
        head, head_place, mean = _bent(self, NECK, chest, neck_place, postures.neck)
        _add(handles, "neck", chest, mean, GROUPS["head"])
        self._carry(out, "head", head, head_place, NECK[-1])
        for i, side in enumerate("LR"):
            self._place_arm(out, handles, postures, i, side, chest, chest_place)
            self._place_leg(out, handles, postures, i, side)
        return Placed(out, handles)

    def soles(self, postures: Postures) -> Points:
        """Place heels and balls of both feet, on the ground under them, in all frames."""
        places = []
        for i, side in enumerate("LR"):
            own = mirrored_matrix if i else np.asarray
            upper = postures.pelvis @ postures.leg[:, i]
            bent = upper @ about_x(postures.knee[:, i])
            foot = bent @ postures.foot[:, i]
            hip, knee, ankle, toe = (
                self.joint(f"{name}.{side}")
                for name in ("upperleg01", "lowerleg01", "foot", "toe2-2")
            )
            here = postures.place + _applied(postures.pelvis, hip - self.joint("root"))
            here = here + _applied(upper @ own(self.rest.leg), knee - hip)
            here = here + _applied(bent @ own(self.rest.leg), ankle - knee)
            heel = np.array([ankle[0], ankle[1] + HEEL_BEHIND, 0.0])
            places += [here + _applied(foot, sole - ankle) for sole in (heel, toe * [1, 1, 0])]
        return np.stack(places, 1)

    def _place_arm(
        self,
        out: Points,
        handles: list[Handle],
        postures: Postures,
        i: int,
        side: str,
        chest: Matrices,
        chest_place: Vectors,
    ) -> None:
        mirror = mirrored_matrix if i else np.asarray
        chain = postures.arm[:, i]
        collar = chest @ self._collar(chain, i)
        at = chest_place + _applied(chest, self.joint(f"clavicle.{side}") - self.joint(SPINE[-1]))
        self._carry(out, f"collar.{side}", collar, at, f"clavicle.{side}")
        bones = (f"clavicle.{side}", f"upperarm01.{side}", f"lowerarm01.{side}", f"wrist.{side}")
        upper = chest @ chain
        bent = upper @ about_x(-postures.elbow[:, i])
        hand = bent @ postures.hand[:, i]
        places = [at]
        # the upper arm does not turn with the collar bone, which only carries it
        for matrices, near, far in zip(
            (collar, upper @ mirror(self.rest.upper_arm), bent @ mirror(self.rest.forearm)),
            bones[:3],
            bones[1:],
            strict=True,
        ):
            places.append(places[-1] + _applied(matrices, self.joint(far) - self.joint(near)))
        _, shoulder, elbow, wrist = places
        groups = [f"{name}.{side}" for name in ("upper", "fore", "hand")]
        self._carry(out, groups[0], upper @ mirror(self.rest.upper_arm), shoulder, bones[1])
        self._carry(out, groups[1], bent @ mirror(self.rest.forearm), elbow, bones[2])
        self._carry(out, groups[2], hand @ mirror(self.rest.hand), wrist, bones[3])
        below = [[k for group in groups[j:] for k in GROUPS[group]] for j in range(3)]
        _add(handles, f"arm.{side}", chest, shoulder, below[0])
        hinge = LAYOUT[f"elbow.{side}"].start
        handles.append(Handle(hinge, -upper[:, :, 0], elbow, below[1]))
        _add(handles, f"hand.{side}", bent, wrist, below[2])

    def _place_leg(
        self, out: Points, handles: list[Handle], postures: Postures, i: int, side: str
    ) -> None:
        mirror = mirrored_matrix if i else np.asarray
        root, pelvis = postures.place, postures.pelvis
        self._carry(out, f"hip.{side}", pelvis, root, "root")
        bones = (f"upperleg01.{side}", f"lowerleg01.{side}", f"foot.{side}")
        upper = pelvis @ postures.leg[:, i]
        bent = upper @ about_x(postures.knee[:, i])
        foot = bent @ postures.foot[:, i]
        hip = root + _applied(pelvis, self.joint(bones[0]) - self.joint("root"))
        thigh, shin = upper @ mirror(self.rest.leg), bent @ mirror(self.rest.leg)
        knee = hip + _applied(thigh, self.joint(bones[1]) - self.joint(bones[0]))
        ankle = knee + _applied(shin, self.joint(bones[2]) - self.joint(bones[1]))
        groups = [f"{name}.{side}" for name in ("thigh", "shin", "foot")]
        self._carry(out, groups[0], thigh, hip, bones[0])
        self._carry(out, groups[1], shin, knee, bones[1])
        self._carry(out, groups[2], foot, ankle, bones[2])
        below = [[k for group in groups[j:] for k in GROUPS[group]] for j in range(3)]
        _add(handles, f"leg.{side}", pelvis, hip, below[0])
        hinge = LAYOUT[f"knee.{side}"].start
        handles.append(Handle(hinge, upper[:, :, 0], knee, below[1]))
        _add(handles, f"foot.{side}", bent, ankle, below[2])

    def _collar(self, chain: Matrices, i: int) -> Matrices:
        """Let the collar bones follow the upper arms, see `collar_bone`."""
        _, ahead, up = np.moveaxis(chain @ ARM_DOWN, -1, 0)
        lift = 0.55 * (0.5 * (1 + up)).clip(0) ** 1.5
        angles = np.stack([np.zeros_like(lift), -lift, 0.22 * ahead], -1)
        matrices = Rotation.from_euler("XYZ", angles).as_matrix()
        return mirrored_matrix(matrices) if i else matrices

    def _carry(
        self, out: Points, group: str, matrices: Matrices, place: Vectors, bone: str
    ) -> None:
        index = GROUPS[group]
        arms = self.landmarks[index] - self.joint(bone)
        out[:, index] = place[:, None] + np.einsum("nij,lj->nli", matrices, arms)

    def bones(self, postures: Postures, frame: int) -> Bones:
        """Turn all bones of the body as in one frame, for `body.transforms`."""
        rest = self.rest
        sides = []
        for i in range(2):
            own = mirrored_matrix if i else np.asarray
            chain = own(postures.arm[frame, i])
            bent = chain @ about_x(-postures.elbow[[frame], i])[0]
            hand = bent @ own(postures.hand[frame, i])
            collar = self._collar(chain[None], 0)[0]
            arm = arm_bones(
                rest, collar, chain @ rest.upper_arm, bent @ rest.forearm, hand @ rest.hand
            )
            chain = own(postures.leg[frame, i])
            bent = chain @ about_x(postures.knee[[frame], i])[0]
            foot = bent @ own(postures.foot[frame, i])
            leg = leg_bones(rest, chain @ rest.leg, bent @ rest.leg, foot)
            sides.append(arm | leg | finger_bones(rest, RELAXED))
        return whole_body(
            postures.pelvis[frame], postures.spine[frame], postures.neck[frame], *sides
        )

    def offset(self, postures: Postures, frame: int) -> tuple[float, float, float]:
        """Tell how far the body is moved in one frame, for `body.transforms`."""
        x, y, z = (postures.place[frame] - self.joint("root")).tolist()
        return x, y, z


def _groups() -> dict[str, list[int]]:
    """Sort the landmarks by what they move with."""
    segments = dict.fromkeys(HEAD, "head") | dict.fromkeys(HANDS, "hand")
    segments |= {"shoulder": "collar", "elbow": "upper", "wrist": "fore", "hip": "hip"}
    segments |= {"knee": "thigh", "ankle": "shin", "heel": "foot", "foot-index": "foot"}
    groups: dict[str, list[int]] = {}
    for index, name in enumerate(LANDMARK_NAMES):
        kind, side = anchor_of(name)
        segment = segments[kind]
        key = segment if segment == "head" else f"{segment}.{side}"
        groups.setdefault(key, []).append(index)
    return groups


GROUPS = _groups()
ARM_GROUPS = [f"{name}.{side}" for side in "LR" for name in ("collar", "upper", "fore", "hand")]


def _applied(matrices: Matrices, vector: np.ndarray) -> Vectors:
    return matrices @ vector


def _crossed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Multiply crosswise; several times as quick as NumPy."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def _add(
    handles: list[Handle], name: str, carrier: Matrices, pivot: Vectors, landmarks: list[int]
) -> None:
    """Add the three numbers that turn a joint in the axes of what carries it."""
    for axis in range(3):
        number = LAYOUT[name].start + axis
        handles.append(Handle(number, carrier[:, :, axis], pivot, landmarks))


def _bent(
    puppet: Puppet, bones: tuple[str, ...], carrier: Matrices, place: Vectors, bend: Vectors
) -> tuple[Matrices, Vectors, Vectors]:
    """Spread a bend over bones: the last one's rotation and place, and the middle of all."""
    each = turns(bend / len(bones))
    matrices, places = carrier @ each, [place]
    for near, far in pairwise(bones):
        places.append(places[-1] + _applied(matrices, puppet.joint(far) - puppet.joint(near)))
        matrices = matrices @ each
    return matrices, places[-1], np.mean(places, axis=0)
