"""Slow, obvious versions of the losses: one number at a time, formulas as the paper writes them."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def discriminator_loss_loops(real: list[Tensor], fake: list[Tensor]) -> Tensor:
    """Half the sum over scales of -log s(real) and -log(1 - s(fake)), each a mean over patches."""
    total = torch.zeros((), dtype=torch.float64)
    for logits in real:
        total = total + _mean([-torch.log(_logistic(x)) for x in logits.flatten()])
    for logits in fake:
        total = total + _mean([-torch.log(1 - _logistic(x)) for x in logits.flatten()])
    return total / 2


def adversarial_loss_loops(fake: list[Tensor]) -> Tensor:
    total = torch.zeros((), dtype=torch.float64)
    for logits in fake:
        total = total + _mean([-torch.log(_logistic(x)) for x in logits.flatten()])
    return total


def perceptual_loss_loops(
    generated: list[Tensor], truth: list[Tensor], weights: list[float]
) -> Tensor:
    total = torch.zeros((), dtype=torch.float64)
    for j in range(len(weights)):
        pairs = zip(generated[j].flatten(), truth[j].flatten(), strict=True)
        total = total + weights[j] * _mean([_absolute(a - b) for a, b in pairs])
    return total


def texture_loss_loops(
    feature_map: Tensor, source: tuple[Tensor, Tensor], target: tuple[Tensor, Tensor]
) -> Tensor:
    """Two means, each over the three colours of every texel with visibility 1."""
    total = torch.zeros((), dtype=torch.float64)
    batch, _, rows, columns = feature_map.shape
    for texture, visibility in (source, target):
        distances = []
        for b in range(batch):
            for row in range(rows):
                for column in range(columns):
                    if visibility[b, 0, row, column] == 1:
                        for colour in range(3):
                            ours = feature_map[b, colour, row, column]
                            distances.append(_absolute(ours - texture[b, colour, row, column]))
        total = total + _mean(distances)
    return total


def face_identity_loss_loops(generated: Tensor, truth: Tensor, seen: Tensor) -> Tensor:
    """Mean over the images with a face of the mean over the embedding."""
    images = []
    for b in range(len(seen)):
        if seen[b]:
            images.append(_mean([_absolute(x) for x in generated[b] - truth[b]]))
    return _mean(images)


def crop_boxes_loops(image: Tensor, boxes: Tensor, size: tuple[int, int]) -> Tensor:
    """A weighted mean of pixels a sample: the weight falls linearly with the distance to it."""
    batch, channels, height, width = image.shape
    out = torch.zeros(batch, channels, *size, dtype=image.dtype)
    for b in range(batch):
        left, top, right, bottom = boxes[b].tolist()
        for row in range(size[0]):
            down = _weights(top, bottom, row, size[0], height)
            for column in range(size[1]):
                across = _weights(left, right, column, size[1], width)
                value = torch.zeros(channels, dtype=image.dtype)
                for y, a in down.items():
                    for x, c in across.items():
                        value = value + a * c * image[b, :, y, x]
                out[b, :, row, column] = value
    return out


def _weights(low: float, high: float, index: int, count: int, length: int) -> dict[int, float]:
    """Weight of each pixel along one axis, those of weight 0 left out."""
    step = (high - low) / count
    place = low + (index + 0.5) * step
    place = min(max(place, 0.5), length - 0.5)
    weights = {}
    for pixel in range(length):
        weight = 1 - abs(pixel + 0.5 - place) / max(step, 1.0)
        if weight > 0:
            weights[pixel] = weight
    total = math.fsum(weights.values())
    return {pixel: weight / total for pixel, weight in weights.items()}


def _logistic(x: Tensor) -> Tensor:
    return 1 / (1 + torch.exp(-x))


def _absolute(x: Tensor) -> Tensor:
    return x if x >= 0 else -x


def _mean(values: list[Tensor]) -> Tensor:
    if not values:
        return torch.zeros((), dtype=torch.float64)
    return sum(values[1:], values[0]) / len(values)
