"""Garments on bodies: they cover what they should and keep off what they should."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.clothes import cuts
from motion_transfer.people.clothes.fabrics import Fabric
from motion_transfer.people.clothes.fit import Fitting
from motion_transfer.people.clothes.flattening import vertex_normals
from motion_transfer.people.clothes.garments import DressedBody
from motion_transfer.people.clothes.outfits import sample_outfit
from motion_transfer.people.clothes.patterns import bottom_pattern, top_pattern
from motion_transfer.people.clothes.surface import along_polyline
from motion_transfer.people.clothes.wardrobe import (
    Belt,
    Outfit,
    Scarf,
    Shoes,
    Skirt,
    Top,
    Trousers,
)
from motion_transfer.people.figure.body import Shape

CLOTH = Fabric("plain", ((0.4, 0.5, 0.6),), 0.001, 0.0, 0.02, "jersey", 1)
TOP = Top("t_shirt", CLOTH, hem=0.05)
JEANS = Trousers("jeans", CLOTH, length=1.0)
OUTFIT = Outfit(Shoes("sneakers"), top=TOP, trousers=JEANS)
EXTREMES = [
    Shape(gender=0, weight=1, muscle=0, height=1, age=1),
    Shape(gender=1, weight=0, muscle=0, height=0, age=0.6),
    Shape(gender=1, weight=1, cupsize=1, firmness=0),
    Shape(gender=0, weight=0, muscle=1),
]


def dressed(outfit, shape, body_model, surface):
    body = body_model.body(shape)
    return body, DressedBody(outfit, body, surface)


def check(pieces) -> None:
    for piece in pieces:
        assert np.isfinite(piece.points).all(), piece.name
        assert np.isfinite(piece.keep).all(), piece.name
        texture = piece.material.texture
        assert np.isfinite(texture).all(), piece.name
        assert texture[..., :3].min() >= 0, piece.name
        assert texture[..., :3].max() <= 1, piece.name
        assert np.abs(texture[..., 3]).max() < 0.05, piece.name
        total = np.asarray(piece.weights.matrix.sum(1)).ravel()
        np.testing.assert_allclose(total, 1, atol=2e-3, err_msg=piece.name)
        seen = (piece.keep[piece.faces] >= 0).any(1)
        assert piece.corner_uv[seen].min() > -0.01, piece.name
        assert piece.corner_uv[seen].max() < 1.01, piece.name


def test_the_same_outfit_is_built_the_same(body_model, surface):
    _, first = dressed(OUTFIT, Shape(), body_model, surface)
    _, second = dressed(OUTFIT, Shape(), body_model, surface)
    assert [p.name for p in first.pieces] == ["trousers", "top", "shoes", "shoes"]
    for a, b in zip(first.pieces, second.pieces, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.material.texture, b.material.texture)


@pytest.mark.parametrize("shape", EXTREMES)
def test_sampled_outfits_fit_extreme_bodies(shape, body_model, surface, in_stride):
    rng = np.random.default_rng(int(shape.gender * 10 + shape.weight))
    for _ in range(6):
        outfit = sample_outfit(rng, shape)
        body, result = dressed(outfit, shape, body_model, surface)
        check(result.pieces)
        pose = in_stride(body)
        for piece in result.pieces:
            assert np.isfinite(piece.posed(pose)).all()


@pytest.mark.parametrize("neck", ["crew", "v", "scoop", "boat", "square", "off_shoulder",
                                  "straps", "turtle"])  # fmt: skip
@pytest.mark.parametrize("sleeve", [0.0, 0.4, 1.0])
def test_every_neckline_and_sleeve_is_built(neck, sleeve, body_model, surface):
    top = replace(TOP, neck=neck, sleeve=sleeve, neck_depth=0.06)
    _, result = dressed(Outfit(Shoes("bare"), top=top), Shape(), body_model, surface)
    check(result.pieces)
    assert (result.pieces[0].keep >= 0).sum() > 500


@pytest.mark.parametrize("kind", ["mini", "pencil", "a_line", "circle", "pleated", "maxi",
                                  "tiered"])  # fmt: skip
def test_every_skirt_is_built(kind, body_model, surface):
    belt = Belt((0.2, 0.1, 0.1), 0.03, (0.7, 0.7, 0.7))
    skirt = Skirt(kind, CLOTH, length=0.5, flare=0.3, waves=8, wave_height=0.01, belt=belt,
                  pleats=kind == "pleated")  # fmt: skip
    scarf = Scarf(CLOTH, 0.03, 1)
    outfit = Outfit(Shoes("boots", shaft=0.2), top=TOP, skirt=skirt, tucked=True, scarf=scarf)
    check(dressed(outfit, Shape(gender=1), body_model, surface)[1].pieces)


@pytest.mark.parametrize("kind", ["sneakers", "trainers", "boots", "flats", "sandals", "loafers"])
def test_shoes_hold_the_feet(kind, body_model, surface):
    body, result = dressed(Outfit(Shoes(kind), top=TOP), Shape(), body_model, surface)
    left, right = (p for p in result.pieces if p.name == "shoes")
    assert left.points[:, 0].min() > 0 > right.points[:, 0].max()
    toes = body.points[(body.points[:, 2] < 0.05) & (body.points[:, 0] > 0)]
    assert left.points[:, 1].min() < toes[:, 1].min()
    assert left.points[:, 2].min() < 0


def test_skin_is_hidden_only_well_inside_garments(body_model, surface):
    _, result = dressed(OUTFIT, Shape(), body_model, surface)
    at, levels = surface.places, surface.levels
    inside = np.full(len(at.x), -1.0, np.float32)
    index = top_pattern(surface).index
    inside[index] = cuts.top_depth(TOP, top_pattern(surface).vertices, levels)
    low = bottom_pattern(surface)
    inside[low.index] = np.maximum(
        inside[low.index], cuts.trousers_depth(JEANS, low.vertices, levels)
    )
    hidden = result.keep < 0
    feet = surface.z < 0.1
    assert hidden[(inside > 0.015)].all()
    assert not hidden[(inside < 0.0) & ~feet].any()


@pytest.mark.parametrize("shape", EXTREMES)
def test_close_garments_stay_outside_the_skin(shape, body_model, surface):
    fitting = Fitting(surface, body_model.body(shape))
    pattern = top_pattern(surface)
    points = fitting.close(pattern, np.full(len(pattern.index), 0.008, np.float32))
    skin = fitting.body.points[pattern.index]
    out = ((points - skin) * vertex_normals(skin, pattern.faces, pattern.sums)).sum(1)
    assert np.quantile(out, 0.02) > 0.002
    assert np.median(out) < 0.03


@pytest.mark.parametrize("sleeve", [0.3, 0.6, 0.9])
def test_a_sleeve_is_as_long_as_asked(sleeve, body_model, surface):
    body, result = dressed(
        Outfit(Shoes("bare"), top=replace(TOP, sleeve=sleeve)), EXTREMES[1], body_model, surface
    )
    piece = result.pieces[0]
    joints = surface.limb_joints(body, "arm", "L")
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):  # where edges cross the sleeve's end
        first, second = piece.faces[:, a], piece.faces[:, b]
        on_arm = surface.on_arm[top_pattern(surface).index]
        crossing = (piece.keep[first] * piece.keep[second] < 0) & on_arm[first] & on_arm[second]
        f, s = first[crossing], second[crossing]
        t = piece.keep[f] / (piece.keep[f] - piece.keep[s])
        ends.append(body.points[top_pattern(surface).index[f]] * (1 - t[:, None])
                    + body.points[top_pattern(surface).index[s]] * t[:, None])  # fmt: skip
    ends = np.concatenate(ends)
    ends = ends[(ends[:, 0] > 0.1)]
    along, _ = along_polyline(ends, joints)
    asked = sleeve * surface.limb_length(body, "arm")
    assert np.median(along) == pytest.approx(asked, abs=0.02)


def test_an_open_jacket_shows_the_top_and_cuts_it_elsewhere(body_model, surface):
    over = replace(TOP, kind="jacket", sleeve=1.0, opening="open", gap=0.06, neck="v",
                   neck_depth=0.2, ease=0.012, collar="lapels")  # fmt: skip
    _, result = dressed(replace(OUTFIT, over=over), Shape(), body_model, surface)
    pieces = {piece.name: piece for piece in result.pieces}
    at = top_pattern(surface).vertices
    chest = (np.abs(at.x) < 0.02) & (at.y < -0.08) & (np.abs(at.z - surface.levels.waist) < 0.1)
    back = (np.abs(at.x) < 0.02) & (at.y > 0.02) & (np.abs(at.z - surface.levels.waist) < 0.1)
    assert (pieces["top"].keep[chest] > 0).all()
    assert (pieces["over"].keep[chest] < 0).all()
    assert (pieces["top"].keep[back] < 0).all()
    assert (pieces["over"].keep[back] > 0).all()
    assert "collar" in pieces


def test_tucking_cuts_the_top_at_the_waistband(body_model, surface):
    at = top_pattern(surface).vertices
    low = at.z < surface.levels.waist + JEANS.rise - 0.05
    _, loose = dressed(OUTFIT, Shape(), body_model, surface)
    _, tucked = dressed(replace(OUTFIT, tucked=True), Shape(), body_model, surface)
    assert (loose.pieces[1].keep[low] > 0).any()
    assert not (tucked.pieces[1].keep[low] > 0).any()


def test_close_garments_move_with_the_body(body_model, surface, in_stride):
    body, result = dressed(OUTFIT, Shape(), body_model, surface)
    pose = in_stride(body)
    for piece, pattern in zip(
        result.pieces, (bottom_pattern(surface), top_pattern(surface)), strict=False
    ):
        seen = piece.keep > 0
        skin = pose.points[pattern.index[seen]]
        apart = np.linalg.norm(piece.posed(pose)[seen] - skin, axis=1)
        assert np.median(apart) < 0.03
        assert apart.max() < 0.15
