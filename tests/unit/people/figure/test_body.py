"""Shapes and posing of the body model."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer import extras
from motion_transfer.errors import InputError
from motion_transfer.people.figure.body import Shape, is_cached, load_body_model


def turn_about_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_at_rest_nothing_moves(body_model):
    body = body_model.template
    assert body_model.pose(body, body.transforms({})) == pytest.approx(body.points, abs=1e-5)


def test_left_is_at_plus_x_and_the_face_at_minus_y(body_model):
    body = body_model.template
    assert body.joint("wrist.L")[0] > 0.3 and body.joint("wrist.R")[0] < -0.3
    assert body.joint("eye.L")[1] < body.joint("head")[1]
    assert body.points[:, 2].min() == 0


def test_a_turned_upper_arm_carries_its_hand_and_nothing_else(body_model):
    body = body_model.template
    turn = turn_about_y(0.5)
    posed = body_model.pose(body, body.transforms({"upperarm01.L": turn}))
    still = body_model.weights.matrix[:, [body.skeleton.index["wrist.R"]]].toarray()[:, 0] > 0.9
    hand = body_model.weights.matrix[:, [body.skeleton.index["finger3-3.L"]]].toarray()[:, 0] > 0.9
    assert posed[still] == pytest.approx(body.points[still], abs=1e-6)
    shoulder = body.joint("upperarm01.L")
    expected = (body.points[hand] - shoulder) @ turn.T + shoulder
    assert posed[hand] == pytest.approx(expected, abs=1e-4)


def test_rotations_follow_one_another_down_the_arm(body_model):
    body = body_model.template
    upper, lower = turn_about_y(0.4), turn_about_y(-0.7)
    joints = body.posed_joints(body.transforms({"upperarm01.L": upper, "lowerarm01.L": lower}))
    shoulder, elbow, wrist = (body.joint(b) for b in ("upperarm01.L", "lowerarm01.L", "wrist.L"))
    new_elbow = shoulder + upper @ (elbow - shoulder)
    new_wrist = new_elbow + upper @ lower @ (wrist - elbow)
    assert joints[body.skeleton.index["wrist.L"]] == pytest.approx(new_wrist, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "measure"),
    [
        ("height", lambda body: body.height),
        ("weight", lambda body: np.ptp(body.points[torso(body), 1])),
    ],
)
def test_shape_numbers_do_what_they_say(body_model, name, measure):
    small, large = (measure(body_model.body(Shape(**{name: value}))) for value in (0.1, 0.9))
    assert large > 1.05 * small


def torso(body) -> np.ndarray:
    low, high = body.joint("spine05")[2], body.joint("spine02")[2]
    return (body.points[:, 2] > low) & (body.points[:, 2] < high) & (abs(body.points[:, 0]) < 0.2)


def test_weights_share_each_vertex_among_bones(body_model):
    sums = body_model.weights.matrix.sum(axis=1)
    assert sums == pytest.approx(np.ones(len(sums)), abs=1e-5)


def test_an_unknown_bone_is_a_key_error(body_model):
    with pytest.raises(KeyError, match="wing"):
        body_model.template.transforms({"wing": np.eye(3)})


def test_without_the_extra_the_command_that_installs_it_is_named(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda _name: None)
    for ask in (load_body_model.__wrapped__, is_cached):
        with pytest.raises(InputError, match=r"pip install 'motion-transfer\[people\]'"):
            ask()
