"""Weights that learn one person, with tiny networks and a judge that looks at colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch
import torch.nn.functional as F
from torch import Tensor

from motion_transfer.drawing.source import SourcePicture, unfold_source
from motion_transfer.drawing.textures import average
from motion_transfer.errors import TrainingError
from motion_transfer.events import Event, FramesDone, Notice, Stage
from motion_transfer.media.pictures.photo import Photo
from motion_transfer.training import adaptation
from motion_transfer.training.adaptation import adapt_model, anneal
from motion_transfer.training.adaptation_settings import AdaptationSettings
from motion_transfer.training.feature_networks import FeatureNetwork
from motion_transfer.training.lessons import (
    Lessons,
    give_one_light,
    hidden_pixels,
    lay_over_white,
    take_portrait,
)
from nhrr_core import ModelConfig, NeuralReRenderer

FRONT = (2, 9, 10, 13, 14, 23)
SETTINGS = AdaptationSettings(steps=12, maps=2)


class Colours(FeatureNetwork):
    """The image, and the image at a quarter of its size."""

    layer_weights = (1.0, 1.0)

    def forward(self, image: Tensor) -> list[Tensor]:
        return [image, F.avg_pool2d(image, 4)]


@pytest.fixture
def model() -> NeuralReRenderer:
    sizes = {"feature_width": 4, "render_width": 4, "residual_blocks": 1}
    config = ModelConfig.preset("lite", alpha=True, image_size=64, texture_size=64, **sizes)
    return NeuralReRenderer(config).eval()


@pytest.fixture
def take(studio):
    """Takes a photo; its alpha is the IUV's outline, or is not known."""

    def photograph(
        x: int = 0, *, parts: Sequence[int] = FRONT, light: float = 1.0, alpha: bool = True
    ) -> SourcePicture:
        iuv = studio.iuv(x, parts=tuple(parts))
        rgb = (studio.dress(iuv) * light).astype(np.uint8)
        cover = (iuv[..., 0] > 0).astype(np.uint8) * 255
        photo = Photo(Path(f"{x}.png"), rgb, cover if alpha else None, turned=False)
        return SourcePicture(photo, iuv)

    return photograph


def learn(model: NeuralReRenderer, pictures, poses=(), heard=None, **changes) -> NeuralReRenderer:
    listener = (lambda _event: None) if heard is None else heard.append
    return adapt_model(model, pictures, poses, replace(SETTINGS, **changes), Colours(), listener)


def drift(model: NeuralReRenderer, lesson) -> float:
    """How far a drawing is from what a lesson asks for, on the body."""
    with torch.no_grad():
        known = lesson["feature_map"], lesson["target_iuv"], lesson.get("detail")
        drawn = lay_over_white(model.render(*known))
    away = (drawn - lesson["target_image"]).abs()
    return float(away[(lesson["target_iuv"][:, :1] > 0).expand_as(away)].mean())


def test_a_photo_is_drawn_better(model, take) -> None:
    picture = take()
    lesson = next(iter(Lessons(model, [picture], [], replace(SETTINGS, light=0, tint=0))))
    adapted = learn(model, [picture], steps=30)
    assert drift(adapted, lesson) < 0.7 * drift(model, lesson)
    assert not adapted.training


def test_only_the_last_layers_of_render_net_learn(model, take) -> None:
    before = {name: value.clone() for name, value in model.state_dict().items()}
    adapted = learn(model, [take()])
    changed = {
        name for name, value in adapted.state_dict().items() if not value.equal(before[name])
    }
    first = adaptation.first_learned(model)
    assert changed
    for name in changed:
        network, _, index, *_ = name.split(".")
        assert network == "render_net"
        assert int(index) >= first
    assert all(value.equal(before[name]) for name, value in model.state_dict().items())


def test_what_no_photo_shows_is_held(model, take, studio) -> None:
    picture = take(parts=(2, 23))
    poses = [studio.iuv(2 * step) for step in range(3)]
    lessons = iter(Lessons(model, [picture], poses, replace(SETTINGS, held_every=1)))
    held = next(lessons)
    assert drift(model, held) == 0
    strays = [
        drift(learn(model, [picture], poses, steps=30, held_every=every), held) for every in (2, 0)
    ]
    assert strays[0] < 0.7 * strays[1]


def test_poses_that_show_nobody_hold_nothing(model, take, studio) -> None:
    nobody = studio.iuv(parts=())
    lessons = [
        next(iter(Lessons(model, [take()], poses, replace(SETTINGS, held_every=1))))
        for poses in ([nobody], [])
    ]
    assert lessons[0]["target_image"].equal(lessons[1]["target_image"])


def test_the_same_photos_give_the_same_weights(model, take) -> None:
    first, again = (learn(model, [take(), take(3)]) for _ in range(2))
    other = learn(model, [take(), take(3)], seed=1)
    states = [each.state_dict() for each in (first, again, other)]
    key = next(key for key in reversed(states[0]) if key.startswith("render_net"))
    assert states[0][key].equal(states[1][key])
    assert not states[0][key].equal(states[2][key])


def test_several_photos_are_drawn_from_each_other(model, take) -> None:
    """Both ways to draw a photo have a map of their own: from itself, and from the other."""
    front, back = take(parts=(2, 23)), take(parts=(9, 24))
    lessons = Lessons(model, [front, back], [], replace(SETTINGS, maps=8, light=0, tint=0))
    found = {
        (round(float(lesson["feature_map"].sum()), 1), int(lesson["target_iuv"][:, 0].max()))
        for lesson in islice(lessons, 8)
    }
    assert {shown for _, shown in found} == {23, 24}
    assert len(found) == 4


def test_photos_get_the_light_of_the_first(take) -> None:
    first, dim = take(), take(2, light=0.7)
    _, relit = give_one_light([first, dim])
    body = dim.iuv[..., 0] > 0
    before, after = (
        np.abs(picture.photo.rgb[body].mean(0) - first.photo.rgb[body].mean(0)).mean()
        for picture in (dim, relit)
    )
    assert after < 0.4 * before


@pytest.mark.parametrize("alpha", [True, False])
def test_surroundings_are_learned_only_where_they_are_known(model, take, alpha: bool) -> None:
    lessons = Lessons(model, [busy(take(alpha=alpha))], [], SETTINGS)
    lesson = next(iter(lessons))
    outside = (lesson["target_iuv"][:, :1] == 0).expand(-1, 3, -1, -1)
    assert ("learned" in lesson) != alpha
    assert ("target_alpha" in lesson) == alpha
    white = lesson["target_image"][outside] > 0.99
    assert bool(white.float().mean() > 0.8) == alpha


def busy(picture: SourcePicture) -> SourcePicture:
    """Put a person before a backdrop that tells nothing."""
    noise = np.random.default_rng(0).integers(0, 255, picture.iuv.shape).astype(np.uint8)
    rgb = np.where(picture.iuv[..., :1] > 0, picture.photo.rgb, noise)
    return replace(picture, photo=replace(picture.photo, rgb=rgb))


def test_a_plain_backdrop_tells_the_outline(take) -> None:
    portrait = take_portrait(take(alpha=False), alpha=True)
    assert portrait.alpha is not None
    assert take_portrait(take(), alpha=False).alpha is None


def test_hidden_pixels_are_those_that_no_photo_shows(take, studio) -> None:
    pose = studio.iuv()
    photos = [take(parts=(2,)), take(parts=(23,))]
    seen = average(unfold_source(photos, 256).visibility, 32)[0] > 0
    hidden, part = hidden_pixels(pose, seen), pose[..., 0]
    assert not hidden[part == 0].any()
    assert hidden[np.isin(part, (2, 23))].mean() < 0.2  # the outline is trimmed
    assert hidden[np.isin(part, (13, 14, 19, 20))].mean() > 0.9


def test_each_step_is_told(model, take, monkeypatch) -> None:
    monkeypatch.setattr(adaptation, "LONG_SECONDS", 0.0)
    heard: list[Event] = []
    learn(model, [take()], heard=heard, steps=5)
    assert isinstance(heard[0], Notice)
    assert "about 1 minute here" in heard[0].message
    assert heard[1] == Stage("adapt", 5)
    assert sum(event.frame_count for event in heard if isinstance(event, FramesDone)) == 5


def test_a_loss_that_is_no_number_ends_it(model, take) -> None:
    with torch.no_grad():
        next(iter(model.render_net.parameters())).fill_(float("nan"))
    with pytest.raises(TrainingError, match="the loss is nan at step 0"):
        learn(model, [take()])


def test_the_learning_rate_rises_and_falls() -> None:
    rates = [anneal(step / 100) for step in range(101)]
    peak = rates.index(max(rates))
    assert 0 < peak <= 10
    assert rates[peak] == pytest.approx(1)
    assert rates[-1] == pytest.approx(0)
    assert sorted(rates[peak:], reverse=True) == rates[peak:]
