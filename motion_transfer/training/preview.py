"""Sample grids: the same few pairs drawn again and again, so that progress can be seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.render.options import parse_colour
from motion_transfer.training.pairs import Pair
from motion_transfer.training.samples import (
    BEYOND_THE_PHOTO,
    TrainingSamples,
    cut_picture,
    person_window,
)
from nhrr_core import NeuralReRenderer

Image = UInt8[np.ndarray, "H W 3"]

GAP_PX = 4


@dataclass(frozen=True)
class PreviewPair:
    """A pair that is shown: the source's photo as large as the target, and the sample."""

    photo: Image
    sample: dict[str, Tensor]


def choose_previews(
    pairs: Sequence[Pair], samples: TrainingSamples, count: int, size: int
) -> list[PreviewPair]:
    """A few pairs spread evenly over all; of an endless set the first ones.

    Raises: InputError as `TrainingSamples`.
    """
    number = min(count, len(pairs))
    stride = 1 if getattr(pairs, "endless", False) else len(pairs) // number
    chosen = []
    for index in range(number):
        pair = pairs[index * stride]
        source = pair.source.load()
        photo = cut_picture(person_window(source), source.rgb, size, BEYOND_THE_PHOTO)
        chosen.append(PreviewPair(photo, samples.load(pair)))
    return chosen


@torch.no_grad()
def draw_grid(
    model: NeuralReRenderer, previews: Sequence[PreviewPair], background: str, device: torch.device
) -> Image:
    """A row for each pair: source, what was drawn, and the target.

    A drawing with alpha lies over the background, as the target does. The model is left in the mode
    it was in.
    """
    mode = model.training
    model.eval()
    rows = []
    colour = np.array(parse_colour(background) or BEYOND_THE_PHOTO, np.float32)
    for preview in previews:
        sample = {name: value[None].to(device) for name, value in preview.sample.items()}
        feature_map = model.encode_texture(
            sample["source_texture"], sample["source_visibility"], sample.get("source_clearance")
        )
        drawn = _pixels(model.render(feature_map, sample["target_iuv"])[0])
        if drawn.shape[-1] == 4:
            weight = drawn[..., 3:] / 255
            drawn = drawn[..., :3] * weight + colour * (1 - weight)
        rows.append(_join([preview.photo, drawn, _pixels(sample["target_image"][0])], axis=1))
    model.train(mode)
    return _join(rows, axis=0)


def _pixels(image: Tensor) -> np.ndarray:
    return ((image.float().clamp(-1, 1) + 1) * 127.5).permute(1, 2, 0).cpu().numpy()


def _join(images: Sequence[np.ndarray], axis: int) -> Image:
    gap_shape = list(images[0].shape)
    gap_shape[axis] = GAP_PX
    gap = np.full(gap_shape, 255, np.uint8)
    pieces = [piece.round().astype(np.uint8) for image in images for piece in (image, gap)]
    return np.concatenate(pieces[:-1], axis=axis)
