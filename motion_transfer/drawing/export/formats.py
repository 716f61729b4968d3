"""Graphs as files of ONNX and of OpenVINO, and what such files give when they are run."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnx
import openvino

from nhrr_core.config import ModelConfig

Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Network:
    """A graph to be written.

    Attributes:
        name: `encoder`, `sampler` or `painter`.
        precision: What it multiplies; its file's name has it where there are several.
        notes: What the file is to say of itself.
    """

    name: str
    model: onnx.ModelProto
    config: ModelConfig
    precision: str
    notes: Mapping[str, str]


def write_onnx(network: Network, path: Path) -> None:
    """Write a graph as it is, after ONNX's own check of it, with notes as its metadata."""
    onnx.helper.set_model_props(network.model, dict(network.notes))
    onnx.checker.check_model(network.model, full_check=True)
    onnx.save_model(network.model, str(path))


def write_openvino(network: Network, path: Path) -> None:
    """Write OpenVINO's representation: `path`, .xml, and the numbers beside it, .bin.

    For bf16 they are stored in 16 bits. Notes are runtime information, below `notes`.
    """
    graph = openvino.Core().read_model(network.model.SerializeToString())
    for name, words in network.notes.items():
        graph.set_rt_info(words, ["notes", name])
    openvino.save_model(graph, path, compress_to_fp16=network.precision == "bf16")


def run_file(path: Path, inputs: Arrays) -> list[np.ndarray]:
    """Give the outputs of an .onnx or .xml file.

    ONNX Runtime runs the former where it is installed, OpenVINO all others.
    """
    if path.suffix != ".onnx" or importlib.util.find_spec("onnxruntime") is None:
        return run_openvino(path, inputs)
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    read = {port.name: inputs[port.name] for port in session.get_inputs()}
    return [np.asarray(output) for output in session.run(None, read)]


def run_openvino(model: Path | bytes, inputs: Arrays) -> list[np.ndarray]:
    """Give the outputs of a graph, computed by OpenVINO in float32."""
    core = openvino.Core()
    exact = {"INFERENCE_PRECISION_HINT": "f32"}
    compiled = core.compile_model(core.read_model(model), "CPU", exact)
    # what nothing reads is no input any more
    read = {port.get_any_name(): inputs[port.get_any_name()] for port in compiled.inputs}
    return list(compiled(read).values())
