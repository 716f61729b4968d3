"""Clips: frames with their IUV, paired by a fixed rule."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.training.clips import ClipFrame, choose_frames, open_clip_pairs, open_clips

FRAMES = 9


@pytest.fixture
def folder(studio) -> Path:
    """Two clips: one with a folder of IUV images, one with an IUV video."""
    iuv = studio.walk(FRAMES)
    photos = np.stack([studio.dress(frame) for frame in iuv])
    path = studio.folder / "clips"
    path.mkdir()
    for name in ("a", "b"):
        studio.video(photos, name=f"clips/{name}.mkv")
    studio.driver(iuv, name="clips/a_iuv", order="vui")
    studio.video(iuv, name="clips/b_IUV.mkv")
    return path


def test_frames_come_with_their_iuv(studio, folder: Path) -> None:
    clips, problems = open_clips(folder)
    assert ([clip.name for clip in clips], problems) == (["a", "b"], [])
    for clip in clips:
        for index in (5, 0, FRAMES - 1):
            frame = ClipFrame(clip, index)
            picture = frame.load()
            assert frame.name == f"{clip.name}/{index:06d}"
            np.testing.assert_array_equal(picture.iuv, studio.walk(FRAMES)[index])
            np.testing.assert_array_equal(picture.rgb, studio.dress(picture.iuv))


def test_pairs_follow_a_fixed_rule(folder: Path) -> None:
    pairs = open_clip_pairs(folder, moments=2)
    assert [pair.name for pair in pairs][:4] == [
        f"a-000000__a-{index:06d}" for index in (1, 2, 7, 8)
    ]
    assert [pair.frame for pair in pairs] == [1, 2, 7, 8] * 2
    assert [pair.group for pair in pairs] == ["a"] * 4 + ["b"] * 4
    assert pairs.digest == open_clip_pairs(folder, moments=2).digest
    assert len(open_clip_pairs(folder, moments=2, limit=1)) == 4


@pytest.mark.parametrize(
    ("count", "moments", "expected"),
    [
        (1, 8, []),
        (2, 8, [1]),
        (3, 8, [1, 2]),
        (10, 1, [1, 2]),
        (350, 3, [1, 2, 174, 175, 348, 349]),
    ],
)
def test_which_frames_are_targets(count: int, moments: int, expected: list[int]) -> None:
    assert list(choose_frames(count, moments)) == expected


def test_problems_name_the_clip(studio, folder: Path) -> None:
    for source, name in (("a", "no-iuv"), ("a", "short")):
        shutil.copy(folder / f"{source}.mkv", folder / f"{name}.mkv")
    studio.driver(3, name="clips/short_iuv")
    (folder / "words.mp4").write_text("words")
    studio.driver(3, name="clips/words_iuv")
    shutil.copy(folder / "a.mkv", folder / "a.mov")
    with pytest.raises(InputError) as caught:
        open_clip_pairs(folder)
    text = str(caught.value)
    assert text.startswith("clips: 4 problems")
    assert "no-iuv.mkv: no IUV beside it; expected no-iuv_iuv/" in text
    assert "short.mkv: it has 9 frames, but short_iuv has 3" in text
    assert "words.mp4: " in text
    assert "is not a readable video" in text
    assert "another video has the same name" in text
    pairs = open_clip_pairs(folder, skip_broken=True)
    assert {pair.group for pair in pairs} == {"a", "b"}
    assert len(pairs.dropped) == 4


def test_frames_that_show_nobody_are_named(studio, folder: Path) -> None:
    iuv = studio.walk(FRAMES)
    iuv[8] = 0
    shutil.rmtree(folder / "a_iuv")
    studio.driver(iuv, name="clips/a_iuv")
    with pytest.raises(InputError, match=r"a: frame 8 of .*a\.mkv: no person in it"):
        open_clip_pairs(folder)
    kept = open_clip_pairs(folder, skip_broken=True)
    assert [pair.frame for pair in kept if pair.group == "a"] == list(range(1, 8))


def test_sizes_must_agree(studio, folder: Path) -> None:
    shutil.rmtree(folder / "a_iuv")
    studio.driver(studio.walk(FRAMES)[:, :90], name="clips/a_iuv")
    with pytest.raises(InputError, match=r"frame 0 of .* is 64 x 96, but its IUV is 64 x 90"):
        open_clip_pairs(folder)


def test_a_folder_without_clips(studio) -> None:
    with pytest.raises(InputError, match="does not exist"):
        open_clips(studio.folder / "none")
    with pytest.raises(InputError, match="holds no videos"):
        open_clips(studio.folder)
