"""One person from several photos, a folder or a video: the commands, to the byte."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from decoded import decoded
from PIL import Image
from studio import LEGS, UPPER

from motion_transfer import render_video
from motion_transfer.drawing.renderers.texture import TextureRecipe
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Notice, Stage
from motion_transfer.render.plan import CHUNK_FRAMES

GREEN, PINK = (60, 150, 60), (200, 90, 150)
FRAMES = CHUNK_FRAMES + 20
draw = partial(render_video, renderer="texture")


@pytest.fixture(autouse=True)
def small_textures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unfolding photos takes most of a short run's time."""
    monkeypatch.setattr(TextureRecipe, "texture_size", 64)


@pytest.fixture
def photos(studio) -> list[Path]:
    """Somebody from the hips up, and their legs in a photo of its own."""
    return [
        studio.source("upper", parts=UPPER),
        studio.source("legs", parts=LEGS, colours={LEGS: GREEN}),
    ]


def first_frame(folder: Path) -> np.ndarray:
    return np.asarray(Image.open(folder / "000000.png")).astype(int)


def colour_of(studio, folder: Path, parts: tuple[int, ...]) -> np.ndarray:
    """The median colour of parts of the body in the first frame of a walk."""
    return np.median(first_frame(folder)[np.isin(studio.walk(1)[0, ..., 0], parts)], axis=0)


def test_each_photo_gives_what_it_shows(studio, draft: Callable, photos: list[Path]) -> None:
    driver, made = studio.driver(2), []
    for name, given in (("both", photos), ("one", photos[:1]), ("other", photos[1:])):
        words = [word for photo in given for word in ("--source", photo)]
        outcome = draft(*words, "--driver", driver, "-o", studio.folder / name)
        assert outcome.code == 0
        assert ("upper.png shows no legs" in outcome.err) is (name == "one")
        made.append(decoded(studio.folder / name))
    assert made[0] != made[1] and made[0] != made[2]
    both = studio.folder / "both"
    np.testing.assert_allclose(colour_of(studio, both, (9, 10)), GREEN, atol=12)
    np.testing.assert_allclose(colour_of(studio, both, (2,)), (200, 40, 40), atol=12)


def test_the_same_photo_twice_is_like_once(studio, photos: list[Path]) -> None:
    photo, driver = studio.source(), studio.driver(1)
    once = draw(photo, driver, studio.folder / "once").output
    twice = draw([photo, photo], driver, studio.folder / "twice").output
    assert np.abs(first_frame(once) - first_frame(twice)).max() <= 3  # the sums of two bands


def test_each_takes_its_own_iuv(studio, draft: Callable, photos: list[Path]) -> None:
    """Named, or beside it: the same pixels; one for two is refused."""
    driver, words = studio.driver(1), [w for photo in photos for w in ("--source", photo)]
    assert draft(*words, "--driver", driver, "-o", studio.folder / "beside").code == 0
    named = []
    for photo in photos:
        iuv = photo.with_name(f"{photo.stem}_IUV.png")
        named += ["--source-iuv", iuv.rename(studio.folder / f"of {photo.name}")]
    outcome = draft(*words, *named, "--driver", driver, "-o", studio.folder / "named")
    assert (outcome.code, outcome.err) == (0, "")
    assert decoded(studio.folder / "named") == decoded(studio.folder / "beside")
    outcome = draft(*words, *named[:2], "--driver", driver, "-o", studio.folder / "no")
    assert outcome.code == 2
    assert "1 source IUV for 2 sources; give one for each" in outcome.err
    assert len(outcome.err.splitlines()) == 1


def test_a_photo_of_other_clothes_is_told(studio, draft: Callable) -> None:
    photo = studio.source()
    clothes = {(2,): PINK, LEGS: (240, 240, 60), (15, 16, 19, 20, 3, 4): (20, 20, 90)}
    other = studio.source("other", colours=clothes)
    words = ("--source", photo, "--source", other, "--driver", studio.driver(1))
    outcome = draft(*words, "-o", studio.folder / "out")
    assert outcome.code == 0
    assert f"{other} seems to show somebody else than {photo}, or other clothes" in outcome.err


def content(path: Path) -> dict[str, bytes]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


@pytest.mark.parametrize("name", ["out.mp4", "out"])
def test_the_bytes_do_not_depend_on_workers(studio, photos: list[Path], name: str) -> None:
    driver = studio.array(FRAMES)
    made = [
        content(draw(photos, driver, studio.folder / str(count) / name, workers=count).output)
        for count in (1, 2)
    ]
    assert made[0] == made[1]


def interrupted(photos: list[Path], driver: Path, output: Path) -> int:
    """Stop a run after its first chunk; how many frames are kept."""
    rendered, kept = 0, []

    def stop(event: object) -> None:
        nonlocal rendered
        if isinstance(event, Notice):
            kept.append(int(event.message.split()[0]))
        if isinstance(event, Stage):
            rendered = 0
        if isinstance(event, FramesDone):
            rendered += event.frame_count
            if rendered == CHUNK_FRAMES + 5:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        draw(photos, driver, output, workers=1, listener=stop)
    assert not output.exists()
    return kept[-1]


def goes_on(photos: list[Path], driver: Path, output: Path) -> list[str]:
    """Run it again; what it says of frames that were finished before."""
    told: list[object] = []
    draw(photos, driver, output, listener=told.append)
    return [event.message for event in told if isinstance(event, Notice)]


def test_a_stopped_run_goes_on_and_ends_with_the_same_bytes(studio, photos: list[Path]) -> None:
    driver, output = studio.array(FRAMES), studio.folder / "out.mp4"
    kept = interrupted(photos, driver, output)
    assert kept >= CHUNK_FRAMES
    assert goes_on(photos, driver, output) == [
        f"{kept} of {FRAMES} frames were finished before; going on there"
    ]
    whole = draw(photos, driver, studio.folder / "whole.mp4").output
    assert output.read_bytes() == whole.read_bytes()


def repaint(studio, photos: list[Path]) -> list[Path]:
    studio.source("legs", parts=LEGS, colours={LEGS: PINK})
    return photos


def relabel(studio, photos: list[Path]) -> list[Path]:
    studio.image("legs_IUV.png", studio.iuv(scale=2, size=(192, 128), parts=LEGS[:2]))
    return photos


CHANGES: dict[str, Callable[..., list[Path]]] = {
    "the second photo": repaint,
    "the second photo's IUV": relabel,
    "their order": lambda _, photos: photos[::-1],
    "one more": lambda _, photos: [*photos, photos[0]],
    "one less": lambda _, photos: photos[:1],
}


@pytest.mark.parametrize("change", CHANGES)
def test_another_set_of_photos_is_drawn_anew(studio, photos: list[Path], change: str) -> None:
    driver, output = studio.array(FRAMES), studio.folder / "out.mp4"
    assert interrupted(photos, driver, output)
    photos = CHANGES[change](studio, photos)
    notes = goes_on(photos, driver, output)
    assert all("shows no legs" in note for note in notes)  # and nothing of what was finished
    fresh = draw(photos, driver, studio.folder / "fresh.mp4").output
    assert output.read_bytes() == fresh.read_bytes()


def in_a_folder(studio) -> Path:
    studio.source("me/upper", parts=UPPER)
    studio.source("me/legs", parts=LEGS, colours={LEGS: GREEN})
    return studio.folder / "me"


def as_a_video(studio) -> Path:
    frames = np.stack([studio.iuv(scale=2, size=(192, 128), parts=p) for p in (UPPER, LEGS)])
    pictures = np.stack([studio.dress(iuv, {LEGS: GREEN}) for iuv in frames])
    studio.video(frames, name="me_IUV.mkv")
    return studio.video(pictures, name="me.mkv")


@pytest.mark.parametrize("make", [in_a_folder, as_a_video])
def test_a_folder_and_a_video_are_like_their_pictures(
    studio, draft: Callable, photos: list[Path], make: Callable
) -> None:
    source, driver = make(studio), studio.driver(2)
    outcome = draft("--source", source, "--driver", driver, "-o", studio.folder / "out")
    assert (outcome.code, outcome.err) == (0, "")
    draw(photos, driver, studio.folder / "photos")
    assert decoded(studio.folder / "out") == decoded(studio.folder / "photos")


def test_the_folder_where_we_are_is_a_source(
    studio, draft: Callable, photos: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    driver = studio.driver(2)
    monkeypatch.chdir(in_a_folder(studio))
    outcome = draft("--source", ".", "--driver", driver, "-o", studio.folder / "out")
    assert (outcome.code, outcome.err) == (0, "")
    draw(photos, driver, studio.folder / "photos")
    assert decoded(studio.folder / "out") == decoded(studio.folder / "photos")


def test_a_photo_of_a_folder_that_changes_is_drawn_anew(studio) -> None:
    folder, driver, output = in_a_folder(studio), studio.array(FRAMES), studio.folder / "out.mp4"
    assert interrupted([folder], driver, output)
    studio.source("me/legs", parts=LEGS, colours={LEGS: PINK})
    assert goes_on([folder], driver, output) == []
    fresh = draw(folder, driver, studio.folder / "fresh.mp4").output
    assert output.read_bytes() == fresh.read_bytes()


@pytest.mark.parametrize("make", [in_a_folder, as_a_video, None])
def test_a_source_that_changes_under_the_run_stops_it(
    studio, photos: list[Path], make: Callable | None
) -> None:
    """Any of its files; one line names what changed, and nothing is left."""
    sources = photos if make is None else [make(studio)]
    stage = ""

    def change(event: object) -> None:
        nonlocal stage
        if isinstance(event, Stage):
            stage = event.name
        if isinstance(event, FramesDone) and event.frame_count and stage == "render":
            stage = "changed"
            studio.source("legs", parts=LEGS, colours={LEGS: PINK})
            if make is in_a_folder:
                studio.source("me/legs", parts=LEGS, colours={LEGS: PINK})
            if make is as_a_video:
                studio.video(np.stack([studio.iuv()] * 2), name="me_IUV.mkv")

    output = studio.folder / "out.mp4"
    with pytest.raises(InputError, match=r"(legs\.png|me|me_IUV\.mkv|legs_IUV\.png) .*changed"):
        draw(sources, studio.driver(5), output, workers=1, listener=change)
    assert stage == "changed" and not output.exists()


def test_nobody_in_a_folder_is_said(studio, draft: Callable) -> None:
    (studio.folder / "me").mkdir()
    outcome = draft(
        *("--source", studio.folder / "me", "--driver", studio.driver(1)),
        *("-o", studio.folder / "out.mp4"),
    )
    assert outcome.code == 2
    assert f"{studio.folder / 'me'} holds no pictures" in outcome.err
    assert len(outcome.err.splitlines()) == 1


def test_a_batch_takes_lists(
    studio, mt: Callable, photos: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In jobs and in a matrix, a list within is one person, also by a glob."""
    monkeypatch.undo()  # a batch's workers are processes of their own
    driver = studio.driver(2)
    in_a_folder(studio)
    manifest = studio.folder / "shoot.yaml"
    manifest.write_text(
        "version: 1\ndefaults: {renderer: texture}\n"
        "jobs:\n"
        f"  - {{source: [upper.png, legs.png], driver: {driver.name}, output: listed}}\n"
        f"  - {{source: me, driver: {driver.name}, output: folder}}\n"
        "matrix:\n"
        f"  - {{sources: [upper.png, [upper.png, 'leg*.png']], drivers: [{driver.name}],"
        " output: 'm{index}'}\n"
    )
    outcome = mt("batch", "run", manifest, "--workers", 1)
    assert outcome.code == 0, outcome.err
    both = decoded(draw(photos, driver, studio.folder / "both").output)
    alone = decoded(draw(photos[0], driver, studio.folder / "alone").output)
    found = {name: decoded(studio.folder / name) for name in ("listed", "folder", "m3", "m4")}
    assert found == {"listed": both, "folder": both, "m3": alone, "m4": both}
