"""Drivers and checkpoints that the benchmarks share, made once into a folder of the caller's."""

from __future__ import annotations

from itertools import cycle, islice
from pathlib import Path

import cv2
import numpy as np
import torch

from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.weights import SHIPPED, find_weights
from motion_transfer.weights.checkpoint import save_checkpoint
from nhrr_core import ModelConfig, NeuralReRenderer

DEMO = Path(__file__).parents[1] / "motion_transfer" / "demo"
SOURCE = DEMO / "source.png"
SIDE = 256  # px of the frames


def driver_folder(folder: Path, frame_count: int) -> Path:
    """The demo's motion as 256 x 256 PNG frames, repeated up to a length."""
    path = folder / f"driver_{frame_count}"
    if not path.exists():
        path.mkdir(parents=True)
        for index, iuv in enumerate(islice(cycle(demo_crops(SIDE)), frame_count)):
            cv2.imwrite(str(path / f"{index:05d}_IUV.png"), iuv)  # RGB = V, U, I
    return path


def demo_crops(size: int) -> list[np.ndarray]:
    """The demo's frames, square and of that side, px."""
    reader = open_reader(open_stream(DEMO / "driver.mkv"))
    return [
        cv2.resize(iuv, (size, size), interpolation=cv2.INTER_NEAREST_EXACT)
        for iuv in reader.read(0, reader.stream.frame_count)
    ]


def weights_of(folder: Path, preset: str) -> Path:
    """A preset's weights: those that ship, whose frames look to an encoder as users' do, or random
    ones, which are the same work for the network."""
    return find_weights(Path(preset)) if preset in SHIPPED else random_checkpoint(folder, preset)


def random_model(preset: str) -> NeuralReRenderer:
    """A seeded model of a preset with Pix2PixHD's initialisation, normal(0, 0.02)."""
    torch.manual_seed(0)
    model = NeuralReRenderer(ModelConfig.preset(preset)).eval()
    for parameter in model.render_net.parameters():
        if parameter.ndim == 4:
            torch.nn.init.normal_(parameter, 0, 0.02)
    return model


def random_checkpoint(folder: Path, preset: str) -> Path:
    """`random_model` as a file."""
    path = folder / f"{preset}.safetensors"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        save_checkpoint(path, random_model(preset), notes={"data": "random"}, dtype=torch.float16)
    return path
