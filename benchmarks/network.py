"""The network by each engine and precision, over a matrix product of as many multiplications.

    python benchmarks/network.py [--weights lite] [--size 256] [--rounds 9] [--paper]

A frame is what `Engine.draw` makes: from target IUV to RGB and alpha of 8 bits, look-up and
blending included. As many calls run side by side as there are cores, as in a run. In the same
rounds OpenVINO multiplies matrices of 2,048 x 2,048 in the same precision; the network's
multiplications at that speed are the floor.

Prints for each form the time until it is ready, the median time a frame, the ratio to torch's
float32, to the floor, and how far its frames are from torch's (PSNR over the person, worst level).
`--paper`: random weights of the paper's size, calibrated on the demo.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle, islice
from pathlib import Path

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # as the command does, before torch

import numpy as np
import openvino
from workload import SOURCE, demo_crops, random_checkpoint

from motion_transfer.cores import core_count
from motion_transfer.drawing.engines import Execution, open_engine
from motion_transfer.drawing.engines.openvino_engine import OpenVinoEngine
from motion_transfer.drawing.engines.threads import one_torch_thread
from motion_transfer.drawing.graphs.graph import FLOAT, Graph
from motion_transfer.evaluation.calibration import measure_ranges
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source import read_source
from motion_transfer.weights import find_weights
from motion_transfer.weights.checkpoint import RANGES, copy_with_notes
from nhrr_core.config import ModelConfig

FORMS = (
    *(("torch", "f32"), ("torch", "bf16"), ("onnx", "f32"), ("onnx", "int8")),
    *(("openvino", "f32"), ("openvino", "bf16"), ("openvino", "int8")),
)
BASIS = FORMS[0]
MATRIX = 2048  # rows and columns
"""Large enough that memory does not count."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--weights", type=Path, default=Path("lite"))
    parser.add_argument("--paper", action="store_true")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        weights = find_weights(arguments.weights)
        if arguments.paper:
            weights = calibrated_paper(Path(folder))
        compare(weights, arguments.size, arguments.rounds)


def calibrated_paper(folder: Path) -> Path:
    plain, path = random_checkpoint(folder, "paper"), folder / "calibrated.safetensors"
    engine = OpenVinoEngine(plain, Execution("openvino", "f32", "cpu"))
    source = read_source(SourceOptions(source=(SOURCE,)), engine.config.finest_texture)
    feature_map = engine.encode(source)
    ranges = measure_ranges(engine, ((feature_map, crop) for crop in demo_crops(256)[::30]))
    copy_with_notes(plain, path, {RANGES: json.dumps(ranges)})
    return path


def compare(weights: Path, size: int, rounds: int) -> None:
    crops = demo_crops(size)
    forms: dict[tuple[str, str], Callable[[int], np.ndarray]] = {}
    ready, frames = {}, {}
    for form in FORMS:
        began = time.perf_counter()
        engine = open_engine(weights, Execution(*form, "cpu"))
        engine.prepare([size])
        ready[form] = time.perf_counter() - began
        if form == BASIS:
            config = engine.config
            source = read_source(SourceOptions(source=(SOURCE,)), config.finest_texture)
            feature_map = engine.encode(source)
        taken = engine.take(feature_map)
        batch = engine.batch_size(size)

        def draw(index: int, engine=engine, taken=taken, batch=batch) -> np.ndarray:
            chosen = islice(cycle(crops), index % len(crops), index % len(crops) + batch)
            return engine.draw(taken, np.stack(list(chosen)))

        forms[form] = draw
        frames[form] = draw(0)[0].astype(float)
    products = {precision: product(precision) for precision in ("f32", "bf16", "int8")}
    seconds: dict[object, list[float]] = {key: [] for key in (*forms, *products)}
    cores = core_count()
    with one_torch_thread(), ThreadPoolExecutor(cores) as pool:
        for _ in range(rounds):
            for key, call in (*forms.items(), *products.items()):
                began = time.perf_counter()
                done = list(pool.map(call, range(2 * cores)))
                images = sum(len(one) for one in done) if key in forms else len(done)
                seconds[key].append((time.perf_counter() - began) / images)
    medians = {key: statistics.median(values) for key, values in seconds.items()}
    multiplications = count_multiplications(config, size)
    print(f"{weights.stem}, {size} x {size}, {cores} cores, medians of {rounds} rounds:")
    person = frames[BASIS][..., -1:] > 0
    for form in forms:
        floor = medians[form[1]] * multiplications / MATRIX**3
        away = (frames[form] - frames[BASIS]) * person
        psnr = 10 * np.log10(255**2 / max(np.square(away).mean(), 1e-9))
        print(
            f"  {form[0]:9} {form[1]:5} ready {ready[form]:4.1f} s, {medians[form] * 1e3:6.1f} ms"
            f" a frame, {medians[BASIS] / medians[form]:4.1f}x, {medians[form] / floor:4.2f} of the"
            f" floor ({floor * 1e3:.1f} ms), {psnr:3.0f} dB, {np.abs(away).max():.0f} levels"
        )


def product(precision: str) -> Callable[[int], np.ndarray]:
    """Make a function that multiplies two matrices in one thread."""
    graph, rng = Graph(), np.random.default_rng(0)
    x = graph.input("x", FLOAT, (MATRIX, MATRIX))
    weight = rng.normal(size=(MATRIX, MATRIX)).astype(np.float32)
    if precision == "int8":
        codes = graph("QuantizeLinear", x, 4 / 127, np.array(0, np.int8))
        x = graph("DequantizeLinear", codes, 4 / 127, np.array(0, np.int8))
        scale = np.abs(weight).max(0) / np.float32(127)
        stored = np.round(weight / scale).astype(np.int8)
        factor = graph("DequantizeLinear", stored, scale, np.zeros(MATRIX, np.int8), axis=1)
    else:
        factor = graph.constant(weight)
    graph.output("y", graph("MatMul", x, factor), FLOAT, (MATRIX, MATRIX))
    core, cores = openvino.Core(), core_count()
    settings = {
        "INFERENCE_PRECISION_HINT": "f32" if precision == "f32" else "bf16",
        "NUM_STREAMS": cores,
        "INFERENCE_NUM_THREADS": cores,
        "ENABLE_CPU_PINNING": False,
    }
    model = core.read_model(graph.build("product").SerializeToString())
    compiled = core.compile_model(model, "CPU", settings)
    values = rng.normal(size=(MATRIX, MATRIX)).astype(np.float32)

    def multiply(_index: int) -> np.ndarray:
        return compiled.create_infer_request().infer([values], share_outputs=True)[0]

    return multiply


def count_multiplications(config: ModelConfig, size: int) -> int:
    """Count those of RenderNet's convolutions for one image."""
    import torch
    from torch.utils.flop_counter import FlopCounterMode

    from nhrr_core import NeuralReRenderer

    with torch.device("meta"), FlopCounterMode(display=False) as counter:
        model = NeuralReRenderer(config)
        model.render_net(torch.empty(1, config.render_inputs, size, size))
    return counter.get_total_flops() // 2


if __name__ == "__main__":
    main()
