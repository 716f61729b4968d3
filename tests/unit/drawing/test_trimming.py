"""Which of a photo's pixels are unfolded: neither the background nor what lies beside a part."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.drawing.source import SourcePicture, unfold_picture
from motion_transfer.drawing.trimming import (
    SOLID_ALPHA,
    trim_arms,
    trim_around_arms,
    trim_head,
    trim_outline,
    trim_to_alpha,
)
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import load_uv_tables

SIZE = 64
HEAD = (23, 24)


def test_an_outline_that_strays_is_trimmed(studio) -> None:
    """The IUV reaches two pixels over the backdrop, which may not enter the texture."""
    true = studio.iuv(scale=4, size=(384, 256))
    photo = studio.dress(true)
    rough = np.maximum(true, np.roll(true, 2, axis=1))
    trimmed = trim_outline(photo, rough)[..., 0] > 0
    person = true[..., 0] > 0
    assert (trimmed & ~person).sum() < 0.01 * ((rough[..., 0] > 0) & ~person).sum()
    assert trimmed.sum() > 0.9 * person.sum()


def test_hair_that_leaves_the_outline_stays_in_it(studio) -> None:
    """Hair lies over the head's outline, on both sides; it is no background for that."""
    iuv = studio.iuv(scale=4, size=(384, 256))
    photo = studio.dress(iuv)
    head = np.isin(iuv[..., 0], HEAD).astype(np.uint8)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (17, 17))
    hair = (cv2.dilate(head, disc) - cv2.erode(head, disc[3:-3, 3:-3])) > 0
    hair &= (head > 0) | (iuv[..., 0] == 0)
    photo[hair] = (40, 30, 20)
    trimmed = trim_outline(photo, iuv)[..., 0] > 0
    assert trimmed[hair & (head > 0)].mean() > 0.6


@pytest.mark.parametrize(
    ("level", "edge", "goes"),
    [
        ("neck", (40, 30, 20), True),
        ("neck", (180, 140, 120), False),
        ("crown", (40, 30, 20), False),
    ],
    ids=["hair beside a neck", "skin in the shade", "hair where it grows"],
)
def test_the_rim_of_a_head(level: str, edge: tuple[int, int, int], goes: bool) -> None:
    heights = load_uv_tables().position[..., 1]
    charts = load_uv_tables().charts[HEAD[0] - 1]  # V, U -> place
    column, row = (charts.reshape(-1, 2) * len(heights)).astype(int).clip(0, 255).T
    choose = np.argmin if level == "neck" else np.argmax
    v, u = divmod(int(choose(heights[row, column])), charts.shape[1])
    iuv = np.zeros((90, 90, 3), np.uint8)
    iuv[20:70, 20:70] = HEAD[0], u, v
    photo = np.full((90, 90, 3), 200, np.uint8)
    photo[22:68, 22:68] = 215, 175, 150
    photo[22:68, 66:68] = photo[40:50, 40:50] = edge
    photo[22:68, 68:] = edge
    trimmed = trim_head(photo, iuv)[..., 0] > 0
    assert trimmed[24:66, 66:70].any() != goes
    assert trimmed[24:66, 24:66].all()
    assert trim_head(photo, np.zeros_like(iuv)).sum() == 0


def test_a_hand_before_trousers_keeps_none_of_them() -> None:
    """The IUV of an arm reaches over white trousers; those of its sleeve are its own colours."""
    iuv = np.zeros((120, 90, 3), np.uint8)
    iuv[10:60, 30:54, 0], iuv[60:100, 30:54, 0] = 20, 3
    skin, sleeve, trousers, thigh = (200, 150, 120), (20, 20, 20), (235, 235, 235), 9
    photo = np.full((120, 90, 3), trousers, np.uint8)
    photo[10:100, 30:50] = skin
    photo[10:30, 30:50] = sleeve
    iuv[60:100, 54:80, 0] = thigh
    trimmed = trim_arms(photo, iuv)[..., 0]
    assert not trimmed[12:98, 50:54].any()
    assert (trimmed[:, :50] == iuv[:, :50, 0])[:, 33:47].all(), "the middle is never doubted"
    assert np.count_nonzero(trimmed[10:100, 30:50]) > 0.97 * 90 * 20, "sleeve and skin stay"
    assert (trimmed[60:100, 54:80] == thigh).all(), "and so do the trousers' own pixels"


def test_fingers_beyond_a_hands_outline_are_no_clothes() -> None:
    """The hand is 3 px wider than its IUV, and casts a shadow; a badge is just as far from it."""
    trunk, hand = 2, 4
    skin, cloth, shadow, badge = (200, 150, 120), (40, 60, 150), (5, 5, 20), (250, 240, 60)
    iuv = np.full((120, 120, 3), (trunk, 99, 99), np.uint8)
    iuv[40:80, 40:80, 0] = hand
    photo = np.full((120, 120, 3), cloth, np.uint8)
    photo[40:80, 37:83] = skin
    photo[80, 40:80] = shadow
    photo[24:32, 50:60] = badge
    trimmed = trim_around_arms(photo, iuv)[..., 0]
    fingers = np.zeros((120, 120), bool)
    fingers[40:80, 37:83] = fingers[80, 40:80] = True
    assert (trimmed[40:80, 40:80] == hand).all()
    assert not trimmed[fingers & (iuv[..., 0] == trunk)].any()
    assert (trimmed[~fingers] == trunk).all()
    plain = trim_around_arms(np.full_like(photo, 70), iuv)
    np.testing.assert_array_equal(plain, iuv)


def test_slivers_between_fingers_go() -> None:
    """They are as blue as the cloth, and in a light of their own; a seam farther away stays."""
    trunk, hand = 2, 4
    iuv = np.full((160, 160, 3), (trunk, 99, 99), np.uint8)
    for left in range(50, 90, 10):
        iuv[50:110, left : left + 8, 0] = hand
    iuv[:, 140:142] = 0
    trimmed = trim_around_arms(np.full_like(iuv, 70), iuv)[..., 0]
    between = np.zeros((160, 160), bool)
    between[50:110, 50:88] = iuv[50:110, 50:88, 0] == trunk
    assert between.sum() == 3 * 2 * 60
    assert trimmed[between].mean() < 0.1 * trunk
    np.testing.assert_array_equal(trimmed[~between], iuv[~between][:, 0])


def test_the_skin_between_a_sleeve_and_a_forearm_stays() -> None:
    iuv = np.zeros((120, 60, 3), np.uint8)
    iuv[10:50, 20:40, 0], iuv[50:110, 20:40, 0] = 18, 20  # an upper arm, its forearm
    photo = np.full((120, 60, 3), (200, 150, 120), np.uint8)
    photo[10:47] = 30, 30, 200  # the sleeve ends 3 px above the elbow
    np.testing.assert_array_equal(trim_around_arms(photo, iuv), iuv)


def test_alpha_says_where_the_person_ends(studio) -> None:
    """Backdrop and person in one colour: only alpha can tell; the solid part of it counts."""
    iuv = studio.iuv(scale=4, size=(384, 256))
    person = iuv[..., 0] > 0
    alpha = person.astype(np.uint8) * 255
    columns = np.flatnonzero(person.any(0))
    middle = (columns.min() + columns.max()) // 2
    alpha[:, middle:] = np.where(person[:, middle:], SOLID_ALPHA - 1, 0)
    trimmed = trim_to_alpha(iuv, alpha)[..., 0] > 0
    assert not trimmed[:, middle - 1 :].any()
    assert trimmed[:, :middle].sum() > 0.9 * person[:, :middle].sum()
    photo = Photo(Path("a.png"), np.full((*alpha.shape, 3), 99, np.uint8), alpha, turned=False)
    parts = tuple(np.unique(iuv[person][:, 0]).tolist())
    seen = unfold_picture(SourcePicture(photo, iuv, parts=parts), SIZE)[1].sum()
    whole = SourcePicture(photo, iuv, np.full_like(alpha, 255), parts)
    assert 0 < seen < unfold_picture(whole, SIZE)[1].sum()
