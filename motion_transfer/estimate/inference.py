"""Networks run on the CPU by OpenVINO: files of TensorFlow Lite, and ONNX graphs built here.

An inference takes one thread. However many run side by side, each gives the same bytes as alone.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import onnx
import openvino

from motion_transfer.cores import core_count
from motion_transfer.drawing.engines.compiling import compile_graph, open_core
from motion_transfer.errors import InputError
from motion_transfer.media.quiet import quiet_libraries


class CpuNetwork:
    """A network that threads may share; each has buffers of its own.

    Args:
        model: A file, or a graph.
        inner: Names of tensors within a file's network: what is added to each of them, the sum, is
            an output, too, after the network's own.
        at_once: How many inferences may run at the same time, each compiled for when it first is;
            more take turns.
    Raises: InputError if the file is no model.
    """

    def __init__(
        self, model: Path | onnx.ModelProto, *, inner: Sequence[str] = (), at_once: int = 1
    ) -> None:
        threads = min(at_once, core_count())
        content = model.read_bytes() if isinstance(model, Path) else model.SerializeToString()

        def read() -> openvino.Model:
            if not isinstance(model, Path):
                return open_core().read_model(content)
            graph = _read(model)
            if inner:
                graph.add_outputs([_find_sum(graph, name) for name in inner])
            return graph

        # measured: in bfloat16 landmarks are 2 px off, some 13, and the IUV network, which would
        # take 8 instead of 13 ms, flickers more (0.23 % of pixels instead of 0.20)
        self._compiled = compile_graph(
            content, read, "f32", threads, threads=threads, how=tuple(inner)
        )
        self._own = threading.local()

    def run(self, *inputs: np.ndarray) -> list[np.ndarray]:
        """Compute the outputs, in the model's order, and as it shapes them.

        The same thread's next call overwrites them.

        Args:
            inputs: In the model's order, contiguous.
        """
        request = getattr(self._own, "request", None)
        if request is None:
            request = self._own.request = self._compiled.create_infer_request()
        request.infer(inputs, share_inputs=True)
        return [tensor.data for tensor in request.output_tensors]


@cache
def open_network(file: Path, inner: tuple[str, ...] = ()) -> CpuNetwork:
    """Open a model file, once for the whole process; `find_model` has checked what is in it.

    Args:
        inner: As that of `CpuNetwork`.
    Raises: InputError if it is no model.
    """
    return CpuNetwork(file, inner=inner)


def _find_sum(graph: openvino.Model, name: str) -> openvino.Output:
    """Find the sum that a tensor goes into, past what only orders its values otherwise."""
    (found,) = (
        output for node in graph.get_ops() for output in node.outputs() if name in output.names
    )
    while found.get_node().get_type_name() != "Add":
        (reader,) = found.get_target_inputs()
        found = reader.get_node().output(0)
    return found


def _read(file: Path) -> openvino.Model:
    try:
        with quiet_libraries():  # the readers of other formats say why it is none of theirs
            return open_core().read_model(file)
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError(
            f"{file} is not a model that can be run ({reason}); `mt models fetch --force` fetches"
            " it anew"
        ) from error
