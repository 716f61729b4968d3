"""Cloth: the same seed gives the same bytes, and patterns measure what the fabric says."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.people.clothes.fabrics import KINDS, Fabric, paint_fabric, sample_fabric
from motion_transfer.people.clothes.fabrics.colours import luminance, sample_colour

BLACK, WHITE = (0.05, 0.05, 0.05), (0.95, 0.95, 0.95)


def of_kind(kind: str, seed: int = 1) -> Fabric:
    return sample_fabric(np.random.default_rng(seed), [kind])


def two_tone(kind: str, scale: float, angle: float = 0.0) -> Fabric:
    return Fabric(kind, (BLACK, WHITE), scale, angle, 0.0, "woven", 7)


def period_metres(profile: np.ndarray, texels_per_metre: float) -> float:
    """The fundamental's period: the lowest strong frequency, refined between bins."""
    size = 16 * len(profile)
    strength = np.abs(np.fft.rfft((profile - profile.mean()) * np.hanning(len(profile)), size))
    strong = np.flatnonzero(strength > 0.3 * strength.max())
    first = strong[0]
    while strength[first + 1] > strength[first]:
        first += 1
    return size / first / texels_per_metre


@pytest.mark.parametrize("kind", KINDS)
def test_same_fabric_gives_the_same_bytes(kind):
    fabric = of_kind(kind)
    first = paint_fabric(fabric, 0.3, 0.2, 300)
    assert first.tobytes() == paint_fabric(of_kind(kind), 0.3, 0.2, 300).tobytes()
    assert not np.array_equal(first, paint_fabric(replace(fabric, seed=2), 0.3, 0.2, 300))


@pytest.mark.parametrize("texels_per_metre", [40.0, 270.0, 900.0])
@pytest.mark.parametrize("kind", KINDS)
def test_panels_are_pictures_of_the_size_asked_for(kind, texels_per_metre):
    for seed in range(3):
        panel = paint_fabric(of_kind(kind, seed), 0.31, 0.17, texels_per_metre)
        assert panel.shape == (round(0.17 * texels_per_metre), round(0.31 * texels_per_metre), 3)
        assert panel.dtype == np.float32
        assert np.isfinite(panel).all() and panel.min() >= 0 and panel.max() <= 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_panel_may_be_one_texel_or_larger_than_any_garment(kind):
    fabric = of_kind(kind)
    assert paint_fabric(fabric, 0.001, 0.001, 100).shape == (1, 1, 3)
    assert paint_fabric(fabric, 2.6, 0.2, 100).shape == (20, 260, 3)


@pytest.mark.parametrize("texels_per_metre", [270.0, 430.0, 1000.0])
@pytest.mark.parametrize("kind", ["stripes", "checks", "houndstooth", "chevron"])
def test_pattern_repeats_after_its_scale(kind, texels_per_metre):
    for scale in (0.017, 0.043):
        panel = paint_fabric(two_tone(kind, scale), 0.5, 0.6, texels_per_metre)
        # Chevrons are even across their rows; one column keeps the zigzag.
        column = panel[:, : max(1, int(0.003 * texels_per_metre)), 0].mean(axis=1)
        assert period_metres(column, texels_per_metre) == pytest.approx(scale, rel=0.01)


def alike_when_moved(panel: np.ndarray, right: int, down: int) -> float:
    """Correlation of a panel with itself moved by whole texels; 1 after a period."""
    moved = np.roll(panel, (down, right), axis=(0, 1))
    return float(np.corrcoef(panel.ravel(), moved.ravel())[0, 1])


def test_dots_in_a_row_are_a_scale_apart_and_rows_are_staggered():
    panel = paint_fabric(two_tone("dots", 0.05), 0.5, 0.5, 400)[..., 0]  # 20 texels apart
    assert min(alike_when_moved(panel, *by) for by in ((20, 0), (0, 20), (10, 10))) > 0.98
    assert max(alike_when_moved(panel, *by) for by in ((10, 0), (0, 10))) < 0.2


def test_argyle_is_half_as_high_again_as_wide():
    fabric = Fabric("argyle", (BLACK, WHITE, BLACK), 0.06, 0.0, 0.0, "jersey", 1)
    panel = paint_fabric(fabric, 0.6, 0.9, 400)[..., 0]  # diamonds of 24 x 36 texels
    assert min(alike_when_moved(panel, *by) for by in ((24, 0), (0, 36))) > 0.98
    assert max(alike_when_moved(panel, *by) for by in ((12, 0), (0, 18), (0, 24))) < 0.5


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 4, np.pi / 2, 2.0, np.pi])
def test_stripes_turn_clockwise_by_the_angle(angle):
    scale, texels_per_metre = 0.03, 400
    panel = paint_fabric(two_tone("stripes", scale, angle), 0.6, 0.6, texels_per_metre)[..., 0]
    strength = np.abs(np.fft.fft2(panel - panel.mean(), (2048, 2048)))
    row, column = np.unravel_index(strength.argmax(), strength.shape)
    wave = np.array([np.fft.fftfreq(2048)[column], np.fft.fftfreq(2048)[row]]) * texels_per_metre
    # Across the stripes: down the panel, turned clockwise (towards -x) with y down.
    across = np.array([-np.sin(angle), np.cos(angle)]) / scale
    assert min(np.abs(wave - across).max(), np.abs(wave + across).max()) < 0.02 / scale


@pytest.mark.parametrize("angle", [0.0, 0.7, 0.9, np.pi / 2, 2.0, np.pi, 4.0, 1.5 * np.pi])
def test_colours_follow_each_other_in_the_direction_of_the_angle(angle):
    primaries = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    fabric = Fabric("colour_block", primaries, 0.3, angle, 0.0, "satin", 3)
    panel = paint_fabric(fabric, 1.0, 1.0, 300)
    along = np.arange(-140, 140)
    rows = np.rint(150 + along * np.cos(angle)).astype(int)
    columns = np.rint(150 - along * np.sin(angle)).astype(int)
    seen = panel[rows, columns].argmax(axis=1)
    steps = np.diff(seen)[np.diff(seen) != 0] % 3
    assert len(steps) >= 8 and (steps == 1).all()


@pytest.mark.parametrize("kind", ["stripes", "plaid", "dots", "flowers", "leopard", "camouflage"])
def test_cloth_is_the_same_at_any_resolution(kind):
    for seed in range(3):
        fabric = replace(of_kind(kind, seed), grain=0.0, scale=0.06)
        coarse, fine = (paint_fabric(fabric, 0.4, 0.4, density) for density in (250, 1000))
        shrunk = cv2.resize(fine, (100, 100), interpolation=cv2.INTER_AREA)
        # A repeat begins at a whole texel, so a panel may be off by one.
        alike = cv2.matchTemplate(shrunk, coarse[2:-2, 2:-2], cv2.TM_CCOEFF_NORMED)
        assert alike.max() > 0.8


@pytest.mark.parametrize("kind", ["stripes", "checks", "dots", "herringbone", "houndstooth"])
def test_patterns_finer_than_a_texel_fade_to_their_mean(kind):
    fabric = two_tone(kind, 0.004)
    coarse, fine = paint_fabric(fabric, 0.4, 0.4, 60), paint_fabric(fabric, 0.4, 0.4, 2000)
    assert coarse.std() < 0.12 * fine.std()
    assert coarse.mean() == pytest.approx(fine.mean(), abs=0.02)


def test_edges_are_antialiased():
    panel = paint_fabric(two_tone("dots", 0.04), 0.4, 0.4, 900)[..., 0]
    between = ((panel > 0.2) & (panel < 0.8)).mean()
    assert 0.01 < between < 0.2


def test_plain_cloth_is_nearly_plain():
    fabric = Fabric("plain", ((0.3, 0.5, 0.7),), 0.001, 0.0, 0.03, "woven", 5)
    panel = paint_fabric(fabric, 0.5, 0.5, 430)
    assert panel.mean(axis=(0, 1)) == pytest.approx((0.3, 0.5, 0.7), abs=0.01)
    assert 0.002 < panel.std(axis=(0, 1)).max() < 0.04
    flat = paint_fabric(replace(fabric, grain=0.0), 0.5, 0.5, 430)
    assert np.ptp(flat, axis=(0, 1)).max() < 1e-6


def test_grain_is_as_strong_as_asked_for_on_every_weave():
    for weave in ("woven", "jersey", "twill", "melange", "satin"):
        fabric = Fabric("plain", ((0.5, 0.5, 0.5),), 0.001, 0.0, 0.1, weave, 5)
        spread = paint_fabric(fabric, 1.0, 1.0, 500).std() / 0.5
        assert 0.07 < spread < 0.15


def test_gradient_runs_from_the_first_colour_to_the_last():
    fabric = Fabric("gradient", (BLACK, WHITE), 0.4, 0.0, 0.0, "satin", 5)
    rows = paint_fabric(fabric, 0.2, 0.8, 200)[..., 0].mean(axis=1)
    assert rows[0] == pytest.approx(0.05, abs=0.02)
    assert rows[-1] == pytest.approx(0.95, abs=0.02)
    assert (np.diff(rows) >= 0).all()
    upside_down = paint_fabric(replace(fabric, angle=np.pi), 0.2, 0.8, 200)[..., 0].mean(axis=1)
    assert upside_down == pytest.approx(rows[::-1], abs=0.01)


def test_plain_is_about_four_in_ten_and_all_kinds_occur():
    rng = np.random.default_rng(0)
    kinds = [sample_fabric(rng).kind for _ in range(3000)]
    assert 0.33 < kinds.count("plain") / len(kinds) < 0.45
    assert set(kinds) == set(KINDS)


def test_kinds_and_palette_are_kept_to():
    rng = np.random.default_rng(0)
    palette = [(0.1, 0.2, 0.3), (0.9, 0.8, 0.7)]
    for _ in range(50):
        fabric = sample_fabric(rng, ["stripes", "denim", "plain"], palette)
        assert fabric.kind in ("stripes", "denim", "plain")
        assert fabric.colours[0] in palette


def test_garments_are_mostly_muted_and_of_all_lightness():
    rng = np.random.default_rng(0)
    colours = np.array([sample_colour(rng) for _ in range(1000)])
    assert colours.min() >= 0 and colours.max() <= 1
    vivid = (np.ptp(colours, axis=1) > 0.5).mean()
    assert 0.02 < vivid < 0.2
    light = np.array([luminance(tuple(colour)) for colour in colours])
    assert 0.2 < (light < 0.2).mean() < 0.5
    assert 0.15 < (light > 0.75).mean() < 0.5


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"kind": "brocade"}, "unknown fabric 'brocade'; supported kinds are plain, "),
        ({"weave": "felt"}, "unknown weave 'felt'; supported weaves are woven, "),
        ({"colours": (BLACK,)}, "stripes needs 2 colours or more, not 1"),
        ({"colours": (BLACK, (0.0, 255.0, 0.0))}, "must lie in 0..1"),
        ({"scale": 0.0}, "above 0 metres"),
        ({"scale": float("nan")}, "above 0 metres"),
    ],
)
def test_impossible_fabrics_are_refused(change, said):
    with pytest.raises(InputError, match=said):
        replace(two_tone("stripes", 0.02), **change)


@pytest.mark.parametrize("size", [(0.0, 1.0, 100.0), (1.0, -1.0, 100.0), (1.0, 1.0, 0.0)])
def test_impossible_panels_are_refused(size):
    with pytest.raises(InputError, match="above 0"):
        paint_fabric(of_kind("plain"), *size)


def test_sampling_from_nothing_is_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="unknown fabric 'lace'; supported kinds are"):
        sample_fabric(rng, ["plain", "lace"])
    with pytest.raises(InputError, match="empty"):
        sample_fabric(rng, [])
    with pytest.raises(InputError, match="empty"):
        sample_fabric(rng, None, [])
