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
    from motion_transfer.estimate.interface import Box, Estimator, Landmarks, PersonEstimate
    from motion_transfer.estimate.opening import open_estimator
    from motion_transfer.estimate.run import EstimateOptions, EstimateReport, estimate_iuv

_HOMES = {
    "BlazePoseEstimator": "blazepose",
    "Box": "interface",
    "ClipSummary": "clip",
    "DensePoseEstimator": "densepose",
    "EstimateOptions": "run",
    "EstimateReport": "run",
    "Estimator": "interface",
    "Landmarks": "interface",
    "PersonEstimate": "interface",
    "estimate_clip": "clip",
    "estimate_iuv": "run",
    "open_estimator": "opening",
}

__all__ = [
    "BlazePoseEstimator",
    "Box",
    "ClipSummary",
    "DensePoseEstimator",
    "EstimateOptions",
    "EstimateReport",
    "Estimator",
    "Landmarks",
    "PersonEstimate",
    "estimate_clip",
    "estimate_iuv",
    "open_estimator",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
