"""RenderNet's fast path against eager float32 at batch 1, in one interleaved run.

    python benchmarks/network.py [--preset paper] [--size 256] [--rounds 9]

Prints, for each form, the first call (compiling), the median time a frame, the ratio to the
baseline and the error against float32 on random features (images lie in [-1, 1]).
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import torch
from torch import Tensor
from workload import random_model

from nhrr_core import FastRenderNet

Form = Callable[[Tensor], Tensor]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--preset", default="paper")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--batch", type=int, default=4)
    arguments = parser.parse_args()

    model = random_model(arguments.preset)
    net, channels = model.render_net, model.config.render_inputs
    features = torch.randn(arguments.batch, channels, arguments.size, arguments.size)
    with torch.inference_mode():
        exact = torch.cat([net(sample) for sample in features.split(1)])
        forms: dict[str, Form] = {}
        for name, winograd in (("fast, plain", False), ("fast, Winograd", True)):
            forms[name] = FastRenderNet(net, dtype=torch.bfloat16, winograd=winograd)
        for name, form in forms.items():
            began = time.perf_counter()
            error = form(features) - exact
            seconds = time.perf_counter() - began
            psnr = 10 * torch.log10(4 / error.pow(2).mean())
            print(
                f"{name}: first call {seconds:.0f} s, error mean {error.abs().mean():.4f}"
                f" max {error.abs().max():.3f}, PSNR {psnr:.1f} dB",
                flush=True,
            )
        compare(net, forms, features, arguments.rounds)


def compare(
    net: torch.nn.Module,
    forms: dict[str, Callable[[Tensor], Tensor]],
    features: Tensor,
    rounds: int,
) -> None:
    """Time the forms and the baseline in turns, so that noise falls on all of them alike."""
    seconds: dict[str, list[float]] = {"eager float32, batch 1": [], **{name: [] for name in forms}}
    for _ in range(rounds):
        for name, form in (("eager float32, batch 1", net), *forms.items()):
            batch = features[:1] if form is net else features
            began = time.perf_counter()
            form(batch)
            seconds[name].append((time.perf_counter() - began) / len(batch))
    medians = {name: statistics.median(times) for name, times in seconds.items()}
    baseline = medians["eager float32, batch 1"]
    for name, median in medians.items():
        print(
            f"{name}: median {median * 1e3:.0f} ms a frame"
            f" (fastest {min(seconds[name]) * 1e3:.0f}), {baseline / median:.2f}x"
        )


if __name__ == "__main__":
    main()
