"""The options of a run: words to values, and what is refused."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.option import parse_colour, parse_frames, parse_rate
from motion_transfer.render.options import RenderOptions, parse_parts, parse_window
from nhrr_core import PART_GROUPS, PART_NAMES


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("10:50", (10, 50)),
        ("10:", (10, None)),
        (":50", (None, 50)),
        (":", (None, None)),
        ("7", (7, 8)),
    ],
)
def test_frames(text: str, frames: tuple) -> None:
    assert parse_frames(text) == frames


@pytest.mark.parametrize("text", ["", "ten", "1:2:3", "-5:", ":-1", "1.5:3"])
def test_bad_frames(text: str) -> None:
    with pytest.raises(InputError, match=f"frames '{text}'; "):
        parse_frames(text)


@pytest.mark.parametrize(
    ("text", "rate"),
    [
        ("25", Fraction(25)),
        ("29.97", Fraction(2997, 100)),
        ("30000/1001", Fraction(30000, 1001)),
        (str(30000 / 1001), Fraction(30000, 1001)),
    ],
)
def test_rates_are_exact(text: str, rate: Fraction) -> None:
    assert parse_rate(text) == rate


@pytest.mark.parametrize("text", ["", "fast", "0", "-25", "1/0", "1001", "1e-12", "nan", "inf"])
def test_bad_rates(text: str) -> None:
    with pytest.raises(InputError, match=f"fps '{text}'; "):
        parse_rate(text)


@pytest.mark.parametrize(
    ("text", "colour"),
    [
        ("white", (255, 255, 255)),
        ("black", (0, 0, 0)),
        ("#10Ff80", (16, 255, 128)),
        ("photo", None),
    ],
)
def test_colours(text: str, colour: tuple | None) -> None:
    assert parse_colour(text) == colour


@pytest.mark.parametrize("text", ["", "mauve", "#fff", "#12345g", "123456", "#1 2 3 4", "#12 34 "])
def test_bad_colours(text: str) -> None:
    with pytest.raises(InputError, match=f"background '{text}'; "):
        parse_colour(text)


def test_parts_by_group_and_by_name() -> None:
    assert parse_parts("torso, hand-left,") == (1, 2, 4)
    assert parse_parts(",".join(PART_GROUPS)) == tuple(range(1, 25))
    assert parse_parts(",".join(PART_NAMES[1:])) == tuple(range(1, 25))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("trousers", "unknown part 'trousers'; groups are torso"),
        ("background", "unknown part 'background'"),
        (" , ", "no parts named"),
    ],
)
def test_bad_parts(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        parse_parts(text)


def options(**changes) -> RenderOptions:
    return RenderOptions(source=(Path("a"),), driver=Path("b"), output=Path("c"), **changes)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"renderer": "gan"}, "renderer is 'gan'; supported are nhrr, texture"),
        ({"iuv_order": "bgr"}, "iuv_order is 'bgr'; supported are iuv, vui"),
        ({"source_iuv_order": "bgr"}, "source_iuv_order is 'bgr'"),
        ({"missing": "skip"}, "missing is 'skip'; supported are hold, background, fail"),
        ({"size": "huge"}, "size is 'huge'; supported are driver, crop, even"),
        ({"renderer": "texture", "weights": Path("w")}, "uses no weights"),
        ({"workers": 0}, "workers is 0"),
        ({"background": "#mauve"}, "background '#mauve'; write a colour as #rrggbb, white, black"),
        ({"background_blur": 101.0}, "background blur 101.0"),
        ({"place": "0.5,0.9"}, "place '0.5,0.9'; write X,Y,SCALE"),
        ({"place": "0.5,0.9,0"}, "place '0.5,0.9,0'; write X,Y,SCALE"),
        ({"size": "background"}, "--size background takes its size from a picture"),
        ({"size": "crop", "place": "0.5,0.9,1"}, "--size crop is the square around one person"),
        ({"background": "transparent", "match_colours": True}, "--match-colours goes by what is"),
    ],
)
def test_bad_options(changes: dict, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        options(**changes)


def test_windows() -> None:
    assert parse_window("auto") is None
    assert parse_window("-10,20,300") == (-10, 20, 300)


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "a,b,c", "0,0,15", "0,0,99999", "1.5,2,30"])
def test_bad_windows(text: str) -> None:
    with pytest.raises(InputError, match=f"window '{text}'; "):
        options(window=text)
