"""ONNX Runtime: for machines that OpenVINO does not know, and as the exported graphs' judge."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
import onnxruntime

from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.graph_engine import GraphEngine
from motion_transfer.errors import InputError

CPU, CUDA = "CPUExecutionProvider", "CUDAExecutionProvider"
ERRORS_ONLY = 3  # of its log


def fast_precisions(_device: str) -> list[str]:
    """List the precisions that it is fast in."""
    return ["f32"]  # in 8 bits it takes as long: what convolutions give is no 8 bits


def open_engine(weights: Path, execution: Execution) -> OnnxEngine:
    """Load a checkpoint.

    Raises: WeightsError if it cannot be read; InputError for a device that it does not reach.
    """
    if execution.device != "cpu" and CUDA not in onnxruntime.get_available_providers():
        raise InputError(
            f"--device {execution.device}: this onnxruntime has no CUDA; pip install"
            " onnxruntime-gpu, or choose --device cpu"
        )
    return OnnxEngine(weights, execution)


class OnnxEngine(GraphEngine):
    """One session for all sizes of a graph; on CPUs a call computes with one thread."""

    def open(
        self,
        model: onnx.ModelProto,
        sizes: Mapping[str, tuple[int, ...]],  # noqa: ARG002 - it is ready for all
        *,
        exact: bool,  # noqa: ARG002 - numbers are as the graph says
    ) -> Session:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.log_severity_level = ERRORS_ONLY
        kind, _, number = self.execution.device.partition(":")
        providers = [CPU] if kind == "cpu" else [(CUDA, {"device_id": int(number or 0)}), CPU]
        return Session(
            onnxruntime.InferenceSession(model.SerializeToString(), options, providers=providers)
        )


class Session:
    """A graph that is ready to run."""

    def __init__(self, session: onnxruntime.InferenceSession) -> None:
        self._session = session
        self._read = [port.name for port in session.get_inputs()]

    def run(self, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Compute the first output."""
        return next(iter(self.run_all(inputs).values()))

    def run_all(self, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Compute all outputs, by name."""
        outputs = self._session.run(None, {name: inputs[name] for name in self._read})
        names = [port.name for port in self._session.get_outputs()]
        return {name: np.asarray(value) for name, value in zip(names, outputs, strict=True)}
