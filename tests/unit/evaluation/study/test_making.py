"""The folder of a study: what is in it, and what must not be."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from motion_transfer.errors import InputError, OutputError
from motion_transfer.evaluation.study.key import Key, read_key
from motion_transfer.evaluation.study.making import (
    SAME_TIME_SECONDS,
    choose_pairs,
    draw_comparisons,
    make_study,
)
from motion_transfer.evaluation.study.options import StudyOptions

LABELS = ("Chromogen", "Umbriel")
ITEMS = [f"person__pose{number}" for number in range(6)]


def data_of(study: Path) -> dict:
    text = (study / "page/data.js").read_text()
    return json.loads(text.removeprefix("const STUDY = ").removesuffix(";\n"))


@pytest.fixture
def study(studio) -> Callable[..., tuple[Path, Key]]:
    """Make a study of two methods whose files are full of their names."""
    for level, label in enumerate(LABELS):
        (studio.folder / label).mkdir()
        for number, item in enumerate(ITEMS):
            text = PngInfo()
            text.add_text("Software", label)
            text.add_itxt("Title", f"{label} {item}")
            pixels = np.full((40 + level, 32, 3), 40 * number + level, np.uint8)
            Image.fromarray(pixels).save(studio.folder / label / f"{item}.png", pnginfo=text)
    studio.image("photos/person.png", np.full((32, 32, 3), 7, np.uint8))

    def make(**options) -> tuple[Path, Key]:
        output = studio.folder / "study"
        results = tuple(f"{studio.folder}/{label}" for label in LABELS)
        words = {"results": results, "sources": studio.folder / "photos", "output": output}
        return output, make_study(StudyOptions(**{**words, **options}))

    return make


def test_nothing_in_the_page_tells_the_method(study) -> None:
    folder, _ = study()
    page = folder / "page"
    files = [file for file in page.rglob("*") if file.is_file()]
    assert len([file for file in files if file.suffix == ".png"]) == 3 * len(ITEMS)
    for word in (*LABELS, *ITEMS, "person", "Software"):
        for file in files:
            assert word not in str(file.relative_to(page))
            if word != "person" or file.parent.name == "media":  # the page's own words have it
                assert word.encode() not in file.read_bytes(), f"{word} in {file}"
    assert {path.stat().st_mtime for path in (page, *page.rglob("*"))} == {SAME_TIME_SECONDS}


def test_the_key_says_what_every_view_is(study) -> None:
    folder, made = study()
    key, data = read_key(folder / "key.json"), data_of(folder)
    assert key == made
    assert data["id"] == key.study
    for shown in data["comparisons"]:
        comparison = key.comparisons[shown["id"]]
        number = ITEMS.index(comparison.item)
        for view in ("a", "b"):
            level = LABELS.index(getattr(comparison, view))
            pixels = np.asarray(Image.open(folder / "page" / shown[view]))
            assert pixels.shape == (40 + level, 32, 3)
            assert (pixels == 40 * number + level).all()
            assert key.files[shown[view]] == f"{LABELS[level]}: {comparison.item}"
        assert (np.asarray(Image.open(folder / "page" / shown["source"])) == 7).all()
        assert key.files[shown["source"]] == f"source: {comparison.item}"


def test_neither_names_nor_order_follow_from_the_method(study) -> None:
    """Made twice, everything lies otherwise: 12 files in the same order are one in 12!."""
    orders = []
    for force in (False, True):
        _, key = study(force=force)
        names = sorted(name for name in key.files if not key.files[name].startswith("source"))
        orders.append([key.files[name] for name in names])
    assert orders[0] != orders[1]


def test_each_method_is_a_in_half_of_its_items() -> None:
    for count in (6, 7):
        items = [str(number) for number in range(count)]
        drawn = draw_comparisons([("x", "y"), ("x", "z")], items).values()
        assert Counter(each.item for each in drawn) == dict.fromkeys(items, 2)
        for other in "yz":
            first = sum(each.a == "x" for each in drawn if other in (each.a, each.b))
            assert first in (count // 2, -(-count // 2))


def test_which_methods_are_compared() -> None:
    assert choose_pairs("xyz", None) == [("x", "y"), ("x", "z"), ("y", "z")]
    assert choose_pairs("xyz", "y") == [("y", "x"), ("y", "z")]
    with pytest.raises(InputError, match="'w' is no method here; there are x, y, z"):
        choose_pairs("xyz", "w")


def test_without_sources_nobody_is_asked_about_identity(study) -> None:
    folder, key = study(sources=None)
    assert key.questions == ["realism"]
    assert [each["id"] for each in data_of(folder)["questions"]] == ["realism"]
    assert {each["source"] for each in data_of(folder)["comparisons"]} == {None}


@pytest.mark.parametrize(
    ("asked", "repeats", "expected"), [(40, 4, (6, 3)), (4, 1, (4, 1)), (1, 4, (1, 0))]
)
def test_how_much_a_reader_sees(study, asked: int, repeats: int, expected: tuple) -> None:
    _, key = study(per_reader=asked, repeats=repeats)
    assert (key.asked, key.repeats) == expected


def test_answers_are_never_replaced(study) -> None:
    folder, _ = study()
    with pytest.raises(OutputError, match="--force"):
        study()
    study(force=True)
    (folder / "answers").mkdir()
    with pytest.raises(OutputError, match="a study that nobody has answered"):
        study(force=True)


def test_a_picture_that_cannot_be_read_leaves_nothing(study, studio) -> None:
    (studio.folder / LABELS[0] / f"{ITEMS[0]}.png").write_bytes(b"\x89PNG\r\n\x1a\nno")
    with pytest.raises(InputError, match=ITEMS[0]):
        study()
    assert not [path for path in studio.folder.iterdir() if "study" in path.name]


def test_an_animation_is_no_photo(study, studio) -> None:
    frames = [Image.new("RGB", (32, 32), colour) for colour in ("red", "blue")]
    path = studio.folder / LABELS[0] / f"{ITEMS[0]}.png"
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=100)
    with pytest.raises(InputError, match="is an animation; make a video of it"):
        study()


def test_videos_tell_nothing_but_their_pictures(studio) -> None:
    for label in LABELS:
        (studio.folder / label).mkdir()
        path = studio.folder / label / "person_walk.mp4"
        with av.open(str(path), "w") as container:
            container.metadata["title"] = container.metadata["comment"] = label
            stream = container.add_stream("libx264", rate=25)
            stream.metadata["handler_name"] = label
            stream.width, stream.height, stream.pix_fmt = 64, 96, "yuv420p"
            for grey in range(5 if label == LABELS[0] else 50):
                pixels = np.full((96, 64, 3), grey, np.uint8)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels)))
            container.mux(stream.encode(None))
        assert label.encode() in path.read_bytes()
    said: list[str] = []
    results = tuple(f"{studio.folder}/{label}" for label in LABELS)
    output = studio.folder / "study"
    make_study(StudyOptions(results=results, output=output), notice=said.append)
    videos = list((output / "page/media").iterdir())
    assert {video.suffix for video in videos} == {".mp4"}
    for video in videos:
        content = video.read_bytes()
        assert not any(word.encode() in content for word in (*LABELS, "x264", "Lavf"))
    assert "lengths differ between methods in 1 of 1 videos" in said[1]
