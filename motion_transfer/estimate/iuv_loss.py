"""What the IUV network is trained on, and how its answers are scored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn import functional as F

from motion_transfer.estimate.iuv_network import PARTS, IuvLogits

UV_WEIGHT = 5.0
SMALL_PARTS = 0.3
"""Parts weigh their mean area to the power of minus this: hands and feet count too."""

PART_AREAS = (
    *(0.72, 0.029, 0.033, 0.003, 0.003, 0.004, 0.004),
    *(0.010, 0.010, 0.012, 0.012, 0.010, 0.010, 0.010, 0.010),
    *(0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.006, 0.017, 0.017),
)
"""Shares of the window, roughly, over the training people."""


def iuv_loss(logits: IuvLogits, iuv: UInt8[Tensor, "B 128 128 3"]) -> dict[str, Float[Tensor, ""]]:
    """Cross-entropy of parts; l1 of U and V on the true part where somebody is."""
    part = iuv[..., 0].long()
    weights = torch.tensor(PART_AREAS) ** -SMALL_PARTS
    parts = F.cross_entropy(logits.parts, part, weights / weights.mean())
    body = part > 0
    batch, rows, columns = body.nonzero(as_tuple=True)
    chosen = logits.uv.permute(0, 3, 4, 1, 2)[batch, rows, columns, part[body] - 1]
    uv = (chosen - iuv[..., 1:][body].float() / 255).abs().mean()
    return {"parts": parts, "uv": uv, "total": parts + UV_WEIGHT * uv}


@dataclass(frozen=True)
class IuvScore:
    """How near an IUV image is to another.

    Attributes:
        iou: intersection over union of the persons.
        part_agreement: share of the pixels in both persons with the same part.
        uv_error: median of |U - U'| and |V - V'| where the part is the same, 0..1.
        swapped: share of the pixels in both persons whose part is the other side's.
        turned: share of the trunk's pixels in both that are front in one and back in the other.
    """

    iou: float
    part_agreement: float
    uv_error: float
    swapped: float
    turned: float


OTHER_SIDE = np.arange(PARTS)
for _left, _right in ((3, 4), (5, 6), (7, 8), (9, 10), (11, 12), (13, 14)):
    OTHER_SIDE[[_left, _right]] = _right, _left
for _left, _right in ((15, 16), (17, 18), (19, 20), (21, 22), (23, 24)):
    OTHER_SIDE[[_left, _right]] = _right, _left


def score_iuv(found: UInt8[np.ndarray, "H W 3"], true: UInt8[np.ndarray, "H W 3"]) -> IuvScore:
    """Compare two IUV images of one person. NaN where there is nothing to compare."""
    mine, yours = found[..., 0], true[..., 0]
    both, either = (mine > 0) & (yours > 0), (mine > 0) | (yours > 0)
    same = both & (mine == yours)
    other = both & (mine == OTHER_SIDE[yours]) & (OTHER_SIDE[yours] != yours)
    trunk = both & (mine <= 2) & (yours <= 2)
    away = np.abs(found[same][:, 1:].astype(int) - true[same][:, 1:])
    return IuvScore(
        iou=_share(both, either),
        part_agreement=_share(same, both),
        uv_error=float(np.median(away)) / 255 if same.any() else float("nan"),
        swapped=_share(other, both),
        turned=_share(trunk & (mine != yours), trunk),
    )


def _share(of: np.ndarray, whole: np.ndarray) -> float:
    return float(of.sum() / whole.sum()) if whole.any() else float("nan")
