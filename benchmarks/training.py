"""Training samples per second, against the plainest loop that does the same.

    python benchmarks/training.py [--preset lite] [--batch 4] [--rounds 3] [--compile] [--bf16]

Prints medians and their ratio, of one run:
* baseline: eager float32, weights and memory as torch has them by default, Adam by a loop;
* ours: what `mt train` does (channels-last, fused Adam, memory that is kept, bf16 where the
  hardware multiplies it).
Both make whole updates of generator and discriminator at 256 x 256, with the perceptual loss of
efficientnet-lite0, on one batch in memory.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from functools import partial

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch

import torch
from torch import Tensor

from motion_transfer.training.feature_networks import load_efficientnet_lite0
from motion_transfer.training.speed import arrange, choose_precision, keep_memory
from motion_transfer.training.step import (
    Arithmetic,
    Average,
    Batch,
    Generator,
    Judges,
    Players,
    set_stage,
    update,
)
from nhrr_core import Discriminator, LossWeights, ModelConfig, NeuralReRenderer


def make_batch(size: int, count: int) -> dict[str, Tensor]:
    """Random photos of a figure that fills the middle half of the picture."""
    torch.manual_seed(0)
    iuv = torch.randint(1, 25, (count, 3, size, size)).to(torch.uint8)
    iuv[..., : size // 4] = 0
    iuv[..., -size // 4 :] = 0
    batch: dict[str, Tensor] = {"target_iuv": iuv}
    for name in ("source_texture", "target_texture", "target_image"):
        batch[name] = torch.rand(count, 3, size, size) * 2 - 1
    for name in ("source_visibility", "target_visibility"):
        batch[name] = (torch.rand(count, 1, size, size) > 0.5).float()
    return batch


class Contender:
    """One way to train."""

    def __init__(self, preset: str, *, tuned: bool, dtype: torch.dtype, compile: bool) -> None:
        torch.manual_seed(0)
        config = ModelConfig.preset(preset)
        self.model = NeuralReRenderer(config)
        discriminator = Discriminator(
            image_channels=config.render_outputs, condition_channels=config.render_inputs
        )
        self.judges = Judges(load_efficientnet_lite0())
        if tuned:
            arrange(self.model.feature_net, self.model.render_net, discriminator)
            arrange(self.judges.perceptual)
        adam = partial(
            torch.optim.Adam,
            lr=2e-4,
            betas=(0.5, 0.999),
            fused=tuned,
            foreach=False if not tuned else None,
        )
        self.players = Players(
            Generator(self.model),
            adam(self.model.parameters()),
            discriminator,
            adam(discriminator.parameters()),
        )
        self.average = Average(deepcopy(self.model).requires_grad_(False), 0.999)
        if compile:
            for network in (self.model.feature_net, self.model.render_net, discriminator):
                if network is not None:
                    network.compile()

        def autocast() -> AbstractContextManager[None]:
            return torch.autocast("cpu", dtype) if dtype != torch.float32 else nullcontext()

        self.arithmetic = Arithmetic(autocast, Tensor.backward, lambda network: network)
        set_stage(self.model, inpainting=False)

    def seconds(self, batch: Batch) -> float:
        """Of one update."""
        began = time.perf_counter()
        update(batch, self.players, self.judges, LossWeights(), self.arithmetic, adversarial=True)
        self.average.update(self.model, 1)
        return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--preset", default="lite")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--bf16", action="store_true")
    options = parser.parse_args()
    batch = make_batch(256, options.batch)
    dtype = choose_precision("bf16" if options.bf16 else "auto", torch.device("cpu"))
    ours = Contender(options.preset, tuned=True, dtype=dtype, compile=options.compile)
    plain = Contender(options.preset, tuned=False, dtype=torch.float32, compile=False)

    def rates(contender: Contender) -> float:
        return options.batch / contender.seconds(batch)

    # memory that is kept would help the baseline as well: it goes first, and is not mixed
    rates(plain)
    slow = [rates(plain) for _ in range(options.rounds)]
    keep_memory()
    rates(ours)
    fast = [rates(ours) for _ in range(options.rounds)]
    for name, found in (("baseline", slow), ("ours", fast)):
        print(
            f"{name}: median {statistics.median(found):.3f} samples/s"
            f" ({min(found):.3f} to {max(found):.3f})"
        )
    print(f"ratio {statistics.median(fast) / statistics.median(slow):.2f}, {dtype}")


if __name__ == "__main__":
    main()
