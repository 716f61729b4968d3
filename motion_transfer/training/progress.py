"""How a run can be followed: events, and grids of drawn samples.

A grid shows the same few pairs each time, so that progress can be seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.drawing.window import BEYOND_THE_PHOTO, cut_picture
from motion_transfer.events import Notice
from motion_transfer.option import parse_colour
from motion_transfer.training.pairs import Pairs
from motion_transfer.training.samples import (
    TrainingSamples,
    person_window,
)
from nhrr_core import NeuralReRenderer

Image = UInt8[np.ndarray, "H W 3"]

Preview = tuple[Image, dict[str, Tensor]]
"""A source's photo, as large as the target, and the sample of the pair."""

GAP_PX = 4  # white, between the pictures of a grid


@dataclass(frozen=True)
class Logged:
    """Some steps are done.

    Attributes:
        steps: In all; None where the clock ends the run.
        terms: The losses of the last step, not weighted; `total` is their weighted sum.
        wait_share: The share of the time since the last such event that was spent waiting for data.
        progress: The share of the run that is done.
    """

    step: int
    steps: int | None
    terms: Mapping[str, float]
    samples_per_second: float
    wait_share: float
    progress: float = 0.0


Event = Logged | Notice
Listener = Callable[[Event], None]


@dataclass(frozen=True)
class TrainResult:
    """How a run ended.

    Attributes:
        stopped: Whether it was asked to stop, before its end.
        progress: The share of the run that is done.
        weights: The exported file.
    """

    step: int
    stopped: bool
    progress: float
    weights: Path
    samples_per_second: float
    wait_share: float


def choose_previews(pairs: Pairs, samples: TrainingSamples, count: int, size: int) -> list[Preview]:
    """Choose a few pairs spread evenly over all; of an endless set the first ones.

    Raises: InputError as `TrainingSamples` does.
    """
    number = min(count, len(pairs))
    stride = 1 if pairs.endless else len(pairs) // number
    chosen = []
    for pair in (pairs[index * stride] for index in range(number)):
        source = pair.source.load()
        photo = cut_picture(person_window(source), source.rgb, size, BEYOND_THE_PHOTO)
        chosen.append((photo, samples.load(pair)))
    return chosen


@torch.no_grad()
def draw_grid(
    model: NeuralReRenderer, previews: Sequence[Preview], background: str, device: torch.device
) -> Image:
    """Draw a row for each pair: source, what the model makes of it, and the target.

    A drawing with alpha lies over the background, as the target does. The model is left in the mode
    it was in.
    """
    mode = model.training
    model.eval()
    rows = []
    colour = np.array(parse_colour(background) or BEYOND_THE_PHOTO, np.float32)
    for photo, tensors in previews:
        sample = {name: value[None].to(device) for name, value in tensors.items()}
        feature_map = model.encode_texture(
            sample["source_texture"],
            sample["source_visibility"],
            sample.get("source_clearance"),
            sample.get("source_pictures"),
        )
        drawn = _pixels(model.render(feature_map, sample["target_iuv"])[0])
        if drawn.shape[-1] == 4:
            weight = drawn[..., 3:] / 255
            drawn = drawn[..., :3] * weight + colour * (1 - weight)
        rows.append(_join([photo, drawn, _pixels(sample["target_image"][0])], axis=1))
    model.train(mode)
    return _join(rows, axis=0)


def _pixels(image: Tensor) -> np.ndarray:
    """H x W x C of 0..255, not rounded yet, from C x H x W in [-1, 1]."""
    return ((image.float().clamp(-1, 1) + 1) * 127.5).permute(1, 2, 0).cpu().numpy()


def _join(images: Sequence[np.ndarray], axis: int) -> Image:
    gap_shape = list(images[0].shape)
    gap_shape[axis] = GAP_PX
    gap = np.full(gap_shape, 255, np.uint8)
    pieces = [piece.round().astype(np.uint8) for image in images for piece in (image, gap)]
    return np.concatenate(pieces[:-1], axis=axis)
