"""The completed texture: what is seen stays, what is hidden takes likely colours."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from motion_transfer.drawing.renderers.texture import complete_texture
from nhrr_core import PART_GROUPS, load_uv_layout

RED, BLUE = (0.8, -0.6, -0.6), (-0.6, -0.6, 0.8)


def half_dressed(parts: dict[tuple[int, ...], tuple]) -> tuple[torch.Tensor, torch.Tensor]:
    """A texture in which only some parts are seen, each in one colour."""
    layout = load_uv_layout()
    texture, visibility = torch.zeros(1, 3, 256, 256), torch.zeros(1, 1, 256, 256)
    for members, colour in parts.items():
        mask = torch.isin(layout.part, torch.tensor(members))
        texture[0, :, mask] = torch.tensor(colour)[:, None]
        visibility[0, 0, mask] = 1
    return texture, visibility


def colours_of(texture: torch.Tensor, parts: tuple[int, ...]) -> np.ndarray:
    mask = np.isin(load_uv_layout().part.numpy(), parts)
    return texture[0].permute(1, 2, 0).numpy()[mask]


def test_what_is_seen_stays() -> None:
    texture, visibility = half_dressed({(2,): RED, (9, 13): BLUE})
    noise = torch.rand(texture.shape, generator=torch.Generator().manual_seed(0)) * visibility
    completed = complete_texture(noise, visibility, load_uv_layout())
    seen = visibility.expand_as(noise) > 0
    torch.testing.assert_close(completed[seen], noise[seen], rtol=0, atol=0)


@pytest.mark.parametrize(
    ("seen", "hidden"), [(2, 1), (9, 10), (9, 7), (9, 8), (15, 16), (15, 18), (23, 24)]
)
def test_hidden_sides_take_the_colour_of_their_mirror_image(seen: int, hidden: int) -> None:
    texture, visibility = half_dressed({(seen,): RED, (3, 5): BLUE})
    completed = complete_texture(texture, visibility, load_uv_layout())
    np.testing.assert_allclose(np.median(colours_of(completed, (hidden,)), axis=0), RED, atol=0.01)


def test_a_limb_that_is_hidden_takes_its_neighbours_colours() -> None:
    texture, visibility = half_dressed({PART_GROUPS["upper-arms"]: RED, PART_GROUPS["feet"]: BLUE})
    completed = complete_texture(texture, visibility, load_uv_layout())
    for group, colour in (("lower-arms", RED), ("lower-legs", BLUE)):
        middle = np.median(colours_of(completed, PART_GROUPS[group]), axis=0)
        np.testing.assert_allclose(middle, colour, atol=0.01)


@pytest.mark.parametrize("seen", [0, 1])
def test_all_or_nothing_seen(seen: int) -> None:
    texture = torch.full((1, 3, 256, 256), 0.5 * seen)
    visibility = torch.full((1, 1, 256, 256), float(seen))
    completed = complete_texture(texture, visibility, load_uv_layout())
    torch.testing.assert_close(completed, texture)


def test_a_limb_that_is_wholly_seen_needs_no_filling() -> None:
    seen = {parts: RED for name, parts in PART_GROUPS.items() if name != "head"}
    texture, visibility = half_dressed(seen)
    completed = complete_texture(texture, visibility, load_uv_layout())
    assert torch.isfinite(completed).all()
    np.testing.assert_allclose(colours_of(completed, (23, 24)).mean(0), RED, atol=0.01)


def test_nothing_leaves_the_range_of_colours() -> None:
    texture, visibility = half_dressed({(2,): RED, (9,): BLUE, (23,): (1.0, 1.0, -1.0)})
    completed = complete_texture(texture, visibility, load_uv_layout())
    assert completed.min() >= -1.0001
    assert completed.max() <= 1.0001
