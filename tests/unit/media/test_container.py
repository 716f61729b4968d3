"""Media files are opened by what they are, whatever they are called and whatever they say."""

from __future__ import annotations

import os
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.container import find_pictures, open_input, open_output
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.iuv.opening import open_stream
from motion_transfer.media.pictures.formats import open_pictures

NAMES = (
    b"2024-05-01T12:30:45.mp4",
    b"http:a.mp4",
    b"-i.mp4",
    b"two\nlines.mp4",
    b"50%d.mp4",
    b"b\xfccher.mp4",
)


def write(path: Path, *, codec: str = "libx264", pixels: str = "yuv420p") -> Path:
    """Three frames, as grey as 100."""
    with open_output(path, options={"movflags": "+faststart"}) as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 32, pixels
        for _ in range(3):
            frame = av.VideoFrame.from_ndarray(np.full((32, 64, 3), 100, np.uint8), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("name", NAMES)
def test_any_name_is_the_name_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: bytes
) -> None:
    monkeypatch.chdir(tmp_path)
    path = write(Path(os.fsdecode(name)))
    assert [os.fsencode(file.name) for file in tmp_path.iterdir()] == [name]
    frames = list(open_pictures(path).read())
    assert len(frames) == 3
    assert frames[0].mean() == pytest.approx(100, abs=2)
    assert tell_kind(path) == "pictures"


@pytest.mark.parametrize("folder", [b"a:b", b"caf\xe9"])
def test_any_name_of_a_folder_will_do(tmp_path: Path, folder: bytes) -> None:
    place = tmp_path / os.fsdecode(folder)
    place.mkdir()
    assert open_pictures(write(place / "a.mp4")).frame_count == 3


LISTS = {
    "concat.mp4": "ffconcat version 1.0\nfile other.mp4\n",
    "concat-absolute.mp4": "ffconcat version 1.0\nfile {folder}/other.mp4\n",
    "hls.mp4": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\nother.ts\n#EXT-X-ENDLIST\n",
    "hls.m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{folder}/other.ts\n#EXT-X-ENDLIST\n",
    "session.sdp": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=a\nc=IN IP4 127.0.0.1\nt=0 0\n"
    "m=video 5004 RTP/AVP 96\na=rtpmap:96 H264/90000\n",
}


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="needs a file that fails to read")
def test_a_disk_that_fails_is_told_with_the_name_of_the_file() -> None:
    fails = Path("/proc/self/mem")
    with (
        pytest.raises(InputError, match=r"driver /proc/self/mem cannot be read: Input/output"),
        open_input(fails, "driver"),
    ):
        pass


@pytest.mark.parametrize("name", LISTS)
def test_a_list_of_other_files_opens_none_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "other.mp4")
    write(tmp_path / "other.ts")
    path = tmp_path / name
    path.write_text(LISTS[name].format(folder=tmp_path))
    for read in (open_pictures, open_stream):
        reason = "list of other files" if name != "session.sdp" else "be read|readable"
        with pytest.raises(InputError, match=reason):
            read(Path(name))
    assert capfd.readouterr() == ("", "")


def test_what_has_no_end_is_refused(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.mp4"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(InputError, match="device or a pipe"), open_input(path):
            pass


def test_a_claim_of_endless_pictures_is_no_memory(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "a.avi", codec="mjpeg", pixels="yuvj420p")
    data = path.read_bytes()
    for side in (15_000, 60_000):
        size = side.to_bytes(2, "big")
        # the header of every JPEG: a marker, a length, 8 bits, height, width
        claim = data.replace(
            b"\xff\xc0\x00\x11\x08\x00\x20\x00\x40", b"\xff\xc0\x00\x11\x08" + 2 * size
        )
        assert claim != data
        path.write_bytes(claim)
        with pytest.raises(InputError):
            list(open_pictures(path).read())
    assert capfd.readouterr() == ("", "")


def test_a_cover_is_no_film(tmp_path: Path) -> None:
    path = tmp_path / "song.m4a"
    with open_output(path, format_name="mp4") as container:
        sound = container.add_stream("aac", rate=48_000)
        cover = container.add_stream("mjpeg", rate=1)
        cover.width, cover.height, cover.pix_fmt = 64, 32, "yuvj420p"
        cover.disposition = av.stream.Disposition.attached_pic
        picture = av.VideoFrame.from_ndarray(np.zeros((32, 64, 3), np.uint8), format="rgb24")
        container.mux(cover.encode(picture.reformat(format="yuvj420p")))
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 48_000
        container.mux(sound.encode(frame))
        container.mux(sound.encode(None))
        container.mux(cover.encode(None))
    with open_input(path) as container:
        assert container.streams.video
        with pytest.raises(InputError, match="it has no video and no pictures in it"):
            find_pictures(container, "it")


def test_a_title_in_another_encoding_is_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    with open_output(path) as container:
        container.metadata["title"] = "Bxcher"
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 32, "bgr0"
        frame = av.VideoFrame.from_ndarray(np.full((32, 64, 3), 9, np.uint8), format="rgb24")
        container.mux(stream.encode(frame.reformat(format="bgr0")))
        container.mux(stream.encode(None))
    path.write_bytes(path.read_bytes().replace(b"Bxcher", b"B\xfccher"))
    assert open_stream(path).frame_count == 1
