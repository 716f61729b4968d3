"""BVH: reading strictly, and our own walk coming back out of a file as it went in."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from motion_transfer.errors import InputError
from motion_transfer.people.motion.bvh import bvh_poses, read_bvh
from motion_transfer.people.motion.bvh.skeleton import base_name, find_roles, tracks
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.poses import Arm, Leg, Pose, pose_rotations

SMALL = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Knee
  {
    OFFSET 0 -2 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -1 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
1 2 3 0 0 0 0 90 0
0 0 0 90 0 0 0 0 90
"""
# our bone -> a name in two schemes
MOTION_BUILDER = {
    "root": "Hips",
    "spine03": "Spine",
    "spine01": "Spine1",
    "neck01": "Neck",
    "head": "Head",
    "clavicle.L": "LeftShoulder",
    "upperarm01.L": "LeftArm",
    "lowerarm01.L": "LeftForeArm",
    "wrist.L": "LeftHand",
    "finger3-1.L": "LeftHandMiddle1",
    "upperleg01.L": "LeftUpLeg",
    "lowerleg01.L": "LeftLeg",
    "foot.L": "LeftFoot",
    "toe2-1.L": "LeftToeBase",
}
BIOVISION = {
    "root": "hip",
    "spine01": "chest",
    "neck01": "neck",
    "head": "head",
    "clavicle.L": "lCollar",
    "upperarm01.L": "lShldr",
    "lowerarm01.L": "lForeArm",
    "wrist.L": "lHand",
    "upperleg01.L": "lThigh",
    "lowerleg01.L": "lShin",
    "foot.L": "lFoot",
}
Z_UP = np.eye(3)
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
T_POSE = Pose(left_arm=Arm(abduction=np.pi / 2), right_arm=Arm(abduction=np.pi / 2))


def write(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "small.bvh"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def both(scheme: dict[str, str]) -> dict[str, str]:
    """The right side's names as well."""
    right = {
        bone.replace(".L", ".R"): name.replace("Left", "Right").replace("l", "r", 1)
        if name.startswith("l")
        else name.replace("Left", "Right")
        for bone, name in scheme.items()
        if bone.endswith(".L")
    }
    return scheme | right


def exported(
    body, poses: list[Pose], scheme: dict[str, str], axes: np.ndarray, scale: float, at_rest: Pose
) -> str:
    """Our body's motion as BVH text, its skeleton standing in any pose at rest."""
    names, bones = both(scheme), list(body.skeleton.names)
    kept = [bone for bone in bones if bone in names]
    parent = {}
    for bone in kept:
        above = body.skeleton.parents[bones.index(bone)]
        while above >= 0 and bones[above] not in names:
            above = body.skeleton.parents[above]
        parent[bone] = bones[above] if above >= 0 else None

    def world(pose: Pose) -> tuple[dict, dict]:
        transforms = body.transforms(pose_rotations(pose, body))
        joints = body.posed_joints(transforms)
        index = body.skeleton.index
        turns = {b: transforms[index[b], :, :3].astype(np.float64) for b in kept}
        return turns, {b: joints[index[b]] for b in kept}

    rest_turns, rest_joints = world(at_rest)
    lines = ["HIERARCHY"]

    def add(bone: str, depth: int) -> None:
        above = parent[bone]
        offset = rest_joints[bone] - (rest_joints[above] if above else 0)
        lines.append(f"{'JOINT' if above else 'ROOT'} {names[bone]}")
        lines.append("{")
        lines.append("OFFSET " + " ".join(f"{v:.6f}" for v in axes @ offset * scale))
        place = "" if above else "Xposition Yposition Zposition "
        count = 3 if above else 6
        lines.append(f"CHANNELS {count} {place}Zrotation Yrotation Xrotation")
        order.append(bone)
        children = [b for b in kept if parent[b] == bone]
        for child in children:
            add(child, depth + 1)
        if not children:
            lines.extend(["End Site", "{", "OFFSET 0 0 0", "}"])
        lines.append("}")

    order: list[str] = []
    add("root", 0)
    lines += ["MOTION", f"Frames: {len(poses)}", "Frame Time: 0.0333333"]
    for pose in poses:
        turns, joints = world(pose)
        full = {b: axes @ turns[b] @ rest_turns[b].T @ axes.T for b in kept}
        row = list(axes @ joints["root"] * scale)
        for bone in order:
            above = parent[bone]
            local = full[above].T @ full[bone] if above else full[bone]
            row += list(Rotation.from_matrix(local).as_euler("ZYX", degrees=True))
        lines.append(" ".join(f"{v:.6f}" for v in row))
    return "\n".join(lines) + "\n"


def test_positions_of_a_skeleton_worked_out_by_hand(tmp_path: Path) -> None:
    motion = read_bvh(write(tmp_path, SMALL))
    assert motion.names == ("Hips", "Knee")
    assert motion.parents == (-1, 0)
    assert motion.frame_seconds == Fraction(333333, 10_000_000)
    assert motion.frame_rate == 30
    found = tracks(motion)
    np.testing.assert_allclose(found.places[0], [[1, 2, 3], [1, 0, 3]], atol=1e-9)
    # frame 0: the knee turns 90 degrees about x, so the end site at -y goes to -z
    np.testing.assert_allclose(found.tips[0, 1], [1, 0, 2], atol=1e-9)
    # frame 1: the root turns 90 degrees about z, -y goes to +x; turning about y keeps the end there
    np.testing.assert_allclose(found.places[1, 1], [2, 0, 0], atol=1e-9)
    np.testing.assert_allclose(found.tips[1, 1], [3, 0, 0], atol=1e-9)


def test_windows_line_ends_byte_order_mark_and_braces_on_the_same_line(tmp_path: Path) -> None:
    text = SMALL.replace("Knee\n  {", "Knee {").replace("\n", "\r\n")
    motion = read_bvh(write(tmp_path, b"\xef\xbb\xbf" + text.encode()))
    assert motion.names == ("Hips", "Knee")
    assert motion.frames.shape == (2, 9)


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (("HIERARCHY", "HIERARCHIE"), 1, "instead of HIERARCHY"),
        (("ROOT Hips", "JOINT Hips"), 2, "instead of ROOT"),
        (("MOTION\n", ""), 16, "instead of MOTION"),
        (("  }\n}\nMOTION", "  }\nMOTION"), 15, "closing brace is missing"),
        (("}\nMOTION", "}\n}\nMOTION"), 16, "a closing brace too many"),
        (("Hips\n{", "Hips\n"), 4, "opening brace"),
        (("CHANNELS 6", "CHANNELS 5"), 5, "CHANNELS says 5, here are 6"),
        (("CHANNELS 3 Z", "CHANNELS 3 W"), 9, "unknown channel 'Wrotation'"),
        (("3 Zrotation Xrotation", "3 Zrotation Zrotation"), 9, "a channel occurs twice"),
        (("OFFSET 0 -2 0", "OFFSET 0 -2"), 8, "OFFSET takes 3 numbers, here are 2"),
        (("OFFSET 0 -2 0", "OFFSET 0 -2 zero"), 8, "'zero' is not a number"),
        (("    OFFSET 0 -2 0\n", ""), 13, "joint Knee has no OFFSET"),
        (("Frames: 2", "Frames: two"), 17, "instead of Frames:"),
        (("Frames: 2", "Frames: 0"), 17, "no frames"),
        (("Frames: 2", "Frames: 3"), 20, "ends after 2 of 3 frames"),
        (("Frames: 2", "Frames: 1"), 20, "more lines than frames, of which line 17 promises 1"),
        (("0.0333333", "0"), 18, "frame time is 0 s"),
        (("0.0333333", "-0.1"), 18, "frame time is -0.1 s"),
        (("0.0333333", "soon"), 18, "'soon' is not a number"),
        (("Frame Time:", "Frametime:"), 18, "instead of Frame Time:"),
        (("1 2 3 0", "1 2 x 0"), 19, "'x' is not a number"),
        (("1 2 3 0", "1 2 nan 0"), 19, "'nan' is no length, angle or time"),
        (("1 2 3 0", "1 2 1e300 0"), 19, "'1e300' is no length, angle or time"),
        (("Frames: 2", "Frames: ³"), 17, "instead of Frames:"),
        (("Frames: 2", f"Frames: {'9' * 5000}"), 17, "instead of Frames:"),
        (("Frames: 2", "Frames: 999999999"), 20, "ends after 2 of 999999999 frames"),
        (("0.0333333", "1e-99999999"), 18, "the frame time is 0 s; it must lie between"),
        (("0.0333333", "1e6"), 18, "the frame time is 1e+06 s; it must lie between"),
        (
            ("JOINT Knee", "JOINT Knee {\nOFFSET 0 1 0\n" * 2000),
            204,
            "more than 1000 joints, or 100",
        ),
        (("1 2 3 0 0 0 0 90 0", "1 2 3 0 0 0 0 90"), 19, "has 8 values, the channels are 9"),
    ],
)
def test_malformed_files_name_the_line(
    tmp_path: Path, change: tuple[str, str], line: int, words: str
) -> None:
    assert change[0] in SMALL
    path = write(tmp_path, SMALL.replace(*change, 1))
    with pytest.raises(InputError) as caught:
        read_bvh(path)
    assert f"{path}, line {line}: " in str(caught.value)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("data", "line", "words"),
    [
        (b"", 1, "empty"),
        (b" \n\n", 1, "empty"),
        (b"HIERARCHY\n\x93\xff\x00\x01", 2, "not text"),
        (b"HIERARCHY\nROOT a\0b", 2, "not text"),
        (SMALL[: SMALL.index("MOTION")].encode(), 15, "the file ends where MOTION"),
        (SMALL[:60].encode(), 5, ""),
    ],
)
def test_what_is_not_bvh_at_all(tmp_path: Path, data: bytes, line: int, words: str) -> None:
    path = write(tmp_path, data)
    with pytest.raises(InputError, match=f"line {line}: .*{words}"):
        read_bvh(path)


def test_a_missing_file_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.bvh does not exist"):
        read_bvh(tmp_path / "none.bvh")


def test_a_skeleton_without_legs_names_its_joints_and_the_root(tmp_path: Path) -> None:
    motion = read_bvh(write(tmp_path, SMALL))
    with pytest.raises(InputError, match=r"line 2: the root 'Hips'.*joints found: Hips, Knee\."):
        find_roles(motion)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("LeftUpLeg", ("upleg", "L")),
        ("mixamorig:RightForeArm", ("forearm", "R")),
        ("mixamorig_LeftHand", ("hand", "L")),
        ("lfemur", ("femur", "L")),
        ("rtibia", ("tibia", "R")),
        ("LHipJoint", ("hipjoint", "L")),
        ("lhipjoint", ("hipjoint", "L")),
        ("UpperLeg_L", ("upperleg", "L")),
        ("Bip01 R Calf", ("calf", "R")),
        ("LEFTFOOT", ("foot", "L")),
        ("rThigh", ("thigh", "R")),
        ("lShin", ("shin", "L")),
        ("Hips", ("hips", "")),
        ("LowerBack", ("lowerback", "")),
        ("root", ("root", "")),
        ("Neck", ("neck", "")),
    ],
)
def test_names(name: str, expected: tuple[str, str]) -> None:
    assert base_name(name) == expected


@pytest.mark.parametrize(
    ("scheme", "axes", "scale", "at_rest"),
    [
        (MOTION_BUILDER, Y_UP, 100.0, T_POSE),
        (MOTION_BUILDER, Z_UP, 1.0, Pose()),
        (BIOVISION, Y_UP, 39.37, T_POSE),
    ],
    ids=["t-pose-cm", "arms-down-z-up", "biovision-inches"],
)
def test_our_walk_comes_back(body_model, tmp_path: Path, scheme, axes, scale, at_rest) -> None:
    body, count = body_model.template, 12
    poses = [MOTIONS["walk"].pose(k / count) for k in range(count)]
    path = write(tmp_path, exported(body, poses, scheme, axes, scale, at_rest))
    moved = bvh_poses(read_bvh(path), body)
    assert len(moved) == count
    bones = ("upperarm01", "lowerarm01", "wrist", "lowerleg01", "foot", "toe2-1")
    rows = [body.skeleton.index[f"{bone}.{side}"] for bone in bones for side in "LR"]
    hips = [body.skeleton.index[f"upperleg01.{side}"] for side in "LR"]
    for pose, (rotations, offset) in zip(poses, moved, strict=True):
        want = body.posed_joints(body.transforms(pose_rotations(pose, body)))
        found = body.posed_joints(body.transforms(rotations, offset))
        want, found = (points - points[hips].mean(0) for points in (want, found))
        # facing comes from the first frame's hips and shoulders, which a walk turns a little
        turn, _ = Rotation.align_vectors(want[rows], found[rows])
        assert turn.magnitude() < 0.08
        np.testing.assert_allclose(turn.apply(found[rows]), want[rows], atol=0.012)


def test_a_rest_pose_that_is_no_pose(body_model, tmp_path: Path) -> None:
    """Legs folded up beside the spine, as where all bones lie along one axis at rest."""
    body = body_model.template
    folded = Pose(left_leg=Leg(hip=2.9, knee=0.2), right_leg=Leg(hip=2.9, knee=0.2))
    start = Pose(left_arm=Arm(abduction=0.4), right_arm=Arm(abduction=0.4))
    pose = Pose(left_arm=Arm(swing=1.4, elbow=1.0), right_leg=Leg(hip=0.9, knee=0.7))
    text = exported(body, [start, pose], MOTION_BUILDER, Y_UP, 100.0, folded)
    rotations, offset = bvh_poses(read_bvh(write(tmp_path, text)), body)[1]
    found = body.posed_joints(body.transforms(rotations, offset))
    want = body.posed_joints(body.transforms(pose_rotations(pose, body)))
    rows = [
        body.skeleton.index[f"{bone}.{s}"] for bone in ("wrist", "foot", "toe2-1") for s in "LR"
    ]
    np.testing.assert_allclose(found[rows], want[rows], atol=0.03)


def test_left_stays_left_and_the_person_faces_the_camera(body_model, tmp_path: Path) -> None:
    """Even where the captured person faced elsewhere."""
    body = body_model.template
    pose = Pose(turn=2.0, left_arm=Arm(abduction=1.6, elbow=0.2), right_arm=Arm(elbow=0.2))
    text = exported(body, [pose, pose], MOTION_BUILDER, Y_UP, 100.0, T_POSE)
    rotations, offset = bvh_poses(read_bvh(write(tmp_path, text)), body)[0]
    joints = body.posed_joints(body.transforms(rotations, offset))
    index = body.skeleton.index
    assert joints[index["wrist.L"], 0] > 0.5
    assert joints[index["wrist.L"], 2] - joints[index["wrist.R"], 2] > 0.4
    assert joints[index["toe2-1.L"], 1] < joints[index["foot.L"], 1]


def test_travel_is_kept_or_removed(body_model, tmp_path: Path) -> None:
    body = body_model.template
    text = exported(body, [Pose(), Pose()], MOTION_BUILDER, Y_UP, 100.0, T_POSE)
    lines = text.rstrip().split("\n")
    x, y, z, *rest = lines[-1].split()
    lines[-1] = " ".join([x, y, str(float(z) + 50), *rest])  # 50 cm along the file's z: our -y
    motion = read_bvh(write(tmp_path, "\n".join(lines)))
    kept = np.array([offset for _, offset in bvh_poses(motion, body, travel=True)])
    stays = np.array([offset for _, offset in bvh_poses(motion, body)])
    np.testing.assert_allclose(kept[1] - kept[0], [0, -0.5, 0], atol=0.005)
    np.testing.assert_allclose(stays[1] - stays[0], 0, atol=1e-6)
    points = body_model.pose(body, body.transforms(*bvh_poses(motion, body)[0]))
    assert abs(points[:, 2].min()) < 0.02


def test_resampling_works_in_time(body_model, tmp_path: Path) -> None:
    body = body_model.template
    poses = [Pose(left_arm=Arm(abduction=a)) for a in (0.2, 0.6, 1.0)]
    text = exported(body, poses, MOTION_BUILDER, Y_UP, 100.0, T_POSE)
    moved = bvh_poses(read_bvh(write(tmp_path, text)), body)
    finer = moved.resampled(7, Fraction(60))
    wrist = body.skeleton.index["wrist.L"]

    def height(item) -> float:
        return float(body.posed_joints(body.transforms(*item))[wrist, 2])

    heights = [height(item) for item in finer]
    for k in range(3):
        assert heights[2 * k] == pytest.approx(height(moved[k]), abs=1e-6)
    assert heights == sorted(heights)
    assert heights[1] == pytest.approx((heights[0] + heights[2]) / 2, abs=0.02)
    assert heights[6] == heights[4]  # after the end the body stands still
