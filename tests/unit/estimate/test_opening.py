"""The table of estimators: what is refused, what is opened, and how light it is."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from estimate_stubs import write_red_model

from motion_transfer.errors import InputError
from motion_transfer.estimate.densepose import DensePoseEstimator
from motion_transfer.estimate.opening import (
    ESTIMATORS,
    check_estimator,
    estimator_facts,
    open_estimator,
)

MODEL = Path("a.pt")


@pytest.mark.parametrize(
    ("name", "model", "fit", "plain", "with_options"),
    [
        (
            "magic",
            None,
            False,
            "supported are blazepose, blazepose-heavy, densepose",
            "supported are blazepose",
        ),
        ("densepose", None, False, "needs its model: a TorchScript", "needs --model FILE; none"),
        ("blazepose", MODEL, False, "choose the densepose", "--model is for the densepose"),
        ("densepose", MODEL, True, "gives no landmarks", "gives none; choose the blazepose"),
    ],
)
def test_what_is_refused(name, model, fit, plain: str, with_options: str) -> None:
    with pytest.raises(InputError, match=plain):
        check_estimator(name, model, fit=fit)
    with pytest.raises(InputError, match=with_options):
        check_estimator(name, model, fit=fit, model_flag="--model")


def test_what_fits_is_not_refused() -> None:
    check_estimator("blazepose", None, fit=True)
    check_estimator("densepose", MODEL, model_flag="--model")


@pytest.mark.filterwarnings("ignore:.*torch.jit.*:DeprecationWarning")
def test_an_estimator_is_opened_by_name(tmp_path: Path) -> None:
    model = write_red_model(tmp_path / "red.pt")
    assert isinstance(open_estimator("densepose", model), DensePoseEstimator)


def test_facts_tell_which_models_look(tmp_path: Path) -> None:
    facts = []
    for content in (b"one", b"other", b"one"):
        (tmp_path / "m.pt").write_bytes(content)
        facts.append(estimator_facts("densepose", tmp_path / "m.pt"))
    assert facts[0] == facts[2] != facts[1]
    own = estimator_facts("blazepose", None)
    assert own["estimator"] == "blazepose" and len(own["models"]) == 5 and own["network"]
    with pytest.raises(InputError, match=r"gone\.pt does not exist"):
        estimator_facts("densepose", tmp_path / "gone.pt")


def test_the_table_is_light() -> None:
    code = (
        "import sys, motion_transfer.estimate.opening;"
        "sys.exit(any(name in sys.modules for name in ('numpy', 'torch', 'cv2')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_row_names_what_is_there() -> None:
    for entry in ESTIMATORS.values():
        module = import_module(entry.home[0])
        assert hasattr(module, entry.home[1]) and hasattr(module, "model_facts")
