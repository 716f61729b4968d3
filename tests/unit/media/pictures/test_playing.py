"""Pictures of a clip by number, whoever asks in whatever order."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from estimate_stubs import FramesInMemory

from motion_transfer.errors import InputError
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.playing import Player

COUNT = 75


def film(path: Path, codec: str = "libx264", **options: str) -> Path:
    """Frame N has the grey level 3 N."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(30), options=options)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.gop_size = 25
        for number in range(COUNT):
            picture = np.full((48, 64, 3), 3 * number, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def numbers(frames) -> list[int]:
    return [round(float(frame.mean()) / 3) for frame in frames]


@pytest.fixture(params=["bframes.mp4", "plain.mkv", "folder"])
def clip(request, tmp_path: Path) -> Path:
    if request.param == "folder":
        folder = tmp_path / "folder"
        folder.mkdir()
        for number in range(COUNT):
            grey = np.full((48, 64, 3), 3 * number, np.uint8)
            av.VideoFrame.from_ndarray(grey, format="rgb24").to_image().save(
                folder / f"{number:03d}.png"
            )
        return folder
    options = {"bf": "3"} if "bframes" in request.param else {"bf": "0"}
    return film(tmp_path / request.param, **options)


def test_any_frame_is_found(clip: Path) -> None:
    player = Player(open_pictures(clip))
    asked = [0, 0, 5, 4, 74, 24, 25, 26, 73, 74, 0, 50]
    assert numbers(player.read(asked)) == asked


def test_a_clip_begins_anywhere(clip: Path) -> None:
    pictures = open_pictures(clip)
    for start in (0, 1, 24, 25, 49, 74):
        assert numbers(make() for make in pictures.play(start)) == list(range(start, COUNT))


def test_threads_read_their_stretches_at_the_same_time(clip: Path) -> None:
    player = Player(open_pictures(clip))
    stretches = [range(start, start + 12) for start in range(0, 60, 12)] * 2
    with ThreadPoolExecutor(3) as pool:
        found = list(pool.map(lambda stretch: numbers(player.read(stretch)), stretches))
    assert found == [list(stretch) for stretch in stretches]


def test_a_decoder_goes_on_where_it_stands(clip: Path) -> None:
    pictures = open_pictures(clip)
    opened = []
    play = pictures.play
    pictures.play = lambda start=0: opened.append(start) or play(start)  # type: ignore[method-assign]
    player = Player(pictures)
    for start in range(0, 60, 12):
        assert numbers(player.read(range(start, start + 12))) == list(range(start, start + 12))
    assert opened == [0]
    numbers(player.read([3]))
    assert opened == [0, 3]


def test_a_clip_that_is_shorter_than_it_says_is_told_of() -> None:
    clip = FramesInMemory([np.full((4, 4, 3), level, np.uint8) for level in (0, 3, 6)])
    clip.frame_count = 5
    player = Player(clip)
    with pytest.raises(InputError, match="frame 3 is not there; export it again"):
        list(player.read([1, 3]))
    assert numbers(player.read([2])) == [2]


def test_a_repeated_frame_is_the_same_object(clip: Path) -> None:
    first, second, third = Player(open_pictures(clip)).read([7, 7, 8])
    assert first is second and second is not third
