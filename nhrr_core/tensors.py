"""Which tensors a model has, without making it: their names, and their shapes."""

from __future__ import annotations

from collections.abc import Iterator

from nhrr_core.config import (
    COLOUR_CHANNELS,
    PHOTO_FEATURES,
    PICTURE_CHANNELS,
    ModelConfig,
    RenderSizes,
)

FEATURE_DOWN_BLOCKS = 4
"""How often FeatureNet halves its texture."""

PHOTO_WIDTH = 16
"""PhotoNet's channels at full size."""
Shape = tuple[int, ...]


def feature_widths(width: int) -> list[int]:
    """Tell FeatureNet's channels at full size and after each halving."""
    return [width, width * 2, width * 4, width * 8, width * 8]


def list_tensors(config: ModelConfig) -> dict[str, Shape]:
    """List the tensors of `NeuralReRenderer(config).state_dict()`, in no order.

    All are floating but the batch norms' `num_batches_tracked`.
    """
    tensors: dict[str, Shape] = {}
    for name, sizes in _render_nets(config):
        tensors |= _render_net(name, sizes)
    if config.has_feature_net:
        tensors |= _feature_net(config)
        if config.prior:
            side = config.texture_size
            tensors["prior"] = (1, COLOUR_CHANNELS, side, side)
    if config.variant == "texture-features":
        width = PHOTO_WIDTH
        tensors |= _two_convolutions("photo_net.entry", PICTURE_CHANNELS, width)
        tensors |= _two_convolutions("photo_net.down", width, 2 * width)
        tensors |= _convolution("photo_net.exit", (PHOTO_FEATURES, 3 * width, 1, 1))
    return tensors


def _feature_net(config: ModelConfig) -> Iterator[tuple[str, Shape]]:
    widths = feature_widths(config.feature_width)
    yield from _two_convolutions("feature_net.entry", config.feature_inputs, widths[0])
    for level in range(FEATURE_DOWN_BLOCKS):
        yield from _two_convolutions(f"feature_net.down.{level}", widths[level], widths[level + 1])
        finer = FEATURE_DOWN_BLOCKS - 1 - level
        outputs = widths[max(finer - 1, 0)]
        yield from _two_convolutions(f"feature_net.up.{level}", 2 * widths[finer], outputs)
    yield from _convolution("feature_net.exit", (config.feature_outputs, widths[0], 1, 1))


def _two_convolutions(name: str, inputs: int, outputs: int) -> Iterator[tuple[str, Shape]]:
    for index, channels in ((0, inputs), (3, outputs)):
        yield f"{name}.{index}.weight", (outputs, channels, 3, 3)
        norm = f"{name}.{index + 1}"
        for part in ("weight", "bias", "running_mean", "running_var"):
            yield f"{norm}.{part}", (outputs,)
        yield f"{norm}.num_batches_tracked", ()


def _render_nets(config: ModelConfig) -> Iterator[tuple[str, RenderSizes]]:
    if config.variant == "dpt":
        yield "render_net.direct", config.direct_sizes
        yield "render_net.blending", config.blending_sizes
    else:
        yield "render_net", config.render_sizes


def _render_net(name: str, sizes: RenderSizes) -> Iterator[tuple[str, Shape]]:
    width, layers = sizes.width, f"{name}.layers"
    first, *down = convolution_layers(sizes)
    yield from _convolution(f"{layers}.{first}", (width, sizes.inputs, 7, 7))
    blocks = down[sizes.down_blocks :][: sizes.residual_blocks]
    up = down[sizes.down_blocks + sizes.residual_blocks : -1]
    for layer in down[: sizes.down_blocks]:
        yield from _convolution(f"{layers}.{layer}", (2 * width, width, 3, 3))
        width *= 2
    for layer in blocks:
        for index in (1, 5):
            yield from _convolution(f"{layers}.{layer}.body.{index}", (width, width, 3, 3))
    for layer in up:  # transposed: inputs come first
        yield f"{layers}.{layer}.weight", (width, width // 2, 3, 3)
        yield f"{layers}.{layer}.bias", (width // 2,)
        width //= 2
    read = width + sizes.inputs * sizes.shortcut
    yield from _convolution(f"{layers}.{down[-1]}", (sizes.outputs, read, 7, 7))


def _convolution(name: str, shape: Shape) -> Iterator[tuple[str, Shape]]:
    yield f"{name}.weight", shape
    yield f"{name}.bias", shape[:1]


def convolution_layers(sizes: ModelConfig | RenderSizes) -> list[int]:
    """Tell where convolutions and residual blocks stand among a RenderNet's layers."""
    first_block = 4 + 3 * sizes.down_blocks
    first_doubling = first_block + sizes.residual_blocks
    last_doubling = first_doubling + 3 * sizes.down_blocks
    return [
        *range(1, first_block, 3),
        *range(first_block, first_doubling),
        *range(first_doubling, last_doubling, 3),
        last_doubling + 1,
    ]
