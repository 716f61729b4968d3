"""What holds for any input: the same bytes from any number of workers, nothing invented."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from PIL import Image

from motion_transfer import render_video
from motion_transfer.drawing.person import Box, People, Person, find_again
from motion_transfer.drawing.window import Window, plan_window
from motion_transfer.media.folders import natural_key
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.option import frame_range, parse_frames, parse_rate
from motion_transfer.render.options import parse_parts
from motion_transfer.render.plan import (
    CHUNK_FRAMES,
    Chunk,
    DriverPlan,
    FramePlan,
    Shot,
)
from nhrr_core import PART_GROUPS, PART_NAMES

FRAMES = 2 * CHUNK_FRAMES + 5
few = settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))


def content(path: Path) -> dict[str, bytes]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


@pytest.mark.parametrize("renderer", ["texture", "nhrr"])
@pytest.mark.parametrize("output", ["out.mp4", "out.mkv", "out.webm", "out"])
def test_bytes_do_not_depend_on_workers(
    studio, checkpoint: Path, renderer: str, output: str
) -> None:
    """One, two and three workers, and once more: every byte is the same."""
    source, driver = studio.source(), studio.array(FRAMES)
    results = []
    for attempt, workers in enumerate((1, 2, 3, 2)):
        path = studio.folder / str(attempt) / output
        render_video(
            source,
            driver,
            path,
            workers=workers,
            renderer=renderer,
            weights=checkpoint if renderer == "nhrr" else None,
        )
        results.append(content(path))
    assert len(results[0]) == (FRAMES if output == "out" else 1)
    assert all(result == results[0] for result in results[1:])


def test_frames_do_not_depend_on_where_the_range_begins(studio) -> None:
    source, driver = studio.source(), studio.array(FRAMES)
    draw = partial(render_video, source, driver, renderer="texture")
    whole = draw(studio.folder / "whole").output
    some = draw(studio.folder / "some", frames=(40, 60)).output
    for index in range(20):
        np.testing.assert_array_equal(
            np.asarray(Image.open(some / f"{index:06d}.png")),
            np.asarray(Image.open(whole / f"{index + 40:06d}.png")),
        )


@pytest.mark.parametrize("renderer", ["texture", "nhrr"])
def test_far_from_the_person_is_exactly_background(studio, checkpoint, renderer: str) -> None:
    frames = np.stack([studio.iuv(60 + 2 * i, 52, size=(200, 200)) for i in range(3)])
    path = studio.folder / "out"
    render_video(
        studio.source(),
        studio.array(frames),
        path,
        background="#0a141e",
        renderer=renderer,
        weights=checkpoint if renderer == "nhrr" else None,
    )
    for pose, file in zip(frames, sorted(path.iterdir()), strict=True):
        rows, columns = np.nonzero(pose[..., 0])
        picture = np.asarray(Image.open(file)).copy()
        near = np.s_[rows.min() - 12 : rows.max() + 13, columns.min() - 12 : columns.max() + 13]
        assert (picture[near] != (10, 20, 30)).any()
        picture[near] = (10, 20, 30)
        assert (picture == (10, 20, 30)).all()


@few
@given(
    x=st.integers(-40, 40),
    y=st.integers(-40, 40),
    side=st.integers(8, 80),
    size=st.integers(4, 90),
    seed=st.integers(0, 99),
)
def test_cutting_invents_no_pixel(x: int, y: int, side: int, size: int, seed: int) -> None:
    assume(x + side > 0 and x < 30 and y + side > 0 and y < 40)  # some of it is in the frame
    iuv = np.random.default_rng(seed).integers(1, 25, (40, 30, 3), np.uint8)
    crop = Window(x, y, side).cut(iuv, size)
    known = {tuple(pixel) for pixel in iuv.reshape(-1, 3).tolist()} | {(0, 0, 0)}
    assert crop.shape == (size, size, 3)
    assert {tuple(pixel) for pixel in crop.reshape(-1, 3).tolist()} <= known


boxes = st.builds(
    lambda x, y, w, h: Person(Box(x, y, x + w, y + h), w * h, (1,)),
    *(st.integers(0, 300), st.integers(0, 300), st.integers(1, 200), st.integers(1, 200)),
)


@few
@given(path=st.lists(st.none() | boxes, min_size=1).filter(any))
def test_the_window_holds_everybody(path: list[Person | None]) -> None:
    window = plan_window([person and person.box for person in path])
    assert window.side % 2 == 0
    assert window.side >= 16
    for person in filter(None, path):
        assert window.x <= person.box.left <= person.box.right <= window.x + window.side
        assert window.y <= person.box.top <= person.box.bottom <= window.y + window.side


@few
@given(frames=st.lists(st.lists(boxes, max_size=4), min_size=1), first=boxes)
def test_following_only_ever_finds_people_who_are_there(frames, first: Person) -> None:
    crowd = [People(tuple(people), len(people)) for people in frames]
    last = first
    for people in crowd:
        person = find_again(people.persons, last)
        assert person is None or person in people.persons
        last = person or last


@few
@given(count=st.integers(1, 500), data=st.data())
def test_chunks_are_a_partition(count: int, data) -> None:
    start = data.draw(st.none() | st.integers(0, count - 1))
    stop = data.draw(st.none() | st.integers((start or 0) + 1, count))
    chosen = frame_range((start, stop), count, "driver")
    ends = sorted({0, len(chosen), *data.draw(st.lists(st.integers(0, len(chosen))))})
    shots = tuple(Shot(*ends, Window(0, 0, 16)) for ends in pairwise(ends))
    plan = DriverPlan(chosen.start, (FramePlan(None, True),) * len(chosen), shots, Fraction(25))
    covered = [i for chunk in plan.chunks for i in range(chunk.start, chunk.stop)]
    assert covered == list(range(len(chosen)))
    shown = [s for chunk in plan.chunks for s in plan.shots_in(chunk)]
    assert [i for s in shown for i in range(s.start, s.stop)] == covered
    assert plan.chunks == [Chunk(i, c.start, c.stop) for i, c in enumerate(plan.chunks)]


@few
@given(words=st.lists(st.sampled_from([*PART_GROUPS, *PART_NAMES[1:]]), min_size=1))
def test_parts_are_the_union_of_what_is_named(words: list[str]) -> None:
    single = {name: (part,) for part, name in enumerate(PART_NAMES)}
    expected = {part for word in words for part in {**single, **PART_GROUPS}[word]}
    assert parse_parts(" , ".join(words)) == tuple(sorted(expected))


@few
@given(rate=st.fractions(Fraction(1, 100), 1000, max_denominator=2**31 - 1))
def test_rates_pass_exactly_or_as_near_as_a_video_can_say(rate: Fraction) -> None:
    parsed = parse_rate(str(rate))
    if rate.numerator < 2**31:
        assert parsed == rate
    assert parsed.numerator < 2**31
    assert abs(parsed - rate) < Fraction(1, 10**5)


@few
@given(start=st.none() | st.integers(0, 9999), stop=st.none() | st.integers(0, 9999))
def test_frames_round_trip(start: int | None, stop: int | None) -> None:
    assert parse_frames(f"{'' if start is None else start}:{'' if stop is None else stop}") == (
        *(start, stop),
    )


@few
@given(numbers=st.sets(st.integers(0, 10**6), min_size=1))
def test_numbered_names_sort_by_number(numbers: set[int]) -> None:
    names = sorted((f"take2_{number}_IUV.png" for number in numbers), key=natural_key)
    assert names == [f"take2_{number}_IUV.png" for number in sorted(numbers)]


@pytest.mark.parametrize("kind", ["video", "array", "driver"])
def test_any_lazily_decoded_range_is_the_same(studio, kind: str) -> None:
    frames = studio.walk(30)
    reader = open_reader(open_stream(getattr(studio, kind)(frames)))

    @few
    @given(ends=st.lists(st.integers(0, 30), min_size=2, max_size=2, unique=True).map(sorted))
    def check(ends: list[int]) -> None:
        start, stop = ends
        np.testing.assert_array_equal(np.stack(list(reader.read(start, stop))), frames[start:stop])

    check()
