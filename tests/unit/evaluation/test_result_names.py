"""Names of results, from a pair and back, and the strips that published code writes."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.evaluation.result_names import PATTERNS, cut_result, find_pattern, item_name


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_name_in_any_pattern_is_one_item(pattern: str) -> None:
    stem = pattern.replace("SOURCE", "id_01_1front").replace("TARGET", "id_01_2side")
    assert find_pattern(stem) == pattern
    assert item_name(stem) == "id_01_1front__id_01_2side"


@pytest.mark.parametrize("stem", ["astronaut_walk", "v1.5", "a_vis", "__a", "a__", ""])
def test_other_names_stay(stem: str) -> None:
    assert find_pattern(stem) is None
    assert item_name(stem) == stem


def test_what_joins_two_names_is_read_once() -> None:
    assert item_name("me__2___b") == item_name("me__2__b") == "me__2__b"
    assert item_name("id_2_front___side") == item_name("id_2_front__side") == "id_2_front__side"
    assert item_name("a__b_vis") == "a__b_vis", "the ending is another method's"


def test_shop_names_are_spelled_one_way() -> None:
    flat = "fashionWOMENTees_Tanksid0000007003_1front"
    assert item_name(f"{flat}___{flat}_vis") == item_name(f"{flat}_2_{flat}")


@pytest.mark.parametrize("count", [3, 5])
def test_of_a_strip_the_last_picture_is_cut_out(count: int) -> None:
    pictures = [np.full((256, 176, 3), shade, np.uint8) for shade in range(count)]
    np.testing.assert_array_equal(cut_result(np.hstack(pictures), count), pictures[-1])
    alone = np.zeros((256, 256, 3), np.uint8)
    assert cut_result(alone, count) is alone
    assert cut_result(np.hstack(pictures), 1).shape == (256, 176 * count, 3)
