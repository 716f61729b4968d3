"""The completed texture: what is seen stays, what is hidden takes likely colours."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.drawing.renderers.texture import complete_texture
from nhrr_core import PART_GROUPS, load_uv_tables

RED, BLUE = (0.8, -0.6, -0.6), (-0.6, -0.6, 0.8)


def half_dressed(parts: dict[tuple[int, ...], tuple]) -> tuple[np.ndarray, np.ndarray]:
    """A texture in which only some parts are seen, each in one colour."""
    texture, visibility = np.split(np.zeros((4, 256, 256), np.float32), [3])
    for members, colour in parts.items():
        mask = np.isin(load_uv_tables().part, members)
        texture[:, mask] = np.array(colour)[:, None]
        visibility[0, mask] = 1
    return texture, visibility


def colours_of(texture: np.ndarray, parts: tuple[int, ...]) -> np.ndarray:
    return texture[:, np.isin(load_uv_tables().part, parts)].T


def test_what_is_seen_stays() -> None:
    texture, visibility = half_dressed({(2,): RED, (9, 13): BLUE})
    noise = np.random.default_rng(0).random(texture.shape, np.float32) * visibility
    completed = complete_texture(noise, visibility)
    np.testing.assert_array_equal(completed * visibility, noise)


@pytest.mark.parametrize(
    ("seen", "hidden"), [(2, 1), (9, 10), (9, 7), (9, 8), (15, 16), (15, 18), (23, 24)]
)
def test_hidden_sides_take_the_colour_of_their_mirror_image(seen: int, hidden: int) -> None:
    texture, visibility = half_dressed({(seen,): RED, (3, 5): BLUE})
    completed = complete_texture(texture, visibility)
    np.testing.assert_allclose(np.median(colours_of(completed, (hidden,)), axis=0), RED, atol=0.01)


def test_a_limb_that_is_hidden_takes_its_neighbours_colours() -> None:
    texture, visibility = half_dressed({PART_GROUPS["upper-arms"]: RED, PART_GROUPS["feet"]: BLUE})
    completed = complete_texture(texture, visibility)
    for group, colour in (("lower-arms", RED), ("lower-legs", BLUE)):
        middle = np.median(colours_of(completed, PART_GROUPS[group]), axis=0)
        np.testing.assert_allclose(middle, colour, atol=0.01)


@pytest.mark.parametrize("seen", [0, 1])
def test_all_or_nothing_seen(seen: int) -> None:
    texture = np.full((3, 256, 256), 0.5 * seen, np.float32)
    visibility = np.full((1, 256, 256), seen, np.float32)
    completed = complete_texture(texture, visibility)
    np.testing.assert_array_equal(completed, texture)


def test_a_limb_that_is_wholly_seen_needs_no_filling() -> None:
    seen = {parts: RED for name, parts in PART_GROUPS.items() if name != "head"}
    texture, visibility = half_dressed(seen)
    completed = complete_texture(texture, visibility)
    assert np.isfinite(completed).all()
    np.testing.assert_allclose(colours_of(completed, (23, 24)).mean(0), RED, atol=0.01)


def test_nothing_leaves_the_range_of_colours() -> None:
    texture, visibility = half_dressed({(2,): RED, (9,): BLUE, (23,): (1.0, 1.0, -1.0)})
    completed = complete_texture(texture, visibility)
    assert completed.min() >= -1.0001
    assert completed.max() <= 1.0001
