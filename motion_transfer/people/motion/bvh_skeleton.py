"""Which joint of a BVH skeleton is which limb, and where its joints are in each frame."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from motion_transfer.errors import InputError
from motion_transfer.people.motion.bvh_file import BvhMotion

Points = Float64[np.ndarray, "N joints 3"]
Matrices = Float64[np.ndarray, "N joints 3 3"]

# names of a limb's joints once the side and prefixes are taken off: MotionBuilder, Mixamo, LAFAN1,
# CMU's own (lfemur, lhumerus), Biovision and Truebones (LeftKnee), Bandai (LowerLeg_L), 3ds Max
# (L Calf)
KNEES = {"leg", "lowerleg", "lowleg", "calf", "shin", "knee", "tibia", "crus"}
ANKLES = {"foot", "ankle"}
TOES = {"toe", "toes", "toebase", "toe0", "ball"}
ELBOWS = {"forearm", "lowerarm", "lowarm", "elbow", "radius", "farm"}
WRISTS = {"wrist", "hand"}
HEADS = {"head"}
NECKS = {"neck", "neck1", "neck01", "neck0", "lowerneck"}


@dataclass(frozen=True)
class Limb:
    """Joint indices from the trunk outwards; -1 where there is none."""

    root: int
    middle: int
    end: int
    tip: int


@dataclass(frozen=True)
class Roles:
    """Who is who.

    Attributes:
        legs, arms: left and right: hip, knee, ankle, toes / shoulder, elbow, wrist, a
            finger; arms may be missing.
        hips: the joint that carries both legs.
        chest: the joint that carries both arms (or the neck's parent), -1 where there is none.
        collars: the joints where the arms leave the chest.
        neck, head: -1 where there is none.
    """

    legs: tuple[Limb, Limb]
    arms: tuple[Limb, Limb] | None
    hips: int
    chest: int
    collars: tuple[int, int] | None
    neck: int
    head: int


def base_name(name: str) -> tuple[str, str]:
    """A joint's name without prefixes and side, and the side: `L`, `R` or nothing.

    `mixamorig:LeftUpLeg`, `LUpLeg`, `UpLeg_L` and `Bip01 L UpLeg` are all (`upleg`, `L`).
    """
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name.split(":")[-1])
    parts = [part for part in re.split(r"[^A-Za-z0-9]+", words.lower()) if part]
    parts = [
        part for part in parts if not re.fullmatch(r"(bip|biped|character|mixamorig)\d*", part)
    ]
    side = ""
    for word, letter in (("left", "L"), ("right", "R"), ("l", "L"), ("r", "R")):
        if word in parts:
            parts.remove(word)
            side = letter
            break
    joined = "".join(parts)
    if side:
        return joined, side
    for word in ("left", "right", "l", "r"):  # lfemur, rightfoot
        rest = joined.removeprefix(word)
        if rest != joined and rest in KNOWN_AFTER_SIDE:
            return rest, word[0].upper()
    return joined, ""


KNOWN_AFTER_SIDE = (
    KNEES
    | ANKLES
    | TOES
    | ELBOWS
    | WRISTS
    | {"femur", "upleg", "upperleg", "thigh", "hip", "hipjoint", "clavicle", "collar", "shoulder"}
    | {"humerus", "arm", "upperarm", "uparm", "fingers", "thumb"}
)


def find_roles(motion: BvhMotion) -> Roles:
    """Recognise the skeleton.

    Raises: InputError that names the root's line and the joints found, where there are no hips with
        two legs.
    """
    names = [base_name(name) for name in motion.names]
    legs = [_leg(motion, names, side) for side in "LR"]
    if legs[0] is None or legs[1] is None:
        missing = " and ".join(
            side for side, leg in zip(("left", "right"), legs, strict=True) if leg is None
        )
        raise _no_legs(motion, f"no {missing} leg (hip, knee and ankle) was recognised")
    hips = _shared(motion, legs[0].root, legs[1].root)
    if hips < 0 or hips in (legs[0].root, legs[1].root):
        raise _no_legs(motion, "no joint carries both legs")
    arms = [_arm(motion, names, side) for side in "LR"]
    chest, collars, both = -1, None, None
    if arms[0] is not None and arms[1] is not None:
        both = (arms[0], arms[1])
        chest = _shared(motion, arms[0].root, arms[1].root)
        collars = (
            _child_towards(motion, chest, arms[0].root),
            _child_towards(motion, chest, arms[1].root),
        )
    middle = [i for i, (_, side) in enumerate(names) if not side]
    head = next((i for i in middle if names[i][0] in HEADS), -1)
    neck = next((i for i in middle if names[i][0] in NECKS), head)
    if chest < 0 and neck >= 0:
        chest = motion.parents[neck]
    return Roles((legs[0], legs[1]), both, hips, chest, collars, neck, head)


def _no_legs(motion: BvhMotion, why: str) -> InputError:
    shown = ", ".join(motion.names[:40]) + (", ..." if len(motion.names) > 40 else "")
    return InputError(
        f"{motion.path}, line {motion.lines[0]}: the root {motion.names[0]!r} is not recognised as"
        f" hips with two legs: {why}; joints found: {shown}. Rename them as in Hips, LeftUpLeg,"
        " LeftLeg, LeftFoot"
    )


def _ancestors(motion: BvhMotion, joint: int) -> Iterator[int]:
    while motion.parents[joint] >= 0:
        joint = motion.parents[joint]
        yield joint


def _shared(motion: BvhMotion, a: int, b: int) -> int:
    """The lowest joint that carries both, which may be one of them."""
    above = {a, *_ancestors(motion, a)}
    return next((joint for joint in (b, *_ancestors(motion, b)) if joint in above), -1)


def _child_towards(motion: BvhMotion, top: int, joint: int) -> int:
    while motion.parents[joint] not in (top, -1):
        joint = motion.parents[joint]
    return joint


def _below(motion: BvhMotion, joint: int, names: list, wanted: set[str]) -> int:
    """The first joint under another whose name is one of those wanted, -1 where there is none."""
    for other in range(joint + 1, len(names)):
        if names[other][0] in wanted and joint in _ancestors(motion, other):
            return other
    return -1


def _above(motion: BvhMotion, joint: int, names: list) -> int:
    """The next joint towards the trunk on the same side, rolls and twists left out."""
    for other in _ancestors(motion, joint):
        base, side = names[other]
        if side != names[joint][1]:
            return -1
        if not re.search(r"roll|twist", base):
            return other
    return -1


def _leg(motion: BvhMotion, names: list, side: str) -> Limb | None:
    for knee, name in enumerate(names):
        if name[1] == side and name[0] in KNEES:
            ankle, hip = _below(motion, knee, names, ANKLES), _above(motion, knee, names)
            if ankle >= 0 and hip >= 0:
                return Limb(hip, knee, ankle, _below(motion, ankle, names, TOES))
    return None


def _arm(motion: BvhMotion, names: list, side: str) -> Limb | None:
    for elbow, name in enumerate(names):
        if name[1] == side and name[0] in ELBOWS:
            wrist, shoulder = _below(motion, elbow, names, WRISTS), _above(motion, elbow, names)
            if wrist >= 0 and shoulder >= 0:
                return Limb(shoulder, elbow, wrist, _finger(motion, names, wrist))
    return None


def _finger(motion: BvhMotion, names: list, wrist: int) -> int:
    """Where the hand points: the middle finger's first joint, or another one's but the thumb's."""
    below = [i for i in range(wrist + 1, len(names)) if wrist in _ancestors(motion, i)]
    below = [i for i in below if "thumb" not in names[i][0]]
    return next((i for i in below if "mid" in names[i][0]), below[0] if below else -1)


@dataclass(frozen=True)
class Tracks:
    """Every joint in every frame, in the file's unit and axes.

    Attributes:
        places: where it is.
        turns: its axes.
        tips: where its `End Site` is, or its first child, or itself.
    """

    places: Points
    turns: Matrices
    tips: Points


def tracks(motion: BvhMotion, *, at_rest: bool = False) -> Tracks:
    """Forward kinematics; at rest: one frame without rotations, as the OFFSETs stand.

    Rotations are applied in the order of the channels, each about the axes that the ones before
    have turned (Zrotation Xrotation Yrotation is Rz Rx Ry). Positions replace a joint's OFFSET,
    except where they are far from it and near 0: then they add to it.
    """
    count = 1 if at_rest else len(motion.frames)
    joints = len(motion.names)
    places = np.zeros((count, joints, 3))
    turns = np.tile(np.eye(3), (count, joints, 1, 1))
    tips = np.empty_like(places)
    column = 0
    for joint, channels in enumerate(motion.channels):
        values = motion.frames[:, column : column + len(channels)]
        column += len(channels)
        offset = np.tile(motion.offsets[joint], (count, 1))
        local = np.tile(np.eye(3), (count, 1, 1))
        if not at_rest:
            offset = _moved(motion, joint, values)
            local = _turned(channels, values)
        parent = motion.parents[joint]
        if parent < 0:
            places[:, joint], turns[:, joint] = offset, local
        else:
            places[:, joint] = places[:, parent] + _applied(turns[:, parent], offset)
            turns[:, joint] = turns[:, parent] @ local
    for joint in range(joints):
        child = next((i for i, p in enumerate(motion.parents) if p == joint), joint)
        tips[:, joint] = places[:, child]
        if joint in motion.ends:
            end = np.tile(motion.ends[joint], (count, 1))
            tips[:, joint] = places[:, joint] + _applied(turns[:, joint], end)
    return Tracks(places, turns, tips)


def _applied(turns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", turns, vectors)


def _moved(motion: BvhMotion, joint: int, values: np.ndarray) -> np.ndarray:
    offset = motion.offsets[joint]
    out = np.tile(offset, (len(values), 1))
    for axis, name in enumerate(("Xposition", "Yposition", "Zposition")):
        if name in motion.channels[joint]:
            out[:, axis] = values[:, motion.channels[joint].index(name)]
    if motion.parents[joint] < 0 or "Xposition" not in motion.channels[joint]:
        return out
    adds = np.linalg.norm(out, axis=1).mean() < np.linalg.norm(out - offset, axis=1).mean()
    return out + offset if adds else out


def _turned(channels: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    columns = [i for i, name in enumerate(channels) if name.endswith("rotation")]
    if not columns:
        return np.tile(np.eye(3), (len(values), 1, 1))
    order = "".join(channels[i][0] for i in columns)  # capitals: about axes that turn along
    return Rotation.from_euler(order, values[:, columns], degrees=True).as_matrix()
