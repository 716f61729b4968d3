"""Videos copied for browsers: the same pictures, and nothing else."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.output.bare import copy_for_browsers


def frames_of(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray() for frame in container.decode(video=0)]


@pytest.mark.parametrize(
    ("codec", "suffix"),
    [("libx264", ".mp4"), ("libx264", ".mkv"), ("libvpx-vp9", ".webm")],
)
def test_the_pictures_are_the_same(studio, codec: str, suffix: str) -> None:
    """With frames that refer to later ones, whose order containers tell in their own ways."""
    walk = np.stack([studio.dress(iuv) for iuv in studio.walk(12)])
    path = studio.video(walk, name=f"in{suffix}", codec=codec, pixels="yuv420p", rate=Fraction(25))
    copied = copy_for_browsers(path, studio.folder / "out.mp4")
    before, after = frames_of(path), frames_of(studio.folder / "out.mp4")
    assert len(after) == 12
    np.testing.assert_array_equal(before, after)
    assert copied.size == (64, 96)
    assert float(copied.duration_seconds) == pytest.approx(12 / 25, abs=0.002)
    with av.open(str(studio.folder / "out.mp4")) as container:
        times = [frame.time for frame in container.decode(video=0)]
        assert times == pytest.approx([number / 25 for number in range(12)], abs=0.002)
        assert not container.streams.audio


@pytest.mark.parametrize(
    ("codec", "pixels", "words"),
    [
        ("ffv1", "bgr0", "is ffv1 in bgr0, which not all browsers play"),
        ("libx264", "yuv444p", "is h264 in yuv444p"),
        ("mpeg4", "yuv420p", "is mpeg4"),
    ],
)
def test_what_browsers_do_not_play(studio, codec: str, pixels: str, words: str) -> None:
    path = studio.video(name="in.mkv", codec=codec, pixels=pixels)
    with pytest.raises(InputError, match=words) as caught:
        copy_for_browsers(path, studio.folder / "out.mp4")
    assert "ffmpeg -i FILE" in str(caught.value)


def test_a_container_without_times(studio) -> None:
    """H.264 refers to later frames, and AVI does not say where they belong."""
    path = studio.video(12, name="in.avi", codec="libx264", pixels="yuv420p", rate=Fraction(25))
    with pytest.raises(InputError, match="does not say when each frame is shown; save it as MP4"):
        copy_for_browsers(path, studio.folder / "out.mp4")


def test_what_is_no_video(studio) -> None:
    path = studio.folder / "in.mp4"
    path.write_text("no video")
    with pytest.raises(InputError, match="cannot be copied"):
        copy_for_browsers(path, studio.folder / "out.mp4")
