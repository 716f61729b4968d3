"""Frames of ordinary videos by number."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.video import IndexedVideo


def pictures(studio, count: int) -> np.ndarray:
    """Frames whose brightness is their number."""
    return np.stack([np.full((64, 48, 3), 10 * index, np.uint8) for index in range(count)])


@pytest.mark.parametrize(
    ("codec", "pixels", "options"),
    [("ffv1", "bgr0", None), ("libx264", "yuv420p", {"g": "6", "bf": "2"})],
)
def test_any_frame_in_any_order(studio, codec: str, pixels: str, options: dict | None) -> None:
    frames = pictures(studio, 20)
    video = IndexedVideo(
        studio.video(
            frames,
            name="a.mp4" if codec != "ffv1" else "a.mkv",
            codec=codec,
            pixels=pixels,
            options=options,
        )
    )
    assert video.frame_count == 20
    for index in (13, 0, 19, 7, 6):
        np.testing.assert_allclose(video.read(index), frames[index], atol=4)


def test_what_is_no_video(studio) -> None:
    words = studio.folder / "a.mp4"
    words.write_text("words")
    for path, reason in (
        (words, "is not a readable video"),
        (studio.folder / "b.mp4", "not exist"),
    ):
        with pytest.raises(InputError, match=reason):
            IndexedVideo(path)


def test_a_damaged_frame_is_named(studio) -> None:
    path = studio.video(pictures(studio, 20), codec="libx264", pixels="yuv420p", name="a.mkv")
    video = IndexedVideo(path)
    path.write_bytes(path.read_bytes()[:1500])
    with pytest.raises(InputError, match=r"frame 19 of .*a\.mkv"):
        video.read(19)


def test_a_frame_that_is_not_there_is_not_replaced_by_the_next(studio) -> None:
    video = IndexedVideo(studio.video(pictures(studio, 5)))
    video._timestamps[2] += 1
    with pytest.raises(InputError, match=r"frame 2 of .* cannot be decoded"):
        video.read(2)


CLOSE_EARLY = """
import faulthandler, sys
from pathlib import Path
from motion_transfer.media.iuv import video  # hears what decoders complain of
from motion_transfer.media.pictures.video import FilmedVideo
faulthandler.dump_traceback_later(60, exit=True)
for count in range(150):
    frames = FilmedVideo(Path(sys.argv[1])).read()
    for _ in range(count % 12 + 1):
        next(frames)
    frames.close()
"""


def test_a_video_can_be_left_before_its_end(studio) -> None:
    """Decoders have threads of their own, which may have something to say when they are closed."""
    clip = studio.video(
        studio.walk(40).repeat(4, 1).repeat(4, 2),
        name="clip.mp4",
        codec="libx264",
        pixels="yuv420p",
    )
    command = [sys.executable, "-c", CLOSE_EARLY, str(clip)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)
    assert result.returncode == 0, result.stderr
