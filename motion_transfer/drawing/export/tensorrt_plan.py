"""Graphs as plans of TensorRT, which are for the GPU, and the version, that they are built with.

Written from TensorRT's documentation (10 and 11), and never run: no GPU was at hand. The graphs
that it is given are tested on CPUs.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from motion_transfer.drawing.export.formats import Network
from motion_transfer.drawing.graphs.whole import IUV
from motion_transfer.drawing.window import DRAWN_UNSCALED
from motion_transfer.errors import RenderError
from nhrr_core.config import ModelConfig


def write_plan(network: Network, path: Path) -> None:
    """Build a plan for this machine's GPU, for all sides that networks draw without scaling.

    It multiplies as the graph says, float32 in TF32 where the GPU has that. The notes are the name
    of its network, as there is no other place for words.

    Raises: RenderError if TensorRT cannot build it.
    """
    trt: Any = import_module("tensorrt")
    logger = trt.Logger(trt.Logger.ERROR)
    builder = trt.Builder(logger)
    # as version 11 has it in any case
    strongly = 1 << int(trt.NetworkDefinitionCreationFlag.STRONGLY_TYPED)
    definition = builder.create_network(strongly)
    parser = trt.OnnxParser(definition, logger)
    if not parser.parse(simplify(network.model).SerializeToString()):
        why = "; ".join(parser.get_error(index).desc() for index in range(parser.num_errors))
        raise RenderError(f"TensorRT cannot read the {network.name}: {why}; choose another format")
    settings = builder.create_builder_config()
    if _has_iuv(network.model):
        profile = builder.create_optimization_profile()
        profile.set_shape(IUV, *((1, side, side, 3) for side in list_sides(network.config)))
        settings.add_optimization_profile(profile)
    definition.name = "; ".join(f"{name}: {words}" for name, words in network.notes.items())
    plan = builder.build_serialized_network(definition, settings)
    if plan is None:
        raise RenderError(f"TensorRT cannot build the {network.name} here; choose another format")
    path.write_bytes(bytes(plan))


def list_sides(config: ModelConfig) -> tuple[int, int, int]:
    """Tell the least, the most frequent and the largest side of a picture, px."""
    step = 2**config.down_blocks
    least, most = (round(share * config.image_size / step) * step for share in DRAWN_UNSCALED)
    return least, config.image_size, most


def simplify(model: onnx.ModelProto) -> onnx.ModelProto:
    """Say the same with what TensorRT has.

    It has 8-bit integers without a sign only as inputs that are cast to floats at once, and as
    outputs.
    """
    simple = onnx.ModelProto()
    simple.CopyFrom(model)
    graph = simple.graph
    for tensor in graph.initializer:
        if tensor.data_type == TensorProto.UINT8:
            wide = numpy_helper.to_array(tensor).astype(np.int32)
            tensor.CopyFrom(numpy_helper.from_array(wide, tensor.name))
    *nodes, last = graph.node  # which only gives the output its name
    nodes[-1].output[:] = last.output
    if _has_iuv(model):
        floats, whole = f"{IUV}_floats", f"{IUV}_whole"
        for node in nodes:
            node.input[:] = [whole if name == IUV else name for name in node.input]
        nodes.insert(0, helper.make_node("Cast", [IUV], [floats], to=TensorProto.FLOAT))
        nodes.insert(1, helper.make_node("Cast", [floats], [whole], to=TensorProto.INT32))
    del graph.node[:]
    graph.node.extend(nodes)
    return simple


def _has_iuv(model: onnx.ModelProto) -> bool:
    return any(port.name == IUV for port in model.graph.input)
