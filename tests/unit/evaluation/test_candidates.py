"""Candidates: what they draw of a pair, and folders of pictures, whichever way they are named."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.candidates import (
    OpenedSource,
    RenderedCandidate,
    ResultsFolder,
    TargetCandidate,
    make_labels_unique,
)
from motion_transfer.evaluation.framing import Framing
from motion_transfer.evaluation.result_names import PATTERNS
from motion_transfer.training.pairs import PairList, open_pairs


@pytest.fixture
def pairs(studio) -> PairList:
    for name in ("a", "b", "c"):
        studio.source(name)
    path = studio.folder / "pairs.csv"
    path.write_text("from,to\na.png,b.png\nb.png,c.png\nc.png,a.png\n")
    return open_pairs(path)


NAMES: dict[str, Callable[[str, str], str]] = {
    "SOURCE__TARGET": lambda a, b: f"{a}__{b}.png",
    "SOURCE___TARGET": lambda a, b: f"{a}___{b}.jpg",
    "SOURCE___TARGET_vis": lambda a, b: f"{a}___{b}_vis.PNG",
    "SOURCE_2_TARGET": lambda a, b: f"{a}_2_{b}.png",
    "SOURCE_2_TARGET_vis": lambda a, b: f"{a}_2_{b}_vis.png",
    "SOURCE.jpg_TARGET.jpg": lambda a, b: f"{a}.png_{b}.png.png",
    "SOURCE.jpg___TARGET.jpg": lambda a, b: f"{a}.png___{b}.png.webp",
    "SOURCE.jpg___TARGET.jpg_vis": lambda a, b: f"{a}.png___{b}.png_vis.jpg",
}


def fill(studio, pairs: PairList, name: Callable[[str, str], str], side: int = 64) -> Path:
    """A flat picture for each pair, brighter from one to the next."""
    for index, pair in enumerate(pairs):
        source, target = (Path(p.name).stem for p in (pair.source, pair.target))
        pixels = np.full((side * 3 // 2, side, 3), 50 * (index + 1), np.uint8)
        studio.image(f"other/{name(source, target)}", pixels)
    return studio.folder / "other"


def test_every_pattern_has_a_case() -> None:
    assert list(NAMES) == list(PATTERNS)


@pytest.mark.parametrize("pattern", NAMES)
def test_each_naming_is_recognised(studio, pairs: PairList, pattern: str) -> None:
    folder = ResultsFolder(fill(studio, pairs, NAMES[pattern]), pairs)
    assert folder.pattern == pattern
    for index, pair in enumerate(pairs):
        assert folder.find_problem(pair, Framing()) is None
        drawn = folder.read(pair, pair.target.load())
        assert abs(int(drawn[9, 9, 0]) - 50 * (index + 1)) <= 2


STRIPS = {name: count for name, count in PATTERNS.items() if count > 1}


@pytest.mark.parametrize("pattern", STRIPS)
@pytest.mark.parametrize("width", [42, 64, 96])  # cropped, as the target, and square
def test_the_last_picture_of_a_strip_counts(studio, pairs: PairList, pattern: str, width) -> None:
    pair, others = pairs[0], width * (STRIPS[pattern] - 1)
    result = np.full((96, width, 3), 200, np.uint8)
    strip = np.hstack([np.zeros((96, others, 3), np.uint8), result])
    for name, pixels in (("strip", strip), ("alone", result)):
        stem = Path(NAMES[pattern]("a", "b")).stem
        studio.image(f"{name}/{stem}.png", pixels)
        folder = ResultsFolder(studio.folder / name, pairs)
        assert folder.pattern == pattern
        np.testing.assert_array_equal(folder.read(pair, pair.target.load()), result)


def test_the_naming_that_finds_most_wins(studio, pairs: PairList) -> None:
    path = fill(studio, pairs, NAMES["SOURCE___TARGET"])
    studio.image("other/a__b.png", np.zeros((96, 64, 3), np.uint8))
    assert ResultsFolder(path, pairs).pattern == "SOURCE___TARGET"


def test_problems_of_single_pictures(studio, pairs: PairList) -> None:
    path = fill(studio, pairs, NAMES["SOURCE__TARGET"])
    (path / "a__b.png").unlink()
    (path / "b__c.png").write_bytes(b"words")
    studio.image("other/c__a.png", np.zeros((64, 96, 3), np.uint8))
    folder = ResultsFolder(path, pairs)
    problems = [folder.find_problem(pair, Framing()) or "" for pair in pairs]
    assert "other/a__b.png does not exist" in problems[0]
    assert "b__c.png is not a picture" in problems[1]
    assert "is 96 x 64, but its target is 128 x 192" in problems[2]


def test_a_folder_of_something_else(studio, pairs: PairList) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        ResultsFolder(studio.folder / "none", pairs)
    with pytest.raises(InputError, match=r"none of its 6 pictures belongs to a pair.*a__b\.png"):
        ResultsFolder(studio.folder, pairs)


def test_labels_become_unique(studio, pairs: PairList) -> None:
    for name in ("x/w", "y/w", "z"):
        shutil.copytree(fill(studio, pairs, NAMES["SOURCE__TARGET"]), studio.folder / name)
    paths = [studio.folder / name for name in ("x/w", "y/w", "z")]
    candidates = [ResultsFolder(path, pairs) for path in paths]
    make_labels_unique(candidates, paths)
    assert [candidate.label for candidate in candidates] == ["x/w", "y/w", "z"]
    with pytest.raises(InputError, match="x/w is given twice"):
        make_labels_unique(candidates, [paths[0], studio.folder / "z/../x/w", paths[2]])


def test_a_source_is_unfolded_once_for_each_size(pairs: PairList) -> None:
    opened = OpenedSource(pairs[0].source.load())
    first = opened.prepare(64)
    assert first.texture.shape[-1] == 64
    assert opened.prepare(64) is first
    assert opened.prepare(32).texture.shape[-1] == 32


def test_candidates_draw_the_target_in_its_own_size(studio, pairs: PairList) -> None:
    pair = pairs[0]
    source, target = OpenedSource(pair.source.load()), pair.target.load()
    draft = RenderedCandidate("texture", None, "black")
    assert draft.describe() == {"label": "texture", "kind": "renderer", "renderer": "texture"}
    drawn = draft.open_source(source)(pair, target)
    assert drawn.shape == target.rgb.shape
    assert (drawn[0, 0] == 0).all()
    np.testing.assert_array_equal(TargetCandidate().open_source(source)(pair, target), target.rgb)
    folder = ResultsFolder(fill(studio, pairs, NAMES["SOURCE__TARGET"]), pairs)
    assert (folder.open_source(source)(pair, target) == 50).all()
    assert folder.describe()["names"] == "SOURCE__TARGET"
