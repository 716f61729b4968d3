"""The two renderers, as the engine sees them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motion_transfer.drawing.engines import ENGINES, Wish
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.renderers.network import grow_mask, open_recipe
from motion_transfer.drawing.renderers.texture import TextureRecipe, soften
from motion_transfer.drawing.source import Source
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source import read_source


@pytest.fixture
def source(studio) -> Source:
    return read_source(SourceOptions(source=(studio.source(),)), 64)


@pytest.fixture(params=["texture", *ENGINES])
def renderer(request, source: Source, checkpoint: Path) -> Renderer:
    if request.param == "texture":
        return draft(source)
    recipe = open_recipe(checkpoint, Wish(engine=request.param))
    return recipe.renderer(recipe.appearance_of(source))


def draft(source: Source) -> Renderer:
    recipe = TextureRecipe()
    return recipe.renderer(recipe.appearance_of(source))


def crops(studio, renderer: Renderer) -> np.ndarray:
    size = renderer.working_size(64)
    pose = studio.iuv(8, -20, size=(size, size))
    return np.stack([pose] + [np.zeros_like(pose)] * (renderer.batch_size(size) - 1))


def test_a_renderer_gives_colour_and_coverage(studio, renderer: Renderer) -> None:
    iuv = crops(studio, renderer)
    rgba = renderer.render(iuv)
    assert (rgba.dtype, rgba.shape) == (np.uint8, (*iuv.shape[:3], 4))
    assert rgba[0, 20, 40, 3] == 255  # the middle of the torso
    assert not rgba[0, :, 0, 3].any()
    assert not rgba[1:, ..., 3].any()


def test_a_renderer_repeats_itself(studio, renderer: Renderer) -> None:
    iuv = crops(studio, renderer)
    np.testing.assert_array_equal(renderer.render(iuv), renderer.render(iuv))


def test_the_texture_renderer_looks_colours_up(studio, source: Source) -> None:
    iuv = studio.iuv(0, 0, size=(96, 96))
    rgba = draft(source).render(iuv[None])[0]
    for part, colour in {2: (200, 40, 40), 9: (30, 60, 160), 23: (220, 180, 40)}.items():
        middle = np.median(rgba[iuv[..., 0] == part][:, :3], axis=0)
        np.testing.assert_allclose(middle, colour, atol=1)


def test_softening_fades_inwards() -> None:
    mask = np.zeros((400, 400), np.uint8)
    mask[100:300, 100:300] = 255
    soft = soften(mask)
    assert (soft <= mask).all()
    assert (soft[110:290, 110:290] == 255).all()
    assert 0 < soft[200, 101] < 255


def test_a_grown_mask_covers_the_outline_and_ends_nearby() -> None:
    iuv = np.zeros((100, 100, 3), np.uint8)
    iuv[40:60, 40:60, 0] = 2
    mask = grow_mask(iuv)
    assert (mask[40:60, 40:60] == 255).all()
    assert 0 < mask[50, 36] <= 255
    assert not mask[:30].any()


def test_softening_never_grows() -> None:
    mask = np.full((60, 60), 255, np.uint8)
    mask[:30, :30] = 0
    mask[45, 45] = 0
    assert (soften(mask) <= mask).all()
