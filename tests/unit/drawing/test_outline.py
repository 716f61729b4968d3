"""How far clothes and hair stand off the body: from alpha, or before a plain backdrop."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.drawing.outline import clearance_of, measure_clearance, stand_out
from motion_transfer.drawing.person import disc
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import ALL_PARTS

COAT = (60, 20, 20)


def grow(mask: np.ndarray, reach: int) -> np.ndarray:
    return cv2.dilate(mask.astype(np.uint8), disc(reach)) * np.uint8(255)


def box(side: int = 60, border: int = 40) -> np.ndarray:
    iuv = np.zeros((side + 2 * border, side + 2 * border, 3), np.uint8)
    iuv[border:-border, border:-border] = (2, 128, 128)
    return iuv


@pytest.mark.parametrize("reach", [1, 3, 12])
def test_the_distance_from_outline_to_alpha(reach: int) -> None:
    iuv = box()
    body = iuv[..., 0] > 0
    clearance, measured = measure_clearance(iuv, grow(body, reach))
    outline = body & ~cv2.erode(body.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    assert np.array_equal(measured, outline)
    assert clearance[measured] == pytest.approx(reach, abs=0.6)
    assert not clearance[~measured].any()


def test_a_person_within_the_outline_has_a_negative_one() -> None:
    iuv = box()
    person = cv2.erode((iuv[..., 0] > 0).astype(np.uint8) * 255, disc(4))
    clearance, measured = measure_clearance(iuv, person)
    assert np.median(clearance[measured]) == pytest.approx(-4, abs=1.5)


def test_one_side_does_not_answer_for_the_other() -> None:
    iuv = box()
    person = (iuv[..., 0] > 0).astype(np.uint8) * 255
    person[:, 100:110] = person[:, 99:100]
    clearance, measured = measure_clearance(iuv, person)
    assert np.median(clearance[50:90, 99]) == pytest.approx(10, abs=0.5)
    assert not clearance[50:90, 40].any()
    assert measured[50:90, 40].all()


def test_nobody_has_none(studio) -> None:
    iuv = studio.iuv()
    nobody = np.zeros_like(iuv)
    for body, alpha in ((nobody, iuv[..., 0]), (iuv, iuv[..., 0] * 0)):
        assert not measure_clearance(body, alpha)[1].any()
    assert not clearance_of(photo(studio.dress(nobody)), nobody, ALL_PARTS).any()


def photo(rgb: np.ndarray, alpha: np.ndarray | None = None) -> Photo:
    return Photo(Path("photo.png"), rgb, alpha, turned=False)


def known(clearance) -> np.ndarray:
    return clearance[0][clearance[1] > 0]


@pytest.mark.parametrize("scale", [2, 4, 9])
def test_the_photos_size_does_not_matter(studio, scale: int) -> None:
    """A coat of 2 px of the mannequin's, seen in photos of any resolution."""
    iuv = studio.iuv(10, 6, scale=scale, size=(110 * scale, 90 * scale))
    alpha = grow(iuv[..., 0] > 0, 2 * scale)
    measured = known(clearance_of(photo(studio.dress(iuv), alpha), iuv, ALL_PARTS))
    iuv = studio.iuv(10, 6, scale=3, size=(330, 270))
    alpha = grow(iuv[..., 0] > 0, 6)
    expected = known(clearance_of(photo(studio.dress(iuv), alpha), iuv, ALL_PARTS))
    assert np.median(measured) == pytest.approx(np.median(expected), rel=0.15)


def test_the_alpha_given_counts_before_the_photos(studio) -> None:
    iuv = studio.iuv(10, 6, scale=3, size=(330, 270))
    tight, wide = (grow(iuv[..., 0] > 0, reach) for reach in (1, 9))
    both = clearance_of(photo(studio.dress(iuv), tight), iuv, ALL_PARTS, alpha=wide)
    alone = clearance_of(photo(studio.dress(iuv), wide), iuv, ALL_PARTS)
    np.testing.assert_array_equal(both, alone)
    assert np.median(known(both)) > 0.2


def test_only_the_parts_asked_for(studio) -> None:
    iuv = studio.iuv(10, 6, scale=3, size=(330, 270))
    shown = photo(studio.dress(iuv), grow(iuv[..., 0] > 0, 6))
    everything, head, torso = (
        clearance_of(shown, iuv, parts)[1] > 0 for parts in (ALL_PARTS, (23, 24), (2,))
    )
    assert head.any()
    assert torso.any()
    assert not (head & torso).any()
    assert not ((head | torso) & ~everything).any()


@pytest.fixture
def coat(studio) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A photo of somebody in a coat, its IUV, and where the coat stands off."""
    iuv = studio.iuv(20, 20, scale=2, size=(280, 220))
    rgb = np.full(iuv.shape, 235, np.uint8)
    worn = grow(iuv[..., 0] > 0, 7) > 0
    rgb[worn] = COAT
    return rgb, iuv, worn


def test_a_plain_backdrop_shows_where_the_person_ends(coat) -> None:
    """With a studio's light, which fades across the photo, and a shadow to one side."""
    rgb, iuv, worn = coat
    light = np.linspace(1, 0.85, rgb.shape[1])[None, :, None] * np.ones((rgb.shape[0], 1, 1))
    light[np.roll(worn, 10, axis=1) & ~worn] *= 0.75
    rgb = (rgb * np.where(worn[..., None], 1, light)).round().astype(np.uint8)
    body = (iuv[..., 0] > 0).astype(np.uint8)
    alpha = stand_out(rgb, body, 192)
    assert alpha is not None
    assert ((alpha > 0) == worn).mean() > 0.995
    opaque, cut_out = (
        clearance_of(photo(rgb, alpha), iuv, ALL_PARTS)
        for alpha in (None, worn.astype(np.uint8) * 255)
    )
    assert np.median(known(opaque)) == pytest.approx(np.median(known(cut_out)), rel=0.1)


def test_what_does_not_touch_the_person_is_not_worn(coat) -> None:
    rgb, iuv, worn = coat
    rgb[worn & (iuv[..., 0] == 0)] = 235
    rgb[60:90, 4:10] = COAT
    alpha = stand_out(rgb, (iuv[..., 0] > 0).astype(np.uint8), 192)
    assert alpha is not None
    assert not alpha[60:90, 4:10].any()


@pytest.mark.parametrize("kind", ["busy", "full"])
def test_no_plain_backdrop_nothing_known(coat, kind: str) -> None:
    rgb, iuv, worn = coat
    if kind == "busy":
        stripes = (np.arange(rgb.shape[1]) // 30 % 2 * np.uint8(120))[None, :, None]
        rgb = np.where(worn[..., None], rgb, rgb - stripes)
    else:
        rows, columns = (np.flatnonzero(iuv[..., 0].any(axis)) for axis in (1, 0))
        body = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        rgb, iuv = rgb[body].copy(), iuv[body].copy()
    assert not clearance_of(photo(rgb), iuv, ALL_PARTS).any()
