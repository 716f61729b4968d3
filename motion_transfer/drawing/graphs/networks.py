"""FeatureNet and RenderNet as ONNX nodes, in the form that runs fastest on CPUs.

The last convolution's 7x7 kernel has few outputs, which would leave most vector lanes idle: it is
written as an 8x8 kernel of stride 2 that makes 2 x 2 pixels at once, a third of the time.
Biases before an instance norm are left out, as the norm takes them away again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float32

from motion_transfer.drawing.graphs.graph import Graph
from nhrr_core.config import ModelConfig
from nhrr_core.tensors import FEATURE_DOWN_BLOCKS, convolution_layers

Kernel = Float32[np.ndarray, "A B H W"]

Weights = Mapping[str, Float32[np.ndarray, "..."]]
"""A model's tensors, by the names of `NeuralReRenderer.state_dict()`."""

Projection = Callable[[Float32[np.ndarray, "I O 3 3"]], Float32[np.ndarray, "I O 3 3"]]

Ranges = Mapping[str, tuple[float, float]]
"""The least and the largest value that convolutions read, by the names of their weights."""

BYTE_LEVELS = 127
"""Of an 8-bit number with a sign, either way."""

WEIGHT_LEVELS = 63
"""Likewise of a weight, where CPUs may compute: x86 without VNNI adds products of bytes by twos in
16 bits, where 2 * 255 * 63 fits. By the perceptual distance `lite` is as near as with 127."""

NORM_EPSILON = 1e-5  # of torch's norms


class Convolutions:
    """Appends convolutions of a model's weights to a graph, of 8-bit numbers where ranges tell.

    Attributes:
        read: What each has read so far, by the name of its weight.
    """

    def __init__(
        self,
        graph: Graph,
        weights: Weights,
        ranges: Ranges | None = None,
        weight_levels: int = WEIGHT_LEVELS,
    ) -> None:
        self._graph = graph
        self._weights = weights
        self._ranges = ranges or {}
        self._weight_levels = weight_levels
        self.read: dict[str, str] = {}

    def plain(self, x: str, name: str, *, bias: bool = False, **attributes: Any) -> str:
        """A convolution."""
        weight = self._weights[f"{name}.weight"]
        return self._append("Conv", x, name, weight, self._bias(name) if bias else None, attributes)

    def folded(self, x: str, name: str, norm: str) -> str:
        """A 3x3 convolution, the batch norm after it, and ReLU."""
        weight, bias = fold_norm(self._weights, name, norm)
        y = self._append("Conv", x, name, weight, bias, {"pads": [1, 1, 1, 1]})
        return self._graph("Relu", y)

    def doubling(self, x: str, name: str, project: Projection | None) -> str:
        """A 3x3 transposed convolution of stride 2, see `nhrr_core.render_net.UpConvolution`."""
        weight = self._weights[f"{name}.weight"]
        weight = project(weight) if project else weight
        places = {"strides": [2, 2], "pads": [1, 1, 1, 1], "output_padding": [1, 1]}
        return self._append("ConvTranspose", x, name, weight, None, places)

    def in_blocks(self, x: str, name: str) -> str:
        """A 7x7 convolution of few outputs and stride 1, of what is padded."""
        weight = self._weights[f"{name}.weight"]
        # the four pixels of a 2 x 2 block see the kernel at four places of an 8x8 window
        shifts = [((0, 0), (0, 0), (y, 1 - y), (x, 1 - x)) for y in (0, 1) for x in (0, 1)]
        block = np.concatenate([np.pad(weight, shift) for shift in shifts], axis=1)
        block = block.reshape(4 * len(weight), weight.shape[1], 8, 8)
        bias = np.repeat(self._bias(name), 4)
        y = self._append("Conv", x, name, block, bias, {"strides": [2, 2]})
        return self._graph("DepthToSpace", y, blocksize=2, mode="CRD")

    def _bias(self, name: str) -> Float32[np.ndarray, " O"]:
        return self._weights[f"{name}.bias"]

    def _append(
        self,
        operator: str,
        x: str,
        name: str,
        weight: Kernel,
        bias: Float32[np.ndarray, " O"] | None,
        attributes: dict[str, Any],
    ) -> str:
        self.read[name] = x
        inputs = [x, weight]
        if name in self._ranges:
            outputs = 1 if operator == "ConvTranspose" else 0
            inputs = [self._rounded(x, *self._ranges[name]), self._stored(weight, outputs)]
        return self._graph(operator, *inputs, *([] if bias is None else [bias]), **attributes)

    def _rounded(self, x: str, least: float, largest: float) -> str:
        """Round what a convolution reads to 8 bits, without a sign where nothing is negative."""
        if least >= 0:
            scale, zero = largest / 255, np.uint8(0)
        else:
            scale, zero = max(-least, largest) / BYTE_LEVELS, np.int8(0)
        step = scale or 1.0  # of what is 0 everywhere
        codes = self._graph("QuantizeLinear", x, step, np.array(zero))
        return self._graph("DequantizeLinear", codes, step, np.array(zero))

    def _stored(self, weight: Kernel, outputs: int) -> str:
        """Store a kernel in 8 bits, with a scale for each output channel.

        Args:
            outputs: The kernel's axis of output channels.
        """
        others = tuple(axis for axis in range(weight.ndim) if axis != outputs)
        scale = np.abs(weight).max(others, keepdims=True) / np.float32(self._weight_levels)
        scale[scale == 0] = 1
        codes = np.round(weight / scale).astype(np.int8)
        zeros = np.zeros(scale.size, np.int8)
        return self._graph("DequantizeLinear", codes, scale.ravel(), zeros, axis=outputs)


def fold_norm(weights: Weights, name: str, norm: str) -> tuple[Kernel, Float32[np.ndarray, " O"]]:
    """Make kernel and bias of a convolution without a bias and the batch norm after it."""
    scale, shift, mean, variance = (
        weights[f"{norm}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")
    )
    gain = scale / np.sqrt(variance + np.float32(NORM_EPSILON))
    return weights[f"{name}.weight"] * gain[:, None, None, None], shift - mean * gain


def append_feature_net(graph: Graph, x: str, weights: Weights) -> str:
    """Append FeatureNet, which completes a texture, see `nhrr_core.FeatureNet`."""
    convolutions = Convolutions(graph, weights)

    def two(x: str, name: str) -> str:
        for index in (0, 3):
            x = convolutions.folded(x, f"{name}.{index}", f"{name}.{index + 1}")
        return x

    skips = [two(x, "feature_net.entry")]
    for level in range(FEATURE_DOWN_BLOCKS):
        half = graph("MaxPool", skips[-1], kernel_shape=[2, 2], strides=[2, 2])
        skips.append(two(half, f"feature_net.down.{level}"))
    x = skips.pop()
    for level in range(FEATURE_DOWN_BLOCKS):
        joined = graph.join(enlarge(graph, x, 2), skips.pop())
        x = two(joined, f"feature_net.up.{level}")
    return convolutions.plain(x, "feature_net.exit", bias=True)


def append_render_net(
    graph: Graph,
    features: str,
    weights: Weights,
    config: ModelConfig,
    ranges: Ranges | None = None,
    weight_levels: int = WEIGHT_LEVELS,
) -> tuple[str, dict[str, str]]:
    """Append RenderNet, which draws a feature image, see `nhrr_core.RenderNet`.

    Args:
        ranges: Of what its convolutions read, where they are to be of 8-bit numbers.
        weight_levels: Of their weights then, either way.
    Returns: The drawing in [-1, 1], and what each convolution reads.
    """
    convolutions = Convolutions(graph, weights, ranges, weight_levels)
    names = (f"render_net.layers.{index}" for index in convolution_layers(config))
    width = config.render_width

    def norm(x: str, channels: int) -> str:
        ones, zeros = np.ones(channels, np.float32), np.zeros(channels, np.float32)
        return graph("InstanceNormalization", x, ones, zeros, epsilon=NORM_EPSILON)

    x = convolutions.plain(_reflect(graph, features, 3), next(names))
    x = graph("Relu", norm(x, width))
    for _ in range(config.down_blocks):
        width *= 2
        x = convolutions.plain(x, next(names), strides=[2, 2], pads=[1, 1, 1, 1])
        x = graph("Relu", norm(x, width))
    for _ in range(config.residual_blocks):
        block = next(names)
        y = convolutions.plain(_reflect(graph, x, 1), f"{block}.body.1")
        y = graph("Relu", norm(y, width))
        y = convolutions.plain(_reflect(graph, y, 1), f"{block}.body.5")
        x = graph("Add", x, norm(y, width))
    for i in reversed(range(config.down_blocks)):
        width //= 2
        project = even_kernel if config.even else None
        if config.bilinear and i == 0:
            project = bilinear_kernel
        x = convolutions.doubling(x, next(names), project)
        x = graph("Relu", norm(x, width))
    if config.geometry:  # the shortcut: what is as fine as a finger is lost in the layers before
        x = graph.join(x, features)
    x = convolutions.in_blocks(_reflect(graph, x, 3), next(names))
    return graph("Tanh", x), convolutions.read


def even_kernel(weight: Float32[np.ndarray, "I O 3 3"]) -> Float32[np.ndarray, "I O 3 3"]:
    """Project kernels as `nhrr_core.render_net.even_kernel` does."""
    rows = np.stack([weight[..., 1], weight[..., 0] + weight[..., 2]], -1)
    sums = np.stack([rows[..., 1, :], rows[..., 0, :] + rows[..., 2, :]], -2)
    share = np.array([[1, 0.5], [0.5, 0.25]], np.float32)
    mean = (sums * share).sum((-2, -1), keepdims=True) / share.sum()
    change = (mean - sums) * share
    return weight + change[..., [1, 0, 1], :][..., [1, 0, 1]]


def bilinear_kernel(weight: Float32[np.ndarray, "I O 3 3"]) -> Float32[np.ndarray, "I O 3 3"]:
    """Project kernels as `nhrr_core.render_net.bilinear_kernel` does."""
    bilinear = np.outer(*[np.array([0.5, 1, 0.5], np.float32)] * 2)
    share = (weight * bilinear).sum((-2, -1), keepdims=True) / np.square(bilinear).sum()
    return share * bilinear


def enlarge(graph: Graph, x: str, factor: int) -> str:
    """Enlarge an image bilinearly, as `torch.nn.functional.interpolate` does."""
    scales = np.array([1, 1, factor, factor], np.float32)
    places = "half_pixel"
    return graph("Resize", x, "", scales, mode="linear", coordinate_transformation_mode=places)


def _reflect(graph: Graph, x: str, width: int) -> str:
    return graph("Pad", x, np.array([0, 0, width, width] * 2), mode="reflect")
