"""A person's own texture, painted through the exact IUV, is the person: charts, IUV and rendering
agree about where on the body a pixel lies."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from reference.people_iuv import barycentric  # noqa: E402

from motion_transfer.people.figure.camera import frame_points  # noqa: E402
from motion_transfer.people.figure.charts import load_charts, render_iuv  # noqa: E402
from motion_transfer.people.figure.mesh import Material, Piece  # noqa: E402
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids  # noqa: E402
from motion_transfer.people.motion.pose_sampler import sample_pose  # noqa: E402
from motion_transfer.people.person import DressedPerson, sample_person  # noqa: E402
from motion_transfer.people.picture.shade import Scene  # noqa: E402

TILE = 256


def look_up(texture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Bilinear colours (N, 3) of a texture at coordinates (N, 2), pixel centres at +0.5."""
    height, width = texture.shape[:2]
    place = np.clip(uv * [width, height] - 0.5, 0, [width - 1.001, height - 1.001])
    (x, y), (fx, fy) = place.astype(int).T, (place % 1).T[..., None]
    top = texture[y, x] * (1 - fx) + texture[y, x + 1] * fx
    bottom = texture[y + 1, x] * (1 - fx) + texture[y + 1, x + 1] * fx
    return (top * (1 - fy) + bottom * fy)[:, :3]


def unfold(piece: Piece, model) -> np.ndarray:
    """The piece's bare colours as an atlas: 24 charts of TILE x TILE, rows V, columns U."""
    charts = load_charts()
    number = {tuple(face): index for index, face in enumerate(model.faces.tolist())}
    ours = np.array([number[tuple(face)] for face in piece.faces.tolist()])
    atlas = np.zeros((24, TILE * TILE, 3), np.float32)
    for part in range(1, 25):
        own = np.flatnonzero(charts.part[ours] == part)
        flat = np.ones((len(own) * 3, 3), np.float32)
        flat[:, :2] = charts.uv[ours[own]].reshape(-1, 2) * (TILE - 1) + 0.5
        corners = np.arange(len(flat), dtype=np.int32).reshape(-1, 3)
        face = triangle_ids(rasterise(flat, Triangles.two_sided(corners), TILE, TILE))
        pixel = np.flatnonzero(face >= 0)
        weights = barycentric(flat[corners[face[pixel]]], pixel, TILE)
        uv = np.einsum("pk,pkc->pc", weights, piece.corner_uv[own[face[pixel]]])
        atlas[part - 1, pixel] = look_up(piece.material.texture, uv)
    return atlas.reshape(24, TILE, TILE, 3)


def differences(piece: Piece, dressed: DressedPerson, model, pose) -> np.ndarray:
    """How far painting through the IUV is from drawing, per pixel inside parts, 0..1."""
    posed = dressed.posed(pose)
    camera = frame_points(posed.points, (256, 256), distance=3.0)
    drawn = Scene([piece]).shade(piece.posed(posed), camera, None)
    iuv = render_iuv(posed.points, model.faces, load_charts(), camera)
    part, u, v = np.moveaxis(iuv.astype(int), 2, 0)
    painted = unfold(piece, model)[np.maximum(part, 1) - 1, v, u]
    borders = cv2.morphologyEx(iuv[..., 0], cv2.MORPH_GRADIENT, np.ones((5, 5))) > 0
    inside = (part > 0) & ~borders & (drawn.coverage == 1)
    assert inside.sum() > 1000
    return np.abs(painted - drawn.rgba[..., :3])[inside].max(1)


def bare(dressed: DressedPerson) -> Piece:
    skin = dressed.pieces[0]
    return replace(skin, keep=np.ones_like(skin.keep))


@pytest.mark.parametrize("seed", range(3))
def test_skin_is_reproduced(body_model, seed):
    rng = np.random.default_rng(seed)
    dressed = DressedPerson(sample_person(rng), body_model)
    off = differences(bare(dressed), dressed, body_model, sample_pose(rng))
    assert np.median(off) < 0.01 and np.quantile(off, 0.95) < 0.06


def test_every_place_is_reproduced(body_model):
    """As before, with colours that differ everywhere: red tells x, green tells z at rest."""
    rng = np.random.default_rng(7)
    dressed = DressedPerson(sample_person(rng), body_model)
    skin = bare(dressed)
    points = body_model.template.points[:, [0, 2]]
    place = (points - points.min(0)) / np.ptp(points, axis=0) * 0.9 + 0.05
    texture = np.zeros((128, 128, 4), np.float32)
    texture[..., 0], texture[..., 1] = np.linspace(0, 1, 128), np.linspace(0, 1, 128)[:, None]
    told = replace(
        skin,
        corner_uv=place[skin.faces].astype(np.float32),
        material=Material(texture, (1.0, 1.0)),
    )
    off = differences(told, dressed, body_model, sample_pose(rng))
    assert np.median(off) < 0.006 and np.quantile(off, 0.98) < 0.03
