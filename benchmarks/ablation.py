"""The paper's ablation, and other methods, at an equal, small budget: `docs/quality.md` tells it.

    mt people render --count 800 --views 4 --noise 0.5 --assets makehuman/ --out people/
    python benchmarks/ablation.py --people-cache people/ --assets makehuman/ -o ablation/
        [--steps 300] [--pairs 200] [--variants warp warp-cond] [--set model.geometry=false]

Trains the variants one after the other, each with the same seed, people, steps and losses (but
for those that a variant does not have), at 128 x 128, then scores them on held-out people at that
size: painted ones and, with assets, free ones. Started again, it goes on where it was stopped.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch.nn.functional as F

from motion_transfer.cli.main import main as mt
from motion_transfer.evaluation.options import FREE_PEOPLE
from motion_transfer.weights.checkpoint import (
    inspect_checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from nhrr_core import VARIANTS, NeuralReRenderer

SIDE = 128
PROTOCOLS = ("people", FREE_PEOPLE)
METRICS = ("ssim", "psnr", "efficientnet-lite0", "hidden")
SETTINGS = {
    "model.alpha": "true",
    "losses.identity": "none",
    "losses.adversarial": "false",
    "optimiser.learning_rate": 4e-4,
    "optimiser.ema_decay": 0.99,
    "optimiser.half_size": 1,
    "data.noise": 0.5,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--people-cache", type=Path, required=True)
    parser.add_argument("--assets", type=Path, help="folder of MakeHuman's")
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=VARIANTS)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    arguments.output.mkdir(exist_ok=True)
    changes = [f"{name}={value}" for name, value in SETTINGS.items()] + arguments.set
    if arguments.assets:
        changes.append(f"data.assets={arguments.assets}")
    weights = []
    for variant in arguments.variants:
        run = arguments.output / variant
        train(run, variant, arguments.people_cache, arguments.steps, changes)
        weights.append(arguments.output / f"{variant}.safetensors")
        halve(run / "weights.safetensors", weights[-1])
    for protocol in PROTOCOLS if arguments.assets else PROTOCOLS[:1]:
        call(
            *("eval", "--protocol", protocol, "--limit", arguments.pairs),
            *("--size", f"{SIDE}x{SIDE}", "--metrics", ",".join(METRICS)),
            *(("--assets", arguments.assets) if protocol == FREE_PEOPLE else ()),
            *(word for path in weights for word in ("--weights", path)),
            *("--renderer", "texture"),
            *("-o", arguments.output / protocol, "--force"),
        )


def train(run: Path, variant: str, people: Path, steps: int, changes: Sequence[str]) -> None:
    """Train one variant, or go on with it."""
    if run.exists():
        call("train", "--resume", run, "--steps", steps)
        return
    count = sum(1 for entry in people.iterdir() if entry.is_dir())
    changes = [*changes, f"keeping.textures={run.with_name('textures')}"]
    call(
        *("train", "--preset", "lite", "--variant", variant, "--steps", steps, "-o", run),
        *("--data", "people", "--people", count, "--people-cache", people),
        *(f"--set={change}" for change in changes),
    )


def halve(trained: Path, output: Path) -> None:
    """The same weights, for the size that they were trained at."""
    info = inspect_checkpoint(trained)
    model = NeuralReRenderer(replace(info.config, image_size=SIDE, texture_size=SIDE))
    state = load_checkpoint(trained).state_dict()
    if "prior" in state:
        state["prior"] = F.adaptive_avg_pool2d(state["prior"], SIDE)  # as it was read
    model.load_state_dict(state)
    save_checkpoint(output, model, notes=info.notes)


def call(*words: object) -> None:
    """`mt`, which says itself what went wrong."""
    if code := mt([str(word) for word in words]):
        raise SystemExit(code)


if __name__ == "__main__":
    main()
