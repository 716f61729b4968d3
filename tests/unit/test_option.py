"""Options described once: what follows from the description."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.option import (
    REQUIRED,
    check_choices,
    list_options,
    option,
    options_from_words,
    parse_frames,
    parse_path,
    parse_rate,
    parse_size,
    part_of,
)


@dataclass(frozen=True, kw_only=True)
class Ends:
    first: Path = option("-f --first-one", "Ends", "The first.", kind="path", default=REQUIRED)
    rate: Fraction | None = option("--fps", "Ends", "How fast.", kind="rate")


@dataclass(frozen=True, kw_only=True)
class Whole(Ends):
    SECTIONS = ("Rest", "Ends")

    colour: str = option("--colour", "Rest", "Of it.", default="red", choices=("red", "blue"))
    unseen: int = 3

    def __post_init__(self) -> None:
        check_choices(self)


def test_sections_order_the_described_fields_and_leave_others_out() -> None:
    assert [entry.name for entry in list_options(Whole)] == ["colour", "first", "rate"]
    assert [entry.name for entry in list_options(Ends)] == ["first", "rate"]
    assert [entry.word for entry in list_options(Whole)] == ["colour", "first_one", "fps"]


def test_words_become_values_and_nothing_the_default() -> None:
    made = options_from_words(Whole, {"first": "a.png", "rate": "30000/1001", "colour": None})
    assert made == Whole(first=Path("a.png"), rate=Fraction(30000, 1001), colour="red")


def test_an_empty_path_is_not_the_folder_where_we_are() -> None:
    with pytest.raises(InputError, match=r"^first one: a path is empty; name a file or a folder$"):
        options_from_words(Whole, {"first": ""})
    with pytest.raises(InputError, match="a path is empty"):
        parse_path("")


def test_a_value_that_is_none_of_the_choices_is_refused() -> None:
    with pytest.raises(InputError, match="colour is 'green'; supported are red, blue"):
        Whole(first=Path("a"), colour="green")


def test_parts_are_equal_where_what_they_hold_is() -> None:
    one, other = (Whole(first=Path("a"), colour=colour) for colour in ("red", "blue"))
    assert one != other
    assert part_of(one, Ends) == part_of(other, Ends) == Ends(first=Path("a"))


@pytest.mark.parametrize(
    "text", ["", "256", "256x", "axb", "-1x5", "1.5x2", "³x5", f"{'9' * 5000}x5"]
)
def test_bad_sizes(text: str) -> None:
    with pytest.raises(InputError, match="write WIDTHxHEIGHT"):
        parse_size(text)


@pytest.mark.parametrize("text", ["1e999999999", "1e-999999999", "9" * 5000, "nan", "inf", "³", ""])
def test_rates_that_no_video_has(text: str) -> None:
    with pytest.raises(InputError, match="fps") as caught:
        parse_rate(text)
    assert len(str(caught.value)) < 150


def test_rates_are_exact() -> None:
    rates = ("30000/1001", "29.97", "2.5e1", 25)
    assert [parse_rate(rate) for rate in rates] == [
        *(Fraction(30000, 1001), Fraction(2997, 100)),
        *(Fraction(25), Fraction(25)),
    ]


@pytest.mark.parametrize("text", ["9" * 5000 + ":", "1_0:", "³:", "1:2:3", "a"])
def test_frames_that_no_driver_has(text: str) -> None:
    with pytest.raises(InputError, match="write START:STOP"):
        parse_frames(text)
