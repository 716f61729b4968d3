"""Which joint of a BVH skeleton is which limb, and where its joints are in each frame."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from motion_transfer.errors import InputError
from motion_transfer.people.motion.bvh.file import CHANNELS, BvhMotion

Points = Float64[np.ndarray, "N joints 3"]
Matrices = Float64[np.ndarray, "N joints 3 3"]

# names of joints once the side and prefixes are taken off, as MotionBuilder, Mixamo, LAFAN1, CMU
# (lfemur, lhumerus), Biovision and Truebones (LeftKnee), Bandai (LowerLeg_L) and 3ds Max (L Calf)
# write them
KNEES = {"leg", "lowerleg", "lowleg", "calf", "shin", "knee", "tibia", "crus"}
ANKLES = {"foot", "ankle"}
TOES = {"toe", "toes", "toebase", "toe0", "ball"}
ELBOWS = {"forearm", "lowerarm", "lowarm", "elbow", "radius", "farm"}
WRISTS = {"wrist", "hand"}
HEADS = {"head"}
NECKS = {"neck", "neck1", "neck01", "neck0", "lowerneck"}
SIDES = ("left", "right", "l", "r")
KNOWN_AFTER_SIDE = (
    KNEES
    | ANKLES
    | TOES
    | ELBOWS
    | WRISTS
    | {"femur", "upleg", "upperleg", "thigh", "hip", "hipjoint", "clavicle", "collar", "shoulder"}
    | {"humerus", "arm", "upperarm", "uparm", "fingers", "thumb"}
)
"""What may follow a side that is but a letter: `lfemur` has one, `lowerback` has none."""


@dataclass(frozen=True)
class Limb:
    """One limb's joints from the trunk outwards.

    Attributes:
        root, middle, end: Hip, knee and ankle, or shoulder, elbow and wrist.
        tip: Where the hand or foot points, -1 where nothing says.
    """

    root: int
    middle: int
    end: int
    tip: int


@dataclass(frozen=True)
class Roles:
    """Which joint is what.

    Attributes:
        legs, arms: Left and right; arms may be missing.
        hips: The joint that carries both legs.
        chest: The joint that carries both arms (or the neck's parent), -1 where there is none.
        neck, head: -1 where there is none.
    """

    legs: tuple[Limb, Limb]
    arms: tuple[Limb, Limb] | None
    hips: int
    chest: int
    neck: int
    head: int


def base_name(name: str) -> tuple[str, str]:
    """Part a joint's name, freed of prefixes, from its side: `L`, `R` or nothing.

    `mixamorig:LeftUpLeg`, `LUpLeg`, `UpLeg_L` and `Bip01 L UpLeg` are all (`upleg`, `L`).
    """
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", name.split(":")[-1])
    prefix = re.compile(r"(bip|biped|character|mixamorig)\d*")
    parts = [p for p in re.split(r"[^a-z0-9]+", words.lower()) if p and not prefix.fullmatch(p)]
    for word in SIDES:
        if word in parts:
            parts.remove(word)
            return "".join(parts), word[0].upper()
    joined = "".join(parts)
    for word in SIDES:  # lfemur, rightfoot
        rest = joined.removeprefix(word)
        if rest != joined and rest in KNOWN_AFTER_SIDE:
            return rest, word[0].upper()
    return joined, ""


def find_roles(motion: BvhMotion) -> Roles:
    """Recognise the skeleton.

    Raises: InputError that names the root's line and the joints found, where there are no hips with
        two legs.
    """
    names = [base_name(name) for name in motion.names]
    legs = [_limb(motion, names, side, KNEES, ANKLES) for side in "LR"]
    if legs[0] is None or legs[1] is None:
        missing = " and ".join(
            side for side, leg in zip(("left", "right"), legs, strict=True) if leg is None
        )
        raise _no_legs(motion, f"no {missing} leg (hip, knee and ankle) was recognised")
    hips = _shared(motion, legs[0].root, legs[1].root)
    if hips < 0 or hips in (legs[0].root, legs[1].root):
        raise _no_legs(motion, "no joint carries both legs")
    arms = [_limb(motion, names, side, ELBOWS, WRISTS) for side in "LR"]
    chest, both = -1, None
    if arms[0] is not None and arms[1] is not None:
        both = (arms[0], arms[1])
        chest = _shared(motion, arms[0].root, arms[1].root)
    middle = [i for i, (_, side) in enumerate(names) if not side]
    head = next((i for i in middle if names[i][0] in HEADS), -1)
    neck = next((i for i in middle if names[i][0] in NECKS), head)
    if chest < 0 and neck >= 0:
        chest = motion.parents[neck]
    return Roles((legs[0], legs[1]), both, hips, chest, neck, head)


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
    """Find the lowest joint that carries both, which may be one of them; -1 where none does."""
    above = {a, *_ancestors(motion, a)}
    return next((joint for joint in (b, *_ancestors(motion, b)) if joint in above), -1)


def _below(motion: BvhMotion, joint: int, names: list, wanted: set[str]) -> int:
    """Find the first joint under another that has a wanted name, -1 where there is none."""
    below = (i for i in range(joint + 1, len(names)) if joint in _ancestors(motion, i))
    return next((other for other in below if names[other][0] in wanted), -1)


def _above(motion: BvhMotion, joint: int, names: list) -> int:
    """Find the next joint towards the trunk on the same side, rolls and twists left out."""
    for other in _ancestors(motion, joint):
        base, side = names[other]
        if side != names[joint][1]:
            return -1
        if not re.search(r"roll|twist", base):
            return other
    return -1


def _limb(
    motion: BvhMotion, names: list, side: str, middles: set[str], ends: set[str]
) -> Limb | None:
    """Find a limb by the names of its middle joint and of its end, None where there is none."""
    for middle, name in enumerate(names):
        if name[1] == side and name[0] in middles:
            end, root = _below(motion, middle, names, ends), _above(motion, middle, names)
            if end >= 0 and root >= 0:
                return Limb(root, middle, end, _tip(motion, names, end))
    return None


def _tip(motion: BvhMotion, names: list, end: int) -> int:
    """Find the middle finger's first joint, or whatever else lies beyond, but for the thumb."""
    below = [i for i in range(end + 1, len(names)) if end in _ancestors(motion, i)]
    below = [i for i in below if "thumb" not in names[i][0]]
    return next((i for i in below if "mid" in names[i][0]), below[0] if below else -1)


@dataclass(frozen=True)
class Tracks:
    """Every joint in every frame, in the file's unit and axes.

    Attributes:
        places: Where it is.
        turns: Its axes.
        tips: Where its `End Site` is, or its first child, or itself.
    """

    places: Points
    turns: Matrices
    tips: Points


def tracks(motion: BvhMotion, *, at_rest: bool = False) -> Tracks:
    """Place all joints; at rest: one frame without rotations, as the OFFSETs stand.

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
        if joint in motion.ends:
            end = np.tile(motion.ends[joint], (count, 1))
            tips[:, joint] = places[:, joint] + _applied(turns[:, joint], end)
        else:
            child = motion.parents.index(joint) if joint in motion.parents else joint
            tips[:, joint] = places[:, child]
    return Tracks(places, turns, tips)


def _applied(turns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", turns, vectors)


def _moved(motion: BvhMotion, joint: int, values: np.ndarray) -> np.ndarray:
    offset = motion.offsets[joint]
    out = np.tile(offset, (len(values), 1))
    for axis, name in enumerate(CHANNELS[:3]):
        if name in motion.channels[joint]:
            out[:, axis] = values[:, motion.channels[joint].index(name)]
    if motion.parents[joint] < 0 or "Xposition" not in motion.channels[joint]:
        return out
    # what is near the OFFSET is the whole of it, what is near 0 is a change of it
    adds = np.linalg.norm(out, axis=1).mean() < np.linalg.norm(out - offset, axis=1).mean()
    return out + offset if adds else out


def _turned(channels: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    columns = [i for i, name in enumerate(channels) if name.endswith("rotation")]
    if not columns:
        return np.tile(np.eye(3), (len(values), 1, 1))
    order = "".join(channels[i][0] for i in columns)  # capitals: about axes that turn along
    return Rotation.from_euler(order, values[:, columns], degrees=True).as_matrix()
