from __future__ import annotations

import numpy as np
import onnx

from motion_transfer.drawing.graphs.graph import FLOAT, TABLE_BYTES, Graph

TABLE = np.arange(TABLE_BYTES // 4, dtype=np.float32)


def held(*values: np.ndarray) -> list[onnx.TensorProto]:
    graph = Graph()
    sums = graph.input("x", FLOAT, (len(TABLE),))
    for value in values:
        sums = graph("Add", sums, value)
    graph.output("y", sums, FLOAT, (len(TABLE),))
    model = graph.build("sums")
    return list(model.graph.initializer)


def test_equal_tables_are_held_once() -> None:
    assert len(held(TABLE, TABLE.copy(), TABLE[::-1])) == 2
    assert len(held(TABLE, TABLE.view(np.float32).reshape(1, -1))) == 2


def test_each_small_constant_is_its_readers_own() -> None:
    small = np.ones(1, np.float32)
    assert len(held(small, small)) == 2


def test_constants_that_nothing_reads_are_left_out() -> None:
    graph = Graph()
    graph.constant(TABLE)
    graph.output("y", graph("Relu", graph.input("x", FLOAT, (1,))), FLOAT, (1,))
    assert not graph.build("rectifier").graph.initializer
