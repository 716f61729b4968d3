"""Frames from memory equal those of `mt run`, to the byte."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer import MotionTransfer
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Stage
from motion_transfer.render.plan import CHUNK_FRAMES


@pytest.fixture
def draft() -> MotionTransfer:
    return MotionTransfer(renderer="texture")


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path))


def written(folder: Path) -> np.ndarray:
    return np.stack([pixels(path) for path in sorted(folder.iterdir())])


@pytest.mark.parametrize("background", ["transparent", "white"])
def test_the_network_draws_what_mt_run_draws(studio, mt, checkpoint: Path, background: str) -> None:
    photo, walk, out = studio.source(), studio.walk(CHUNK_FRAMES + 3), studio.folder / "out"
    words = ("--source", photo, "--driver", studio.driver(walk), "-o", out)
    told = mt("run", *words, "--weights", checkpoint, "--background", background)
    assert told.code == 0, told.err
    model = MotionTransfer(checkpoint)
    iuv = pixels(photo.with_name("person_IUV.png"))
    person = model.encode(pixels(photo), iuv)
    frames = model.render(person, walk, background=background)
    assert len(frames) == len(walk)
    assert (frames.height, frames.width) == walk.shape[1:3]
    np.testing.assert_array_equal(np.stack(list(frames)), written(out))


def test_files_and_options_go_as_on_the_command_line(studio, mt, draft: MotionTransfer) -> None:
    photo, driver, out = studio.source(), studio.video(9), studio.folder / "out"
    scene = ("--shadow", "--on-the-spot", "--background", "photo", "--frames", "2:8")
    run = ("run", "--renderer", "texture", "--source", photo, "--driver", driver, "-o", out)
    assert mt(*run, *scene).code == 0
    frames = draft.render(
        draft.encode(photo),
        driver,
        shadow=True,
        on_the_spot=True,
        background="photo",
        frames="2:8",
    )
    assert frames.frame_rate == Fraction(30000, 1001)
    np.testing.assert_array_equal(np.stack(list(frames)), written(out))


def test_alpha_of_a_photo_counts_as_it_does_in_a_file(studio, draft: MotionTransfer) -> None:
    photo = studio.source()
    iuv = pixels(photo.with_name("person_IUV.png"))
    alpha = np.where(iuv[..., :1] > 0, 255, 0).astype(np.uint8)
    alpha[: len(alpha) // 3] = 0
    rgba = np.concatenate([pixels(photo), alpha], axis=-1)
    one, other = draft.encode(rgba, iuv), draft.encode(studio.image("person.png", rgba))
    np.testing.assert_array_equal(one.source.texture, other.source.texture)
    assert (
        one.source.visibility.mean()
        < 0.9 * draft.encode(rgba[..., :3], iuv).source.visibility.mean()
    )


def test_a_source_is_drawn_from_as_often_as_wanted(studio, draft: MotionTransfer) -> None:
    person = draft.encode(studio.source())
    frames = draft.render(person, studio.walk(4))
    first = list(frames)
    np.testing.assert_array_equal(np.stack(list(frames)), np.stack(first))
    with pytest.raises(InputError, match="by other weights"):
        MotionTransfer().render(person, studio.walk(1))


def test_progress_is_told_and_a_pass_can_be_ended(studio, checkpoint: Path) -> None:
    model, heard = MotionTransfer(checkpoint), []
    person = model.encode(studio.source())
    frames = iter(model.render(person, studio.walk(9), listener=heard.append))
    next(frames)
    next(frames)
    frames.close()
    drawn = heard[heard.index(Stage("render", 9)) :]
    assert drawn == [Stage("render", 9), FramesDone(1)]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda m, p, i: m.encode(p.astype(np.float32), i), "array of float32 .* uint8 H x W"),
        (lambda m, p, i: m.encode(p, i[1:]), "the given IUV is 128 x 191, but"),
        (lambda m, p, i: m.encode(p, np.full_like(i, 99)), "the given IUV is not an IUV image"),
        (lambda m, p, i: m.encode(p, np.zeros_like(i)), "no person"),
        (lambda m, p, _: m.encode(p, "me_IUV.png"), "IUV from memory"),
        (lambda m, _, i: m.encode("me.png", i), "IUV from a file"),
        (
            lambda m, p, i: m.render(m.encode(p, i), i),
            r"\[192, 128, 3\], where uint8 N x H x W x 3",
        ),
        (lambda m, p, i: m.render(m.encode(p, i), np.zeros_like(i)[None]), "no person in any"),
    ],
)
def test_what_does_not_fit_is_said(studio, draft: MotionTransfer, call, said: str) -> None:
    photo = studio.source()
    with pytest.raises(InputError, match=said):
        call(draft, pixels(photo), pixels(photo.with_name("person_IUV.png")))
