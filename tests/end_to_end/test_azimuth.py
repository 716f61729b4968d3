"""`mt run --azimuth`: a driver of raw pictures, seen from elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anny")

from tracking_clips import CAMERA, Known, clip

from motion_transfer import RenderOptions
from motion_transfer.batch.active import scan_name
from motion_transfer.errors import InputError
from motion_transfer.events import Notice, Stage, ignore
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render import picture_driver
from motion_transfer.render.content import driver_key
from motion_transfer.render.picture_driver import ORDER, estimate_driver
from motion_transfer.render.run import run

COUNT = 16
LEFT_HEAD, RIGHT_HEAD = 24, 23


def walker_unseen_in(unseen: range) -> Known:
    """An estimator that sees somebody walk, whatever the frames show; nobody in some of them."""
    marks = clip("walk", COUNT)[2]
    return Known([None if index in unseen else one for index, one in enumerate(marks)])


@pytest.fixture
def dance(tmp_path: Path) -> Path:
    (tmp_path / "dance").mkdir()
    for index in range(COUNT):
        grey = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
        write_png(tmp_path / f"dance/{index:03d}.png", grey)
    return tmp_path / "dance"


@pytest.fixture
def walker(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Lets whoever opens an estimator for a driver get one that walks."""

    def choose(unseen: range = range(0)) -> None:
        monkeypatch.setattr(
            picture_driver, "open_estimator", lambda *_, **__: walker_unseen_in(unseen)
        )

    choose()
    return choose


@pytest.fixture
def options(studio, dance: Path, tmp_path: Path) -> RenderOptions:
    output = tmp_path / "o.mp4"
    return RenderOptions(
        source=(studio.source(),), driver=dance, output=output, renderer="texture", azimuth=90.0
    )


def parts_of(options: RenderOptions, folder: Path) -> np.ndarray:
    """How many pixels of each part every frame of the driver's IUV shows, N x 25."""
    driver = estimate_driver(options, folder, ignore, Inputs([options.driver]))
    stream = open_stream(driver.iuv, missing="fail")
    frames = open_reader(stream, ORDER).read(0, stream.frame_count)
    return np.stack([np.bincount(iuv[..., 0].ravel(), minlength=25) for iuv in frames])


def test_the_body_is_seen_from_where_the_camera_stands(options, walker, tmp_path: Path) -> None:
    heads = []
    for azimuth in (90.0, -90.0):
        walker()
        seen = parts_of(replace(options, azimuth=azimuth), tmp_path).sum(0)
        heads.append(seen[[LEFT_HEAD, RIGHT_HEAD]])
    assert heads[0][0] > 3 * heads[0][1] > 0
    assert heads[1][1] > 3 * heads[1][0] > 0


def test_a_run_draws_it_and_goes_on_with_the_same_view(options, walker) -> None:
    stages: list[str] = []

    def listen(event) -> None:
        if isinstance(event, Stage):
            stages.append(event.name)
            if event.name == "render" and stages.count("render") == 1:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(options, listen)
    assert stages == ["track", "draw", "scan", "render"]
    stages[:] = ["render"]
    assert run(options, listen).frame_count == COUNT
    assert stages[1:] == ["scan", "render"]


def test_whoever_is_not_seen_is_filled_in(options, walker, tmp_path: Path) -> None:
    walker(range(6, 9))
    told: list[str] = []

    def keep(event) -> None:
        if isinstance(event, Notice):
            told.append(event.message)

    driver = estimate_driver(options, tmp_path, keep, Inputs([options.driver]))
    assert told == list(driver.notes)
    assert "nobody found in 0:00.20-0:00.30 (frames 6:9)" in told[0]
    assert (parts_of(options, tmp_path)[:, 1:].sum(1) > 100).all()
    walker(range(6, 9))
    with pytest.raises(InputError, match=r"nobody found in .*frames 6:9.*another --missing"):
        parts_of(replace(options, missing="fail"), tmp_path / "other")


def test_only_the_chosen_frames_are_tracked(options, walker, tmp_path: Path) -> None:
    seen = parts_of(replace(options, frames=(4, 12)), tmp_path)[:, 1:].sum(1)
    assert not seen[:4].any() and (seen[4:12] > 100).all() and len(seen) == 12


def test_each_view_is_another_driver(options, tmp_path: Path) -> None:
    views = [options, replace(options, azimuth=45.0), replace(options, azimuth=None)]
    assert len({driver_key(view) for view in views}) == 3
    assert len({scan_name(view) for view in views}) == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"azimuth": 500.0}, "--azimuth 500; it must lie in -360..360 degrees"),
        ({"fit_body": True}, "leave one out"),
        ({"background": "driver"}, "leave it out, or --partner and --background driver"),
        (
            {"estimator": "densepose", "estimator_model": Path("a.pt")},
            "the densepose estimator gives none; choose blazepose or blazepose-heavy",
        ),
    ],
)
def test_what_does_not_go_together(options, words: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(options, **words)


@pytest.mark.parametrize(
    ("driver", "advice"),
    [("people:walk", "write people:walk,azimuth=90"), ("", "give the video or pictures")],
)
def test_drivers_that_are_no_pictures(options, studio, driver: str, advice: str) -> None:
    named = Path(driver) if driver else studio.driver(2)
    with pytest.raises(InputError, match=f"--azimuth fits a body to pictures.*{advice}"):
        run(replace(options, driver=named))
