"""Prints: deterministic, whole, antialiased, and readable on their cloth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.people.clothes.fabrics.colours import luminance, sample_colour
from motion_transfer.people.clothes.prints import PRINT_KINDS, Print, paint_print, sample_print
from motion_transfer.people.clothes.prints.pictures import PICTURES

INKS = ((0.9, 0.1, 0.1), (0.1, 0.1, 0.9), (0.1, 0.8, 0.1))


def lettered(kind: str, *lines: str) -> Print:
    return Print(kind, "", lines, 0, 0.15, INKS, False, 0.0, 0.5, 3)


def pictured(picture: str) -> Print:
    return Print("picture", picture, (), 0, 0.15, INKS, False, 0.0, 1.0, 3)


ALL = {
    "word": lettered("word", "NORVEN"),
    "slogan": lettered("slogan", "Norven", "CLUB"),
    "arc": lettered("arc", "NORVEN"),
    "number": lettered("number", "27"),
    **{picture: pictured(picture) for picture in PICTURES},
}


@pytest.mark.parametrize("name", ALL)
def test_same_print_gives_the_same_bytes(name):
    first = paint_print(ALL[name], 96, 80)
    assert first.tobytes() == paint_print(replace(ALL[name]), 96, 80).tobytes()


def test_another_seed_draws_another_picture():
    for picture in ("shapes", "wave", "cat", "scene", "palm"):
        other = replace(pictured(picture), seed=4)
        assert not np.array_equal(
            paint_print(pictured(picture), 64, 64), paint_print(other, 64, 64)
        )


def test_sampling_repeats_with_its_seed_and_differs_with_another():
    prints = [sample_print(np.random.default_rng(seed), (0.1, 0.1, 0.1)) for seed in (1, 1, 2)]
    assert prints[0] == prints[1] != prints[2]


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("size", [(128, 128), (90, 40), (31, 77), (700, 300), (1, 1)])
def test_prints_are_pictures_of_the_size_asked_for(name, size):
    picture = paint_print(ALL[name], *size)
    assert picture.shape == (size[1], size[0], 4)
    assert picture.dtype == np.float32
    assert np.isfinite(picture).all() and picture.min() >= 0 and picture.max() <= 1


@pytest.mark.parametrize("name", ALL)
def test_ink_is_opaque_somewhere_clear_elsewhere_and_soft_at_its_edges(name):
    alpha = paint_print(ALL[name], 128, 128)[..., 3]
    assert 0.02 < (alpha > 0.99).mean() < 0.95
    assert (alpha == 0).mean() > 0.03
    assert ((alpha > 0.1) & (alpha < 0.9)).any()


@pytest.mark.parametrize("name", ["word", "slogan", "arc", "number"])
def test_letters_are_whole_and_centred(name):
    alpha = paint_print(replace(ALL[name], font=3, weight=0.24), 160, 80)[..., 3]
    assert alpha[:, [0, -1]].max() == 0 and alpha[[0, -1]].max() == 0
    columns = np.flatnonzero(alpha.max(axis=0) > 0.2)
    assert columns[0] == pytest.approx(159 - columns[-1], abs=4)


def test_letters_below_the_line_are_not_cut_off():
    alpha = paint_print(lettered("word", "HHyy"), 160, 80)[..., 3] > 0.5
    columns = np.flatnonzero(alpha.any(axis=0))
    lowest = [np.flatnonzero(alpha[:, part].any(axis=1))[-1] for part in np.split(columns, [40])]
    assert lowest[1] > lowest[0] + 5


def test_colour_is_not_multiplied_by_alpha():
    picture = paint_print(lettered("word", "NORVEN"), 160, 80)
    apart = np.abs(picture[..., :3] - np.array(INKS[0], np.float32)).max(axis=2)
    assert apart[picture[..., 3] > 0.1].max() < 0.05
    assert apart[picture[..., 3] == 0].max() < 1e-6


def test_an_outlined_word_has_both_inks():
    picture = paint_print(replace(lettered("word", "NORVEN"), outlined=True), 160, 80)
    inked = picture[picture[..., 3] > 0.9][:, :3]
    for ink in INKS[:2]:
        assert (np.abs(inked - np.array(ink)).max(axis=1) < 0.05).mean() > 0.05


def test_an_arc_is_higher_in_its_middle():
    def middle_below_ends(kind: str) -> float:
        alpha = paint_print(replace(ALL["arc"], kind=kind, lines=("HHHHHHHH",)), 200, 110)[..., 3]
        used = np.flatnonzero(alpha.max(axis=0) > 0.3)
        tops = (alpha > 0.3).argmax(axis=0)[used]
        ends = np.concatenate([tops[:12], tops[-12:]]).min()
        return float(tops[len(tops) // 2 - 12 : len(tops) // 2 + 12].min() - ends)

    assert abs(middle_below_ends("word")) <= 1
    assert middle_below_ends("arc") < -5


def test_wear_takes_ink_away():
    new = pictured("heart")
    worn = paint_print(replace(new, wear=0.6), 128, 128)[..., 3]
    assert worn.mean() < 0.9 * paint_print(new, 128, 128)[..., 3].mean()


def test_a_print_keeps_its_proportions():
    alpha = paint_print(pictured("mountain"), 200, 100)[..., 3]
    rows, columns = (np.flatnonzero(alpha.max(axis=axis) > 0.5) for axis in (1, 0))
    assert len(rows) == pytest.approx(len(columns), abs=2)
    assert len(rows) == pytest.approx(96, abs=3)


def test_the_first_ink_stands_out_from_any_cloth():
    rng = np.random.default_rng(0)
    for _ in range(300):
        ground = sample_colour(rng)
        assert abs(luminance(sample_print(rng, ground).inks[0]) - luminance(ground)) > 0.25


def test_all_kinds_and_pictures_occur():
    rng = np.random.default_rng(0)
    prints = [sample_print(rng, (0.9, 0.9, 0.9)) for _ in range(600)]
    assert {design.kind for design in prints} == set(PRINT_KINDS)
    assert {design.picture for design in prints} == {"", *PICTURES}
    for design in prints[:60]:
        assert paint_print(design, 64, round(64 * design.aspect))[..., 3].max() > 0.3


def test_impossible_prints_are_refused():
    with pytest.raises(InputError, match="unknown print 'logo'; supported kinds are word, "):
        replace(ALL["word"], kind="logo")
    with pytest.raises(InputError, match="unknown picture 'dog'; supported pictures are sunset, "):
        pictured("dog")
    with pytest.raises(InputError, match="3 inks"):
        replace(ALL["word"], inks=INKS[:2])
    with pytest.raises(InputError, match="1 pixel"):
        paint_print(ALL["word"], 0, 10)
