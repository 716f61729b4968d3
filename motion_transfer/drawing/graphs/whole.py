"""The graphs that engines run: a texture becomes a feature map, target IUV becomes frames.

An image a call: on CPUs, calls side by side are as fast as batches.
"""

from __future__ import annotations

import numpy as np
import onnx

from motion_transfer.drawing.graphs.graph import FLOAT, UINT8, Graph
from motion_transfer.drawing.graphs.networks import (
    WEIGHT_LEVELS,
    Ranges,
    Weights,
    append_feature_net,
    append_render_net,
    enlarge,
)
from motion_transfer.drawing.graphs.places import (
    detail_share,
    fill_holes,
    find_body,
    find_places,
    look_up,
    pixels_per_texel,
    resize_nearest,
    signed_distance,
    smooth_places,
    spread_colours,
    texel_positions,
)
from nhrr_core.config import (
    CLEARANCE_CHANNELS,
    CLEARANCE_SIZE,
    COLOUR_CHANNELS,
    IUV_CHANNELS,
    MARGIN_LEVELS,
    OUTLINE_PIXELS,
    POSITION_CHANNELS,
    UNIT_PIXELS,
    UNIT_TEXELS,
    ModelConfig,
)
from nhrr_core.parts import PART_COUNT

TEXTURE, VISIBILITY, CLEARANCE = "texture", "visibility", "clearance"
FEATURE_MAP, DETAIL = "feature_map", "detail"
IUV, FEATURES, FRAME = "iuv", "features", "frame"
SAMPLED, DISTANCE, UNIT = "sampled", "distance", "unit"


def build_encoder(config: ModelConfig, weights: Weights) -> onnx.ModelProto:
    """Build what `NeuralReRenderer.encode_texture` and `detail` compute.

    Inputs: `texture`, 1 x 3 x t x t in [-1, 1], 0 where nothing is seen, t being
    `config.finest_texture`; `visibility`, 1 x 1 x t x t, 1 or 0; with `config.clearance`
    `clearance`, 1 x 2 x 128 x 128, 0 where it is not known. Outputs: `feature_map`, 1 x D x T x T,
    T being `config.texture_size`; with `config.has_detail` `detail`, 1 x 3 x t x t.
    """
    graph = Graph()
    finest, size = config.finest_texture, config.texture_size
    texture = graph.input(TEXTURE, FLOAT, (1, COLOUR_CHANNELS, finest, finest))
    visibility = graph.input(VISIBILITY, FLOAT, (1, 1, finest, finest))
    completed, detail = _complete(graph, texture, visibility, config, weights)
    carried = [completed]
    if config.clearance:
        shape = (1, CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE)
        clearance = graph.input(CLEARANCE, FLOAT, shape)
        lengths, measured = graph.part(clearance, 0, 1), graph.part(clearance, 1, 2)
        filled, known = fill_holes(graph, lengths, measured, CLEARANCE_SIZE, 1)
        any_known = graph("ReduceMax", known, axes=[2, 3])
        flag = graph("Add", any_known, np.zeros((1, 1, CLEARANCE_SIZE, CLEARANCE_SIZE), np.float32))
        carried.append(resize_nearest(graph, graph.join(filled, flag), CLEARANCE_SIZE, size))
    if config.geometry:
        carried.append(graph.constant(texel_positions(size)))
    graph.output(FEATURE_MAP, graph.join(*carried), FLOAT, (1, config.map_channels, size, size))
    if detail is not None:
        graph.output(DETAIL, detail, FLOAT, (1, COLOUR_CHANNELS, finest, finest))
    return graph.build("encoder")


def _complete(
    graph: Graph, texture: str, visibility: str, config: ModelConfig, weights: Weights
) -> tuple[str, str | None]:
    """Append what `NeuralReRenderer` does to a texture.

    Returns: The learned features; and what the texture shows finer, where that is wanted.
    """
    if not config.has_feature_net:
        return texture, None
    factor = config.finest_texture // config.texture_size
    coarse, seen, share = texture, visibility, visibility
    if factor > 1:
        pool = {"kernel_shape": [factor, factor], "strides": [factor, factor]}
        share = graph("AveragePool", visibility, **pool)
        mean = graph("AveragePool", texture, **pool)
        coarse = graph("Div", mean, graph("Max", share, 1 / factor**2))
        seen = graph("Cast", graph("Greater", share, 0), to=FLOAT)
    own = _read_by_feature_net(graph, coarse, seen, config, weights)
    features = append_feature_net(graph, graph.join(*own), weights)
    if not config.colour_shortcut:
        return features, None
    detail = None
    if config.has_detail:
        finer = graph("Sub", texture, enlarge(graph, own[0], factor))
        detail = graph("Mul", finer, visibility)
    change = graph("Mul", graph.part(features, 0, COLOUR_CHANNELS), graph("Sub", 1, share))
    colours = graph("Add", own[0], change)
    return _with_colours(graph, colours, features, config.feature_outputs), detail


def _with_colours(graph: Graph, colours: str, features: str, channels: int) -> str:
    """Put colours in the place of the first three channels."""
    if channels == COLOUR_CHANNELS:
        return colours
    return graph.join(colours, graph.part(features, COLOUR_CHANNELS, channels))


def _read_by_feature_net(
    graph: Graph, texture: str, visibility: str, config: ModelConfig, weights: Weights
) -> list[str]:
    """The texture, filled if it is to be, and what is known of it."""
    size = config.texture_size
    known = [visibility] if config.visibility_input else []
    if config.prefilled:
        texture, shown = fill_holes(graph, texture, visibility, size, COLOUR_CHANNELS)
        known.append(shown)
    if config.geometry:
        known.append(graph.constant(texel_positions(size)))
    if config.prior:
        known.append(graph.constant(weights["prior"]))
    return [texture, *known]


def build_sampler(config: ModelConfig) -> onnx.ModelProto:
    """Build what `NeuralReRenderer.feature_image` computes.

    Inputs: `feature_map`, 1 x D x T x T; with `config.has_detail` `detail`, 1 x 3 x t x t; `iuv`,
    1 x H x W x 3 uint8 (I, U, V). Output: `features`, 1 x C x H x W, which RenderNet reads.
    """
    graph = Graph()
    _map_input(graph, config)
    iuv = _iuv_input(graph)
    features, _ = _append_sampler(graph, config, iuv, looked_up=False, starts_frames=False)
    graph.output(FEATURES, features, FLOAT, (1, config.render_inputs, "height", "width"))
    return graph.build("sampler")


def build_painter(
    config: ModelConfig,
    weights: Weights,
    *,
    ranges: Ranges | None = None,
    weight_levels: int = WEIGHT_LEVELS,
    looked_up: bool = False,
    taps: bool = False,
) -> onnx.ModelProto:
    """Build what `NeuralReRenderer.render` computes, from target IUV to a frame of 8 bits.

    Inputs: `feature_map`, 1 x D x T x T; with `config.has_detail` `detail`, 1 x 3 x t x t; `iuv`,
    1 x H x W x 3 uint8 (I, U, V), H and W multiples of 2**down_blocks. Output: `frame`,
    1 x H x W x K uint8, RGB and alpha where the model has it.

    Args:
        ranges: Makes RenderNet's convolutions ones of 8-bit numbers.
        weight_levels: Of their weights then, either way.
        looked_up: Whether `sampled`, 1 x H x W x D, the feature map as the pixels see it, with its
            detail, is an input in place of both; with `config.geometry` also `distance`,
            1 x 1 x H x W, that to the outline, and with `config.clearance` `unit`, 1 x 1 x 1 x 1,
            what a clearance of 1 is in the image. Whoever knows where the body is finds them
            several times as fast as a graph.
        taps: Whether what RenderNet's convolutions read is given out as well, by the names of their
            weights.
    """
    graph = Graph()
    if looked_up:
        graph.input(SAMPLED, FLOAT, (1, "height", "width", config.map_channels))
        if config.geometry:
            graph.input(DISTANCE, FLOAT, (1, 1, "height", "width"))
        if config.clearance:
            graph.input(UNIT, FLOAT, (1, 1, 1, 1))
    else:
        _map_input(graph, config)
    iuv = _iuv_input(graph) if not looked_up or config.told_iuv else ""
    features, colours = _append_sampler(graph, config, iuv, looked_up=looked_up, starts_frames=True)
    drawn, read = append_render_net(graph, features, weights, config, ranges, weight_levels)
    frame = drawn if colours is None else _blend(graph, drawn, colours, config)
    levels = graph("Mul", graph("Add", frame, 1), 127.5)
    rows = graph("Clip", graph("Round", graph("Transpose", levels, perm=[0, 2, 3, 1])), 0, 255)
    shape = (1, "height", "width", config.render_outputs)
    graph.output(FRAME, graph("Cast", rows, to=UINT8), UINT8, shape)
    for name, value in read.items() if taps else ():
        graph.output(name, value, FLOAT, (1, f"{name}_c", f"{name}_h", f"{name}_w"))
    return graph.build("painter")


def _map_input(graph: Graph, config: ModelConfig) -> None:
    size, finest = config.texture_size, config.finest_texture
    graph.input(FEATURE_MAP, FLOAT, (1, config.map_channels, size, size))
    if config.has_detail:
        graph.input(DETAIL, FLOAT, (1, COLOUR_CHANNELS, finest, finest))


def _iuv_input(graph: Graph) -> str:
    return graph.input(IUV, UINT8, (1, "height", "width", IUV_CHANNELS))


def _append_sampler(
    graph: Graph,
    config: ModelConfig,
    iuv: str,
    *,
    looked_up: bool,
    starts_frames: bool,
) -> tuple[str, str | None]:
    """Append the feature image.

    Args:
        looked_up: See `build_painter`.
        starts_frames: Whether the colours that frames start from are wanted as well, which are
            carried beyond the body in one go with what RenderNet is told there.
    Returns: The image; and those colours, where a model has them.
    """
    if looked_up:
        sampled = graph("Transpose", SAMPLED, perm=[0, 3, 1, 2])
        if config.geometry:
            inside = graph("Less", DISTANCE, 0)
        else:  # wherever anything is seen
            inside = graph("Greater", graph("ReduceMax", graph("Abs", sampled), axes=[1]), 0)
        body = graph("Cast", inside, to=FLOAT)
        distance, unit = DISTANCE, UNIT
    else:
        body, places = find_body(graph, iuv), find_places(graph, iuv)
        grid = graph("Sub", graph("Mul", smooth_places(graph, iuv, places), 2), 1)
        sampled = look_up(graph, FEATURE_MAP, grid, body)
        scale = pixels_per_texel(graph, places, body) if config.told_scale else ""
        if config.has_detail:
            finer = look_up(graph, DETAIL, grid, body)
            share = detail_share(graph, scale, config.finest_texture)
            own = graph.part(sampled, 0, COLOUR_CHANNELS)
            colours = graph("Add", own, graph("Mul", finer, share))
            sampled = _with_colours(graph, colours, sampled, config.map_channels)
        unit = graph("Mul", scale, UNIT_TEXELS / UNIT_PIXELS) if config.clearance else ""
        distance = signed_distance(graph, body, OUTLINE_PIXELS) if config.geometry else ""
    learned, end = config.appearance_channels, config.map_channels
    image = [graph.part(sampled, 0, learned)]
    nearest = []
    if config.clearance:
        clearance = graph("Mul", graph.part(sampled, learned, learned + 1), unit)
        image += [clearance, graph.part(sampled, learned + 1, learned + 2)]
        nearest.append(clearance)
    if config.told_iuv:
        codes = graph("Cast", graph("Transpose", iuv, perm=[0, 3, 1, 2]), to=FLOAT)
        scale = np.array([2 / PART_COUNT, 2 / 255, 2 / 255], np.float32)[:, None, None]
        image.append(graph("Sub", graph("Mul", codes, scale), 1))
    told = POSITION_CHANNELS + int(config.clearance)
    carried: list[str] = []  # beyond the body's outline
    if config.geometry:
        carried += [*nearest, graph.part(sampled, end - POSITION_CHANNELS, end)]
    colours = None
    if starts_frames and config.colour_shortcut:
        colours = graph("Clip", graph.part(sampled, 0, COLOUR_CHANNELS), -1, 1)
        carried += [colours] if config.colour_margin else []
    if carried:
        channels = told * config.geometry + COLOUR_CHANNELS * (colours in carried)
        beyond = spread_colours(graph, graph.join(*carried), body, MARGIN_LEVELS, channels)
        if config.geometry:
            image.append(graph.part(beyond, 0, told))
        if colours in carried:
            colours = graph.part(beyond, channels - COLOUR_CHANNELS, channels)
    if config.geometry:
        image.append(graph("Mul", distance, 1 / UNIT_PIXELS))
    return graph.join(*image), colours


def _blend(graph: Graph, drawn: str, colours: str, config: ModelConfig) -> str:
    """Append what makes a frame of a drawing, see `NeuralReRenderer.blend`."""
    # twice: tanh lies in [-1, 1], the difference of two colours in [-2, 2]
    painted = graph("Mul", graph.part(drawn, 0, COLOUR_CHANNELS), 2)
    blended = graph("Clip", graph("Add", colours, painted), -1, 1)
    if not config.alpha:
        return blended
    return graph.join(blended, graph.part(drawn, COLOUR_CHANNELS, COLOUR_CHANNELS + 1))
