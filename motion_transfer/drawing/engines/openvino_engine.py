"""OpenVINO: the fastest on CPUs, and there in a fraction of a second."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import onnx
import openvino

from motion_transfer.cores import core_count, multiplies_bytes
from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.compiling import compile_graph, open_core
from motion_transfer.drawing.engines.graph_engine import GraphEngine

EXACT = "f32"


def fast_precisions(_device: str) -> list[str]:
    """List the precisions that this CPU is fast in."""
    told = open_core().get_property("CPU", "OPTIMIZATION_CAPABILITIES")
    able = {"int8": "INT8" in told and multiplies_bytes(), "bf16": "BF16" in told}
    return [*(name for name, can in able.items() if can), EXACT]


def open_engine(weights: Path, execution: Execution) -> OpenVinoEngine:
    """Load a checkpoint. Raises: WeightsError if it cannot be read."""
    return OpenVinoEngine(weights, execution)


class OpenVinoEngine(GraphEngine):
    """One compiled graph for each size; a call computes with one thread."""

    def open(
        self, model: onnx.ModelProto, sizes: Mapping[str, tuple[int, ...]], *, exact: bool
    ) -> Session:
        content = model.SerializeToString()

        def read() -> openvino.Model:
            graph = open_core().read_model(content)
            if sizes:
                named = {port.get_any_name() for port in graph.inputs}
                graph.reshape({name: list(sizes[name]) for name in named & sizes.keys()})
            return graph

        # what is left of 8 bits is computed in 16 where that is fast
        half = not exact and self.execution.precision != EXACT and "bf16" in fast_precisions("cpu")
        # calls side by side are as fast as two threads in one call, and any number of workers gives
        # the same bits; what is called once is done soonest by all threads
        at_once = 1 if exact else core_count()
        compiled = compile_graph(
            content,
            read,
            "bf16" if half else EXACT,
            at_once,
            threads=core_count(),
            how=sorted(sizes.items()),
        )
        return Session(compiled, [output.name for output in model.graph.output])


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
