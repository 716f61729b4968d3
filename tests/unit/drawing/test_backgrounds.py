"""What is behind a person: pictures fitted, blurred, and people filled from around."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motion_transfer.drawing.backgrounds import (
    blur_picture,
    fill_from_around,
    fit_picture,
    make_background,
    person_area,
)
from motion_transfer.drawing.source import Source
from motion_transfer.media.pictures.photo import Photo

WIDE = np.zeros((40, 80, 3), np.uint8)
WIDE[:, :20], WIDE[:, 20:60], WIDE[:, 60:] = (250, 0, 0), (0, 250, 0), (0, 0, 250)


def test_cover_cuts_off_both_sides() -> None:
    assert (fit_picture(WIDE, (40, 40), "cover") == (0, 250, 0)).all()


def test_contain_shows_all_with_black_beside_it() -> None:
    fitted = fit_picture(WIDE, (40, 40), "contain")
    assert not fitted[:10].any() and not fitted[30:].any()
    assert fitted[20, [4, 20, 36]].tolist() == [[250, 0, 0], [0, 250, 0], [0, 0, 250]]


def test_stretch_changes_the_shape() -> None:
    fitted = fit_picture(WIDE, (40, 40), "stretch")
    assert fitted[20, [4, 20, 36]].tolist() == [[250, 0, 0], [0, 250, 0], [0, 0, 250]]
    assert fitted.any(-1).all()


@pytest.mark.parametrize("fit", ["cover", "contain", "stretch"])
@pytest.mark.parametrize("size", [(1, 1), (7, 300), (41, 80), (1080, 1920)])
def test_any_size_is_made(fit: str, size: tuple[int, int]) -> None:
    assert fit_picture(WIDE, size, fit).shape == (*size, 3)


def test_a_blur_is_a_share_of_the_height() -> None:
    edge = np.zeros((200, 200, 3), np.uint8)
    edge[:, 100:] = 200
    row = blur_picture(edge, 2)[100, :, 0].astype(float)
    # of an edge, the blur's deviation is that of the row's differences
    steps = np.abs(np.diff(row))
    middle = (steps * np.arange(199)).sum() / steps.sum()
    deviation = np.sqrt((steps * (np.arange(199) - middle) ** 2).sum() / steps.sum())
    assert deviation == pytest.approx(4, rel=0.1)
    assert blur_picture(edge, 0) is edge


@pytest.mark.parametrize("scale", [1, 8])
def test_a_hole_takes_the_colour_around_it(scale: int) -> None:
    picture = np.full((100 * scale, 120 * scale, 3), (90, 140, 200), np.uint8)
    hole = np.zeros(picture.shape[:2], np.uint8)
    hole[30 * scale : 80 * scale, 40 * scale : 70 * scale] = 1
    picture[hole > 0] = (255, 0, 0)
    assert np.abs(fill_from_around(picture, hole).astype(int) - (90, 140, 200)).max() <= 1


def test_a_fill_goes_smoothly_from_one_side_to_the_other() -> None:
    ramp = np.broadcast_to(np.arange(128, dtype=np.uint8)[None, :, None], (128, 128, 3)).copy()
    hole = np.zeros((128, 128), np.uint8)
    hole[40:90, 40:90] = 1
    filled = fill_from_around(np.where(hole[..., None] > 0, np.uint8(255), ramp), hole)
    assert (filled[hole == 0] == ramp[hole == 0]).all()
    assert np.abs(filled.astype(int) - ramp).max() < 16
    assert (np.diff(filled[64, 40:90, 0].astype(int)) >= 0).all()


def test_a_fill_shows_no_seam() -> None:
    """Where a wall grows lighter from side to side, nobody is to see who stood before it."""
    wall = np.repeat(np.linspace(0, 255, 300)[None], 400, 0).round().astype(np.uint8)
    wall = np.repeat(wall[..., None], 3, 2)
    hole = np.zeros((400, 300), np.uint8)
    hole[20:380, 60:240] = 1
    filled = fill_from_around(wall, hole)[..., 0].astype(int)
    for outside, inside in ((59, 61), (240, 238)):
        assert np.abs(filled[60:340, outside] - filled[60:340, inside]).max() <= 1


def test_a_picture_that_is_all_hole_stays_defined() -> None:
    picture = np.full((9, 9, 3), 77, np.uint8)
    assert fill_from_around(picture, np.ones((9, 9), np.uint8)).shape == picture.shape


def test_nobody_leaves_no_area(studio) -> None:
    assert not person_area(np.zeros((30, 20, 3), np.uint8)).any()
    iuv = studio.iuv()
    area = person_area(iuv)
    assert area[iuv[..., 0] > 0].all()
    assert area.sum() > (iuv[..., 0] > 0).sum() * 1.1  # with room for hair and clothes


@pytest.fixture
def dressed_source() -> Source:
    """A head with long hair, and wide blue trousers, before a grey wall; IUV of the bare body."""
    rgb = np.full((120, 80, 3), 150, np.uint8)
    rgb[11:40, 31:49] = (90, 50, 20)  # hair
    rgb[50:115, 29:51] = (0, 0, 250)
    iuv = np.zeros_like(rgb)
    iuv[14:38, 34:46, 0], iuv[52:112, 32:48, 0] = 23, 9
    photo = Photo(Path("me.png"), rgb, None, turned=False)
    blank = np.zeros((3, 8, 8), np.float32)
    return Source(photo, iuv, None, blank, blank[:1])


def test_in_place_a_photo_stays_as_it_is(dressed_source: Source) -> None:
    made = make_background("photo", (120, 80), dressed_source, in_place=True)
    np.testing.assert_array_equal(made, dressed_source.photo.rgb)


def test_in_place_old_clothes_go_and_the_rest_stays(dressed_source: Source) -> None:
    made = make_background("photo", (120, 80), dressed_source, in_place=True, redressed=[9, 10])
    np.testing.assert_array_equal(made[:40], dressed_source.photo.rgb[:40])
    assert np.abs(made[50:115].astype(int) - 150).max() <= 2


def test_elsewhere_the_whole_person_goes(dressed_source: Source) -> None:
    made = make_background("photo", (120, 80), dressed_source, in_place=False, redressed=[9])
    assert np.abs(made.astype(int) - 150).max() <= 2
