"""Photographed surfaces: pictures at several sizes, dyed, cut out by alpha, bent by normals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.figure.body import SkinWeights
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.figure.picture import (
    LEVELS,
    Overlay,
    Picture,
    mean_brightness,
)
from motion_transfer.people.picture.light import Lamp, Light
from motion_transfer.people.picture.shade import Scene

SQUARE = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
CORNERS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)[FACES]
CAMERA = Camera(64, 64, 64.0, 2.0, (0.0, 0.0, 0.0))  # the square fills the picture


def plain(red: int, green: int, blue: int, alpha: int = 255, side: int = 32) -> Picture:
    return Picture.of(np.full((side, side, 4), (red, green, blue, alpha), np.uint8))


def square(overlay: Overlay) -> Piece:
    return Piece(
        name="square",
        points=SQUARE,
        faces=FACES,
        weights=SkinWeights(csr_array(np.ones((4, 1), np.float32))),
        corner_uv=CORNERS,
        material=Material(np.zeros((1, 1, 4), np.float32), (1.0, 1.0), overlay=overlay),
        keep=np.ones(4, np.float32),
        two_sided=True,
    )


def drawn(overlay: Overlay, light: Light | None = None) -> np.ndarray:
    return Scene([square(overlay)]).shade(SQUARE, CAMERA, light).rgba


def test_a_picture_is_kept_at_half_the_size_again_and_again():
    picture = Picture.of(np.zeros((37, 60, 4), np.uint8))
    assert (picture.height, picture.width) == (40, 64)  # sides that halve three times
    assert len(picture.texels) == sum((40 >> k) * (64 >> k) for k in range(LEVELS))


def test_colours_under_what_is_transparent_are_those_around():
    rgba = np.zeros((32, 32, 4), np.uint8)
    rgba[:, :16] = (200, 100, 50, 255)
    picture = Picture.of(rgba)
    assert (picture.whole[:, 16:24, :3] == (200, 100, 50)).all()
    assert not picture.whole[:, 16:, 3].any()


def test_the_picture_is_seen_in_linear_light():
    seen = drawn(Overlay(plain(255 // 2, 255, 0)))[32, 32]
    assert seen[3] == 1
    assert seen[:3] == pytest.approx([(127 / 255) ** 2.2, 0.95**2.2, 0], abs=1e-4)


def test_left_and_top_of_the_picture_are_left_and_top():
    rgba = np.full((32, 32, 4), 255, np.uint8)
    rgba[:16, :16, 1:3] = 0
    seen = drawn(Overlay(Picture.of(rgba)))
    red = seen[..., 1] < 0.1
    assert red[8, 8] and not red[8, 56] and not red[56, 8]


def test_a_tint_replaces_colours_and_keeps_differences_of_brightness():
    rgba = np.full((32, 32, 4), 255, np.uint8)
    rgba[..., :3] = 60
    rgba[:16, :, :3] = 100
    overlay = Overlay(Picture.of(rgba), tint=(0.4, 0.2, 0.0), tint_share=1.0, mean=80 / 255)
    seen = drawn(overlay)
    dark, bright = seen[56, 32, :3], seen[8, 32, :3]
    assert dark == pytest.approx([(0.4 * 0.75) ** 2.2, (0.2 * 0.75) ** 2.2, 0], abs=1e-3)
    assert bright == pytest.approx([(0.4 * 1.25) ** 2.2, (0.2 * 1.25) ** 2.2, 0], abs=1e-3)


@pytest.mark.parametrize("alpha", [0, 64, 128, 255])
def test_a_pixel_shows_its_share_of_what_an_alpha_cuts_out(alpha):
    coverage = drawn(Overlay(plain(255, 255, 255, alpha), cut_out=True))[..., 3]
    assert coverage.mean() == pytest.approx(alpha / 255, abs=0.02)
    # the samples of a pixel are spread over the thresholds: no grain, but where two triangles meet
    assert np.quantile(np.abs(coverage - alpha / 255), 0.95) <= 0.251


def test_what_is_cut_out_shows_what_is_behind():
    behind = square(Overlay(plain(0, 0, 255)))
    hole = square(Overlay(plain(255, 0, 0, 0), cut_out=True))
    points = np.concatenate([SQUARE, SQUARE - np.array([0, 0.1, 0], np.float32)])
    seen = Scene([behind, hole]).shade(points, CAMERA, None).rgba[32, 32]
    assert seen[2] > 0.8 and seen[0] == 0


def test_normals_bend_the_light():
    lamp = Light(
        (Lamp(np.pi / 2, 0.0, (1.0, 1.0, 1.0)),), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    )  # from the right
    flat = drawn(Overlay(plain(200, 200, 200), plain(128, 128, 255)), lamp)[32, 32, 0]
    right = drawn(Overlay(plain(200, 200, 200), plain(220, 128, 200)), lamp)[32, 32, 0]
    assert flat < 0.05 < 0.2 < right


def test_mean_brightness_is_of_what_is_opaque():
    rgba = np.zeros((32, 32, 4), np.uint8)
    rgba[:, :16] = (100, 100, 100, 255)
    corners = np.array([[[0.1, 0.5]] * 3, [[0.9, 0.5]] * 3], np.float32)
    assert mean_brightness(Picture.of(rgba), corners) == pytest.approx(100 / 255)
