"""From the network's logits to an IUV image at the frame's own resolution."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import Float, Float32, Int, UInt8
from torch import Tensor

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.iuv.network import IuvLogits

FINEST = 768
"""Larger windows are painted at this size, px, and enlarged: memory stays bounded, and 128 x 128
logits hold no finer borders."""


def paint_iuv(logits: IuvLogits, window: Box, box: Box) -> UInt8[np.ndarray, "h w 3"]:
    """Paint IUV on a box of the frame, from the logits of one person (B = 1) in a window.

    Parts are decided after enlarging their logits, so that borders are smooth; U and V are
    interpolated within each part and never across a border. Where the box reaches beyond the
    window, nobody is.
    """
    size = min(window.width, FINEST)
    parts = enlarge_parts(logits.parts[0].numpy(), size)
    rows, columns = torch.nonzero(torch.from_numpy(parts), as_tuple=True)
    which = torch.from_numpy(parts)[rows, columns].long()
    # a border of nobody around it, for pixels beyond the window
    iuv = np.zeros((size + 2, size + 2, 3), np.uint8)
    uv = interpolate_within(logits.uv[0], which - 1, rows, columns, size)
    values = torch.cat([which[:, None], (uv.clamp(0, 1) * 255).round().long()], 1)
    iuv[rows.numpy() + 1, columns.numpy() + 1] = values.to(torch.uint8).numpy()
    spans = (box.top, box.bottom, window.top), (box.left, box.right, window.left)
    nearest = [
        np.floor((np.arange(first, last) + 0.5 - start) * (size / window.width)).astype(int) + 1
        for first, last, start in spans
    ]
    return iuv[nearest[0].clip(0, size + 1)[:, None], nearest[1].clip(0, size + 1)]


def enlarge_parts(
    logits: Float32[np.ndarray, "25 h w"], size: int
) -> UInt8[np.ndarray, "size size"]:
    """Find the part with the highest logit at each pixel of a size x size picture."""
    # one part after the other: an argmax over a stack of enlarged ones reads across its planes,
    # which is slower, and the stack takes memory
    best = cv2.resize(logits[0], (size, size), interpolation=cv2.INTER_LINEAR)
    parts = np.zeros((size, size), np.uint8)
    for part, plane in enumerate(logits[1:], 1):
        enlarged = cv2.resize(plane, (size, size), interpolation=cv2.INTER_LINEAR)
        np.copyto(parts, np.uint8(part), where=enlarged > best)
        cv2.max(best, enlarged, dst=best)
    return parts


def interpolate_within(
    uv: Float[Tensor, "24 2 h w"],
    chart: Int[Tensor, " N"],
    rows: Int[Tensor, " N"],
    columns: Int[Tensor, " N"],
    size: int,
) -> Float[Tensor, "N 2"]:
    """Look up U and V of one chart each at pixels of a size x size picture.

    Bilinear between the low resolution's pixel centres, clamped at the edge.
    """
    height, width = uv.shape[-2:]
    y = ((rows + 0.5) * (height / size) - 0.5).clamp(0, height - 1)
    x = ((columns + 0.5) * (width / size) - 0.5).clamp(0, width - 1)
    top, left = y.long().clamp_max(height - 2), x.long().clamp_max(width - 2)
    down, right = (y - top)[:, None], (x - left)[:, None]
    table = uv.permute(0, 2, 3, 1).reshape(-1, 2)
    first = (chart * height + top) * width + left
    above = torch.lerp(table[first], table[first + 1], right)
    below = torch.lerp(table[first + width], table[first + width + 1], right)
    return torch.lerp(above, below, down)
