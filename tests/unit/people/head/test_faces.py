"""Faces: descriptions, and skin painted from them."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from motion_transfer.people.figure.body import BodyModel, Shape
from motion_transfer.people.figure.mesh import Piece
from motion_transfer.people.head.faces import BEARDS, GLASSES, Complexion, Face, MakeUp, sample_face
from motion_transfer.people.head.skin import skin_pieces
from motion_transfer.people.head.skin_atlas import skin_atlas

EXTREMES = (
    Shape(gender=0, age=1, weight=1, african=1, asian=0, caucasian=0),
    Shape(gender=1, age=0.6, weight=0, african=0, asian=1, caucasian=0),
    Shape(gender=0, age=0.6, weight=0, african=0, asian=0, caucasian=1),
    Shape(gender=1, age=1, weight=1, african=0.3, asian=0.3, caucasian=0.4),
)


def piece(pieces: list[Piece], name: str) -> Piece:
    return next(each for each in pieces if each.name == name)


def colours_at(skin: Piece, model: BodyModel, x: float, z: float, radius: float) -> np.ndarray:
    """Colours of the texels of a disc on the front of the template's face."""
    place = skin_atlas(model).place
    near = np.hypot(place[..., 0] - x, place[..., 2] - z) < radius
    return skin.material.texture[: len(place)][near & (place[..., 1] < -0.08)][:, :3]


@pytest.mark.parametrize("shape", EXTREMES)
def test_a_face_is_drawn_alike_from_the_same_seed(shape):
    first, again = (sample_face(np.random.default_rng(4), shape) for _ in range(2))
    assert first == again
    assert first != sample_face(np.random.default_rng(5), shape)


def test_descriptions_are_json():
    for seed in range(30):
        face = sample_face(np.random.default_rng(seed), Shape(gender=seed % 2))
        assert json.loads(json.dumps(asdict(face)))["seed"] == face.seed


def test_beards_go_with_men_and_make_up_with_women():
    men = [sample_face(np.random.default_rng(seed), Shape(gender=0)) for seed in range(60)]
    women = [sample_face(np.random.default_rng(seed), Shape(gender=1)) for seed in range(60)]
    assert all(face.make_up == MakeUp() for face in men)
    assert all(face.beard == "none" for face in women)
    assert {face.beard for face in men} == set(BEARDS)


def test_darker_tones_are_darker():
    sums = [sum(Complexion(tone).colour) for tone in np.linspace(0, 1, 9)]
    assert sums == sorted(set(sums), reverse=True)


def test_the_skin_has_the_bodys_vertices_in_their_order(body_model):
    body = body_model.body(EXTREMES[0])
    skin = piece(skin_pieces(Face(Complexion(0.3)), body, body_model), "skin")
    assert np.array_equal(skin.points, body.points)
    eyes = {tuple(row) for row in body_model.faces.tolist()} - {
        tuple(row) for row in skin.faces.tolist()
    }
    assert 100 < len(eyes) < 400  # nothing but the two eyeballs is left out
    seen = body.points[np.unique(list(eyes))]
    assert np.abs(np.abs(seen[:, 0]) - body.joint("eye.L")[0]).max() < 0.02


def test_the_texture_is_the_faces_alone(body_model):
    face = sample_face(np.random.default_rng(1), Shape())
    bodies = [body_model.body(shape) for shape in EXTREMES[:2]]
    first, second = (skin_pieces(face, body, body_model) for body in bodies)
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.material.texture, b.material.texture)
        assert np.array_equal(a.corner_uv, b.corner_uv)
    other = skin_pieces(replace(face, seed=face.seed + 1), bodies[0], body_model)
    assert not np.array_equal(other[0].material.texture, first[0].material.texture)


@pytest.mark.parametrize("shape", EXTREMES)
def test_the_iris_lies_where_the_eye_looks(body_model, shape):
    body = body_model.body(shape)
    face = Face(Complexion(0.3), iris=(0.9, 0.1, 0.1))
    eyes = piece(skin_pieces(face, body, body_model), "eyes")
    for side, half in (("L", 0), ("R", 1)):
        joint = body.joint(f"eye.{side}")
        middles = eyes.points[eyes.faces].mean(1)
        ahead = middles - joint - [0, -0.015, 0]
        front = int(np.argmin((ahead**2).sum(1)))
        # the texture, looked up where the eyeball's front is pierced by the gaze
        corners = eyes.points[eyes.faces[front]][:, [0, 2]]
        system = np.vstack([corners.T, np.ones(3)])
        weights = np.linalg.solve(system, [joint[0], joint[2], 1])
        u, v = weights @ eyes.corner_uv[front]
        assert (u < 0.5) == (half == 0)
        assert u * 2 % 1 == pytest.approx(0.5, abs=0.08)  # 8 % of 30 mm
        assert v == pytest.approx(0.5, abs=0.08)
    tile = eyes.material.texture[:, :48]
    red = tile[..., 0] - tile[..., 1] > 0.3
    _, columns = np.nonzero(red)
    assert abs(columns.mean() - 23.5) < 2
    white = tile[24, 6]
    assert white[1] > 0.2


def test_lips_are_where_the_mouth_is_and_brows_above_the_eyes(body_model):
    paint = MakeUp(lips=1.0, lipstick=(0.9, 0.0, 0.0))
    face = Face(Complexion(0.1), hair_colour=(0.02, 0.02, 0.02), make_up=paint, scalp=0.0)
    skin = piece(skin_pieces(face, body_model.template, body_model), "skin")
    lip = colours_at(skin, body_model, 0, 1.643, 0.002).mean(0)
    cheek = colours_at(skin, body_model, 0.05, 1.68, 0.005).mean(0)
    assert lip[0] > 4 * lip[1]
    assert cheek[0] < 2.5 * cheek[1]
    forehead = colours_at(skin, body_model, 0, 1.77, 0.01).sum(1).mean()
    for side in (1, -1):
        brow = colours_at(skin, body_model, 0.035 * side, 1.742, 0.006).sum(1)
        assert brow.min() < 0.5 * forehead


def test_dark_skin_has_paler_palms(body_model):
    body = body_model.template
    skin = piece(skin_pieces(Face(Complexion(0.85)), body, body_model), "skin")
    middle = (body.joint("finger3-1.L") + body.joint("wrist.L")) / 2
    near = np.linalg.norm(body.points[skin.faces] - middle, axis=2) < 0.03
    rows = (skin.corner_uv[near][:, 1] * len(skin.material.texture)).astype(int)
    light = skin.material.texture[rows, 200, :3].sum(1)
    assert light.max() > 1.5 * light.min()


@pytest.mark.parametrize("shape", EXTREMES)
def test_all_there_is_to_wear_is_finite_and_stays_at_the_head(body_model, shape):
    body = body_model.body(shape)
    for beard in BEARDS:
        for glasses in GLASSES:
            face = Face(Complexion(0.4), beard=beard, beard_length=10, glasses=glasses)
            for each in skin_pieces(face, body, body_model)[2:]:
                assert np.isfinite(each.points).all()
                assert np.linalg.norm(each.points - body.joint("head"), axis=1).max() < 0.25
                rows = np.asarray(each.weights.matrix.sum(1)).ravel()
                assert rows == pytest.approx(1, abs=1e-5)


def test_lenses_keep_clear_of_the_eyes(body_model):
    for shape in EXTREMES:
        body = body_model.body(shape)
        face = Face(Complexion(0.4), glasses="sun")
        pieces = skin_pieces(face, body, body_model)
        eyes, glasses = piece(pieces, "eyes"), piece(pieces, "glasses")
        assert glasses.points[:, 1].min() < eyes.points[:, 1].min() - 0.005
