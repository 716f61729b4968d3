"""What runs the network: which engines there are, and which one a machine is best off with.

The table is light; an engine's module is imported when it is first opened.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from motion_transfer.devices import count_cuda, find_device
from motion_transfer.errors import InputError

if TYPE_CHECKING:
    from motion_transfer.drawing.engines.interface import Engine
    from motion_transfer.weights.checkpoint import CheckpointInfo

PRECISIONS = ("int8", "bf16", "f32")
"""The fastest first."""

WITHOUT_GRAPH = ("dpt",)
"""Variants for which no graph is built: they are there to be compared with."""


@dataclass(frozen=True)
class EngineRow:
    """One way of running the network.

    Attributes:
        name: What options and reports call it.
        package: The library that has to be installed.
        module: Whose `open_engine` opens it for a checkpoint and an `Execution`, and whose
            `fast_precisions` tells what a device is fast in.
        precisions: What it can multiply in.
        summary: What it is, for help.
    """

    name: str
    package: str
    module: str
    precisions: tuple[str, ...]
    summary: str

    @property
    def installed(self) -> bool:
        return importlib.util.find_spec(self.package) is not None


ENGINES = {
    row.name: row
    for row in (
        EngineRow(
            "openvino",
            "openvino",
            "motion_transfer.drawing.engines.openvino_engine",
            PRECISIONS,
            "fastest on CPUs",
        ),
        EngineRow(
            "onnx",
            "onnxruntime",
            "motion_transfer.drawing.engines.onnx_engine",
            ("int8", "f32"),
            "ONNX Runtime",
        ),
        EngineRow(
            "torch",
            "torch",
            "motion_transfer.drawing.engines.torch_engine",
            ("bf16", "f32"),
            "fastest on GPUs",
        ),
    )
}


@dataclass(frozen=True)
class Wish:
    """What a user asks for; None: whatever is fastest here."""

    engine: str | None = None
    precision: str | None = None
    device: str | None = None


ANYTHING = Wish()


@dataclass(frozen=True)
class Execution:
    """How a network is run: pictures of another execution may differ in their last bits."""

    engine: str
    precision: str
    device: str

    def __str__(self) -> str:
        return f"{self.engine}, {self.precision}, {self.device}"


def choose_execution(wish: Wish, info: CheckpointInfo) -> Execution:
    """Decide how a checkpoint is run here.

    A CUDA device is taken where there is one. 8 bits are taken where the checkpoint says of which
    ranges its numbers are, see `motion_transfer.weights.checkpoint.read_ranges`.

    Raises: InputError for what this machine, or the checkpoint, cannot.
    """
    from motion_transfer.weights.checkpoint import read_ranges

    device = wish.device or _best_device(wish.engine)
    in_torch = device != "cpu" or info.config.variant in WITHOUT_GRAPH
    name = wish.engine or ("torch" if in_torch else _best_cpu_engine())
    row = ENGINES[name]
    if name != "torch" and info.config.variant in WITHOUT_GRAPH:
        raise InputError(
            f"--engine {name} does not run variant {info.config.variant} of weights {info.path};"
            " choose --engine torch"
        )
    if not row.installed:
        raise InputError(f"--engine {name} needs {row.package}; pip install {row.package}")
    if device != "cpu":
        _check_device(device, row)
    calibrated = bool(read_ranges(info))
    possible = [one for one in row.precisions if one != "int8" or calibrated]
    precision = wish.precision
    if precision is None:
        fast = resolve_name(f"{row.module}:fast_precisions")(device)
        precision = next(one for one in possible if one in fast)
    elif precision not in row.precisions:
        others = ", ".join(row.precisions)
        raise InputError(f"--precision {precision}: {name} has {others}; choose one of them")
    elif precision not in possible:
        raise InputError(
            f"--precision int8: weights {info.path} do not say of which ranges their numbers are;"
            f" add that with mt calibrate {info.path}, or choose bf16 or f32"
        )
    return Execution(name, precision, device)


def open_engine(weights: Path, execution: Execution) -> Engine:
    """Load a checkpoint into an engine. Raises: WeightsError if it cannot be read."""
    return resolve_name(f"{ENGINES[execution.engine].module}:open_engine")(weights, execution)


def _best_device(engine: str | None) -> str:
    return "cuda" if engine in (None, "torch") and count_cuda() else "cpu"


def _best_cpu_engine() -> str:
    return next(name for name in ("openvino", "torch") if ENGINES[name].installed)


def _check_device(device: str, row: EngineRow) -> None:
    if row.name == "openvino":
        raise InputError(f"--device {device}: openvino runs on CPUs; choose --engine torch")
    if row.name == "onnx" and device == "mps":
        raise InputError(f"--device {device}: only torch runs there; choose --engine torch")
    if row.name == "torch":
        find_device(device)
