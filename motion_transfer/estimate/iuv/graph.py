"""The IUV network as an ONNX graph, built from its weights without torch.

`IuvNetwork` is the specification, features and all; this is held to it by a test.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from jaxtyping import Float32

from motion_transfer.drawing.graphs.graph import FLOAT, Graph
from motion_transfer.drawing.graphs.networks import fold_norm
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT
from motion_transfer.estimate.iuv.body import (
    COARSE,
    FEATURE_SCALE,
    FINE,
    FINE_CELL,
    GRID,
    HIPS,
    LEAST_REACH,
    MASK_CELL,
    MASK_SIZE,
    MOST_BESIDE,
    MOST_DEPTH,
    NEAR_METRES,
    REACH,
    SHOULDERS,
    bone_ends,
    cell_centres,
)
from motion_transfer.estimate.iuv.weights import FINER, PARTS, Weights, read_weights
from nhrr_core.parts import PART_COUNT

MIDDLE = np.array([0.5, 0.5, 0], np.float32)  # of the window; depth has its own


def build_graph(weights: Path) -> onnx.ModelProto:
    """Build the network from a file of weights.

    Inputs: as in `BodyArrays`. Output: 1 x 73 x 128 x 128, the logits of background and 24 parts,
    then U and V of each part; see `read_painted`.
    Raises: WeightsError as `read_weights`.
    """
    config, tensors = read_weights(weights)
    graph = Graph()
    points = graph.input("points", FLOAT, (1, LANDMARK_COUNT, 3))
    world = graph.input("world", FLOAT, (1, LANDMARK_COUNT, 3))
    visibility = graph.input("visibility", FLOAT, (1, LANDMARK_COUNT))
    mask = graph.input("mask", FLOAT, (1, 1, MASK_SIZE, MASK_SIZE))
    coarse, fine = (
        graph.input("coarse", FLOAT, (1, *COARSE)),
        graph.input("fine", FLOAT, (1, *FINE)),
    )
    row = _append_row(graph, points, world, visibility)
    maps = graph.join(
        _append_bones(graph, points, world),
        graph("SpaceToDepth", mask, blocksize=MASK_CELL),
        _append_features(graph, coarse),
        graph("SpaceToDepth", _append_features(graph, fine), blocksize=FINE_CELL),
    )
    cells = _Layers(graph, tensors).append(row, maps, len(config.widths))
    spread = graph("DepthToSpace", cells, blocksize=FINER, mode="DCR")
    # not split in the graph: that would take OpenVINO a third of the network's time
    graph.output("painted", spread, FLOAT, (1, PARTS + 2 * PART_COUNT, GRID * FINER, GRID * FINER))
    return graph.build("iuv")


def read_painted(
    painted: Float32[np.ndarray, "1 73 n n"],
) -> tuple[Float32[np.ndarray, "25 n n"], Float32[np.ndarray, "24 2 n n"]]:
    """Read the graph's output, of one person, as the network's `IuvLogits`: parts, and U and V."""
    parts, uv = painted[0, :PARTS], painted[0, PARTS:]
    return parts, uv.reshape(PART_COUNT, 2, *uv.shape[1:])


def _append_row(graph: Graph, points: str, world: str, visibility: str) -> str:
    """Append what `feature_vector` computes."""
    flat = np.array([1, -1])
    places = graph("Mul", graph("Sub", points, MIDDLE), 2)
    metres = graph("Div", world, NEAR_METRES)
    shown = graph("Sub", graph("Mul", visibility, 2), 1)
    return graph.join(graph("Reshape", places, flat), graph("Reshape", metres, flat), shown)


def _append_features(graph: Graph, features: str) -> str:
    return graph("Mul", graph("Transpose", features, perm=[0, 3, 1, 2]), FEATURE_SCALE)


def _append_bones(graph: Graph, points: str, world: str) -> str:
    """Append what `feature_maps` draws: 1 x bones x cells or x 1, at last 1 x C x 64 x 64."""
    grid_x, grid_y = cell_centres().T[:, None, None]
    start_x, start_y, _ = _append_middles(graph, points, bone_ends()[:, 0])
    end_x, end_y, _ = _append_middles(graph, points, bone_ends()[:, 1])
    *_, start_depth = _append_middles(graph, world, bone_ends()[:, 0] / NEAR_METRES)
    *_, end_depth = _append_middles(graph, world, bone_ends()[:, 1] / NEAR_METRES)
    along_x, along_y = graph("Sub", end_x, start_x), graph("Sub", end_y, start_y)
    length = graph("Max", _sum_products(graph, along_x, along_x, along_y, along_y), 1e-6)
    away_x, away_y = graph("Sub", grid_x, start_x), graph("Sub", grid_y, start_y)
    share = graph("Div", _sum_products(graph, away_x, along_x, away_y, along_y), length)
    share = graph("Clip", share, 0, 1)
    rest_x = graph("Sub", away_x, graph("Mul", share, along_x))
    rest_y = graph("Sub", away_y, graph("Mul", share, along_y))
    reach = graph("Max", graph("Mul", _append_trunk(graph, points), REACH), LEAST_REACH)
    far = graph("Sqrt", graph("Max", _sum_products(graph, rest_x, rest_x, rest_y, rest_y), 1e-12))
    near = graph("Exp", graph("Neg", graph("Div", far, reach)))
    beside = graph("Sub", graph("Mul", away_x, along_y), graph("Mul", away_y, along_x))
    beside = graph("Div", graph("Div", beside, graph("Sqrt", length)), reach)
    beside = graph("Clip", beside, -MOST_BESIDE, MOST_BESIDE)
    rest = graph("Sub", 1, share)
    depth = _sum_products(graph, start_depth, rest, end_depth, share)
    depth = graph("Clip", depth, -MOST_DEPTH, MOST_DEPTH)
    places = np.concatenate([grid_x, grid_y], 1) * 2 - 1
    bones = (near, graph("Mul", near, beside), graph("Mul", near, depth))
    drawn = graph.join(*bones, graph.constant(places))
    return graph("Reshape", drawn, np.array([1, -1, GRID, GRID]))


def _append_middles(
    graph: Graph, points: str, shares: Float32[np.ndarray, "N 33"]
) -> tuple[str, str, str]:
    """Append x, y and depth, 1 x N x 1 each, of the middles of landmarks."""
    middles = graph("MatMul", shares[None], points)
    x, y, depth = (graph("Gather", middles, np.array([axis]), axis=2) for axis in range(3))
    return x, y, depth


def _append_trunk(graph: Graph, points: str) -> str:
    """Append the trunk's length, or the shoulders' width where that is more, 1 x 1 x 1."""
    shares = np.zeros((2, LANDMARK_COUNT), np.float32)
    left, right = (LANDMARK[name] for name in SHOULDERS)
    shares[0, [left, right]] = 0.5
    shares[0, [LANDMARK[name] for name in HIPS]] = -0.5
    shares[1, [left, right]] = 1, -1
    x, y, _ = _append_middles(graph, points, shares)
    lengths = graph("Sqrt", _sum_products(graph, x, x, y, y))
    return graph("ReduceMax", lengths, axes=[1])


def _sum_products(graph: Graph, a: str, b: str, c: str, d: str) -> str:
    """Append a * b + c * d."""
    return graph("Add", graph("Mul", a, b), graph("Mul", c, d))


class _Layers:
    """Appends the network's layers to a graph."""

    def __init__(self, graph: Graph, weights: Weights) -> None:
        self._graph = graph
        self._weights = weights

    def append(self, row: str, maps: str, levels: int) -> str:
        """Append what `IuvNetwork` makes of its features, 1 x 4 * 73 x 64 x 64."""
        code = self._graph("Relu", self._dense(row, "encode_row.0"))
        code = self._graph("Relu", self._dense(code, "encode_row.2"))
        features = self._convolve(maps, *self._named("stem"))
        skips = []
        for level in range(levels):
            if level:
                half = {"kernel_shape": [2, 2], "strides": [2, 2]}
                features = self._graph("MaxPool", features, **half)
            features = self._block(features, code, f"down.{level}")
            skips.append(features)
        skips.pop()  # the coarsest level is what goes up, and no skip
        for level in range(levels - 1):
            features = self._block(
                self._graph.join(self._double(features), skips.pop()), code, f"up.{level}"
            )
        weight, bias = self._named("head")
        bias = bias.reshape(FINER**2, PARTS + 2 * PART_COUNT).copy()
        bias[:, PARTS:] += 0.5  # the network's U and V are from the middle of a chart
        return self._convolve(features, weight, bias.ravel())

    def _block(self, features: str, code: str, name: str) -> str:
        """Append two convolutions, the second's output scaled and shifted by the code."""
        features = self._graph("Relu", self._normed(features, f"{name}.first"))
        features = self._normed(features, f"{name}.second")
        weight, bias = self._named(f"{name}.film")
        width = len(bias) // 2
        bias = np.concatenate([bias[:width] + 1, bias[width:]])  # what scales is around 1
        film = self._graph("Add", self._graph("MatMul", code, weight.T), bias)
        film = self._graph("Reshape", film, np.array([1, 2 * width, 1, 1]))
        scaled = self._graph("Mul", features, self._graph.part(film, 0, width))
        return self._graph(
            "Relu", self._graph("Add", scaled, self._graph.part(film, width, 2 * width))
        )

    def _normed(self, features: str, name: str) -> str:
        """Append a convolution that the normalisation after it is part of."""
        return self._convolve(features, *fold_norm(self._weights, name, f"{name}_norm"))

    def _convolve(self, features: str, weight: np.ndarray, bias: np.ndarray) -> str:
        return self._graph("Conv", features, weight, bias, pads=[weight.shape[-1] // 2] * 4)

    def _dense(self, row: str, name: str) -> str:
        weight, bias = self._named(name)
        return self._graph("Add", self._graph("MatMul", row, weight.T), bias)

    def _double(self, features: str) -> str:
        """Append each pixel as 2 x 2."""
        nearest = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric"}
        scales = np.array([1, 1, 2, 2], np.float32)
        return self._graph("Resize", features, "", scales, nearest_mode="floor", **nearest)

    def _named(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        return self._weights[f"{name}.weight"], self._weights[f"{name}.bias"]
