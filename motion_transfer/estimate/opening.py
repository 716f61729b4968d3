"""Which estimators there are: a table, light to import, and what opens one of them by name.

A new estimator is one module and one row here. What a row names is loaded when it is needed, so
that options can be described and checked without the libraries that do the work.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.errors import InputError
from motion_transfer.version import __version__

if TYPE_CHECKING:
    from motion_transfer.estimate.blazepose.retarget import BodyFit
    from motion_transfer.estimate.interface import Estimator

DEFAULT_RATE = Fraction(30)


@dataclass(frozen=True)
class EstimatorEntry:
    """One way to find people in raw pictures.

    Attributes:
        home: The module and the class in it. The module also has `model_facts(model)`, which tells
            what decides the answers, for keys of content.
        takes: What the class is made with; `fit` only if it gives landmarks.
        always: What the class, and `model_facts`, are given besides.
        model_kind: What kind of file `model` has to be; empty where the estimator brings its own.
    """

    home: tuple[str, str]
    takes: tuple[str, ...]
    always: Mapping[str, Any] = field(default_factory=dict)
    model_kind: str = ""


ESTIMATORS = {
    "blazepose": EstimatorEntry(
        ("motion_transfer.estimate.blazepose", "BlazePoseEstimator"),
        takes=("frame_rate", "fit", "for_photos"),
    ),
    "blazepose-heavy": EstimatorEntry(
        ("motion_transfer.estimate.blazepose", "BlazePoseEstimator"),
        takes=("frame_rate", "fit", "for_photos"),
        always={"heavy": True},
    ),
    "densepose": EstimatorEntry(
        ("motion_transfer.estimate.densepose", "DensePoseEstimator"),
        takes=("model",),
        model_kind="a TorchScript or ONNX file, such as those of DensePose-TorchScript",
    ),
}


def check_estimator(
    name: str, model: Path | None, *, fit: bool = False, model_flag: str = ""
) -> None:
    """Check that there is such an estimator, and that it gets what it uses and nothing else.

    Args:
        fit: Whether people get other proportions.
        model_flag: The option that gives the model; messages then speak of options.
    Raises: InputError for an unknown estimator, a model too many or too few, or a fit of what has
        no landmarks.
    """
    if name not in ESTIMATORS:
        raise InputError(f"estimator {name!r}; supported are {', '.join(ESTIMATORS)}")
    kind = ESTIMATORS[name].model_kind
    if kind and model is None:
        lacking = f"{model_flag} FILE; none ships" if model_flag else f"its model: {kind}; name it"
        raise InputError(f"the {name} estimator needs {lacking}")
    if model is not None and not kind:
        other = " or ".join(_names_of("model"))
        raise InputError(
            f"{model_flag} is for the {other} estimator; add --estimator {other}"
            if model_flag
            else f"the {name} estimator has its own models and does not use {model}; leave it out,"
            f" or choose the {other} estimator"
        )
    if fit and name not in landmark_estimators():
        raise InputError(
            f"--fit-body compares landmarks, and the {name} estimator gives none; choose the"
            f" {' or '.join(landmark_estimators())} estimator, or leave out --fit-body"
            if model_flag
            else f"the {name} estimator gives no landmarks, so no body can be fitted"
        )


def open_estimator(
    name: str,
    model: Path | None,
    *,
    frame_rate: Fraction | None = None,
    fit: BodyFit | None = None,
    for_photos: bool = False,
) -> Estimator:
    """Open an estimator, ready for a clip.

    Args:
        model: The user's file, for an estimator that runs one.
        frame_rate: The clip's, for smoothing; None means 30.
        fit: Other proportions for everybody.
        for_photos: Whether it gets photos that have nothing to do with each other, and as much time
            for each as makes it better.
    Raises: InputError as `check_estimator`; InputError and WeightsError where a model or a package
        is missing, saying how to get it.
    """
    check_estimator(name, model, fit=fit is not None)
    rate = float(frame_rate or DEFAULT_RATE)
    given = {"model": model, "frame_rate": rate, "fit": fit, "for_photos": for_photos}
    entry = ESTIMATORS[name]
    module, estimator = entry.home
    takes = {what: given[what] for what in entry.takes}
    return getattr(import_module(module), estimator)(**takes, **entry.always)


def estimator_facts(name: str, model: Path | None) -> dict[str, Any]:
    """Tell what decides an estimator's answers, for keys of content. Raises: InputError."""
    check_estimator(name, model)
    entry = ESTIMATORS[name]
    facts = import_module(entry.home[0]).model_facts(model, **entry.always)
    return {"estimator": name, "version": __version__, **facts}


def landmark_estimators() -> tuple[str, ...]:
    """Name those that give landmarks."""
    return _names_of("fit")


def _names_of(what: str) -> tuple[str, ...]:
    return tuple(name for name, entry in ESTIMATORS.items() if what in entry.takes)
