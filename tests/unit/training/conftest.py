"""Inputs that the tests of training share, and tiny runs on painted people."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

TINY: dict[str, Any] = {
    "model.feature_width": 4,
    "model.render_width": 4,
    "model.residual_blocks": 1,
    "model.image_size": 64,
    "model.texture_size": 64,
    "losses.perceptual": "none",
    "losses.identity": "none",
    "losses.discriminator_width": 4,
    "losses.discriminator_scales": 1,
    "optimiser.batch_size": 2,
    "speed.workers": 0,
    "keeping.tensorboard": False,
    "keeping.log_every": 1,
    "keeping.samples": 2,
}


@pytest.fixture(autouse=True)
def seed() -> None:
    torch.manual_seed(0)


@pytest.fixture
def paint_pairs(studio) -> Callable[..., Path]:
    """Writes a list of pairs: each a person of other colours, who stands elsewhere as target."""

    def paint(count: int = 3, *, alpha: bool = True) -> Path:
        random = np.random.default_rng(0)
        lines = ["source,target"]
        for number in range(count):
            hues = random.integers(0, 255, (4, 3))
            parts = ((2,), (9, 10, 13, 14, 5, 6), (15, 16, 19, 20, 3, 4), (23, 24))
            colours = dict(zip(parts, map(tuple, hues), strict=True))
            for view in range(2):
                iuv = studio.iuv(3 * view + number % 3, 2 * view)
                stem = f"photos/{number}_{view}"
                studio.image(f"{stem}.png", studio.dress(iuv, colours))
                studio.image(f"{stem}_IUV.png", iuv)
                if alpha:
                    studio.image(f"{stem}_alpha.png", (iuv[..., 0] > 0).astype(np.uint8) * 255)
            lines.append(f"{number}_0.png,{number}_1.png")
        path = studio.folder / "photos/pairs.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return paint


@pytest.fixture
def settings() -> dict[str, Any]:
    """Of a run that takes no time."""
    return dict(TINY)
