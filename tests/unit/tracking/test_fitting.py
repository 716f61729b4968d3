"""A body fitted to landmarks of which the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("anny")

from tracking_clips import CAMERA, FOCAL, clip

from motion_transfer.estimate.interface import Landmarks
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.tracking.fitting import View, fit_postures
from motion_transfer.tracking.habits import as_postures
from motion_transfer.tracking.landmarks import posed_places
from motion_transfer.tracking.puppet import PARAMETERS, Postures, Puppet
from motion_transfer.tracking.starting import OTHER_SIDE, find_flipped, observe

VIEW = View(FOCAL, (256.0, 256.0))
LIMBS = [
    f"{bone}.{side}"
    for side in "LR"
    for bone in ("upperarm01", "lowerarm01", "wrist", "upperleg01", "lowerleg01", "foot")
]


@pytest.fixture(scope="module")
def puppet() -> Puppet:
    model = load_body_model()
    return Puppet(model.template, model)


def joints(puppet: Puppet, postures: Postures) -> np.ndarray:
    """Frames x joints x 3, from the root."""
    index = puppet.body.skeleton.index
    rows = []
    for frame in range(len(postures)):
        bones, offset = puppet.bones(postures, frame), puppet.offset(postures, frame)
        rows.append(puppet.body.posed_joints(puppet.body.transforms(bones, offset)))
    found = np.array(rows)
    return found[:, [index[name] for name in (*LIMBS, "head")]] - found[:, [index["root"]]]


def true_joints(bodies: list[PosedBody]) -> np.ndarray:
    index = bodies[0].body.skeleton.index
    found = np.array([body.joints for body in bodies])
    return found[:, [index[name] for name in (*LIMBS, "head")]] - found[:, [index["root"]]]


def swapped(marks: Landmarks) -> Landmarks:
    return Landmarks(
        marks.image[OTHER_SIDE],
        marks.world[OTHER_SIDE],
        marks.visibility[OTHER_SIDE],
        marks.presence[OTHER_SIDE],
    )


def degrees_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    cosine = (np.einsum("nij,nij->n", a, b) - 1) / 2
    return np.degrees(np.arccos(cosine.clip(-1, 1)))


@pytest.mark.parametrize("name", ["walk", "turntable", "dance"])
def test_exact_landmarks_give_joints_and_rotations_back(puppet: Puppet, name: str) -> None:
    poses, bodies, marks = clip(name)
    found, flipped = fit_postures(puppet, observe(marks), VIEW, 30)
    assert flipped == 0
    away = np.linalg.norm(joints(puppet, found) - true_joints(bodies), axis=-1)
    assert away.mean() < 0.02
    assert np.quantile(away, 0.95) < 0.05
    true = as_postures(poses)
    # two hips, a hand's length apart, say little of how the pelvis turns against the spine
    assert np.median(degrees_between(found.pelvis, true.pelvis)) < 8
    for side in (0, 1):
        thighs = [p.pelvis @ p.leg[:, side] for p in (found, true)]
        assert np.median(degrees_between(*thighs)) < 8
        assert np.median(np.abs(np.degrees(found.knee[:, side] - true.knee[:, side]))) < 5
    # the root joint lies where the camera saw it
    place = np.array([body.joints[puppet.body.skeleton.index["root"]] for body in bodies])
    assert np.abs(found.place - (place - CAMERA.position)).max() < 0.08


def test_two_flipped_frames_are_outvoted(puppet: Puppet) -> None:
    _, _, marks = clip("dance")
    whole, _ = fit_postures(puppet, observe(marks), VIEW, 30)
    spoilt = [swapped(m) if i in (20, 21) and m else m for i, m in enumerate(marks)]
    assert np.flatnonzero(find_flipped(observe(spoilt), 30)).tolist() == [20, 21]
    found, flipped = fit_postures(puppet, observe(spoilt), VIEW, 30)
    assert flipped == 2
    assert np.abs(joints(puppet, found) - joints(puppet, whole)).max() < 0.002


def test_a_wrong_limb_of_a_frame_is_outvoted(puppet: Puppet) -> None:
    _, _, marks = clip("walk")
    whole, _ = fit_postures(puppet, observe(marks), VIEW, 30)
    wrong = marks[30]
    assert wrong is not None
    image = wrong.image.copy()
    image[[15, 17, 19, 21], 1] -= 120  # the left hand, up to the face
    marks[30] = Landmarks(image, wrong.world, wrong.visibility, wrong.presence)
    found, _ = fit_postures(puppet, observe(marks), VIEW, 30)
    assert np.abs(joints(puppet, found) - joints(puppet, whole))[28:33].max() < 0.05


def test_a_turn_of_the_whole_person_is_no_flip(puppet: Puppet) -> None:
    _, _, marks = clip("turntable", 180)
    assert not find_flipped(observe(marks), 30).any()


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_frames_will_do(puppet: Puppet, count: int) -> None:
    _, bodies, marks = clip("walk", count)
    found, _ = fit_postures(puppet, observe(marks), VIEW, 30)
    away = np.linalg.norm(joints(puppet, found) - true_joints(bodies), axis=-1)
    assert away.mean() < 0.03


def test_the_puppet_stands_where_the_body_does(puppet: Puppet) -> None:
    poses, _, _ = clip("dance", 40)
    model = load_body_model()
    postures = as_postures(poses)
    marks = puppet.place(postures).landmarks
    for frame in (0, 13, 39):
        transforms = puppet.body.transforms(
            puppet.bones(postures, frame), puppet.offset(postures, frame)
        )
        body = PosedBody(
            puppet.body,
            transforms,
            model.pose(puppet.body, transforms),
            puppet.body.posed_joints(transforms),
        )
        assert np.linalg.norm(posed_places(body, model) - marks[frame], axis=1).max() < 0.012


def test_slopes_are_those_of_small_steps(puppet: Puppet) -> None:
    postures = as_postures(clip("dance", 3)[0])
    placed = puppet.place(postures)
    slopes = placed.slopes()
    worst = 0.0
    for number in range(PARAMETERS):
        step = np.zeros((3, PARAMETERS))
        step[:, number] = 1e-4
        moved = puppet.place(postures.turned(step)).landmarks
        measured = (moved - placed.landmarks) / 1e-4
        worst = max(worst, np.abs(measured - slopes[..., number]).max())
    # collar bones follow arms, and bends of the spine add up: both are left out of the slopes
    assert worst < 0.12


def test_steps_lead_from_one_posture_to_another(puppet: Puppet) -> None:
    a, b = (as_postures(clip("dance", 30)[0])[frames] for frames in (slice(0, 4), slice(5, 9)))
    reached = a.turned(b.away_from(a))
    for name in ("place", "pelvis", "spine", "arm", "elbow", "hand", "leg", "knee", "foot"):
        assert getattr(reached, name) == pytest.approx(getattr(b, name), abs=1e-9)
