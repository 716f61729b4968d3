"""The pairs of Table 1: drawn by a rule that anyone can follow, or those of a list."""

from __future__ import annotations

import hashlib
from pathlib import PurePosixPath

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.deepfashion import TABLE_1, choose_pairs, draw_pairs

NAMES = [
    f"fashionWOMENDressesid{item:08d}{outfit:02d}_{view}"
    for item in (2, 35, 41)
    for outfit in (1, 2)
    for view in ("1front", "2side", "3back", "6flat")
]
PHOTOS = {name: PurePosixPath(f"test/{name}.jpg") for name in NAMES}


def test_a_pair_of_every_outfit_and_never_of_two() -> None:
    drawn = draw_pairs(NAMES)
    outfits = [[name.split("_")[0] for name in pair] for pair in drawn]
    assert len(drawn) == len({source for source, _ in outfits}) == 6
    assert all(source == target for source, target in outfits)
    assert all(source != target for source, target in drawn)
    assert not any("flat" in name for pair in drawn for name in pair)


def test_the_rule_is_the_one_that_is_told() -> None:
    def digest(*words: str) -> str:
        return hashlib.sha256(" ".join(("2020", *words)).encode()).hexdigest()

    source, target = draw_pairs(NAMES)[0]
    outfit = source.split("_")[0]
    assert digest(outfit) == min(digest(name.split("_")[0]) for name in NAMES)
    views = [name for name in NAMES if name.startswith(outfit) and "flat" not in name]
    pairs = [(a, b) for a in views for b in views if a != b]
    assert digest(source, target) == min(digest(*pair) for pair in pairs)


def test_the_order_of_names_does_not_matter_and_a_missing_photo_moves_one_pair() -> None:
    drawn = draw_pairs(NAMES)
    assert draw_pairs(NAMES[::-1]) == drawn
    source, target = drawn[2]
    without = draw_pairs([name for name in NAMES if name != target])
    assert [pair for pair in without if pair not in drawn] == [without[2]]
    assert without[2][0].split("_")[0] == source.split("_")[0]


def test_too_few_outfits_are_not_made_up_for(tmp_path) -> None:
    with pytest.raises(InputError, match=r"has 6 outfits .* 176 are needed .* --limit 6$"):
        choose_pairs(tmp_path, PHOTOS, None, None)
    assert len(choose_pairs(tmp_path, PHOTOS, None, 6).rows) == 6
    alone = {name: PHOTOS[name] for name in NAMES[:1]}
    with pytest.raises(InputError, match=r"has 0 outfits .* for as many pairs$"):
        choose_pairs(tmp_path, alone, None, 2)


def test_a_list_may_spell_names_as_it_likes(tmp_path) -> None:
    listed = tmp_path / "pairs.csv"
    listed.write_text(
        "from,to\n"
        "fasionWOMENDressesid0000000201_1front.jpg,fashionWOMENDressesid0000000201_2side.jpg\n"
        "img/WOMEN/Dresses/id_00000035/02_3_back.jpg,WOMEN/Dresses/id_00000035/02_2_side.jpg\n"
        "fashionWOMENDressesid0000000201_1front.jpg,fashionWOMENDressesid0000000299_2side.jpg\n"
        "a.jpg,fashionWOMENDressesid0000000201_2side.jpg\n"
    )
    chosen = choose_pairs(tmp_path, PHOTOS, listed, None)
    assert chosen.rows == [
        ("line 2", NAMES[0], NAMES[1]),
        ("line 3", NAMES[14], NAMES[13]),
    ]
    assert chosen.problems == [
        f"line 4: fashionWOMENDressesid0000000299_2side.jpg is not in {tmp_path}",
        f"line 5: a.jpg is not in {tmp_path}",
    ]
    assert len(choose_pairs(tmp_path, PHOTOS, listed, 1).rows) == 1


def test_the_papers_table_is_whole() -> None:
    assert list(TABLE_1.scores) == ["CBI", "DSC", "VUnet", "DPT", "NHRR", "GT"]
    assert all(numbers.keys() == TABLE_1.better.keys() for numbers in TABLE_1.scores.values())
    best = max(TABLE_1.scores, key=lambda name: (name != "GT", TABLE_1.scores[name]["ssim"]))
    assert best == "NHRR"  # set in bold there
