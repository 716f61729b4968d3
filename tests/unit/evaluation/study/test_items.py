"""What methods made, paired by name."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.study.items import (
    find_sources,
    open_methods,
    shared_items,
)

GREY = np.full((32, 32, 3), 128, np.uint8)


def quiet(_words: str) -> None:
    pass


def test_methods_are_called_as_their_folders_or_as_told(studio) -> None:
    for name in ("a/x.png", "b/x.png", "c=d/x.png", "e/images/lite/x.png", "e/images/full/x.png"):
        studio.image(name, GREY)
    folder = studio.folder
    named = [f"{folder}/a/", f"B={folder}/b", f"{folder}/c=d", f"{folder}/e"]
    assert [m.label for m in open_methods(named)] == ["a", "B", "c=d", "full", "lite"]
    one = open_methods([f"{folder}/a", f"lite={folder}/e/images/full"])[1]
    assert (one.label, one.path.name) == ("lite", "full")


@pytest.mark.parametrize(
    ("named", "words"),
    [
        (["a"], "two methods or more"),
        (["a", "nothing"], "not a folder"),
        (["a", "empty"], "no pictures and no videos"),
        (["a", "other/a"], "two methods are called 'a'; rename one, as NAME=other/a"),
        (["a", "x=eval"], "2 methods, which 'x' cannot all be called"),
        (["a", "=b"], "no name before its ="),
        (["a", "gif"], "is an animation; make a video"),
        (["a", "twice"], "go by one name, s__t"),
        (["a", "scores"], "evaluate once more, with --save-images"),
    ],
)
def test_folders_that_are_no_methods(studio, monkeypatch, named: list[str], words: str) -> None:
    for name in ("a/x.png", "b/x.png", "other/a/x.png", "gif/x.gif", "twice/s__t.png"):
        studio.image(name, GREY)
    studio.image("twice/s_2_t.png", GREY)
    studio.image("eval/images/p/x.png", GREY)
    studio.image("eval/images/q/x.png", GREY)
    (studio.folder / "empty").mkdir()
    (studio.folder / "scores").mkdir()
    (studio.folder / "scores/results.json").write_text("{}")
    monkeypatch.chdir(studio.folder)
    with pytest.raises(InputError, match=re.escape(words)):
        open_methods(named)


def test_what_not_all_have_is_told_in_one_line(studio) -> None:
    for name in ("a/s__t1.png", "a/s__t2.png", "b/s.jpg___t2.jpg_vis.png", "b/s_2_t10.png"):
        studio.image(name, GREY)
    methods = open_methods([f"{studio.folder}/a", f"{studio.folder}/b"])
    said: list[str] = []
    assert shared_items(methods, said.append) == ["s__t2"]
    assert said == ["left out, as not all methods have them: s__t1 (not of b); s__t10 (not of a)"]


def test_methods_without_a_common_name(studio) -> None:
    studio.image("a/x.png", GREY)
    studio.image("b/y.png", GREY)
    with pytest.raises(InputError, match="no name is shared by all methods"):
        shared_items(open_methods([f"{studio.folder}/a", f"{studio.folder}/b"]), quiet)


def test_a_picture_is_not_compared_with_a_video(studio) -> None:
    studio.image("a/x.png", GREY)
    (studio.folder / "b").mkdir()
    studio.video(name="b/x.mkv")
    with pytest.raises(InputError, match="is a picture and a video"):
        shared_items(open_methods([f"{studio.folder}/a", f"{studio.folder}/b"]), quiet)


def test_a_source_is_the_longest_beginning(studio) -> None:
    for name in ("photos/me.png", "photos/me_2.jpg", "photos/7/0.png", "photos/m.png"):
        studio.image(name, GREY)
    items = ["me__dance", "me_2__dance", "me_walk", "me", "7-0__7-1"]
    found = find_sources(studio.folder / "photos", items)
    assert [found[item].stem for item in items] == ["me", "me_2", "me", "me", "0"]
    with pytest.raises(InputError, match=r"with which meta__dance begins; .* called meta\.png"):
        find_sources(studio.folder / "photos", ["meta__dance"])
    with pytest.raises(InputError, match="is not a folder"):
        find_sources(Path("nowhere"), items)
