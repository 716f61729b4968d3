"""Pair lists: what is read, and that everything wrong with one is said at once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.training.pairs import (
    PROBLEMS_SHOWN,
    flat_stem,
    list_problems,
    open_pairs,
    read_pair_list,
)


def write(studio, text: str) -> Path:
    path = studio.folder / "pairs.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize("header", ["from,to", "source,target", ",from,to", "\ufefffrom,to"])
def test_both_headers_are_read(studio, header: str) -> None:
    lead = "," if header.startswith(",") else ""  # a column of row numbers, as pandas writes
    path = write(studio, f"{header}\n{lead}a.png,b.png\n\n{lead} c/d.jpg , a.png\n")
    rows, problems = read_pair_list(path)
    assert rows == [(2, "a.png", "b.png"), (4, "c/d.jpg", "a.png")]
    assert problems == []


@pytest.mark.parametrize(("header", "found"), [("image,pose", "image, pose"), ("", "none")])
def test_another_header_is_refused(studio, header: str, found: str) -> None:
    path = write(studio, f"{header}\na,b\n")
    with pytest.raises(InputError, match=rf"pairs\.csv, line 1: columns are {found}; expected"):
        read_pair_list(path)


def test_a_file_that_is_no_list(studio) -> None:
    with pytest.raises(InputError, match="is not text"):
        read_pair_list(studio.source())
    with pytest.raises(InputError, match=r"none\.csv does not exist"):
        read_pair_list(studio.folder / "none.csv")


def test_pairs_are_read_whole_and_lazily(studio) -> None:
    studio.source("a")
    studio.source("b", order="vui")
    pairs = open_pairs(write(studio, "from,to\na.png,b.png\nb.png,a.png\n"))
    assert (len(pairs), pairs.name, pairs.dropped) == (2, "pairs.csv", ())
    first, second = pairs
    assert (first.name, first.group, first.frame) == ("a__b", "a.png", None)
    assert pairs[1] is second
    picture = first.target.load()
    assert (picture.name, picture.alpha) == ("b.png", None)
    np.testing.assert_array_equal(picture.iuv, studio.iuv(scale=2, size=(192, 128)))
    np.testing.assert_array_equal(picture.rgb, studio.dress(picture.iuv))


def test_names_are_relative_to_the_folder_of_images(studio) -> None:
    studio.source("photos/7/0")
    path = write(studio, "from,to\n7/0.png,7/0.png\n")
    (pair,) = open_pairs(path, studio.folder / "photos")
    assert pair.name == "7-0__7-0"
    with pytest.raises(InputError, match=r"photo .*7/0\.png does not exist"):
        open_pairs(path)
    with pytest.raises(InputError, match=r"folder of photos .* does not exist"):
        open_pairs(path, studio.folder / "nowhere")


def test_an_alpha_beside_is_read(studio) -> None:
    studio.source("a")
    alpha = np.zeros((192, 128), np.uint8)
    alpha[:50] = 255
    studio.image("a_alpha.png", alpha)
    path = write(studio, "from,to\na.png,a.png\n")
    (pair,) = open_pairs(path)
    np.testing.assert_array_equal(pair.source.load().alpha, alpha)
    studio.image("a_alpha.png", alpha[:9])
    with pytest.raises(InputError, match=r"a_alpha\.png is 128 x 9, but .* is 128 x 192"):
        open_pairs(path)


def spoil(studio) -> Path:
    """A list with one good pair among every kind of problem."""
    studio.source("a")
    studio.source("b")
    studio.source("lone")
    (studio.folder / "lone_IUV.png").unlink()
    broken = studio.source("broken")
    broken.write_bytes(broken.read_bytes()[:200])
    studio.image("empty_IUV.png", np.zeros((192, 128, 3), np.uint8))
    studio.image("empty.png", np.zeros((192, 128, 3), np.uint8))
    lines = [
        "from,to",
        "a.png,b.png",
        "a.png,none.png",
        "lone.png,a.png",
        "a.png,",
        "b.png,broken.png",
    ]
    return write(studio, "\n".join([*lines, "none.png,b.png", "empty.png,a.png"]) + "\n")


PROBLEMS = [
    r"line 5: `to` is empty",
    r"line 3 \(and 1 more\): photo .*none\.png does not exist",
    r"line 4: photo .*lone\.png has no IUV: neither lone_IUV\.png nor lone_iuv\.png is beside it",
    r"line 6: photo .*broken\.png is truncated",
    r"line 8: photo IUV .*empty_IUV\.png: no person in it",
]


def test_all_problems_are_said_at_once_with_their_lines(studio) -> None:
    with pytest.raises(InputError) as caught:
        open_pairs(spoil(studio))
    first, *lines, last = str(caught.value).splitlines()
    assert first == "pairs.csv: 5 problems"
    assert len(lines) == len(PROBLEMS)
    for line, pattern in zip(lines, PROBLEMS, strict=True):
        assert re.match("  " + pattern, line), line
    assert "--skip-broken" in last


def test_broken_pairs_can_be_skipped(studio) -> None:
    pairs = open_pairs(spoil(studio), skip_broken=True)
    assert [pair.name for pair in pairs] == ["a__b"]
    assert len(pairs.dropped) == len(PROBLEMS)


def test_nothing_left_is_an_error(studio) -> None:
    path = write(studio, "from,to\nx.png,y.png\n")
    with pytest.raises(InputError, match="no pair that can be used: 2 problems"):
        open_pairs(path, skip_broken=True)
    with pytest.raises(InputError, match="no pair that can be used"):
        open_pairs(write(studio, "from,to\n"))


def test_a_long_list_of_problems_is_cut() -> None:
    lines = list_problems("it", [f"line {n}" for n in range(PROBLEMS_SHOWN + 3)])
    assert lines[PROBLEMS_SHOWN : PROBLEMS_SHOWN + 2] == [
        f"  line {PROBLEMS_SHOWN - 1}",
        "  and 3 more",
    ]
    assert f"  line {PROBLEMS_SHOWN}" not in lines


def test_names_that_results_could_not_tell_apart_are_refused(studio) -> None:
    studio.source("a/b")
    studio.source("a-b")
    path = write(studio, "from,to\na/b.png,a-b.png\n")
    with pytest.raises(InputError, match=r"a-b\.png and a/b\.png are both a-b for short"):
        open_pairs(path)


def test_the_digest_knows_pixels_order_and_names_but_not_the_encoding(studio) -> None:
    from PIL import Image

    for name in ("a", "b"):
        studio.source(name)
    text = "from,to\na.png,b.png\nb.png,a.png\n"
    path = write(studio, text)
    digest = open_pairs(path).digest
    Image.open(studio.folder / "a.png").save(studio.folder / "a.png", compress_level=0)
    assert open_pairs(write(studio, text.replace("from,to", "source,target"))).digest == digest
    assert open_pairs(write(studio, "from,to\nb.png,a.png\na.png,b.png\n")).digest != digest
    assert open_pairs(path, limit=1).digest != digest
    pixels = np.array(Image.open(studio.folder / "a.png"))
    pixels[0, 0] ^= 1
    studio.image("a.png", pixels)
    assert open_pairs(write(studio, text)).digest != digest


def test_a_glance_only_looks_for_files(studio) -> None:
    path = studio.source("a")
    path.write_bytes(path.read_bytes()[:200])
    listed = write(studio, "from,to\na.png,a.png\n")
    assert len(open_pairs(listed, thorough=False)) == 1
    path.unlink()
    with pytest.raises(InputError, match="does not exist"):
        open_pairs(listed, thorough=False)


def test_progress_counts_each_picture_once(studio) -> None:
    studio.source("a")
    studio.source("b")
    path = write(studio, "from,to\na.png,b.png\nb.png,a.png\na.png,a.png\n")
    calls: list[tuple[int, int]] = []
    open_pairs(path, done=lambda count, total: calls.append((count, total)))
    assert calls == [(1, 2), (1, 2)]


def test_short_names() -> None:
    assert flat_stem("a/b.c.png") == "a-b.c"
    assert flat_stem("clip/000012") == "clip-000012"
