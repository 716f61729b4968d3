"""Framing: the whole picture, one size, padded alike."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.framing import Framing, lay_over
from motion_transfer.training.pictures import PersonPicture


def test_a_picture_of_that_size_passes_unchanged() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (64, 48, 3), np.uint8)
    np.testing.assert_array_equal(Framing(48, 64).fit(picture), picture)


@pytest.mark.parametrize(
    ("size", "inside"), [((32, 16), np.s_[:, 16:48]), ((20, 40), np.s_[16:48])]
)
def test_another_aspect_is_padded_in_the_middle(size: tuple[int, int], inside) -> None:
    framed = Framing(64, 64, "#102030").fit(np.full((*size, 3), 200, np.uint8))
    assert framed.shape == (64, 64, 3)
    assert (framed[inside] == 200).all()
    padding = np.ones((64, 64), bool)
    padding[inside] = False
    assert (framed[padding] == (16, 32, 48)).all()


def target(studio, alpha: np.ndarray | None) -> PersonPicture:
    iuv = studio.iuv(scale=2, size=(192, 128))
    return PersonPicture("a", studio.dress(iuv), iuv, alpha)


def test_a_target_keeps_its_surroundings_where_alpha_is_unknown(studio) -> None:
    frame = Framing(50, 75).fit_target(target(studio, None))
    assert tuple(frame.rgb[0, 0]) == (120, 120, 120)
    codes = {tuple(code) for code in frame.iuv.reshape(-1, 3)}
    assert codes < {tuple(code) for code in studio.iuv().reshape(-1, 3)}  # nothing in between
    assert frame.mask[frame.iuv[..., 0] > 0].all()


def test_a_target_is_laid_over_the_background_by_its_alpha(studio) -> None:
    alpha = np.zeros((192, 128), np.uint8)
    alpha[40:100, 40:80] = 255
    frame = Framing(64, 96, "black").fit_target(target(studio, alpha))
    assert tuple(frame.rgb[0, 0]) == (0, 0, 0)
    assert frame.rgb[20:50, 20:40].any(-1).all()
    expected = np.zeros((96, 64), bool)
    expected[20:50, 20:40] = True
    np.testing.assert_array_equal(frame.mask, expected)
    kept = Framing(64, 96, "photo").fit_target(target(studio, alpha))
    assert tuple(kept.rgb[0, 0]) == (120, 120, 120)


def test_laying_over_blends() -> None:
    rgb = np.full((1, 3, 3), 200, np.uint8)
    alpha = np.array([[0, 51, 255]], np.uint8)
    np.testing.assert_array_equal(lay_over(rgb, alpha, (100, 100, 100))[0, :, 0], [100, 120, 200])


@pytest.mark.parametrize("size", [(256, 256), (128, 192), (64, 96), (63, 96), (640, 961)])
def test_results_that_show_the_whole_target_pass(size: tuple[int, int]) -> None:
    Framing().check_aspect(size, (128, 192), "it")


@pytest.mark.parametrize("size", [(192, 128), (176, 256), (100, 192), (255, 255)])
def test_results_of_another_crop_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match=rf"it is {size[0]} x {size[1]}, but its target is 128 x"):
        Framing().check_aspect(size, (128, 192), "it")


def test_bad_settings() -> None:
    with pytest.raises(InputError, match="size 8x256; each side must lie in 32"):
        Framing(8, 256)
    with pytest.raises(InputError, match="background 'mauve'"):
        Framing(background="mauve")
