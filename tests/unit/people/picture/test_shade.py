"""Light on simple shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.figure.body import SkinWeights
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.picture.light import Lamp, Light
from motion_transfer.people.picture.shade import SAMPLES, Scene, Shading

CAMERA = Camera(32, 32, 64.0, 4.0, (0.0, 0.0, 0.0))  # sees 2 x 2 m
DARK = (0.0, 0.0, 0.0)
WHITE = (1.0, 1.0, 1.0)


def shade(pieces: list[Piece], camera: Camera, light: Light | None) -> Shading:
    points = np.concatenate([piece.points for piece in pieces])
    return Scene(pieces).shade(points, camera, light)


def lamp(azimuth: float, elevation: float = 0.0) -> Light:
    return Light((Lamp(azimuth, elevation, WHITE),), DARK, DARK, 0.01, 0.0)


def plate(
    half: float = 0.8, y: float = 0.0, texture: np.ndarray | None = None, **settings
) -> Piece:
    """A square that faces the camera; columns of its texture run to the right, rows down."""
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]) * half + [0, y, 0]
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.int32)  # counter-clockwise seen from -y
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)[faces]
    if texture is None:
        texture = np.broadcast_to(np.array([0.5, 0.25, 0.1, 0], np.float32), (4, 4, 4)).copy()
    weights = SkinWeights(csr_array(np.ones((4, 1))))
    return Piece(
        "plate",
        corners.astype(np.float32),
        faces,
        weights,
        uv,
        Material(texture, (2 * half, 2 * half), **settings),
        np.ones(4, np.float32),
    )


def colour(seen: Shading) -> np.ndarray:
    """Linear RGB, multiplied by the coverage."""
    return seen.rgba[..., :3]


def middle(seen: Shading) -> np.ndarray:
    return colour(seen)[16, 16]


def test_without_light_a_surface_shows_its_own_colour():
    seen = shade([plate()], CAMERA, None)
    assert middle(seen) == pytest.approx([0.5, 0.25, 0.1], abs=1e-6)
    assert colour(seen)[0, 0].tolist() == [0, 0, 0] and seen.coverage[0, 0] == 0


def test_coverage_is_the_share_of_samples():
    seen = shade([plate(half=0.83)], CAMERA, None)
    steps = seen.coverage * SAMPLES**2
    assert steps == pytest.approx(np.rint(steps), abs=1e-5)
    assert seen.coverage.mean() == pytest.approx(0.83**2, abs=0.03)
    assert seen.coverage.max() == 1


def test_the_texture_lies_the_right_way_up():
    texture = np.zeros((8, 8, 4), np.float32)
    texture[:4, :, 0], texture[:, :4, 1] = 1, 1  # red above, green on the left
    seen = shade([plate(texture=texture)], CAMERA, None)
    assert colour(seen)[8, 20].tolist() == pytest.approx([1, 0, 0])
    assert colour(seen)[24, 10].tolist() == pytest.approx([0, 1, 0])


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.2])
def test_lambert(angle):
    seen = shade([plate()], CAMERA, lamp(angle))
    assert middle(seen) == pytest.approx(np.cos(angle) * np.array([0.5, 0.25, 0.1]), rel=1e-3)


def test_a_lamp_behind_gives_nothing_and_skin_lets_some_red_through():
    assert middle(shade([plate()], CAMERA, lamp(1.8))).max() == 0
    red, _, blue = middle(shade([plate(translucency=0.9)], CAMERA, lamp(1.8)))
    assert red > 0 and blue / red < 0.1 / 0.5


def test_what_stands_in_the_way_of_the_key_throws_a_shadow():
    screen = plate(half=0.3, y=-0.5)
    wall = plate()
    from_the_left = lamp(np.pi / 4)  # the lamp is at +x, so the shadow falls towards -x
    seen = shade([wall, screen], CAMERA, from_the_left)
    assert colour(seen)[16, 8].max() < 0.05  # x = -0.5 of the wall
    assert colour(seen)[16, 26] == pytest.approx(
        np.cos(np.pi / 4) * np.array([0.5, 0.25, 0.1]), rel=0.02
    )


def test_gaps_are_darker_where_occlusion_is_asked_for():
    light = Light((Lamp(0, 0, DARK),), WHITE, WHITE, 0.01, 0.0)
    pieces = [plate(), plate(half=0.3, y=-0.1)]
    open_air = colour(shade(pieces, CAMERA, light))
    closed = colour(shade(pieces, CAMERA, replace(light, occlusion=1.0)))
    beside, far = (16, 10), (16, 4)  # on the wall, beside the small plate and away from it
    assert closed[beside][0] < 0.9 * open_air[beside][0]
    assert closed[far][0] == pytest.approx(open_air[far][0], rel=0.02)


def test_relief_turns_towards_the_light():
    texture = np.full((32, 32, 4), 0.5, np.float32)
    texture[..., 3] = 0.4 * np.linspace(0, 1.6, 32)  # rises to the right: faces the left
    left, right = (
        middle(shade([plate(texture=texture)], CAMERA, lamp(angle)))[0] for angle in (-0.6, 0.6)
    )
    assert left > 1.5 * right


def test_the_inside_of_cloth_is_lit_on_its_own_side():
    cloth = plate()
    turned = replace(cloth, faces=cloth.faces[:, ::-1].copy(), corner_uv=cloth.corner_uv[:, ::-1])
    assert shade([turned], CAMERA, lamp(0.0)).coverage.max() == 0
    seen = shade([replace(turned, two_sided=True)], CAMERA, lamp(0.0))
    assert middle(seen) == pytest.approx([0.5, 0.25, 0.1], rel=1e-3)


def test_gloss_shines_where_the_mirror_points():
    straight = middle(shade([plate(gloss=0.3, sharpness=30)], CAMERA, lamp(0.0)))
    aside = middle(shade([plate(gloss=0.3, sharpness=30)], CAMERA, lamp(1.0)))
    assert straight - [0.5, 0.25, 0.1] == pytest.approx([0.3] * 3, abs=0.02)
    assert aside - np.cos(1.0) * np.array([0.5, 0.25, 0.1]) == pytest.approx([0] * 3, abs=0.02)
