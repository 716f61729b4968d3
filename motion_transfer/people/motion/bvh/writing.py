"""Writing a body's motion as a BVH file, with the body's own proportions.

Convention of the file: metres, y up, at rest the person faces +z; rotations in degrees in the order
Z X Y. Twist bones are merged with the limbs they twist; fingers and toes are left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from motion_transfer.people.figure.body import Body, Rotations
from motion_transfer.people.motion.limbs import NECK, SPINE

TO_FILE = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From our axes (z up, facing -y) to the file's."""

POSITION = "Xposition Yposition Zposition"
ORDER = "ZXY"
CROWN = np.array([0.0, 0.0, 0.17])  # of the head's end, above its joint; metres, by eye


@dataclass(frozen=True)
class _Joint:
    """A joint of the file.

    Attributes:
        name: In the file.
        parent: Its parent's name in the file, empty for the root.
        bone: Where it is.
        turn: The bone whose rotation it has.
        end: The bone whose beginning is its `End Site`, if it has one.
    """

    name: str
    parent: str
    bone: str
    turn: str
    end: str = ""


def _joints() -> list[_Joint]:
    """List the joints in the order of the file: each one's children follow it."""
    trunk = ["Hips", "Spine", "Spine1", "Spine2", "Spine3", "Spine4"]
    joints = [_Joint(trunk[0], "", "root", "root")]
    joints += [
        _Joint(name, above, bone, bone)
        for name, above, bone in zip(trunk[1:], trunk, SPINE, strict=False)
    ]
    neck = ["Neck", "Neck1", "Neck2", "Head"]
    joints += [
        _Joint(name, above, bone, bone)
        for name, above, bone in zip(neck, [trunk[-1], *neck], NECK, strict=False)
    ]
    for word, side in (("Left", "L"), ("Right", "R")):
        arm = [
            ("Shoulder", trunk[-1], "clavicle", "clavicle", ""),
            ("Arm", "Shoulder", "upperarm01", "upperarm02", ""),
            ("ForeArm", "Arm", "lowerarm01", "lowerarm01", ""),
            ("Hand", "ForeArm", "wrist", "wrist", "finger3-1"),
        ]
        joints += [_sided(word, side, *row) for row in arm]
    for word, side in (("Left", "L"), ("Right", "R")):
        leg = [
            ("UpLeg", trunk[0], "upperleg01", "upperleg02", ""),
            ("Leg", "UpLeg", "lowerleg01", "lowerleg01", ""),
            ("Foot", "Leg", "foot", "foot", ""),
            ("ToeBase", "Foot", "toe2-1", "foot", "toe2-3"),
        ]
        joints += [_sided(word, side, *row) for row in leg]
    return joints


def _sided(word: str, side: str, name: str, parent: str, bone: str, turn: str, end: str) -> _Joint:
    trunk = parent in ("Hips", "Spine4")
    return _Joint(
        word + name,
        parent if trunk else word + parent,
        f"{bone}.{side}",
        f"{turn}.{side}",
        f"{end}.{side}" if end else "",
    )


JOINTS = _joints()
NAMES = [joint.name for joint in JOINTS]
PARENTS = [NAMES.index(joint.parent) if joint.parent else -1 for joint in JOINTS]


def write_bvh(
    path: Path,
    body: Body,
    frames: Iterable[tuple[Rotations, tuple[float, float, float]]],
    frame_rate: Fraction,
) -> int:
    """Write a motion; the file is there when all of it is written.

    Args:
        frames: Bone rotations and offset of each, as for `body.transforms`.
    Returns: How many frames.
    """
    rows = [_row(body, *frame) for frame in frames]
    lines = ["HIERARCHY", *_skeleton(body, 0), "MOTION", f"Frames: {len(rows)}"]
    lines += [f"Frame Time: {float(1 / frame_rate):.9f}"]
    lines += [" ".join(f"{number:.5f}" for number in row) for row in rows]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return len(rows)


def _skeleton(body: Body, index: int) -> list[str]:
    """Describe a joint and all below it."""
    joint, parent = JOINTS[index], PARENTS[index]
    here = body.joint(joint.bone)
    # a root has no parent: where it is stands in its channels
    offset = here - body.joint(JOINTS[parent].bone) if parent >= 0 else np.zeros(3)
    rotations = " ".join(f"{axis}rotation" for axis in ORDER)
    channels = f"6 {POSITION} {rotations}" if parent < 0 else f"3 {rotations}"
    lines = [f"OFFSET {_shown(offset)}", f"CHANNELS {channels}"]
    for child, above in enumerate(PARENTS):
        if above == index:
            lines += _skeleton(body, child)
    if index not in PARENTS:
        end = body.joint(joint.end) - here if joint.end else CROWN
        lines += ["End Site", "{", f"\tOFFSET {_shown(end)}", "}"]
    kind = "JOINT" if parent >= 0 else "ROOT"
    return [f"{kind} {joint.name}", "{", *(f"\t{line}" for line in lines), "}"]


def _shown(vector: np.ndarray) -> str:
    return " ".join(f"{number:.6f}" for number in TO_FILE @ vector)


def _row(
    body: Body, rotations: Rotations, offset: tuple[float, float, float]
) -> Float64[np.ndarray, " channels"]:
    """Find the channels of a frame."""
    index = body.skeleton.index
    matrices = body.transforms(rotations, offset).astype(np.float64)
    turns = TO_FILE @ matrices[[index[joint.turn] for joint in JOINTS], :, :3] @ TO_FILE.T
    above = np.where(np.array(PARENTS)[:, None, None] >= 0, turns[PARENTS], np.eye(3))
    angles = Rotation.from_matrix(above.swapaxes(1, 2) @ turns).as_euler(ORDER, degrees=True)
    root = matrices[index[JOINTS[0].bone]]
    place = root[:, :3] @ body.joint(JOINTS[0].bone) + root[:, 3]
    return np.concatenate([TO_FILE @ place, angles.ravel()])
