"""Take training runs' weights into the package: `python tools/ship_weights.py NAME RUN [RUN...]`.

Each run began with the weights of the one before. Writes `motion_transfer/weights/NAME.safetensors`
in float16, and what the runs were into `docs/weights/`: `NAME-1.toml`... (every setting),
`NAME.csv` (their losses) and `NAME.png` (the curves).
Needs the `train` extra and matplotlib.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from motion_transfer.training.config import TrainConfig
from motion_transfer.training.config_file import build_config, read_settings, write_toml
from motion_transfer.weights.checkpoint import inspect_checkpoint, load_checkpoint, save_checkpoint

ROOT = Path(__file__).parents[1]
TERMS = ("perceptual", "texture", "alpha", "adversarial", "discriminator")
WINDOW = 20  # logged values in a moving average

Curve = list[tuple[int, float]]


def main(name: str, runs: list[Path]) -> None:
    docs = ROOT / "docs" / "weights"
    docs.mkdir(exist_ok=True)
    curves: dict[str, Curve] = {}
    marks, recipe, done = [], "", 0
    for number, run in enumerate(runs, 1):
        config = build_config(read_settings(run / "train.toml"))
        recipe = write_toml(forget_folders(config, f"{name}-{number - 1}" if recipe else ""))
        (docs / f"{name}-{number}.toml").write_text(recipe)
        marks += [done, done + config.half_size_steps]
        for term, curve in read_curves(run).items():
            curves.setdefault(term, []).extend((done + step, value) for step, value in curve)
        done += int(inspect_checkpoint(run / "weights.safetensors").notes["step"])
    write_table(docs / f"{name}.csv", curves)
    draw_curves(docs / f"{name}.png", curves, marks[1:])

    weights = runs[-1] / "weights.safetensors"
    notes = {**inspect_checkpoint(weights).notes, "train.toml": recipe, "step": str(done)}
    shipped = ROOT / "motion_transfer" / "weights" / f"{name}.safetensors"
    save_checkpoint(shipped, load_checkpoint(weights), notes=notes, dtype=torch.float16)
    print(f"{shipped}: {shipped.stat().st_size / 1e6:.1f} MB, {done} steps")


def forget_folders(config: TrainConfig, init: str) -> TrainConfig:
    """The settings without what means something on one machine only."""
    return replace(
        config,
        run=replace(config.run, init=init and f"{init}.safetensors"),
        data=replace(config.data, people_cache=""),
        keeping=replace(config.keeping, textures=""),
    )


def read_curves(run: Path) -> dict[str, Curve]:
    """The losses that a run logged; where it was resumed, the later log counts."""
    found: dict[str, dict[int, float]] = {}
    for log in sorted((run / "tensorboard").rglob("events.*"), key=lambda path: path.name):
        events = EventAccumulator(str(log), size_guidance={"scalars": 0}).Reload()
        for tag in events.Tags()["scalars"]:
            if tag.rpartition("/")[2] in TERMS:
                values = {event.step: event.value for event in events.Scalars(tag)}
                found.setdefault(tag.rpartition("/")[2], {}).update(values)
    return {term: sorted(found[term].items()) for term in TERMS if term in found}


def write_table(path: Path, curves: dict[str, Curve]) -> None:
    table = {term: dict(curve) for term, curve in curves.items()}
    steps = sorted(set().union(*table.values()))
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["step", *table])
        for step in steps:
            values = [table[term].get(step) for term in table]
            writer.writerow([step, *("" if value is None else f"{value:.4f}" for value in values)])


def draw_curves(path: Path, curves: dict[str, Curve], marks: list[int]) -> None:
    figure, panels = plt.subplots(1, len(curves), figsize=(4 * len(curves), 3), squeeze=False)
    for panel, (term, curve) in zip(panels[0], curves.items(), strict=True):
        steps, values = zip(*curve, strict=True)
        means = [
            sum(values[max(0, i - WINDOW + 1) : i + 1]) / min(i + 1, WINDOW)
            for i in range(len(values))
        ]
        panel.plot(steps, values, color="0.8", linewidth=0.8)
        panel.plot(steps, means, color="tab:blue")
        for mark in marks:
            panel.axvline(mark, color="0.5", linestyle=":")
        panel.set(title=term, xlabel="step", ylim=(0, 2.5 * sorted(values)[len(values) // 2]))
    figure.tight_layout()
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main(sys.argv[1], [Path(run) for run in sys.argv[2:]])
