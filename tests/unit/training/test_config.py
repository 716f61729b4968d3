"""`train.toml`: what is refused, and that what is written reads back the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.training.config import (
    TrainConfig,
    build_config,
    check_value,
    parse_assignment,
    read_settings,
    write_toml,
)
from nhrr_core import ModelConfig


def write(folder: Path, text: str) -> Path:
    path = folder / "train.toml"
    path.write_text(text)
    return path


def test_the_defaults_are_the_papers() -> None:
    config = build_config({"data.source": "pairs.csv"})
    weights = config.losses.weights
    assert (weights.perceptual, weights.adversarial, weights.identity, weights.texture) == (
        *(10, 1, 5, 1),
    )
    assert (config.optimiser.learning_rate, config.optimiser.beta1) == (2e-4, 0.5)
    assert config.losses.discriminator_scales == 3
    assert config.losses.matching_weight == config.losses.r1_weight == 0
    assert config.losses.identity == "sphereface"
    assert config.losses.adversarial
    assert config.model == ModelConfig.preset("lite")


def test_people_come_with_alpha_and_without_a_face_network() -> None:
    config = build_config({})
    assert config.model.alpha
    assert config.losses.identity == "none"
    chosen = build_config({"losses.identity": "sphereface", "model.alpha": False})
    assert (chosen.losses.identity, chosen.model.alpha) == ("sphereface", False)


def test_written_and_read_it_is_the_same(tmp_path: Path) -> None:
    config = build_config(
        {
            "data.source": 'a "quoted"\tfölder\\',
            "losses.adversarial": False,
            "optimiser.learning_rate": 1e-5,
            "model.preset": "paper",
            "model.variant": "ip",
        }
    )
    text = write_toml(config)
    settings = read_settings(write(tmp_path, text))
    assert build_config(settings) == config
    assert write_toml(build_config(settings)) == text
    assert len(settings) == text.count(" = ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[run]\nsteps = 5\n\n[losses]\nperceptul = 'none'\n", r"line 5, \[losses\]: unknown key"),
        ("[lossses]\nidentity = 'none'\n", r"line 1.*unknown section 'lossses'"),
        ("steps = 5\n", "line 1: steps stands outside a section"),
        ("[run]\nsteps = '5'\n", r"run\.steps is '5'; it must be a valid integer"),
        ("[run]\nsteps = true\n", r"run\.steps is True"),
        ("[run]\nsteps = " + "9" * 5000, "a whole number here has more digits"),
        ("a = " + "[" * 20000, "lie in each other more than"),
        ("[model]\ndown_blocks = 4611686018427387904\n", ":2: '46116860184273"),
        ('[run]\n"" = 3\n', "unknown key ''"),
        ("[run\n", r"Expected .* \(at line 1"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_settings(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [
        ("run.steps=7", "run.steps", 7),
        ("losses.texture_weight=2", "losses.texture_weight", 2.0),
        ("losses.perceptual=vgg19", "losses.perceptual", "vgg19"),
        ("model.alpha=true", "model.alpha", True),
        ("data.source=/a b/c", "data.source", "/a b/c"),
    ],
)
def test_assignments(text: str, name: str, value: object) -> None:
    assert parse_assignment(text) == (name, value)
    assert type(parse_assignment(text)[1]) is type(value)


@pytest.mark.parametrize("text", ["run.steps", "run.step=4", "steps=4"])
def test_bad_assignments(text: str) -> None:
    with pytest.raises(InputError):
        parse_assignment(text)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("run.steps", 0, "it must be greater than or equal to 1"),
        ("losses.perceptual", "vgg16", "must be 'efficientnet-lite0', 'vgg19' or 'none'"),
        ("optimiser.beta1", 1.0, "less than 1"),
        ("data.noise", 1.5, "less than or equal to 1"),
        ("losses.texture_weight", float("nan"), "a finite number"),
        ("speed.precision", "fp16", "'auto', 'fp32' or 'bf16'"),
        ("speed.device", "gpu", "device 'gpu'; it is cpu, mps, or cuda"),
        ("data.views", 1, "greater than or equal to 2"),
        (
            "model.variant",
            "wrap",
            "'full', 'no-int', 'ip', 'warp', 'warp-cond', 'texture-features', 'cbi' or 'dpt'",
        ),
        ("model.image_size", 60, r"\[model\]: image_size is 60"),
        ("data.background", "pinkish", "background"),
    ],
)
def test_impossible_values(name: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_config({name: check_value(name, value)})


def test_weights_to_start_from_decide_the_shape() -> None:
    given = ModelConfig(render_width=8)
    assert build_config({}, model=given).model == given
    assert build_config({"model.render_width": 8}, model=given).model == given
    with pytest.raises(InputError, match=r"model\.render_width is 16, but the weights .* have 8"):
        build_config({"model.render_width": 16}, model=given)
    for name in ("colour_margin", "clearance", "geometry"):
        changed = build_config({f"model.{name}": True}, model=given).model
        assert changed.to_dict() == {**given.to_dict(), name: True}


def test_the_stages_of_a_run() -> None:
    by_the_paper = build_config({"data.source": "pairs.csv", "run.steps": 200})
    assert by_the_paper.half_size_steps == 0
    assert by_the_paper.is_adversarial(0)
    on_people = build_config({"run.steps": 200})
    assert on_people.half_size_steps == 140
    judged = [on_people.is_adversarial(on_people.progress(step, 0)) for step in (0, 169, 170)]
    assert judged == [False, False, True]
    small = {"model.image_size": 24, "model.texture_size": 32}
    with pytest.raises(InputError, match=r"half of model\.image_size, 24, is no multiple of 8"):
        build_config(small)
    assert build_config({**small, "optimiser.half_size": 0}).half_size_steps == 0


def test_steps_or_the_clock_tell_how_far_a_run_is() -> None:
    by_steps = build_config({"run.steps": 8})
    assert [by_steps.progress(step, 1e9) for step in (0, 2, 8, 9)] == [0, 0.25, 1, 1]
    by_the_clock = build_config({"run.steps": 8, "run.minutes": 0.5})
    assert [by_the_clock.progress(99, seconds) for seconds in (0, 15, 30, 31)] == [0, 0.5, 1, 1]


def test_the_learning_rate_stays_then_falls_to_nothing() -> None:
    constant = build_config({"optimiser.learning_rate": 0.1})
    eighths = [number / 8 for number in range(9)]
    assert {constant.learning_rate(progress) for progress in eighths} == {0.1}
    falling = {"optimiser.learning_rate": 0.1, "optimiser.decay_from": 0.5}
    rates = [build_config(falling).learning_rate(progress) for progress in eighths]
    assert rates == pytest.approx([0.1] * 5 + [0.075, 0.05, 0.025, 0])
    whole = build_config({**falling, "optimiser.decay_from": 0})
    assert whole.learning_rate(0.5) == pytest.approx(0.05)


def test_the_stages_of_ip() -> None:
    assert not TrainConfig().is_inpainting(0)
    ip = build_config({"model.variant": "ip"})
    assert (ip.is_inpainting(0.49), ip.is_inpainting(0.5)) == (True, False)
    chosen = build_config({"model.variant": "ip", "optimiser.inpainting": 0.3})
    assert not chosen.is_inpainting(0.3)
