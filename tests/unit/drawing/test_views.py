"""Several photos of one person: who gives which texel, under whose light, and who is a stranger."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from jaxtyping import Bool, Float

from motion_transfer.drawing.views import (
    EDGE_TRUST,
    FACE_LEAD,
    GAMMA,
    HEAD,
    LEAD,
    View,
    equalise_light,
    find_strangers,
    measure_sharpness,
    merge_views,
    rate_texels,
    trust_pixels,
)
from nhrr_core import load_uv_tables

SIZE = 128
AMPLITUDE = 0.1
ROWS, COLUMNS = np.indices((SIZE, SIZE))
UPRIGHT, LYING = (np.float32(AMPLITUDE) * (1 - 2 * (axis % 2)) for axis in (COLUMNS, ROWS))
"""Stripes one texel wide: patterns that can be told apart, whose mean is nothing."""

PART = load_uv_tables().part[1::2, 1::2]  # at the centres of SIZE x SIZE texels
ON_HEAD = np.isin(PART, HEAD)
EVERYWHERE = np.ones((SIZE, SIZE), bool)
LEFT, RIGHT = COLUMNS < 80, COLUMNS >= 48  # whole cells of what counts as one colour

SKIN, RED, GREEN, BLUE = (0.75, 0.55, 0.45), (0.7, 0.2, 0.2), (0.2, 0.6, 0.25), (0.2, 0.3, 0.6)


def clothed(
    trunk: tuple[float, ...] = RED, legs: tuple[float, ...] = BLUE
) -> Float[np.ndarray, "3 T T"]:
    """The colours of a person, 0..1."""
    colours = np.tile(np.array(SKIN)[:, None, None], (1, SIZE, SIZE))
    for parts, colour in (((1, 2, *range(15, 23)), trunk), ((*range(5, 15),), legs)):
        colours[:, np.isin(PART, parts)] = np.array(colour)[:, None]
    return colours


def view(
    colours: Float[np.ndarray, "3 T T"] | None = None,
    *,
    seen: Bool[np.ndarray, "T T"] = EVERYWHERE,
    rating: float | Float[np.ndarray, "T T"] = 1.0,
    pattern: Float[np.ndarray, "T T"] | float = 0.0,
    light: tuple[float, ...] = (1.0, 1.0, 1.0),
) -> View:
    """A photo of a person under some light, unfolded."""
    lit = (clothed() if colours is None else colours) * np.array(light)[:, None, None] ** (
        1 / GAMMA
    )
    visibility = seen[None].astype(np.float32)
    texture = (lit * 2 - 1 + pattern).astype(np.float32) * visibility
    return View("photo", texture, visibility, (visibility * rating).astype(np.float32))


def pattern_of(texture: Float[np.ndarray, "3 T T"]) -> Float[np.ndarray, "T T"]:
    """What is left of a texture without the person's colours."""
    return (texture - (clothed() * 2 - 1)).mean(0)


def apart(one: View, other: View, where: Bool[np.ndarray, "T T"] = EVERYWHERE) -> float:
    """How far two photos' colours are from each other, of 255."""
    return float(np.abs(one.texture - other.texture)[:, where].mean() * 127.5)


def test_one_photo_stays_as_it_is() -> None:
    only = view(seen=LEFT, pattern=UPRIGHT, light=(0.6, 0.7, 0.8))
    merged = merge_views([only])
    np.testing.assert_array_equal(merged.texture, only.texture)
    np.testing.assert_array_equal(merged.visibility, only.visibility)
    np.testing.assert_array_equal(merged.shares, only.visibility)
    assert merged.strangers == ()


def test_what_one_photo_alone_sees_keeps_its_pattern() -> None:
    """However well the other photo sees what lies beside it."""
    grey = np.full((3, SIZE, SIZE), 0.5)
    one = view(grey, seen=LEFT, pattern=UPRIGHT, rating=5.0)
    other = view(grey, seen=RIGHT, pattern=LYING, rating=0.1)
    found = merge_views([one, other]).texture.mean(0)
    np.testing.assert_allclose(found[~LEFT], LYING[~LEFT], atol=1e-3)
    np.testing.assert_allclose(found[~RIGHT], UPRIGHT[~RIGHT], atol=1e-3)


def test_shares_add_up_to_one_where_anything_is_seen() -> None:
    seen = (LEFT & (ROWS < 100), RIGHT & (ROWS < 100), ROWS < 30)
    views = [
        view(seen=where, rating=rating)
        for where, rating in zip(seen, (1.0, 2.5, 0.01), strict=True)
    ]
    merged = merge_views(views)
    shown = np.any(seen, axis=0)
    np.testing.assert_allclose(merged.shares.sum(0), shown, rtol=1e-6)
    np.testing.assert_array_equal(merged.visibility[0], shown)
    assert not merged.texture[:, ~shown].any()
    for share, where in zip(merged.shares, seen, strict=True):
        assert not share[~where].any()
    assert (merged.shares >= 0).all()


@pytest.mark.parametrize(("times", "winner"), [(0.3, 0), (1.0, 0), (LEAD / 1.6, 0), (LEAD * 2, 1)])
def test_who_sees_it_better_gives_the_pattern(times: float, winner: int) -> None:
    """The first photo gives it, unless another sees the place LEAD times as well."""
    views = [view(pattern=UPRIGHT), view(pattern=LYING, rating=times)]
    merged = merge_views(views)
    body = ~ON_HEAD
    assert (merged.shares[winner][body] > 0.9).all()
    near = np.abs(pattern_of(merged.texture) - (UPRIGHT, LYING)[winner])
    assert near[body].mean() < 0.2 * AMPLITUDE


def test_it_is_decided_place_by_place() -> None:
    rating = np.where(ROWS < 64, LEAD * 4, 0.1)
    merged = merge_views([view(pattern=UPRIGHT), view(pattern=LYING, rating=rating)])
    assert (merged.shares[1][(ROWS < 60) & ~ON_HEAD] > 0.9).all()
    assert (merged.shares[0][(ROWS > 68) & ~ON_HEAD] > 0.9).all()


@pytest.mark.parametrize("leader", [0, 1])
def test_a_face_is_not_mixed(leader: int) -> None:
    """One photo gives the head, also where another photo sees somewhat better."""
    whole = np.ones((SIZE, SIZE))
    end = np.quantile(COLUMNS[ON_HEAD], 0.3)
    piece = np.where(end > COLUMNS, FACE_LEAD / 2, 0.1)
    ratings = [whole, piece] if leader == 0 else [piece, whole]
    merged = merge_views([view(rating=ratings[0]), view(rating=ratings[1] * LEAD)])
    assert (merged.shares[leader][ON_HEAD] > 0.9).all()


def test_colours_pass_into_each_other_over_wide_borders() -> None:
    """Where light differs by more than can be told, patterns change at once, and colours slowly."""
    grey = np.full((3, SIZE, SIZE), 0.5)
    well = np.where(COLUMNS < 64, 9.0, 0.1)
    views = [view(grey, rating=well / LEAD), view(grey * 1.4, rating=well[:, ::-1])]
    row = merge_views(views).texture[0, 100]
    assert row[16] < row[-16] - 0.1
    steps = np.abs(np.diff(row))
    assert (steps > 0.01).sum() >= 2 and steps.max() < 0.8 * (row[-16] - row[16])


DARKER, BRIGHTER = (0.7,) * 3, (1.3,) * 3


@pytest.mark.parametrize("light", [DARKER, BRIGHTER])
@pytest.mark.parametrize("seen", [EVERYWHERE, RIGHT])
def test_exposure_comes_back_to_the_first(
    light: tuple[float, ...], seen: Bool[np.ndarray, "T T"]
) -> None:
    first = view(pattern=UPRIGHT, seen=LEFT)
    other = view(pattern=UPRIGHT, seen=seen, light=light)
    first_after, after = equalise_light([first, other])
    np.testing.assert_array_equal(first_after.texture, first.texture)
    truth = view(pattern=UPRIGHT, seen=seen)
    assert apart(after, truth, seen) < 0.45 * apart(other, truth, seen)
    assert not after.texture[:, ~seen].any()


@pytest.mark.parametrize("light", [(1.15, 1.0, 0.85), (0.9, 1.0, 1.15)])
def test_white_balance_comes_nearer_to_the_first(light: tuple[float, ...]) -> None:
    first, other = view(), view(light=light)
    assert apart(equalise_light([first, other])[1], first) < 0.9 * apart(other, first)


def test_photos_are_merged_under_one_light() -> None:
    """What the second photo alone sees is no darker for that."""
    other, truth = view(seen=RIGHT, light=DARKER), view(seen=RIGHT)
    merged = merge_views([view(seen=LEFT), other])
    found = View("merged", merged.texture, merged.visibility, merged.visibility)
    assert apart(found, truth, ~LEFT) < 0.5 * apart(other, truth, ~LEFT)


def test_light_is_told_along_a_chain_of_photos() -> None:
    """Front and back have nothing in common but what a photo from the side shows of both."""
    front, back = PART == 23, np.isin(PART, [5, 6])
    views = [
        view(seen=front),
        view(seen=front | back, light=DARKER),
        view(seen=back, light=DARKER),
    ]
    truth = view(seen=back)
    without = equalise_light([views[0], views[2]])[1]
    assert apart(without, views[2], back) < 1  # nothing tells
    assert apart(equalise_light(views)[2], truth, back) < 0.6 * apart(views[2], truth, back)


def test_a_back_takes_the_light_of_a_front_in_the_same_clothes() -> None:
    """They show no place in common, but both faces of a trunk and of legs."""
    front, back = (np.isin(PART, parts) for parts in ((2, 9, 10, 13, 14), (1, 7, 8, 11, 12)))
    first, other, truth = view(seen=front), view(seen=back, light=DARKER), view(seen=back)
    after = equalise_light([first, other])[1]
    assert apart(after, truth, back) < 0.5 * apart(other, truth, back)


def test_burnt_out_and_black_places_tell_nothing_of_the_light() -> None:
    """A shirt that is burnt out in one photo is no darker in the other."""
    white = clothed(trunk=(1.0, 1.0, 1.0), legs=(1.0, 1.0, 1.0))
    grey = clothed(trunk=(0.7, 0.7, 0.7), legs=(0.7, 0.7, 0.7))
    after = equalise_light([view(white), view(grey)])[1]
    skin = (PART == 23) | (PART == 3)
    assert apart(after, view(grey), skin) < 2


def test_other_clothes_are_told() -> None:
    person = view()
    others = [
        view(light=DARKER),
        view(clothed(trunk=GREEN, legs=RED)),
        view(light=(1.1, 1.0, 0.9), rating=0.5),
        view(clothed(trunk=(0.9,) * 3, legs=GREEN), rating=7.0),
    ]
    merged = merge_views([person, *others])
    assert merged.strangers == (2, 4)
    assert find_strangers([person, others[1]]) == (1,)


def test_the_other_side_may_look_otherwise() -> None:
    """What the first photo does not show can be of any colour."""
    back = view(clothed(trunk=GREEN, legs=RED), seen=~LEFT)
    assert merge_views([view(seen=LEFT), back]).strangers == ()


def photographed(studio, scale: int = 3, blur: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A photo with grain, so that it has a sharpness, and its IUV."""
    iuv = studio.iuv(scale=scale, size=(96 * scale, 64 * scale))
    grain = np.random.default_rng(0).integers(-40, 40, iuv.shape)
    rgb = (studio.dress(iuv).astype(int) + grain).clip(0, 255).astype(np.uint8)
    return (cv2.GaussianBlur(rgb, (0, 0), blur) if blur else rgb), iuv


def test_more_pixels_rate_higher(studio) -> None:
    """They are counted along a texel's side: a photo twice as large rates twice as high."""
    small, large = (rate_texels(*photographed(studio, scale)) for scale in (4, 8))
    both = (small > 0) & (large > 0)
    assert both.mean() > 0.1
    assert 1.6 < np.median(large[both] / small[both]) < 2.4


def test_a_rating_is_the_pixels_along_a_texel_of_256(studio) -> None:
    """The front of the trunk fills as many texels as the layout says, with so many pixels."""
    rgb, iuv = photographed(studio, 8)
    trunk = iuv * (iuv[..., :1] == 2)
    pixels = (trunk[..., 0] > 0).sum()
    texels = (load_uv_tables().part == 2).sum()
    side = float((pixels / texels) ** 0.5)
    rating = rate_texels(rgb, trunk) / measure_sharpness(rgb, trunk)
    assert np.median(rating[rating > 0]) == pytest.approx(side, rel=0.35)


def test_blur_rates_lower_everywhere(studio) -> None:
    sharp, blurred = (rate_texels(*photographed(studio, blur=blur)) for blur in (0.0, 2.0))
    np.testing.assert_array_equal(sharp > 0, blurred > 0)
    assert (blurred < 0.7 * sharp)[sharp > 0].all()


def test_an_edge_is_trusted_less(studio) -> None:
    """The outline, and where an arm covers the trunk; not where parts join."""
    _, iuv = photographed(studio, 8)
    arm = np.s_[26 * 8 : 44 * 8, 28 * 8 : 34 * 8]
    covered = iuv.copy()
    covered[arm] = (20, 128, 128)
    open_trust, trust = trust_pixels(iuv), trust_pixels(covered)
    body = iuv[..., 0] > 0
    assert not trust[~body].any() or trust[~body].max() == pytest.approx(EDGE_TRUST)
    assert open_trust.min() == pytest.approx(EDGE_TRUST)
    inside = (35 * 8, 32 * 8)
    assert open_trust[inside] == trust[inside] == 1
    beside_the_arm = (35 * 8, 34 * 8)
    assert open_trust[beside_the_arm] == 1
    assert trust[beside_the_arm] < 0.3
    outline = (35 * 8, 14 * 8)
    assert open_trust[outline] < 0.3


def test_edges_rate_lower_than_what_lies_within(studio) -> None:
    """The same texels of a trunk, in the middle of a photo and cut off by something before it."""
    rgb, iuv = photographed(studio, 8)
    hidden = iuv.copy()
    hidden[:, : 31 * 8] = 0
    whole, half = rate_texels(rgb, iuv), rate_texels(rgb, hidden)
    both = (whole > 0) & (half > 0)
    ratio = half[both] / whole[both]
    assert ratio.min() < 0.4
    assert 0.8 < np.median(ratio) < 1.2


def test_nobody_is_seen_nowhere(studio) -> None:
    rgb, iuv = photographed(studio)
    assert not rate_texels(rgb, np.zeros_like(iuv)).any()


def test_sharpness_falls_with_blur(studio) -> None:
    found = [measure_sharpness(*photographed(studio, blur=blur)) for blur in (0.0, 1.0, 2.0, 4.0)]
    assert all(one > 1.15 * other for one, other in pairwise(found))
    assert all(0 < one <= 1 for one in found)


@pytest.mark.parametrize("kernel", [(15, 1), (1, 15)])
def test_motion_along_one_axis_is_blur(studio, kernel: tuple[int, int]) -> None:
    rgb, iuv = photographed(studio)
    moved = cv2.blur(rgb, kernel)
    assert measure_sharpness(moved, iuv) < 0.75 * measure_sharpness(rgb, iuv)


def test_sharpness_does_not_depend_on_contrast(studio) -> None:
    rgb, iuv = photographed(studio)
    faint = (rgb // 4 + 90).astype(np.uint8)
    assert measure_sharpness(faint, iuv) == pytest.approx(measure_sharpness(rgb, iuv), rel=0.05)


def test_photos_are_not_changed_by_merging_them() -> None:
    views = [view(rating=1.0), view(light=DARKER, rating=2.0)]
    before = [replace(one, texture=one.texture.copy(), rating=one.rating.copy()) for one in views]
    merge_views(views)
    for one, same in zip(views, before, strict=True):
        np.testing.assert_array_equal(one.texture, same.texture)
        np.testing.assert_array_equal(one.rating, same.rating)
