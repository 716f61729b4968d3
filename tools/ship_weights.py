"""Take a training run's weights into the package: `python tools/ship_weights.py NAME RUN`.

Writes `motion_transfer/weights/NAME.safetensors` in float16, and what the run was into
`docs/weights/`: its settings as `NAME-N.toml`, its losses as rows of `NAME.csv`, all runs' curves
as `NAME.png`. A run with an `init` went on from the weights that ship, and is one more; a run
without replaces them and everything that was written of them. `mt calibrate NAME` then tells of
which ranges their numbers are, so that they are computed in 8 bits.
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

from motion_transfer.training.config import TrainConfig, build_config, read_settings, write_toml
from motion_transfer.weights.checkpoint import inspect_checkpoint, load_checkpoint, save_checkpoint

ROOT = Path(__file__).parents[1]
TERMS = ("perceptual", "head", "texture", "alpha", "adversarial", "discriminator")
WINDOW = 20  # logged values in a moving average

Row = dict[str, float | None]


def main(name: str, run: Path) -> None:
    docs = ROOT / "docs" / "weights"
    docs.mkdir(exist_ok=True)
    shipped = ROOT / "motion_transfer" / "weights" / f"{name}.safetensors"
    table = docs / f"{name}.csv"
    config = build_config(read_settings(run / "train.toml"))
    if config.run.init:
        rows = read_table(table)
        number, done = int(rows[-1]["run"] or 0) + 1, read_steps(shipped)
    else:
        for old in docs.glob(f"{name}-*.toml"):
            old.unlink()
        rows, number, done = [], 1, 0
    recipe = write_toml(forget_folders(config, f"{name}-{number - 1}" if number > 1 else ""))
    (docs / f"{name}-{number}.toml").write_text(recipe, encoding="utf-8")
    for step, losses in read_losses(run).items():
        rows.append({"run": number, "step": done + step, **losses})
    write_table(table, rows)
    draw_curves(docs / f"{name}.png", rows, find_marks(docs, name, rows))

    weights = run / "weights.safetensors"
    done += read_steps(weights)
    notes = {**inspect_checkpoint(weights).notes, "train.toml": recipe, "step": str(done)}
    save_checkpoint(shipped, load_checkpoint(weights), notes=notes, dtype=torch.float16)
    print(f"{shipped}: {shipped.stat().st_size / 1e6:.1f} MB, {done} steps")


def read_steps(weights: Path) -> int:
    return int(inspect_checkpoint(weights).notes["step"])


def forget_folders(config: TrainConfig, init: str) -> TrainConfig:
    """Take out of settings what means something on one machine only."""
    return replace(
        config,
        run=replace(config.run, init=init and f"{init}.safetensors"),
        data=replace(config.data, people_cache=""),
        keeping=replace(config.keeping, textures=""),
    )


def read_losses(run: Path) -> dict[int, Row]:
    """Read the losses that a run logged, by step; where it was resumed, the later log counts."""
    found: dict[int, Row] = {}
    for log in sorted((run / "tensorboard").rglob("events.*"), key=lambda path: path.name):
        events = EventAccumulator(str(log), size_guidance={"scalars": 0}).Reload()
        for tag in events.Tags()["scalars"]:
            term = tag.rpartition("/")[2]
            if term in TERMS:
                for event in events.Scalars(tag):
                    found.setdefault(event.step, {})[term] = event.value
    return dict(sorted(found.items()))


def find_marks(docs: Path, name: str, rows: list[Row]) -> list[int]:
    """Find the steps at which another run begins, or images grow."""
    marks, last = [], {int(row["run"] or 0): int(row["step"] or 0) for row in rows}
    begin = 0
    for number, end in last.items():
        config = build_config(read_settings(docs / f"{name}-{number}.toml"))
        marks += [begin, begin + config.half_size_steps]
        begin = end
    return marks[1:]


def read_table(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return [
            {name: float(value) if value else None for name, value in row.items()}
            for row in csv.DictReader(file)
        ]


def write_table(path: Path, rows: list[Row]) -> None:
    terms = [term for term in TERMS if any(term in row for row in rows)]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", "step", *terms])
        for row in rows:
            values = [row.get(term) for term in terms]
            words = ["" if value is None else f"{value:.4f}" for value in values]
            writer.writerow([f"{row['run']:.0f}", f"{row['step']:.0f}", *words])


def draw_curves(path: Path, rows: list[Row], marks: list[int]) -> None:
    terms = [term for term in TERMS if any(row.get(term) is not None for row in rows)]
    figure, panels = plt.subplots(1, len(terms), figsize=(4 * len(terms), 3), squeeze=False)
    for panel, term in zip(panels[0], terms, strict=True):
        steps, values = zip(
            *((row["step"], value) for row in rows if (value := row.get(term)) is not None),
            strict=True,
        )
        means = [
            sum(values[max(0, i - WINDOW + 1) : i + 1]) / min(i + 1, WINDOW)
            for i in range(len(values))
        ]
        panel.plot(steps, values, color="0.8", linewidth=0.8)
        panel.plot(steps, means, color="tab:blue")
        for mark in marks:
            panel.axvline(mark, color="0.5", linestyle=":")
        # the first steps of a run would make the rest of the curve flat
        panel.set(title=term, xlabel="step", ylim=(0, 2.5 * sorted(values)[len(values) // 2]))
    figure.tight_layout()
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
