"""`mt iuv` on raw pictures: what it writes and what it refuses."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from estimate_stubs import RED, scene, write_red_model
from PIL import Image
from skimage import data

from motion_transfer.drawing.person import Box
from motion_transfer.media.iuv.opening import open_reader, open_stream

pytestmark = pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")

SIZE = (96, 64)


@pytest.fixture(scope="module")
def red_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_red_model(tmp_path_factory.mktemp("model") / "red.pt")


@pytest.fixture
def red(red_model: Path) -> list:
    """The words that choose an estimator that takes red rectangles for people."""
    return ["--estimator", "densepose", "--model", red_model]


def somebody(x: int = 0) -> np.ndarray:
    return scene((RED, Box(10 + x, 12, 40 + x, 84)), size=SIZE)


def film(path: Path, frames: list[np.ndarray], rate: Fraction = Fraction(25)) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def frames_of(path: Path) -> list[np.ndarray]:
    reader = open_reader(open_stream(path))
    return list(reader.read(0, reader.stream.frame_count))


def test_a_photo(tmp_path: Path, mt, red) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    photo = tmp_path / "me.png"
    Image.fromarray(np.rot90(somebody())).save(photo, exif=exif)
    outcome = mt("iuv", photo, "-o", tmp_path / "me_IUV.png", *red)
    assert (outcome.code, outcome.err) == (0, "")
    assert "me_IUV.png: 1 frame\n" in outcome.out
    (iuv,) = frames_of(tmp_path / "me_IUV.png")
    assert iuv.shape == (*SIZE, 3)
    assert set(np.unique(iuv[12:84, 10:40, 0])) == {2, 10}
    assert not iuv[:10].any() and not iuv[:, 44:].any()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["me.png", "me_IUV.png"]


@pytest.mark.parametrize("output", ["iuv", "iuv.mkv", "iuv.npy"])
def test_a_video_with_gaps(tmp_path: Path, mt, red, output: str) -> None:
    frames = [somebody(i) for i in range(12)]
    frames[4] = frames[5] = scene(size=SIZE)
    video = film(tmp_path / "dance.mp4", frames, Fraction(30000, 1001))
    outcome = mt("iuv", video, "-o", tmp_path / output, *red)
    assert outcome.code == 0
    assert "nobody found in 2 frames, background only: 0:00.13-0:00.20 (frames 4:6)" in outcome.err
    found = frames_of(tmp_path / output)
    assert len(found) == 12
    for index, iuv in enumerate(found):
        columns = np.flatnonzero(iuv[..., 0].any(0))
        assert len(columns) == 0 if index in (4, 5) else abs(columns[0] - 10 - index) <= 2
    if output.endswith(".mkv"):
        assert open_stream(tmp_path / output).frame_rate == Fraction(30000, 1001)


@pytest.mark.parametrize("output", ["iuv", "iuv.mkv", "iuv.npy"])
def test_some_frames_of_a_video(tmp_path: Path, mt, red, output: str) -> None:
    """As they are in the whole clip's; what nobody is in is told by its place in the clip."""
    frames = [somebody(i) for i in range(12)]
    frames[1] = frames[6] = scene(size=SIZE)
    video = film(tmp_path / "dance.mp4", frames)
    whole, part = tmp_path / "whole.npy", tmp_path / output
    assert mt("iuv", video, "-o", whole, *red).code == 0
    outcome = mt("iuv", video, "-o", part, *red, "--frames", "4:9")
    assert outcome.code == 0, outcome.err
    assert "nobody found in 1 frame, background only" in outcome.err
    assert "(frames 6:7)" in outcome.err
    np.testing.assert_array_equal(np.stack(frames_of(part)), np.load(whole)[4:9])
    refused = mt("iuv", video, "-o", tmp_path / "more.npy", *red, "--frames", "4:13")
    assert refused.code == 2
    assert "frames 4:13 asked for, but" in refused.err and "has 12: 0:12 at most" in refused.err
    assert not (tmp_path / "more.npy").exists()


def alpha_of(path: Path) -> list[np.ndarray]:
    """The frames of an alpha folder, picture, video or stack."""
    if path.suffix == ".npy":
        return list(np.load(path))
    if path.suffix == ".mkv":
        with av.open(str(path)) as container:
            assert container.streams.video[0].codec_context.pix_fmt == "gray"
            assert container.streams.video[0].average_rate == 25
            return [frame.to_ndarray() for frame in container.decode(video=0)]
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return [np.asarray(Image.open(file)) for file in files]


@pytest.mark.parametrize(
    ("output", "alpha"),
    [
        ("me_IUV.png", "me_alpha.png"),
        ("me.png", "me_alpha.png"),
        ("dance_iuv", "dance_alpha"),
        ("dance.mkv", "dance_alpha.mkv"),
        ("dance.npy", "dance_alpha.npy"),
    ],
)
def test_alpha_is_written_beside(tmp_path: Path, mt, red, output: str, alpha: str) -> None:
    frames = [somebody(3 * i) for i in range(1 if output.endswith(".png") else 4)]
    if len(frames) > 1:
        frames[2] = scene(size=SIZE)
    source, out = film(tmp_path / "clip.mp4", frames), tmp_path / "out"
    words = ["iuv", source, "-o", out / output, "--alpha", *red, "--missing", "hold"]
    outcome = mt(*words)
    assert outcome.code == 0, outcome.err
    assert f"{output} and {out / alpha}: {len(frames)} frame" in outcome.out
    assert sorted(p.name for p in out.iterdir()) == sorted([output, alpha])
    found = alpha_of(out / alpha)
    assert len(found) == len(frames)
    for index, (matte, iuv) in enumerate(zip(found, frames_of(out / output), strict=True)):
        x = 10 + 3 * (1 if index == 2 else index)  # held
        assert (matte.shape, matte.dtype) == (SIZE, np.uint8)
        assert matte[20:76, x + 4 : x + 26].min() == 255 and matte[:, : x - 4].max() == 0
        np.testing.assert_array_equal(matte > 0, iuv[..., 0] > 0)
    refused = mt(*words)
    assert refused.code == 2 and "exists already" in refused.err
    assert mt(*words, "--force").code == 0
    assert sorted(p.name for p in out.iterdir()) == sorted([output, alpha])


def test_alpha_and_iuv_come_together_or_not_at_all(tmp_path: Path, mt, red) -> None:
    frames = [somebody(), scene(size=SIZE), somebody()]
    video = film(tmp_path / "dance.mp4", frames)
    words = ["iuv", video, "-o", tmp_path / "dance.mkv", "--alpha", *red]
    assert mt(*words, "--missing", "fail").code == 2
    assert [p.name for p in tmp_path.iterdir()] == ["dance.mp4"]
    (tmp_path / "dance_alpha.mkv").write_bytes(b"mine")
    outcome = mt(*words)
    assert outcome.code == 2 and "dance_alpha.mkv exists already" in outcome.err
    assert not (tmp_path / "dance.mkv").exists()
    assert (tmp_path / "dance_alpha.mkv").read_bytes() == b"mine"


def test_half_written_output_is_never_left(tmp_path: Path, mt, red) -> None:
    frames = [somebody(), scene(size=SIZE), somebody()]
    video = film(tmp_path / "dance.mp4", frames)
    outcome = mt("iuv", video, "-o", tmp_path / "iuv", *red, "--missing", "fail")
    assert outcome.code == 2
    assert "frame 1 of" in outcome.err and "--missing hold" in outcome.err
    assert [p.name for p in tmp_path.iterdir()] == ["dance.mp4"]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (
            ["--estimator", "magic"],
            "estimator 'magic'; supported are blazepose, blazepose-heavy, densepose",
        ),
        (["--estimator", "densepose"], "needs its model"),
        (["--model", "a.pt"], "leave it out, or choose the densepose"),
        (["--person", "somebody"], "write largest, an index"),
        (["--missing", "what"], "missing 'what'; supported are hold, background, fail"),
    ],
)
def test_impossible_options(tmp_path: Path, mt, words: list[str], reason: str) -> None:
    Image.fromarray(somebody()).save(tmp_path / "me.png")
    outcome = mt("iuv", tmp_path / "me.png", "-o", tmp_path / "iuv.png", *words)
    assert outcome.code == 2
    assert reason in outcome.err


def test_models_that_are_not_there_are_fetched_by_a_command(
    tmp_path: Path, mt, monkeypatch
) -> None:
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "cache"))
    Image.fromarray(somebody()).save(tmp_path / "me.png")
    outcome = mt("iuv", tmp_path / "me.png", "-o", tmp_path / "iuv.png")
    assert outcome.code == 2
    assert "`mt models fetch` fetches it" in outcome.err
    assert not (tmp_path / "iuv.png").exists()


@pytest.mark.parametrize("name", ["black", "pixel", "landscape"])
def test_pictures_of_nobody(tmp_path: Path, mt, red, name: str) -> None:
    picture = {
        "black": np.zeros((48, 64, 3), np.uint8),
        "pixel": np.full((1, 1, 3), 9, np.uint8),
        "landscape": data.rocket(),
    }[name]
    Image.fromarray(picture).save(tmp_path / "a.png")
    outcome = mt("iuv", tmp_path / "a.png", "-o", tmp_path / "b.png", *red)
    assert outcome.code == 2
    assert "nobody was found in" in outcome.err and "a.png" in outcome.err
    assert not (tmp_path / "b.png").exists()


def test_help_shows_both_ways(mt) -> None:
    assert "estimate" in mt("iuv", "--help").out
    assert "PHOTO|VIDEO|DIR" in mt("iuv", "estimate", "--help").out
