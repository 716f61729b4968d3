"""An ONNX graph under construction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnx
import xxhash
from onnx import TensorProto, helper, numpy_helper

OPSET, IR_VERSION = 17, 8  # the oldest that has all that is used: GridSample is of 16

TABLE_BYTES = 1 << 16
"""Constants from this size on may be shared. OpenVINO (2026.4) finds convolutions of 8 bits only
where each of them has its own scales and zeros."""

FLOAT, UINT8 = TensorProto.FLOAT, TensorProto.UINT8
INT32, INT64 = TensorProto.INT32, TensorProto.INT64

Value = str | int | float | np.ndarray
"""The name of a tensor in the graph, or a constant; numbers are float32."""


class Graph:
    """Nodes in the order in which they run, each appended by a call that gives its output's name.

    Example:
        >>> graph = Graph()
        >>> x = graph.input("x", FLOAT, ("batch", 3, "height", "width"))
        >>> graph.output("y", graph("Relu", x), FLOAT, ("batch", 3, "height", "width"))
        >>> model = graph.build("rectifier")
    """

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        self._tables: dict[bytes, str] = {}
        self._inputs: list[onnx.ValueInfoProto] = []
        self._outputs: list[onnx.ValueInfoProto] = []

    def __call__(self, operator: str, *inputs: Value, **attributes: Any) -> str:
        """Append a node. Empty names stand for inputs that are left out."""
        names = [value if isinstance(value, str) else self.constant(value) for value in inputs]
        output = f"{operator}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(operator, names, [output], name=output, **attributes))
        return output

    def constant(self, value: float | np.ndarray) -> str:
        """Hold an array, as it is, or a number, as float32; equal tables are held once."""
        array = np.array(value, None if isinstance(value, np.ndarray) else np.float32, order="C")
        name = f"constant_{len(self._constants)}"
        if array.nbytes >= TABLE_BYTES:
            content = f"{array.dtype.str}{array.shape}".encode()
            content += xxhash.xxh3_128_digest(array.data)
            if (known := self._tables.setdefault(content, name)) != name:
                return known
        self._constants.append(numpy_helper.from_array(array, name))
        return name

    def input(self, name: str, kind: int, shape: Sequence[int | str]) -> str:
        """Declare an input; sizes that are words are open."""
        self._inputs.append(helper.make_tensor_value_info(name, kind, shape))
        return name

    def output(self, name: str, value: str, kind: int, shape: Sequence[int | str]) -> None:
        """Give a tensor out under a name."""
        self._nodes.append(helper.make_node("Identity", [value], [name], name=name))
        self._outputs.append(helper.make_tensor_value_info(name, kind, shape))

    def part(self, value: str, first: int, end: int) -> str:
        """Take some channels, `first` to `end` - 1, of N x C x ...

        A Slice, as OpenVINO's Split (2026.4) shares memory with what is written over later.
        """
        return self("Slice", value, *(np.array([number]) for number in (first, end, 1)))

    def join(self, *values: str) -> str:
        """Join channels."""
        return values[0] if len(values) == 1 else self("Concat", *values, axis=1)

    def build(self, name: str, notes: Mapping[str, str] | None = None) -> onnx.ModelProto:
        """Make the model of it.

        Args:
            notes: Its metadata.
        """
        read = {name for node in self._nodes for name in node.input}
        constants = [held for held in self._constants if held.name in read]
        graph = helper.make_graph(
            self._nodes, name, self._inputs, self._outputs, initializer=constants
        )
        opsets = [helper.make_opsetid("", OPSET)]
        model = helper.make_model(
            graph, opset_imports=opsets, ir_version=IR_VERSION, producer_name="motion-transfer"
        )
        helper.set_model_props(model, dict(notes or {}))
        return model
