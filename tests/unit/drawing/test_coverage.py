"""What photos show of a body: which share, by whom, how well, and what is wanting."""

from __future__ import annotations

import numpy as np
import pytest
from jaxtyping import Bool

from motion_transfer.drawing.coverage import (
    PALETTE,
    SIDES,
    UNSEEN,
    WANTING,
    WELL,
    Coverage,
    draw_coverage,
    measure_coverage,
    regions,
    visible_from,
)
from motion_transfer.drawing.views import View
from nhrr_core import load_uv_tables

PART = load_uv_tables().part
EVERYWHERE = np.ones(PART.shape, bool)
MIRROR = {"front": "back", "back": "front", "left side": "right side", "right side": "left side"}


def view(where: Bool[np.ndarray, "T T"], well: float = WELL, name: str = "photo") -> View:
    """A photo that shows some texels, all as well."""
    visibility = where[None].astype(np.float32)
    return View(name, visibility.repeat(3, axis=0) * 0.2, visibility, visibility * well)


def parts(*numbers: int) -> Bool[np.ndarray, "T T"]:
    return np.isin(PART, numbers)


def test_each_texel_lies_in_one_region() -> None:
    found = regions()
    assert (np.sum(list(found.values()), axis=0) == 1).all()
    area = measure_coverage([view(EVERYWHERE)]).area
    shares = {name: float(area[where].sum()) for name, where in found.items()}
    assert sum(shares.values()) == pytest.approx(1)
    # of a grown body, about: the trunk is a third, both legs more than both arms
    assert 0.2 < shares["front of the trunk"] + shares["back of the trunk"] < 0.5
    legs = shares["front of the legs"] + shares["back of the legs"]
    assert legs > shares["front of the arms"] + shares["back of the arms"]
    assert shares["face"] < 0.08 and shares["hands"] < 0.12


@pytest.mark.parametrize(
    ("side", "shown", "hidden"),
    [
        ("front", ["face", "front of the trunk", "front of the legs"], ["back of the trunk"]),
        ("back", ["back of the trunk", "back of the legs"], ["face", "front of the trunk"]),
    ],
)
def test_a_camera_sees_its_side(side: str, shown: list[str], hidden: list[str]) -> None:
    seen = visible_from(side)
    assert all(seen[regions()[name]].mean() > 0.6 for name in shown)
    assert all(seen[regions()[name]].mean() < 0.3 for name in hidden)


def test_left_and_right_are_the_persons_own() -> None:
    left, right = visible_from("left side"), visible_from("right side")
    for of_left, of_right in ((4, 3), (5, 6), (24, 23)):  # hands, feet, head
        assert left[parts(of_left)].mean() > 2 * right[parts(of_left)].mean()
        assert right[parts(of_right)].mean() > 2 * left[parts(of_right)].mean()
    assert left.mean() == pytest.approx(right.mean(), rel=0.1)


def test_a_region_is_told_by_its_surface_and_how_well_that_is_seen() -> None:
    coverage = measure_coverage([view(parts(2), well=0.5 * WELL), view(parts(23), well=9 * WELL)])
    assert coverage.of(parts(2)) == (pytest.approx(1), pytest.approx(0.5))
    assert coverage.of(parts(23)) == (pytest.approx(1), pytest.approx(1))  # no more than well
    assert coverage.of(parts(1)) == (0, 0)
    both = coverage.area[parts(1)].sum() + coverage.area[parts(2)].sum()
    seen, well = coverage.of(parts(1, 2))
    assert seen == pytest.approx(coverage.area[parts(2)].sum() / both)
    assert well == pytest.approx(0.5)
    assert coverage.seen == pytest.approx(coverage.area[parts(2, 23)].sum())


def test_the_photo_that_sees_it_best_tells_how_well() -> None:
    coverage = measure_coverage(
        [view(EVERYWHERE, well=0.2 * WELL), view(parts(2), well=0.6 * WELL)]
    )
    assert coverage.of(parts(2))[1] == pytest.approx(0.6)
    assert coverage.of(parts(9))[1] == pytest.approx(0.2)


def test_each_source_has_its_share() -> None:
    """All frames of a video are one source."""
    views = [
        view(parts(2), name="front.jpg"),
        view(parts(1), name="turn.mp4"),
        view(parts(7, 8), name="turn.mp4"),
    ]
    coverage = measure_coverage(views)
    assert coverage.names == ("front.jpg", "turn.mp4")
    given = coverage.given()
    assert given == {
        "front.jpg": pytest.approx(coverage.area[parts(2)].sum(), abs=1e-3),
        "turn.mp4": pytest.approx(coverage.area[parts(1, 7, 8)].sum(), abs=1e-3),
    }
    assert sum(given.values()) == pytest.approx(coverage.seen, abs=1e-3)


@pytest.mark.parametrize("side", SIDES)
def test_the_side_that_nobody_shows_is_wanting(side: str) -> None:
    found = measure_coverage([view(~visible_from(side))]).wanting()
    assert found is not None
    assert found == (side, pytest.approx(1))
    shown = measure_coverage([view(visible_from(side))]).wanting()
    assert shown is not None and shown[0] == MIRROR[side]


def test_nothing_is_wanting_where_all_is_seen_well() -> None:
    assert measure_coverage([view(EVERYWHERE)]).wanting() is None
    assert measure_coverage([view(EVERYWHERE, well=(1 - WANTING / 2) * WELL)]).wanting() is None
    far = measure_coverage([view(EVERYWHERE, well=(1 - WANTING * 1.5) * WELL)]).wanting()
    assert far is not None and far[1] == pytest.approx(WANTING * 1.5, rel=0.01)


def near(picture: np.ndarray, colour: tuple[int, ...]) -> np.ndarray:
    return np.abs(picture.astype(int) - colour).max(-1) < 12


def draw(coverage: Coverage) -> np.ndarray:
    photo = np.full((80, 40, 3), 128, np.uint8)
    return draw_coverage(coverage, [photo] * len(coverage.names))


def split(body: np.ndarray) -> list[np.ndarray]:
    """The bodies of a picture, from left to right: white lies between them."""
    inked = np.flatnonzero((body < 255).any((0, 2)))
    return np.split(body, inked[1:][np.diff(inked) > 8], axis=1)


def test_each_side_shows_in_colours_who_sees_it() -> None:
    """The first sees the front, the second the back of the trunk, nobody the backs of the legs."""
    views = [view(visible_from("front"), name="front.png"), view(parts(1), name="back.png")]
    drawn = draw(measure_coverage(views))
    assert drawn.dtype == np.uint8
    panels = split(drawn[:400])
    assert len(panels) == len(SIDES)
    first, second, unseen = (
        [int(near(panel, colour).sum()) for panel in panels]
        for colour in (PALETTE[0], PALETTE[1], UNSEEN)
    )
    assert first[0] > 20 * (second[0] + unseen[0])
    assert min(second[1], unseen[1]) > 5 * first[1]
    for side in (2, 3):
        assert min(first[side], second[side], unseen[side]) > 500


def test_what_is_seen_badly_is_drawn_pale() -> None:
    well, badly = (
        draw(measure_coverage([view(EVERYWHERE, well=share * WELL)]))[:400] for share in (1, 0.5)
    )
    assert near(well, PALETTE[0]).sum() > 10_000
    assert not near(badly, PALETTE[0]).any()
    pale = tuple(round(255 - (255 - channel) * 0.5) for channel in PALETTE[0])
    assert near(badly, pale).sum() == pytest.approx(near(well, PALETTE[0]).sum(), rel=0.1)


@pytest.mark.parametrize("count", [1, 9])
def test_all_photos_stand_below(count: int) -> None:
    """Also more of them than there are colours, and of any shape and name."""
    names = [f"{'Ф' * 3 * number}{number}.png" for number in range(count)]
    coverage = measure_coverage([view(EVERYWHERE, name=name) for name in names])
    shades = [20 * number for number in range(count)]
    photos = [np.full((100, 30 + shade, 3), shade, np.uint8) for shade in shades]
    below = draw_coverage(coverage, photos)[420:]
    for shade in shades:
        assert near(below, (shade, shade, shade)).sum() > 2000
    assert near(below, PALETTE[0]).any()
