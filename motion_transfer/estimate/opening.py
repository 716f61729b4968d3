"""Which estimator: by name, ready to work, and known again by its content."""

from __future__ import annotations

from fractions import Fraction
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.model_files import MODEL_FILES, digest
from motion_transfer.version import __version__

if TYPE_CHECKING:
    from motion_transfer.estimate.proportions import BodyFit

ESTIMATORS = ("blazepose", "densepose")
DEFAULT_RATE = Fraction(30)


def check_estimator(name: str, model: Path | None) -> None:
    """Raises: InputError for an unknown estimator, or a model too many or too few."""
    if name not in ESTIMATORS:
        raise InputError(f"estimator {name!r}; supported are {', '.join(ESTIMATORS)}")
    if name == "densepose" and model is None:
        raise InputError(
            "the densepose estimator needs its model: a TorchScript or ONNX file, such as those of"
            " DensePose-TorchScript; name it"
        )
    if name == "blazepose" and model is not None:
        raise InputError(
            f"the blazepose estimator has its own models and does not use {model}; leave it out, or"
            " choose the densepose estimator"
        )


def open_estimator(
    name: str,
    model: Path | None,
    *,
    frame_rate: Fraction | None = None,
    threads: int = 1,
    fit: BodyFit | None = None,
) -> Estimator:
    """An estimator ready for a clip.

    Args:
        model: DensePose's file.
        frame_rate: of the clip, for smoothing; None: 30.
        threads: of BlazePose's networks.
        fit: other proportions for everybody; blazepose only.
    Raises: InputError for a fit of what has no landmarks; InputError and WeightsError where a model
        or a package is missing, saying how to get it.
    """
    check_estimator(name, model)
    if fit is not None and name != "blazepose":
        raise InputError(f"the {name} estimator gives no landmarks, so no body can be fitted")
    if name == "densepose" and model is not None:
        from motion_transfer.estimate.densepose import DensePoseEstimator

        return DensePoseEstimator(model)
    from motion_transfer.estimate.blazepose import BlazePoseEstimator

    rate = float(frame_rate or DEFAULT_RATE)
    return BlazePoseEstimator(frame_rate=rate, threads=threads, fit=fit)


def estimator_facts(name: str, model: Path | None) -> dict[str, Any]:
    """What decides an estimator's answers, for keys of content. Raises: InputError."""
    check_estimator(name, model)
    if model is not None:
        try:
            content = digest(model.read_bytes())
        except OSError as error:
            raise InputError(f"DensePose model {model} cannot be read: {error.strerror}") from error
        return {"estimator": name, "model": content, "version": __version__}
    from motion_transfer.estimate.iuv_weights import SHIPPED

    network = files("motion_transfer.estimate").joinpath(SHIPPED)
    return {
        "estimator": name,
        "models": [file.sha256 for file in MODEL_FILES],
        "network": digest(network.read_bytes()) if network.is_file() else None,
        "version": __version__,
    }
