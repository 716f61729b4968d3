"""From raw pictures to people: where they are, their landmarks, alpha and IUV.

Public names are loaded when they are first used: asking where the models lie needs no network.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motion_transfer.estimate.blazepose import BlazePoseEstimator
    from motion_transfer.estimate.clip import ClipSummary, estimate_clip
    from motion_transfer.estimate.densepose import DensePoseEstimator
    from motion_transfer.estimate.frames import estimate_frames
    from motion_transfer.estimate.interface import Estimator, Landmarks, PersonEstimate
    from motion_transfer.estimate.opening import open_estimator
    from motion_transfer.estimate.run import EstimateOptions, EstimateReport, estimate_iuv

__all__ = [
    "BlazePoseEstimator", "ClipSummary", "DensePoseEstimator", "EstimateOptions", "EstimateReport",
    "Estimator", "Landmarks", "PersonEstimate", "estimate_clip", "estimate_frames", "estimate_iuv",
    "open_estimator",
]  # fmt: skip

_NAMES_OF = {
    "blazepose": "BlazePoseEstimator",
    "clip": "ClipSummary estimate_clip",
    "densepose": "DensePoseEstimator",
    "frames": "estimate_frames",
    "interface": "Estimator Landmarks PersonEstimate",
    "opening": "open_estimator",
    "run": "EstimateOptions EstimateReport estimate_iuv",
}


def __getattr__(name: str) -> Any:
    for home, names in _NAMES_OF.items():
        if name in names.split():
            return getattr(import_module(f"{__name__}.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
