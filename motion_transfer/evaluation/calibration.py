"""Of which ranges RenderNet's numbers are: what arithmetic of 8 bits has to know beforehand."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.graph_engine import GraphEngine
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.openvino_engine import OpenVinoEngine
from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.window import drawn_side, plan_window
from motion_transfer.evaluation.candidates import OpenedSource
from motion_transfer.media.publish import publish, work_folder
from motion_transfer.training.pairs import Pair
from motion_transfer.training.sources import StreamedPairs
from motion_transfer.weights.checkpoint import RANGES, copy_with_notes

SEED = 8  # of people who are neither trained on nor evaluated with
SIZE = (256, 256)
NOISE = 0.5  # the share of photos whose IUV has DensePose's faults

Ranges = dict[str, tuple[float, float]]


def calibrate(
    weights: Path, out: Path, *, count: int, assets: Path | None, done: Callable[[int], object]
) -> Ranges:
    """Measure the ranges on synthetic people and write the checkpoint with them.

    Args:
        out: Where it is written; it may be the checkpoint itself.
        count: People, each drawn once; half of them free ones where there are assets.
        done: Called with how many more people are done.
    Raises: InputError without the extra; WeightsError.
    """
    share = 0.5 if assets else 0.0
    people = StreamedPairs(seed=SEED, size=SIZE, noise=NOISE, assets=assets, free_share=share)
    engine = OpenVinoEngine(weights, Execution("openvino", "f32", "cpu"))
    shown = (_show(engine, people[number], done) for number in range(count))
    ranges = measure_ranges(engine, shown)
    rounded = {name: [float(f"{end:.4g}") for end in ends] for name, ends in ranges.items()}
    with work_folder(out) as folder:
        written = folder / out.name
        copy_with_notes(weights, written, {RANGES: json.dumps(rounded)})
        publish(written, out)
    return ranges


def measure_ranges(
    engine: GraphEngine, shown: Iterable[tuple[FeatureMap, UInt8[np.ndarray, "S S 3"]]]
) -> Ranges:
    """Measure the least and the largest value that each convolution reads.

    Args:
        shown: Feature maps, each with the crop of a target's IUV.
    """
    ends: dict[str, list[float]] = {}
    for feature_map, iuv in shown:
        for name, values in engine.read_by_convolutions(feature_map, iuv).items():
            ends.setdefault(name, []).extend((float(values.min()), float(values.max())))
    return {name: (min(values), max(values)) for name, values in ends.items()}


def _show(
    engine: GraphEngine, pair: Pair, done: Callable[[int], object]
) -> tuple[FeatureMap, UInt8[np.ndarray, "S S 3"]]:
    """Encode a pair's source, and cut out its target as a run would."""
    source = OpenedSource(pair.source.load()).prepare(engine.config.finest_texture)
    iuv = pair.target.load().iuv
    window = plan_window([bounding_box(iuv)])
    done(1)
    return engine.encode(source), window.cut(iuv, drawn_side(window.side, engine.config))
