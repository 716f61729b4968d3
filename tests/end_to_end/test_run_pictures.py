"""A photo is enough, a video is enough: `mt run` without any IUV."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from estimate_stubs import RED, scene, write_red_model
from PIL import Image
from skimage import data

from motion_transfer import Garment, render_video
from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.events import Notice, Stage
from motion_transfer.media.work import WorkFolder, work_path
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source import read_source

pytestmark = pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")

SIZE = (96, 128)
RATE = Fraction(30000, 1001)


@pytest.fixture(scope="module")
def red_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_red_model(tmp_path_factory.mktemp("model") / "red.pt")


@pytest.fixture
def red(red_model: Path) -> dict:
    """The options of a draft, and of an estimator that takes red rectangles for people."""
    return {"estimator": "densepose", "estimator_model": red_model, "renderer": "texture"}


def ground(name: str) -> np.ndarray:
    return np.ascontiguousarray(getattr(data, name)()[: SIZE[0], : SIZE[1]]) // 2 + 60


def somebody(box: Box, behind: np.ndarray | None = None) -> np.ndarray:
    picture = scene(size=SIZE) if behind is None else behind.copy()
    picture[box.slices] = RED
    return picture


def dance(count: int = 8) -> list[np.ndarray]:
    return [somebody(Box(20 + 3 * i, 14, 50 + 3 * i, 82)) for i in range(count)]


def film(path: Path, frames: list[np.ndarray], *, sound: bool = False) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=RATE)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        audio = container.add_stream("aac", rate=48_000) if sound else None
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
        if audio:
            samples = (np.random.default_rng(0).random((1, 48_000)) - 0.5).astype(np.float32)
            block = av.AudioFrame.from_ndarray(samples, "fltp", "mono")
            block.sample_rate = 48_000
            container.mux(audio.encode(block))
            container.mux(audio.encode(None))
    return path


@pytest.fixture
def me(tmp_path: Path) -> Path:
    path = tmp_path / "me.png"
    Image.fromarray(somebody(Box(30, 10, 70, 86), ground("coffee"))).save(path)
    return path


def painted(frame: np.ndarray) -> tuple[int, int]:
    """First and last column of what is drawn on white."""
    columns = np.flatnonzero((frame.min(-1) < 128).any(0))
    return int(columns[0]), int(columns[-1])


def decode(path: Path) -> list[np.ndarray]:
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_a_photo_and_a_video(tmp_path: Path, draft: Callable, red: dict, me: Path) -> None:
    clip = film(tmp_path / "dance.mp4", dance(), sound=True)
    output = tmp_path / "out.mp4"
    words = ["--estimator", "densepose", "--estimator-model", red["estimator_model"]]
    outcome = draft("--source", me, "--driver", clip, "-o", output, *words)
    assert (outcome.code, outcome.err) == (0, "")
    with av.open(str(output)) as container:
        assert container.streams.video[0].average_rate == RATE
        assert container.streams.audio
    frames = decode(output)
    assert len(frames) == 8
    for index, frame in enumerate(frames):
        first, last = painted(frame)
        assert abs(first - 20 - 3 * index) <= 3
        assert abs(last - 49 - 3 * index) <= 3
        assert np.abs(np.median(frame[20:76, first + 6 : last - 6], (0, 1)) - RED).max() < 40
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dance.mp4", "me.png", "out.mp4"]


def test_a_folder_of_photos(tmp_path: Path, red: dict, me: Path) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index, frame in enumerate(dance(3)):
        Image.fromarray(frame).save(folder / f"{index}.png")
    report = render_video(me, folder, tmp_path / "out", **red)
    assert (report.frame_count, report.frame_rate) == (3, 30)


def test_only_the_chosen_frames_are_estimated(tmp_path: Path, red: dict, me: Path) -> None:
    clip = film(tmp_path / "dance.mp4", dance(12))
    stages: list[Stage] = []
    listen = lambda event: stages.append(event) if isinstance(event, Stage) else None  # noqa: E731
    report = render_video(me, clip, tmp_path / "out", frames="2:5", listener=listen, **red)
    assert report.frame_count == 3
    assert [(stage.name, stage.frame_count) for stage in stages][:1] == [("estimate", 5)]
    first = np.asarray(Image.open(tmp_path / "out" / "000000.png"))
    assert abs(painted(first)[0] - 26) <= 3


def test_a_stopped_run_does_not_estimate_again(tmp_path: Path, red: dict, me: Path) -> None:
    clip = film(tmp_path / "dance.mp4", dance())
    output = tmp_path / "out"
    stages: list[str] = []

    def stop(event) -> None:
        if isinstance(event, Stage):
            stages.append(event.name)
            if event.name == "render":
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_video(me, clip, output, listener=stop, **red)
    assert work_path(output).exists() and not output.exists()

    def listen(event) -> None:
        if isinstance(event, Stage):
            stages.append(event.name)

    render_video(me, clip, output, listener=listen, **red)
    assert stages == ["estimate", "scan", "render", "scan", "render"]
    assert not work_path(output).exists()


def test_another_clip_of_the_same_name_is_estimated_anew(
    tmp_path: Path, red: dict, me: Path
) -> None:
    clip, output = film(tmp_path / "dance.mp4", dance()), tmp_path / "out"
    seen: list[str] = []

    def stop(event) -> None:
        if isinstance(event, Stage):
            seen.append(event.name)
            if event.name == "render":
                raise KeyboardInterrupt

    for frames in (dance(), dance(9), dance(9)):
        film(clip, frames)
        with pytest.raises(KeyboardInterrupt):
            render_video(me, clip, output, listener=stop, **red)
    assert seen.count("estimate") == 2


def test_frames_without_anybody_are_listed(tmp_path: Path, red: dict, me: Path) -> None:
    frames = dance(6)
    frames[2] = frames[3] = scene(size=SIZE)
    clip = film(tmp_path / "dance.mp4", frames)
    notes: list[str] = []

    def listen(event) -> None:
        if isinstance(event, Notice):
            notes.append(event.message)

    report = render_video(me, clip, tmp_path / "out", missing="hold", listener=listen, **red)
    assert report.missing == ((2, 4),)
    assert "nobody found in 2 of 6 frames, the frame before" in notes[-1]
    second, third = (np.asarray(Image.open(tmp_path / "out" / f"00000{i}.png")) for i in (1, 3))
    np.testing.assert_array_equal(second, third)


@pytest.mark.parametrize("size", ["driver", "crop"])
def test_shots_have_their_own_windows(tmp_path: Path, red: dict, me: Path, size: str) -> None:
    near, far = Box(10, 4, 70, 92), Box(90, 40, 112, 88)
    frames = [somebody(near, ground("coffee"))] * 5 + [somebody(far, ground("rocket"))] * 5
    clip = film(tmp_path / "dance.mp4", frames)
    report = render_video(me, clip, tmp_path / "out", size=size, **red)
    pictures = [np.asarray(Image.open(file)) for file in sorted((tmp_path / "out").iterdir())]
    assert report.frame_count == len(pictures) == 10
    if size == "driver":
        assert abs(painted(pictures[0])[0] - near.left) <= 3
        assert abs(painted(pictures[9])[0] - far.left) <= 3
    else:  # both fill their squares of 104 and 56 px, of which the larger is shown
        assert len(pictures[0]) == 104
        heights = [np.ptp(np.flatnonzero((p.min(-1) < 128).any(1))) for p in pictures]
        assert min(heights[:5]) > 0.95 * (near.bottom - near.top)
        assert min(heights[5:]) > 0.95 * 104 / 56 * (far.bottom - far.top)


def test_the_source_ends_where_alpha_does(red_model: Path, me: Path) -> None:
    options = SourceOptions(source=(me,), estimator="densepose", estimator_model=red_model)
    source = read_source(options, 64)
    assert source.alpha is not None and source.iuv_path is None
    colours = source.texture[:, source.visibility[0] > 0].T
    reddish = (colours[:, 0] > 0.7) & (colours[:, 1:].max(1) < -0.7)
    assert reddish.mean() > 0.99  # nothing of the coffee


def test_a_photo_that_drives_itself_stays_as_it_is(tmp_path: Path, red: dict, me: Path) -> None:
    render_video(me, me, tmp_path / "out.png", background="photo", **red)
    before, after = (np.asarray(Image.open(p)).astype(int) for p in (me, tmp_path / "out.png"))
    assert np.abs(before - after)[:, 80:].max() == 0
    assert np.abs(before - after).mean() < 3


def test_a_photo_of_nobody(tmp_path: Path, draft: Callable, red: dict) -> None:
    nobody = tmp_path / "nobody.png"
    Image.fromarray(ground("rocket")).save(nobody)
    clip = film(tmp_path / "dance.mp4", dance(2))
    words = ["--estimator", "densepose", "--estimator-model", red["estimator_model"]]
    outcome = draft("--source", nobody, "--driver", clip, "-o", tmp_path / "a.mp4", *words)
    assert outcome.code == 2
    assert "neither nobody_IUV.png nor nobody_iuv.png is beside it" in outcome.err
    assert "nobody was found in it" in outcome.err
    assert not (tmp_path / "a.mp4").exists()


def test_a_missing_photo_is_told_before_the_driver_is_looked_at(
    tmp_path: Path, red: dict, me: Path
) -> None:
    clip = film(tmp_path / "dance.mp4", dance(2))
    events: list = []
    dress = Garment(photo=tmp_path / "dress.png", parts=(2,))
    for options in ({"source": tmp_path / "gone.png"}, {"source": me, "garments": (dress,)}):
        with pytest.raises(InputError, match=r"(source|garment) .*(gone|dress).png does not exist"):
            render_video(
                driver=clip, output=tmp_path / "out", listener=events.append, **options, **red
            )
    assert events == []


def test_models_that_are_not_there_are_fetched_by_a_command(
    tmp_path: Path, draft: Callable, monkeypatch, studio
) -> None:
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "cache"))
    photo = tmp_path / "alone.png"
    Image.fromarray(ground("coffee")).save(photo)
    outcome = draft("--source", photo, "--driver", studio.driver(2), "-o", tmp_path / "a.mp4")
    assert outcome.code == 2
    assert "no IUV found for" in outcome.err and "`mt models fetch` fetches it" in outcome.err
    clip = film(tmp_path / "dance.mp4", dance(2))
    outcome = draft("--source", studio.source(), "--driver", clip, "-o", tmp_path / "a.mp4")
    assert outcome.code == 2
    assert "`mt models fetch` fetches it" in outcome.err


def test_a_batch_of_pictures(tmp_path: Path, mt: Callable, red: dict, me: Path) -> None:
    film(tmp_path / "dance.mp4", dance(3))
    manifest = tmp_path / "shoot.yaml"
    manifest.write_text(
        "version: 1\n"
        "defaults:\n" + "".join(f"  {name}: {value}\n" for name, value in red.items()) + "jobs:\n"
        "  - {source: me.png, driver: dance.mp4, output: a}\n"
        "  - {source: me.png, driver: dance.mp4, output: b, background: black}\n"
    )
    outcome = mt("batch", "run", manifest, "--workers", 1)
    assert outcome.code == 0, outcome.err
    again = mt("batch", "run", manifest, "--workers", 1)
    assert again.code == 0
    roots = list(tmp_path.rglob("estimates"))
    assert len(roots) == 1
    assert len(list(roots[0].glob("*.mkv"))) == 1
    assert len(list(tmp_path.rglob("000002.png"))) == 2


def test_work_folders_keep_the_estimate_by_its_content(tmp_path: Path) -> None:
    final = tmp_path / "out.mp4"
    with WorkFolder(final) as work:
        (work.path / "driver-a.mkv").write_bytes(b"iuv")
        work.note("driver-a.mkv", "0", "key")
    assert (work_path(final) / "driver-a.mkv").exists()
