"""`mt run --fit-body`: the driver's motion in a body of the source's proportions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from estimate_stubs import BLUE, RED, StandingEstimator, scene, write_red_model
from PIL import Image

from motion_transfer import RenderOptions, render_video
from motion_transfer.batch.active import scan_name
from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.retarget import BONES, BodyFit
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.events import Stage
from motion_transfer.render import picture_driver, source_pictures

SIZE = (128, 160)
TOP, FEET = 10, 110
SOURCE_HIPS, DRIVER_HIPS = 50, 70
"""Long legs, and short ones."""


def somebody(hips: int, left: int = 20) -> list[tuple[tuple[int, int, int], Box]]:
    upper, lower = Box(left, TOP, left + 30, hips), Box(left, hips, left + 30, FEET)
    return [(RED, upper), (BLUE, lower)]


def save(path: Path, *people: list) -> Path:
    Image.fromarray(scene(*(part for one in people for part in one), size=SIZE)).save(path)
    return path


@pytest.fixture(autouse=True)
def estimator(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever opens an estimator gets one that sees red above blue."""

    def opened(name: str, model: Path | None, *, fit: BodyFit | None = None, **_how: object):
        return StandingEstimator(fit)

    for module in (source_pictures, picture_driver):
        monkeypatch.setattr(module, "open_estimator", opened)


@pytest.fixture
def me(tmp_path: Path) -> Path:
    return save(tmp_path / "me.png", somebody(SOURCE_HIPS))


@pytest.fixture
def dance(tmp_path: Path) -> Path:
    (tmp_path / "dance").mkdir()
    for index in range(4):
        save(tmp_path / f"dance/{index}.png", somebody(DRIVER_HIPS, 40 + 4 * index))
    return tmp_path / "dance"


def rows_of(picture: Path) -> tuple[int, int, int]:
    """Where the person begins, where red becomes blue, and where the person ends."""
    pixels = np.asarray(Image.open(picture)).astype(int)
    red, blue = ((np.abs(pixels - colour) < 90).all(-1) for colour in (RED, BLUE))
    drawn = np.flatnonzero((red | blue).any(1))
    return int(drawn[0]), int(np.flatnonzero(blue.any(1))[0]), int(drawn[-1])


def test_the_driver_gets_the_sources_legs(tmp_path: Path, me: Path, dance: Path) -> None:
    for name, fit_body, hips in (("own", False, DRIVER_HIPS), ("fitted", True, SOURCE_HIPS)):
        render_video(me, dance, tmp_path / name, renderer="texture", fit_body=fit_body)
        pictures = sorted((tmp_path / name).iterdir())
        assert len(pictures) == 4
        for picture in pictures:
            assert rows_of(picture) == pytest.approx((TOP, hips, FEET), abs=4)


def test_the_sources_iuv_says_who_it_is(tmp_path: Path, dance: Path) -> None:
    photo = save(tmp_path / "two.png", somebody(90, 10), somebody(SOURCE_HIPS, 100))
    _, wanted = StandingEstimator().estimate(np.asarray(Image.open(photo)))
    Image.fromarray(wanted.on_frame(*SIZE)[0]).save(tmp_path / "two_IUV.png")
    words = {"renderer": "texture", "source_iuv_order": "iuv", "fit_body": True}
    render_video(photo, dance, tmp_path / "out", **words)
    assert rows_of(tmp_path / "out/000001.png")[1] == pytest.approx(SOURCE_HIPS, abs=4)


def test_a_stopped_run_goes_on_only_with_the_same_body(
    tmp_path: Path, me: Path, dance: Path
) -> None:
    stages: list[str] = []

    def stop(event) -> None:
        if isinstance(event, Stage):
            stages.append(event.name)
            if event.name == "render":
                raise KeyboardInterrupt

    def run(fit_body: bool) -> list[str]:
        stages.clear()
        with pytest.raises(KeyboardInterrupt):
            output = tmp_path / "out"
            render_video(me, dance, output, renderer="texture", fit_body=fit_body, listener=stop)
        return list(stages)

    assert run(False) == ["estimate", "scan", "render"]
    assert run(True) == ["compare", "estimate", "scan", "render"]
    assert run(True) == ["scan", "render"]
    save(me, somebody(SOURCE_HIPS + 6))
    assert run(True) == ["compare", "estimate", "scan", "render"]


def test_jobs_share_a_fitted_driver_only_with_their_source(tmp_path: Path) -> None:
    def name(source: str, fit_body: bool) -> str:
        paths = {"source": (Path(source),), "driver": Path("d.mp4"), "output": Path("o.mp4")}
        return scan_name(RenderOptions(**paths, fit_body=fit_body))

    assert name("a.png", False) == name("b.png", False)
    assert len({name("a.png", False), name("a.png", True), name("b.png", True)}) == 3


def test_a_driver_without_landmarks_is_refused(
    tmp_path: Path, draft: Callable, me: Path, studio
) -> None:
    output = tmp_path / "a.mp4"
    outcome = draft("--source", me, "--driver", studio.driver(2), "-o", output, "--fit-body")
    assert outcome.code == 2
    assert "IUV as in the driver" in outcome.err and "leave out --fit-body" in outcome.err
    words = ["--estimator", "densepose", "--estimator-model", "a.pt", "--fit-body"]
    outcome = draft("--source", me, "--driver", "b.mp4", "-o", output, *words)
    assert outcome.code == 2
    assert "the densepose estimator gives none; choose the blazepose" in outcome.err
    assert not output.exists()


def test_pictures_of_nobody_are_named(tmp_path: Path, dance: Path) -> None:
    nobody = save(tmp_path / "nobody.png")
    with pytest.raises(InputError, match=r"no landmarks .* in the source .*nobody.png"):
        render_video(nobody, dance, tmp_path / "out", renderer="texture", fit_body=True)
    with pytest.raises(InputError, match=r"nobody was found in .*nobody.png; it should show"):
        photo = save(tmp_path / "me.png", somebody(SOURCE_HIPS))
        render_video(photo, nobody, tmp_path / "out", renderer="texture", fit_body=True)


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_an_estimator_without_landmarks_cannot_be_opened_with_a_fit(tmp_path: Path) -> None:
    model = write_red_model(tmp_path / "red.pt")
    with pytest.raises(InputError, match="densepose estimator gives no landmarks"):
        open_estimator("densepose", model, fit=BodyFit(dict.fromkeys(BONES, 1.0)))
