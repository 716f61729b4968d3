"""OpenVINO: the fastest on CPUs, and there in a fraction of a second."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import onnx
import openvino

from motion_transfer.cores import core_count
from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.graph_engine import GraphEngine

EXACT = "f32"


def fast_precisions(_device: str) -> list[str]:
    """List the precisions that this CPU is fast in."""
    told = _core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
    return [name for name, word in (("int8", "INT8"), ("bf16", "BF16")) if word in told] + [EXACT]


def open_engine(weights: Path, execution: Execution) -> OpenVinoEngine:
    """Load a checkpoint. Raises: WeightsError if it cannot be read."""
    return OpenVinoEngine(weights, execution)


class OpenVinoEngine(GraphEngine):
    """One compiled graph for each size; a call computes with one thread."""

    def open(
        self, model: onnx.ModelProto, sizes: Mapping[str, tuple[int, ...]], *, exact: bool
    ) -> Session:
        graph = _core().read_model(model.SerializeToString())
        if sizes:
            graph.reshape({name: list(size) for name, size in sizes.items()})
        half = not exact and self.execution.precision != EXACT
        threads = core_count()
        settings = {
            # what is left of 8 bits is computed in 16 where that is fast
            "INFERENCE_PRECISION_HINT": _half() if half else EXACT,
            # calls side by side are as fast as two threads in one call, and any number of workers
            # gives the same bits; what is called once is done soonest by all threads
            "NUM_STREAMS": 1 if exact else threads,
            "INFERENCE_NUM_THREADS": threads,
            "ENABLE_CPU_PINNING": False,
        }
        names = [output.name for output in model.graph.output]
        return Session(_core().compile_model(graph, "CPU", settings), names)


def _half() -> str:
    return "bf16" if "bf16" in fast_precisions("cpu") else EXACT


class Session:
    """A compiled graph; each thread has a request of its own."""

    def __init__(self, compiled: openvino.CompiledModel, outputs: Sequence[str]) -> None:
        self._outputs = outputs
        self._compiled = compiled
        self._read = {port.get_any_name() for port in compiled.inputs}
        self._own = threading.local()

    def run(self, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Compute the first output."""
        return self._infer(inputs).get_output_tensor(0).data.copy()

    def run_all(self, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Compute all outputs, by name."""
        request = self._infer(inputs)
        tensors = (request.get_output_tensor(index) for index in range(len(self._outputs)))
        copies = (tensor.data.copy() for tensor in tensors)
        return dict(zip(self._outputs, copies, strict=True))

    def _infer(self, inputs: Mapping[str, np.ndarray]) -> openvino.InferRequest:
        if not hasattr(self._own, "request"):
            self._own.request = self._compiled.create_infer_request()
        request = self._own.request
        for name in self._read:
            request.set_tensor(name, openvino.Tensor(inputs[name], shared_memory=True))
        request.infer()
        return request


@cache
def _core() -> openvino.Core:
    return openvino.Core()
