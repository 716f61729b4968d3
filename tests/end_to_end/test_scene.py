"""`mt run` in a scene: alpha, pictures and videos behind, places, partners."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from estimate_stubs import RED, write_red_model
from PIL import Image
from skimage import data
from studio import COLOURS, TORSO

from motion_transfer import Partner, render_video
from motion_transfer.errors import InputError, MotionTransferError
from motion_transfer.events import Notice
from motion_transfer.media.pictures.formats import open_pictures

BEHIND = (10, 90, 160)
PINK = (240, 120, 180)


def write_picture(path: Path, size: tuple[int, int], colour: tuple[int, int, int]) -> Path:
    Image.new("RGB", size[::-1], colour).save(path)
    return path


def write_clip(path: Path, count: int, rate: int, size: tuple[int, int] = (96, 64)) -> Path:
    """Frame N is grey 10 N, lossless."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=Fraction(rate))
        stream.height, stream.width = size
        stream.pix_fmt = "bgr0"
        for number in range(count):
            grey = np.full((*size, 3), 10 * number, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        container.mux(stream.encode(None))
    return path


def frames_of(path: Path) -> list[np.ndarray]:
    return list(open_pictures(path).read())


def rgba_of(path: Path) -> list[np.ndarray]:
    return list(open_pictures(path).read_rgba())


@pytest.fixture
def scene(studio):
    """`render_video` of a draft of four frames into a lossless video; returns its frames."""

    def make(name: str = "out.mkv", frames: int = 4, **options) -> list[np.ndarray]:
        if "driver" not in options:
            options["driver"] = studio.array(frames)
        output = studio.folder / name
        words = {"renderer": "texture", "codec": "ffv1", "frame_rate": 10, "force": True}
        render_video(studio.source(), output=output, **{**words, **options})
        return frames_of(output)

    return make


def test_a_picture_is_behind_the_person(scene, studio) -> None:
    behind = write_picture(studio.folder / "sky.png", (96, 64), BEHIND)
    plain, drawn = scene(), scene(background=behind)
    for white, frame in zip(plain, drawn, strict=True):
        beside = (white == 255).all(-1)
        assert (frame[beside] == BEHIND).all()
        inside = (white == COLOURS[TORSO]).all(-1)
        assert inside.any()
        assert (frame[inside] == white[inside]).all()


@pytest.mark.parametrize(
    ("end", "levels"),
    [("loop", [0, 0, 10, 20, 20, 0, 0, 10]), ("hold", [0, 0, 10, 20, 20, 20, 20, 20])],
)
def test_a_video_behind_keeps_its_own_time(scene, studio, end: str, levels: list[int]) -> None:
    """Three frames at 6 a second, under eight at 10."""
    behind = write_clip(studio.folder / "behind.mkv", 3, 6)
    frames = scene(frames=8, background=behind, background_end=end)
    assert [int(frame[0, 0, 0]) for frame in frames] == levels


def test_a_video_behind_cuts_the_output(scene, studio) -> None:
    behind = write_clip(studio.folder / "behind.mkv", 3, 6)
    frames = scene(frames=8, background=behind, background_end="cut")
    assert [int(frame[0, 0, 0]) for frame in frames] == [0, 0, 10, 20, 20]


def test_chunks_and_workers_never_show(studio) -> None:
    behind = write_clip(studio.folder / "behind.mkv", 25, 7)
    made = []
    for workers in (1, 3):
        output = studio.folder / f"{workers}.mkv"
        render_video(
            studio.source(),
            studio.array(130),
            output,
            renderer="texture",
            background=behind,
            workers=workers,
            shadow=True,
            match_colours=True,
            on_the_spot=True,
            frame_rate=30,
        )
        made.append(output.read_bytes())
    assert made[0] == made[1]


def test_light_comes_from_what_is_behind(scene, studio) -> None:
    dark = write_picture(studio.folder / "night.png", (96, 64), (10, 10, 30))
    plain, lit = scene(background=dark), scene(background=dark, match_colours=True)
    for before, after in zip(plain, lit, strict=True):
        person = (before != (10, 10, 30)).any(-1)
        assert after[person].mean() < before[person].mean() - 20
        assert (after[~person] == before[~person]).all()


def test_another_picture_behind_is_another_run(scene, studio) -> None:
    behind = studio.folder / "sky.png"
    write_picture(behind, (96, 64), BEHIND)
    first = scene(background=behind)
    write_picture(behind, (96, 64), PINK)
    second = scene(background=behind)
    assert tuple(first[0][0, 0]) == BEHIND
    assert tuple(second[0][0, 0]) == PINK


def test_the_frame_of_the_background_and_a_place_in_it(scene, studio) -> None:
    behind = write_picture(studio.folder / "wide.png", (200, 400), BEHIND)
    (frame, *_) = scene(
        driver=studio.array(np.stack([studio.iuv()] * 2)),
        background=behind,
        size="background",
        place="0.75,0.9,0.5",
    )
    assert frame.shape == (200, 400, 3)
    person = (frame != BEHIND).any(-1)
    rows, columns = np.flatnonzero(person.any(1)), np.flatnonzero(person.any(0))
    # 93 - 4 px of a driver 96 px high, fitted to 200 and then halved
    assert rows[-1] + 1 == pytest.approx(180, abs=3)
    assert rows[-1] - rows[0] == pytest.approx(89 * 200 / 96 / 2, abs=4)
    assert (columns[0] + columns[-1]) / 2 == pytest.approx(300, abs=4)


@pytest.mark.parametrize("name", ["a.mov", "a.webm", "a.mkv", "a.webp", "a.apng", "folder"])
def test_nothing_behind(scene, studio, name: str) -> None:
    scene(name, background="transparent", codec=None)
    plain = scene()
    made = rgba_of(studio.folder / name)
    assert len(made) == 4
    for frame, white in zip(made, plain, strict=True):
        beside = (white == 255).all(-1)
        assert (frame[..., 3] < 8)[beside].mean() > 0.97  # a soft edge lies beside, too
        inside = (white == COLOURS[TORSO]).all(-1)
        assert (frame[inside][:, 3] > 250).mean() > 0.97
        shown = frame[inside & (frame[..., 3] > 250)][:, :3].astype(int)
        assert np.abs(np.median(shown, axis=0) - COLOURS[TORSO]).max() <= 4


def two_people(studio, count: int = 3) -> np.ndarray:
    """Two mannequins in one driver, the left one larger and lower, so nearer."""
    frames = []
    for index in range(count):
        frame = studio.iuv(0, 20, size=(130, 200))
        other = studio.iuv(90 + index, 4, size=(130, 200))
        frames.append(np.where(other[..., :1] > 0, other, frame))
    return np.stack(frames)


def test_partners_take_the_places_of_others(scene, studio) -> None:
    bob = studio.source("bob", colours={TORSO: PINK})
    driver = studio.array(two_people(studio))
    alone = scene(driver=driver, driver_person="0")
    both = scene(driver=driver, driver_person="0", partners=[Partner(photo=bob, person="1")])
    for one, two in zip(alone, both, strict=True):
        assert not (one == PINK).all(-1).any()
        assert (two == PINK).all(-1)[:, 100:].sum() > 200
        left = np.s_[:, :80]
        assert (one[left] == two[left]).all()


def test_a_partner_who_is_who_leads_is_refused(scene, studio) -> None:
    bob = studio.source("bob")
    with pytest.raises(InputError, match=r"bob\.png and who leads follow the same person"):
        scene(
            driver=studio.array(two_people(studio)),
            driver_person="0",
            partners=[Partner(photo=bob, person="0")],
        )


def test_iuv_has_no_pictures_to_show(scene) -> None:
    with pytest.raises(InputError, match="is IUV, which has none; name the video by --background"):
        scene(background="driver")


def test_a_batch_does_the_same(studio, mt) -> None:
    behind = write_clip(studio.folder / "behind.mkv", 3, 6)
    bob = studio.source("bob", colours={TORSO: PINK})
    studio.source()
    driver = studio.array(two_people(studio, 60))
    (studio.folder / "shoot.yaml").write_text(
        "version: 1\ndefaults: {renderer: texture, background: behind.mkv, fps: 10}\n"
        "jobs:\n  - source: person.png\n    driver: driver.npy\n    output: batch.mkv\n"
        "    driver_person: '0'\n    background_blur: 1.5\n    shadow: true\n"
        "    partners: [{photo: bob.png, person: '1'}]\n"
    )
    assert mt("batch", "run", studio.folder / "shoot.yaml", "-q").code == 0
    render_video(
        studio.folder / "person.png",
        driver,
        studio.folder / "run.mkv",
        renderer="texture",
        background=behind,
        frame_rate=10,
        driver_person="0",
        background_blur=1.5,
        shadow=True,
        partners=[Partner(photo=bob, person="1")],
    )
    batch, run = (studio.folder / name for name in ("batch.mkv", "run.mkv"))
    assert batch.read_bytes() == run.read_bytes()


@pytest.fixture(scope="module")
def red_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_red_model(tmp_path_factory.mktemp("model") / "red.pt")


def filmed(folder: Path, red_model: Path, *, pan: int) -> tuple[Path, list[np.ndarray], dict]:
    """Somebody in red walks before a still life, which a moving camera passes by."""
    still = np.ascontiguousarray(data.coffee()[:96, :400]) // 2 + 60
    path, grounds = folder / "walk.mkv", []
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=Fraction(30))
        stream.height, stream.width, stream.pix_fmt = 96, 160, "bgr0"
        for index in range(24):
            left = pan * index
            ground = np.ascontiguousarray(still[:, left : left + 160])
            frame = ground.copy()
            frame[20:80, 10 + 5 * index : 30 + 5 * index] = RED
            grounds.append(ground)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode(None))
    words = {"estimator": "densepose", "estimator_model": red_model, "background": "driver"}
    return path, grounds, words


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_what_a_still_cameras_person_hides_is_found_in_other_frames(
    scene, studio, red_model: Path
) -> None:
    driver, grounds, words = filmed(studio.folder, red_model, pan=0)
    heard: list = []
    frames = scene(driver=driver, listener=heard.append, place="0.9,0.2,0.2", **words)
    corner = np.s_[:30, 120:]  # there stands who is drawn instead
    for index, (frame, ground) in enumerate(zip(frames, grounds, strict=True)):
        away = np.ones(frame.shape[:2], bool)
        away[10:92, max(0, 5 * index - 2) : 45 + 5 * index] = away[corner] = False
        assert (frame[away] == ground[away]).all()
        found = np.ones(frame.shape[:2], bool)
        found[corner] = False
        assert np.abs(frame.astype(int) - ground)[found].max() <= 3
    assert not [event for event in heard if isinstance(event, Notice) and "camera" in event.message]


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_a_camera_that_moves_is_told(scene, studio, red_model: Path) -> None:
    driver, grounds, words = filmed(studio.folder, red_model, pan=8)
    heard: list = []
    frames = scene(driver=driver, listener=heard.append, **words)
    notes = [event.message for event in heard if isinstance(event, Notice)]
    assert any("the camera moves" in note for note in notes)
    assert (frames[3][:, 120:] == grounds[3][:, 120:]).all()
    red = [(np.abs(frame.astype(int) - RED).sum(-1) < 60).sum() for frame in frames]
    # what is left of it is the drawn person's, whose photo has no such red
    assert max(red) < 20


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"background": "gone.png"}, r"background gone\.png does not exist; name a picture"),
        ({"background": __file__}, r"background .*test_scene\.py is neither a picture nor a video"),
        ({"background": "transparent"}, r"out\.mp4 cannot hold transparency; \.mov, \.mkv"),
        ({"alpha": "premultiplied"}, r"--alpha premultiplied means nothing; leave it out"),
        ({"background": "transparent", "compare": True}, r"--compare shows panels"),
        (
            {"partners": [Partner(photo=Path("gone.png"), person="1")]},
            r"partner gone\.png does not",
        ),
        (
            {"partners": [Partner(photo=Path("a.png"), person="largest")]},
            r"name whose motion it is",
        ),
        ({"pix_fmt": "yuv999p"}, r"pix-fmt"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_drawn(
    scene, studio, words: dict, message: str
) -> None:
    with pytest.raises(MotionTransferError, match=message) as refused:
        scene("out.mp4", codec=None, **words)
    assert "\n" not in str(refused.value)
    assert not (studio.folder / "out.mp4").exists()
    assert not list(studio.folder.glob(".*"))
