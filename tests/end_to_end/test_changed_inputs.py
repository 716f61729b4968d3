"""Files that are replaced while a run reads them: it stops, names the file, and mixes nothing."""

from __future__ import annotations

import os
import shutil
import wave
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.torch
from estimate_stubs import RED, scene, write_red_model

from motion_transfer import render_video
from motion_transfer.drawing.engines import ANYTHING
from motion_transfer.drawing.person import Box
from motion_transfer.drawing.renderers import network
from motion_transfer.drawing.renderers.texture import TextureRecipe
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Stage
from motion_transfer.render import composition
from motion_transfer.render import run as running

Change = Callable[[], object]
FRAMES = 5

MOMENTS = {
    "scan": "while the driver is looked through",
    "read": "when the source was read, before its key is made",
    "render": "when the first frames are drawn",
    "join": "when everything is drawn",
}


class Bystander:
    """Does something once at a moment of a run, however fast that is over."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, moment: str, change: Change) -> None:
        self._moment, self._change, self._stage = moment, change, ""
        for module, name, when in (
            (composition, "read_source", "read"),
            (running, "join_segments", "join"),
        ):
            monkeypatch.setattr(module, name, partial(self._after, getattr(module, name), when))

    def _after(self, call: Callable[..., Any], moment: str, *arguments: Any) -> Any:
        result = call(*arguments)
        self._reach(moment)
        return result

    def _reach(self, moment: str) -> None:
        if moment == self._moment:
            self._moment = ""
            self._change()

    def hear(self, event: object) -> None:
        if isinstance(event, Stage):
            self._stage = event.name
        if isinstance(event, FramesDone) and event.frame_count:
            self._reach(self._stage)


def replace(old: Path, new: Path) -> None:
    """Rename another file or folder over one."""
    if old.is_dir():
        shutil.rmtree(old)
    new.rename(old)


def rewrite(old: Path, new: Path) -> None:
    """Write other content into the same file, and set its time back."""
    status = old.stat()
    old.write_bytes(new.read_bytes())
    os.utime(old, ns=(status.st_atime_ns, status.st_mtime_ns))


def remove(old: Path, _new: Path) -> None:
    old.unlink()


@pytest.fixture(autouse=True)
def small_textures(monkeypatch) -> None:
    """Unfolding a photo takes most of a short run's time."""
    monkeypatch.setattr(TextureRecipe, "texture_size", 32)


@pytest.fixture
def assert_stops(studio, monkeypatch) -> Callable[..., None]:
    """Start a run with a bystander, see it stop and name the file, and start it again."""

    def call(moment: str, changed: Path, change: Change, again: bool = True, **options) -> None:
        output = studio.folder / "new/out.mp4"
        settings = {
            "source": studio.folder / "person.png",
            "driver": studio.folder / "driver",
            "renderer": "texture",
            "workers": 1,
            **options,
        }
        with monkeypatch.context() as patch:
            bystander = Bystander(patch, moment, change)
            with pytest.raises(InputError) as caught:
                render_video(output=output, listener=bystander.hear, **settings)
        assert changed.name in str(caught.value)
        assert "\n" not in str(caught.value)
        assert not output.exists()
        if again:
            render_video(output=output, **settings)
            fresh = render_video(output=studio.folder / "fresh/out.mp4", **settings).output
            assert output.read_bytes() == fresh.read_bytes()
            assert list(output.parent.iterdir()) == [output]

    return call


@pytest.fixture
def inputs(studio) -> None:
    studio.source()
    studio.driver(FRAMES)


@pytest.mark.parametrize(
    ("moment", "change"),
    [("scan", replace), ("read", rewrite), ("render", replace), ("join", rewrite)],
)
def test_a_frame_that_is_drawn_already(studio, inputs, assert_stops, moment: str, change) -> None:
    frame = studio.folder / "driver/frame_0_IUV.png"
    other = studio.image("other.png", studio.iuv(7, 7))
    assert_stops(moment, frame, partial(change, frame, other))


@pytest.mark.parametrize("moment", ["scan", "join"])
@pytest.mark.parametrize("number", [FRAMES - 1, FRAMES])
def test_frames_that_go_and_come(studio, inputs, assert_stops, moment: str, number: int) -> None:
    frame = studio.folder / f"driver/frame_{number}_IUV.png"
    other = studio.image("other.png", studio.iuv(7, 7))
    change = partial(remove, frame, other) if frame.exists() else partial(replace, frame, other)
    assert_stops(moment, frame, change, again=False)


@pytest.mark.parametrize("moment", ["scan", "render"])
@pytest.mark.parametrize("kind", ["video", "array"])
def test_a_driver_of_one_file(studio, assert_stops, moment: str, kind: str) -> None:
    studio.source()
    write = {"video": studio.video, "array": studio.array}[kind]
    driver = write(FRAMES)
    other = write(studio.walk(FRAMES + 2)[2:], name=f"other{driver.suffix}")
    assert_stops(moment, driver, partial(replace, driver, other), again=False, driver=driver)


@pytest.mark.parametrize("name", ["person.png", "person_IUV.png"])
@pytest.mark.parametrize(
    ("moment", "change"), [("read", replace), ("render", rewrite), ("join", replace)]
)
def test_a_source(studio, inputs, assert_stops, moment: str, name: str, change) -> None:
    source = studio.source("other", colours={(2,): (1, 2, 3)}, parts=(2, 9, 10, 23, 24))
    other = source if name == "person.png" else studio.folder / "other_IUV.png"
    file = studio.folder / name
    assert_stops(moment, file, partial(change, file, other))


@pytest.mark.parametrize("moment", ["read", "join"])
def test_a_source_that_goes(studio, inputs, assert_stops, moment: str) -> None:
    file = studio.folder / "person.png"
    assert_stops(moment, file, partial(remove, file, file), again=False)


@pytest.mark.parametrize("moment", ["render", "join"])
def test_sound(studio, inputs, assert_stops, moment: str) -> None:
    sound, other = tone(studio.folder / "a.wav", 440), tone(studio.folder / "b.wav", 880)
    assert_stops(moment, sound, partial(replace, sound, other), again=False, audio=sound)


@pytest.mark.parametrize("moment", ["read", "render", "join"])
def test_weights(studio, inputs, assert_stops, moment: str, checkpoint: Path) -> None:
    weights, other = studio.folder / "a.safetensors", studio.folder / "b.safetensors"
    shutil.copy(checkpoint, weights)
    other_weights(checkpoint, other)
    network._load_network.cache_clear()
    assert_stops(
        *(moment, weights, partial(replace, weights, other)),
        renderer="nhrr",
        weights=weights,
        frames=(0, 4),
    )


def tone(path: Path, hertz: int) -> Path:
    """Write two seconds of sound."""
    samples = np.sin(np.arange(2 * 48_000) / 48_000 * hertz * 2 * np.pi) * 10_000
    with wave.open(str(path), "wb") as file:
        file.setparams((1, 2, 48_000, 0, "NONE", ""))
        file.writeframes(samples.astype("<i2").tobytes())
    return path


def other_weights(checkpoint: Path, path: Path) -> None:
    """Write a checkpoint that draws other colours."""
    with safetensors.safe_open(checkpoint, framework="pt") as file:
        state = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        metadata = file.metadata()
    state = {name: -t if name.endswith("weight") else t for name, t in state.items()}
    safetensors.torch.save_file(state, path, metadata=metadata)


def test_weights_that_changed_before_they_are_loaded_draw_nothing(
    tmp_path: Path, checkpoint: Path
) -> None:
    """A batch's worker may load them long after the run was planned."""
    weights = tmp_path / "a.safetensors"
    shutil.copy(checkpoint, weights)
    recipe = network.open_recipe(weights, ANYTHING)
    other_weights(checkpoint, weights)
    with pytest.raises(InputError, match=r"a.safetensors have changed since the run began"):
        recipe.make_ready([64])


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
@pytest.mark.parametrize(
    ("moment", "kind"),
    [("estimate", "video"), ("estimate", "folder"), ("scan", "video"), ("join", "video")],
)
def test_a_raw_clip(studio, assert_stops, moment: str, kind: str) -> None:
    """What is kept of a clip must not come from another one than its key says."""
    studio.source()
    dance = np.stack([scene((RED, Box(5 + 3 * i, 8, 25 + 3 * i, 52))) for i in range(8)])
    if kind == "video":
        filmed = partial(studio.video, codec="libx264", pixels="yuv420p")
        clip, other = filmed(dance, name="dance.mp4"), filmed(dance[::-1], name="other.mp4")
    else:
        for number, picture in enumerate(dance):
            studio.image(f"dance/{number}.png", picture)
        clip, other = studio.folder / "dance", studio.image("other.png", dance[5])
    changed = clip / "0.png" if clip.is_dir() else clip
    assert_stops(
        *(moment, changed, partial(replace, changed, other)),
        driver=clip,
        estimator="densepose",
        estimator_model=write_red_model(studio.folder / "red.pt"),
    )


@pytest.mark.parametrize("moment", ["scan", "render", "join"])
def test_what_is_only_touched_stops_nobody(studio, inputs, monkeypatch, moment: str) -> None:
    source, driver = studio.folder / "person.png", studio.folder / "driver"
    frame = driver / "frame_0_IUV.png"

    def touch() -> None:
        source.touch()
        os.utime(frame, ns=(0, 0))
        other = studio.folder / "same.png"
        shutil.copy(frame, other)
        other.replace(driver / "frame_0_IUV.png")

    whole = render_video(source, driver, studio.folder / "whole.mp4", renderer="texture").output
    bystander = Bystander(monkeypatch, moment, touch)
    output = render_video(
        source, driver, studio.folder / "out.mp4", renderer="texture", listener=bystander.hear
    ).output
    assert bystander._moment == ""
    assert output.read_bytes() == whole.read_bytes()


@pytest.mark.parametrize("command", ["convert", "repair"])
def test_iuv_that_changes_while_it_is_rewritten(studio, mt, monkeypatch, command: str) -> None:
    """Its last frame, when that has been read."""
    folder = studio.driver(6)
    read = np.ascontiguousarray

    def change(*arguments: Any) -> np.ndarray:
        studio.image("driver/frame_5_IUV.png", studio.iuv(9, 9))
        return read(*arguments)

    monkeypatch.setattr("motion_transfer.media.iuv.writing.np.ascontiguousarray", change)
    output = studio.folder / "new/out.npy"
    more = ("--speckle", 3) if command == "repair" else ()
    result = mt("iuv", command, folder, "-o", output, *more)
    assert result.code == 2
    assert result.err.splitlines()[-1].startswith("mt: ")
    assert "frame_5_IUV.png has changed since" in result.err.splitlines()[-1]
    assert not output.parent.exists()
