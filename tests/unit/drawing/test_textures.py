"""Partial textures without torch: the same as by the functions of `nhrr_core` of these names."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import torch.nn.functional as F

import nhrr_core
from motion_transfer.drawing.textures import (
    average,
    enlarge,
    merge_textures,
    mirror_texture,
    pick_nearest,
    shrink_texture,
    twins,
)
from nhrr_core import load_uv_layout
from nhrr_core.texture import resize_twins

LAYOUT = load_uv_layout()
SIZES = [64, 256, 512]


def partial(size: int, share: float = 0.3, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Noise, of which some is seen."""
    random = np.random.default_rng(seed)
    seen = (random.random((1, size, size)) < share).astype(np.float32)
    return random.uniform(-1, 1, (3, size, size)).astype(np.float32) * seen, seen


def batch(*maps: np.ndarray) -> list[torch.Tensor]:
    return [torch.from_numpy(each)[None] for each in maps]


@pytest.mark.parametrize("size", SIZES)
def test_mirrored_as_by_its_twin(size: int) -> None:
    wanted = nhrr_core.mirror_texture(*batch(*partial(size)), LAYOUT.side_twin, LAYOUT.depth_twin)
    given = partial(size)
    for found, one, own, same in zip(
        mirror_texture(*given), wanted, given, partial(size), strict=True
    ):
        np.testing.assert_array_equal(found, one[0])
        np.testing.assert_array_equal(own, same)  # what is given stays as it is


def test_merged_as_by_its_twin() -> None:
    layers = [partial(64, share, seed) for seed, share in enumerate((0.6, 0.3, 0.0))]
    wanted = nhrr_core.merge_textures([tuple(batch(*layer)) for layer in layers])
    for found, one in zip(merge_textures(layers), wanted, strict=True):
        np.testing.assert_array_equal(found, one[0])


@pytest.mark.parametrize("factor", [1, 2, 3, 8])
def test_shrunk_as_by_its_twin(factor: int) -> None:
    wanted = nhrr_core.shrink_texture(*batch(*partial(96)), factor)
    texture, visibility = shrink_texture(*partial(96), factor)
    np.testing.assert_allclose(texture, wanted[0][0], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(visibility, wanted[1][0])


@pytest.mark.parametrize("size", SIZES)
def test_twins_as_by_its_twin(size: int) -> None:
    for found, table in zip(twins(size), (LAYOUT.side_twin, LAYOUT.depth_twin), strict=True):
        np.testing.assert_array_equal(found, resize_twins(table, size))


@pytest.mark.parametrize("size", [1, 16, 32, 96])
def test_means_are_those_of_equal_cells(size: int) -> None:
    values = partial(96)[0]
    wanted = F.adaptive_avg_pool2d(torch.from_numpy(values), size)
    np.testing.assert_allclose(average(values, size), wanted, rtol=0, atol=1e-6)


@pytest.mark.parametrize("size", [64, 100, 256])
def test_enlarged_between_the_centres(size: int) -> None:
    values = partial(64)[0]
    wanted = F.interpolate(torch.from_numpy(values)[None], (size, size), mode="bilinear")[0]
    np.testing.assert_allclose(enlarge(values, size), wanted, rtol=0, atol=1e-5)


@pytest.mark.parametrize("size", [16, 48, 64, 200])
def test_the_nearest_is_the_one_at_the_centre(size: int) -> None:
    values = partial(64)[0]
    wanted = F.interpolate(torch.from_numpy(values)[None], (size, size), mode="nearest-exact")[0]
    np.testing.assert_array_equal(pick_nearest(values, size), wanted)
    np.testing.assert_array_equal(pick_nearest(values[0], size), wanted[0])
