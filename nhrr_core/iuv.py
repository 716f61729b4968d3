"""The IUV convention.

Convention: an IUV image is uint8, channels (I, U, V). I in 0..24 is the part, 0 the background.
U and V are chart coordinates in [0, 1], scaled by 255. Left and right are the person's own.
Source: DensePose (Güler et al., CVPR 2018).
"""

from __future__ import annotations

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nhrr_core.errors import IuvError, ShapeError
from nhrr_core.parts import PART_COUNT


def check_iuv(iuv: Tensor) -> None:
    """Hold a tensor to the convention.

    Raises: ShapeError unless it is B x 3 x H x W; IuvError unless it is uint8 with every part index
        at most 24.
    """
    if iuv.ndim != 4 or iuv.shape[1] != 3:
        raise ShapeError(f"an IUV tensor is B x 3 x H x W, not {list(iuv.shape)}")
    if iuv.dtype != torch.uint8:
        raise IuvError(f"an IUV tensor is uint8, not {iuv.dtype}")
    highest = int(iuv[:, 0].max()) if iuv.numel() else 0
    if highest > PART_COUNT:
        raise IuvError(f"part index {highest} found; parts are 1 to {PART_COUNT}, 0 is background")


def keep_parts(iuv: UInt8[Tensor, "B 3 H W"], parts: tuple[int, ...]) -> UInt8[Tensor, "B 3 H W"]:
    """Turn every pixel of another part into background, (0, 0, 0)."""
    allowed = torch.zeros(256, dtype=torch.uint8, device=iuv.device)
    allowed[list(parts)] = 1
    return iuv * allowed[iuv[:, :1].long()]


def normalise_iuv(iuv: UInt8[Tensor, "B 3 H W"]) -> Float[Tensor, "B 3 H W"]:
    """Bring I / 24, U / 255 and V / 255 to [-1, 1] each, as network input."""
    scale = torch.tensor([2 / PART_COUNT, 2 / 255, 2 / 255], device=iuv.device)
    return iuv * scale[:, None, None] - 1
