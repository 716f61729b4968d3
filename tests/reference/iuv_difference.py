"""How far one IUV is from another of the same picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8


@dataclass(frozen=True)
class IuvDifference:
    """What two IUVs of one picture share.

    Attributes:
        iou: Intersection over union of the silhouettes, 0..1; 1 where both are empty.
        part_agreement: Share of the pixels in both silhouettes that have the same part; nan where
            there are none.
        median_uv_error: Median distance of (U, V) in units of a chart, 0..sqrt(2), over the pixels
            with the same part; nan where there are none.
    """

    iou: float
    part_agreement: float
    median_uv_error: float


def iuv_difference(
    reference: UInt8[np.ndarray, "H W 3"], other: UInt8[np.ndarray, "H W 3"]
) -> IuvDifference:
    """Compare two IUVs, channels (I, U, V). Raises: ValueError where the shapes differ."""
    if reference.shape != other.shape:
        raise ValueError(
            f"IUVs of one picture have one shape, not {reference.shape} and {other.shape}"
        )
    first, second = reference[..., 0] > 0, other[..., 0] > 0
    both, either = int((first & second).sum()), int((first | second).sum())
    same = first & (reference[..., 0] == other[..., 0])
    gap = (reference[same][:, 1:].astype(np.float32) - other[same][:, 1:]) / 255
    return IuvDifference(
        iou=both / either if either else 1.0,
        part_agreement=int(same.sum()) / both if both else float("nan"),
        median_uv_error=float(np.median(np.hypot(*gap.T))) if len(gap) else float("nan"),
    )
