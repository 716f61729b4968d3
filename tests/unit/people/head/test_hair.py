"""Hair: off the head, on every body, and never through it."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest
from scipy.spatial import KDTree

from motion_transfer.people.figure.body import Body, BodyModel, Shape
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.head.faces import Hairline, sample_face
from motion_transfer.people.head.hair import HATS, STYLES, Hair, hair_pieces, sample_hair
from motion_transfer.people.head.skin_atlas import skin_atlas

EXTREMES = (
    Shape(gender=0, age=1, weight=1, african=1, asian=0, caucasian=0),
    Shape(gender=1, age=0.6, weight=0, african=0, asian=1, caucasian=0),
    Shape(gender=1, age=0.7, weight=1, african=0, asian=0, caucasian=1, cupsize=1),
)
HANGING = ("bob", "shoulder", "long", "ponytail", "braid")


def turn(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def nod(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


HEAD_TURNED = {"neck01": turn(20), "neck03": turn(20), "head": turn(20)}
BENT = {"spine03": nod(25), "head": nod(20)}


def pose(body: Body, model: BodyModel, rotations: dict[str, np.ndarray]) -> PosedBody:
    transforms = body.transforms(rotations)
    points = model.pose(body, transforms)
    return PosedBody(body, transforms, points, body.posed_joints(transforms))


class Skin:
    """The skin of a posed body, without ears and the face's holes, as dense samples."""

    def __init__(self, model: BodyModel, posed: PosedBody) -> None:
        faces = skin_atlas(model).skin
        middle = model.template.points[faces].mean(1)
        x, y, z = np.abs(middle[:, 0]), middle[:, 1], middle[:, 2]
        ear = (x > 0.068) & (z > 1.655) & (z < 1.74) & (y > -0.08)
        hole = (y < -0.06) & (z > 1.60) & (z < 1.75) & (x < 0.05)  # lids, nostrils, lips, mouth
        corners = posed.points[faces[(z > 1.0) & (x < 0.35) & ~ear & ~hole]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shares = np.array([(a, b, 3 - a - b) for a in range(4) for b in range(4 - a)]) / 3
        self.samples = np.einsum("sk,fkx->fsx", shares, corners).reshape(-1, 3)
        self.normals = normals.repeat(len(shares), 0)
        self.tree = KDTree(self.samples, balanced_tree=False)

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Metres below the nearest skin, negative outside."""
        _, near = self.tree.query(points)
        return -((points - self.samples[near]) * self.normals[near]).sum(1)


@pytest.fixture(scope="module")
def bodies(body_model):
    """The extreme bodies, each with its skin at rest and in two poses."""
    out = []
    for shape in EXTREMES:
        body = body_model.body(shape)
        poses = [pose(body, body_model, turns) for turns in ({}, HEAD_TURNED, BENT)]
        out.append((body, [(each, Skin(body_model, each)) for each in poses]))
    return out


def hair_of(style: str, **changes) -> Hair:
    lengths = {"bob": 0.1, "shoulder": 0.2, "long": 0.45, "ponytail": 0.3, "braid": 0.4}
    numbers = {"length": lengths.get(style, 0.0), "volume": 0.06 if style == "afro" else 0.018}
    return Hair(style, **{**numbers, **changes})


def test_hair_is_drawn_alike_from_the_same_seed():
    first, again = (sample_hair(np.random.default_rng(3), Shape()) for _ in range(2))
    assert first == again
    assert first != sample_hair(np.random.default_rng(4), Shape())


def test_descriptions_are_json():
    for seed in range(40):
        hair = sample_hair(np.random.default_rng(seed), Shape(gender=seed % 2))
        assert json.loads(json.dumps(asdict(hair)))["style"] in STYLES


def test_every_style_and_hat_is_drawn():
    drawn = [
        sample_hair(np.random.default_rng(seed), Shape(gender=seed % 2)) for seed in range(1500)
    ]
    assert {hair.style for hair in drawn} == set(STYLES)
    assert {hair.hat for hair in drawn} == set(HATS)


def test_hair_takes_the_faces_colour_unless_dyed():
    same = 0
    for seed in range(50):
        face = sample_face(np.random.default_rng(seed), Shape(gender=0))
        hair = sample_hair(np.random.default_rng(seed), Shape(gender=0), face)
        assert hair.hairline == face.hairline
        same += hair.colour == pytest.approx(face.hair_colour) or face.grey > 0
    assert same > 40


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("shape", EXTREMES)
def test_every_style_builds_on_every_body(body_model, style, shape):
    body = body_model.body(shape)
    for number, changes in enumerate(
        (
            {"part": 1.0, "front": 1.0, "wave": 0.01, "curl": 1.0},
            {"fringe": 1.0, "front": 0.5, "tie": 0.0, "grey": 0.3},
            {"hat": "beanie", "tuck": True, "part": -1.0, "tie": 1.0},
            {"hat": "cap", "hairline": Hairline(10, 20, 0, 0.9)},
            {"hat": "brim", "volume": 0.05},
        )
    ):
        pieces = hair_pieces(hair_of(style, **changes, seed=number), body, body_model)
        assert pieces or style == "bald"
        for piece in pieces:
            assert np.isfinite(piece.points).all()
            assert np.isfinite(piece.keep).all()
            assert (piece.keep > 0).any()
            assert piece.points.dtype == piece.corner_uv.dtype == np.float32
            assert piece.faces.dtype == np.int32
            assert piece.faces.max() < len(piece.points) == len(piece.keep)
            assert piece.corner_uv.shape == (*piece.faces.shape, 2)
            assert piece.corner_uv.min() >= 0
            assert piece.corner_uv.max() <= 1
            rows = np.asarray(piece.weights.matrix.sum(1)).ravel()
            assert rows == pytest.approx(1, abs=1e-5)


def test_pieces_are_the_descriptions_alone(body_model):
    hair = hair_of("long", wave=0.01, front=1.0, seed=9)
    body = body_model.body(EXTREMES[1])
    for a, b in zip(*(hair_pieces(hair, body, body_model) for _ in range(2)), strict=True):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.material.texture, b.material.texture)
        assert np.array_equal(a.keep, b.keep)
    other = hair_pieces(hair_of("long", wave=0.01, front=1.0, seed=10), body, body_model)
    assert not np.array_equal(other[0].keep, hair_pieces(hair, body, body_model)[0].keep)


@pytest.mark.parametrize("style", [style for style in STYLES if style != "bald"])
def test_hair_lies_outside_the_head_and_neck(body_model, bodies, style):
    for body, ((_, skin), *_) in bodies:
        for piece in hair_pieces(hair_of(style, front=1.0), body, body_model):
            depth = skin.depth(piece.points[piece.keep > 0])
            # a knot's inner side is sunk into the hair around it
            assert depth.max() < (0.015 if piece.name in ("hair_bun", "hair_tail") else 0.006)


@pytest.mark.parametrize("style", HANGING)
@pytest.mark.parametrize("number", [1, 2], ids=["turned", "bent"])
def test_settled_hair_lies_outside_the_body(body_model, bodies, style, number):
    for body, poses in bodies:
        posed, skin = poses[number]
        for front in (0.0, 1.0):
            for piece in hair_pieces(hair_of(style, front=front), body, body_model):
                points = piece.posed(posed)[piece.keep > 0]
                assert np.isfinite(points).all()
                depth = skin.depth(points)
                assert np.quantile(depth, 0.97) < 0.004
                assert depth.max() < 0.02


def test_settling_changes_nothing_at_rest(body_model):
    body = body_model.body(EXTREMES[1])
    rest = pose(body, body_model, {})
    for style in HANGING:
        for piece in hair_pieces(hair_of(style, front=1.0), body, body_model):
            assert piece.posed(rest) == pytest.approx(piece.points, abs=1e-4)


def test_loose_hair_hangs_down_when_the_body_bends(body_model):
    body = body_model.body(EXTREMES[1])
    posed = pose(body, body_model, {"spine03": nod(60), "head": nod(30)})
    piece = hair_pieces(hair_of("bob"), body, body_model)[0]
    rigid = piece.weights.pose(piece.points, posed.transforms)
    assert piece.posed(posed)[-72:, 2].mean() < rigid[-72:, 2].mean() - 0.01


def test_hair_falls_in_front_of_the_shoulders_only_if_asked_to(body_model):
    body = body_model.body(EXTREMES[1])
    chest = body.joint("neck01")[1] - 0.07
    counts = []
    for front in (0.0, 1.0):
        points = hair_pieces(hair_of("long", front=front), body, body_model)[0].points
        low = points[points[:, 2] < body.joint("neck01")[2] - 0.10]
        counts.append(int((low[:, 1] < chest).sum()))
    assert 10 * counts[0] < counts[1]


def test_a_tail_starts_at_the_back_of_the_head_wherever_it_looks(body_model):
    body = body_model.body(EXTREMES[1])
    posed = pose(body, body_model, HEAD_TURNED)
    tail = hair_pieces(hair_of("ponytail", tie=0.5), body, body_model)[-1]
    ring = tail.posed(posed)[:14]
    assert np.ptp(ring, axis=0).max() > 0.01
    turned = turn(-60) @ (ring.mean(0) - posed.joints[body.skeleton.index["head"]])
    assert turned[1] > 0.08
    assert abs(turned[0]) < 0.02
    assert np.linalg.norm(posed.points - ring.mean(0), axis=1).min() < 0.03


def test_a_fringe_covers_the_forehead(body_model):
    body = body_model.template
    heights = []
    for fringe in (0.0, 0.85):
        piece = hair_pieces(hair_of("long", fringe=fringe), body, body_model)[0]
        seen = piece.points[piece.keep > 0]
        ahead = seen[(np.abs(seen[:, 0]) < 0.03) & (seen[:, 1] < -0.10)]
        heights.append(float(ahead[:, 2].min()) if len(ahead) else np.inf)
    assert 1.712 < heights[1] < 1.765 < heights[0]  # its longest strand ends at the eyes


def test_hats_hold_hair_down(body_model):
    body = body_model.template
    plain, under = (
        next(
            piece
            for piece in hair_pieces(hair_of("short", volume=0.03, hat=hat), body, body_model)
            if piece.name == "hair"
        )
        for hat in ("none", "beanie")
    )
    assert plain.points[:, 2].max() > under.points[:, 2].max() + 0.01


def test_an_unknown_style_is_refused(body_model):
    with pytest.raises(KeyError):
        hair_pieces(Hair("mullet"), body_model.template, body_model)
