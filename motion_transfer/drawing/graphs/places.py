"""What lies around the networks as ONNX nodes: the texture's holes, the look-up, the outline."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32

from motion_transfer.drawing.graphs.graph import FLOAT, INT32, INT64, Graph
from motion_transfer.drawing.graphs.networks import enlarge
from motion_transfer.drawing.textures import pick_nearest, twins
from nhrr_core.config import (
    CLEARANCE_SIZE,
    DETAIL_FULL,
    DETAIL_NONE,
    FILL_FROM,
    FILL_METRES,
    FILL_TO,
    PLACE_METRES,
)
from nhrr_core.uv_tables import (
    CHART_SIZE,
    MAX_SPREAD,
    SMOOTHED_OVER,
    WORD,
    UVTables,
    load_uv_tables,
)

TINY = 1e-6  # far below the smallest weight that is not 0, a sixteenth
LEAST = 1e-20  # likewise of a place's weight, even across the whole body


def fill_holes(graph: Graph, texture: str, shown: str, size: int, channels: int) -> tuple[str, str]:
    """Fill a partial texture from its mirror images and surroundings.

    See `nhrr_core.mirror_texture` and `fill_texture`.

    Args:
        texture, shown: 1 x C x T x T, and 1 x 1 x T x T, 1 where it shows something.
        size, channels: T and C.
    Returns: The texture, and 1 where it or its mirror image was seen.
    """
    tables = load_uv_tables()
    colours = graph("Reshape", texture, np.array([1, channels, -1]))
    known = graph("Reshape", shown, np.array([1, 1, -1]))
    side, depth = twins(size)
    for twin in (side, depth, side):
        hidden = graph("Equal", known, 0)
        colours = graph("Where", hidden, graph("Gather", colours, twin, axis=2), colours)
        known = graph("Max", known, graph("Gather", known, twin, axis=2))
    texture = graph("Reshape", colours, np.array([1, channels, size, size]))
    shown = graph("Reshape", known, np.array([1, 1, size, size]))

    counted = graph("Mul", shown, _lie_at_their_place(tables, size))
    weighted = graph.join(graph("Mul", texture, counted), counted)
    shares = _area_shares(size)
    places = graph("MatMul", graph("MatMul", shares, weighted), shares.T.copy())
    rows = graph("Reshape", places, np.array([1, channels + 1, FILL_FROM**2]))
    spread = graph("MatMul", rows, _measure_surroundings(graph, tables))
    total, weight = graph.part(spread, 0, channels), graph.part(spread, channels, channels + 1)
    mean = graph("Div", total, graph("Max", weight, LEAST))
    mean = graph("Reshape", mean, np.array([1, channels, FILL_TO, FILL_TO]))
    filled = resize_nearest(graph, mean, FILL_TO, size)
    return graph("Where", graph("Greater", shown, 0), texture, filled), shown


def resize_nearest(graph: Graph, x: str, size: int, wanted: int) -> str:
    """Resize N x C x size x size to wanted x wanted, as torch's `nearest` does."""
    if size == wanted:
        return x
    chosen = np.arange(wanted) * size // wanted
    return graph("Gather", graph("Gather", x, chosen, axis=2), chosen, axis=3)


def _area_shares(size: int) -> Float32[np.ndarray, "P T"]:
    """The share of each of T texels in each of FILL_FROM places, along one axis."""
    shares = np.zeros((FILL_FROM, size), np.float32)
    for place in range(FILL_FROM):
        first, end = place * size // FILL_FROM, -(-(place + 1) * size // FILL_FROM)
        shares[place, first:end] = 1 / (end - first)
    return shares


def _measure_surroundings(graph: Graph, tables: UVTables) -> str:
    """Weigh places as `nhrr_core.measure_surroundings` does, N x M.

    In the graph, whose reader computes it once: as a constant it would be half of the file.
    """
    given, wanted = (
        _places(tables.position, count).reshape(-1, 3) for count in (FILL_FROM, FILL_TO)
    )
    squared = FILL_METRES**2
    for one, other in zip(given.T, wanted.T, strict=True):
        apart = graph("Sub", one[:, None], other[None])
        squared = graph("Add", graph("Mul", apart, apart), squared)
    share = graph("Div", FILL_METRES**2, squared)
    return graph("Mul", graph("Mul", share, share), share)  # a power takes ten times as long


def _places(position: Float32[np.ndarray, "256 256 3"], count: int) -> Float32[np.ndarray, "P P 3"]:
    """Where the middles of count x count equal shares of the texture lie on the body."""
    step = len(position) // count
    return position[step // 2 :: step, step // 2 :: step]


def _lie_at_their_place(tables: UVTables, size: int) -> Float32[np.ndarray, "T T"]:
    """1 where a texel belongs to the place whose share of the texture it lies in, else 0."""
    step = len(tables.position) // FILL_FROM
    own = _places(tables.position, FILL_FROM).repeat(step, 0).repeat(step, 1)
    near = np.linalg.norm(tables.position - own, axis=-1) < PLACE_METRES
    chosen = np.arange(size) * len(near) // size
    return near[chosen][:, chosen].astype(np.float32)


def texel_positions(size: int) -> Float32[np.ndarray, "1 3 T T"]:
    """The position of each texel on the body, each axis in [-1, 1]."""
    position = load_uv_tables().position.transpose(2, 0, 1)
    places = pick_nearest(position, size) / np.abs(position).max((1, 2), keepdims=True)
    return np.ascontiguousarray(places[None])


def look_up(graph: Graph, values: str, grid: str, body: str) -> str:
    """Look each pixel up in a map, 1 x D x T x T, see `nhrr_core.sample_features`.

    Args:
        grid: Where each pixel lies in it, (x, y), 1 x H x W x 2, in [-1, 1].
    Returns: 1 x D x H x W, 0 outside the body.
    """
    sampled = graph("GridSample", values, grid, mode="bilinear", padding_mode="border")
    return graph("Mul", sampled, body)


def find_body(graph: Graph, iuv: str) -> str:
    """Tell where anybody is in 1 x H x W x 3 uint8: 1 x 1 x H x W, 1 or 0."""
    part = graph("Gather", iuv, np.array(0), axis=3)
    return graph("Min", graph("Cast", graph("Unsqueeze", part, np.array([1])), to=FLOAT), 1)


def find_places(graph: Graph, iuv: str) -> str:
    """Where each pixel lies in the texture, (x, y), 1 x H x W x 2; the background is part 1's."""
    # the table is of 16-bit words, which graphics processors do not know: as bytes, low and high
    words = (load_uv_tables().charts * WORD).round().astype(np.uint16).reshape(-1, 2)
    table = np.concatenate([words & 255, words >> 8], axis=1).astype(np.uint8)
    found = graph("Cast", graph("Gather", table, _chart_rows(graph, iuv), axis=0), to=FLOAT)
    low, high = (
        graph("Slice", found, *(np.array([number]) for number in (first, first + 2, 3)))
        for first in (0, 2)
    )
    return graph("Div", graph("Add", low, graph("Mul", high, 256)), float(WORD))


def smooth_places(graph: Graph, iuv: str, places: str) -> str:
    """Tell where pixels lie between the levels of U and V, see `nhrr_core.smooth_coordinates`.

    Args:
        places: What `find_places` found.
    Returns: The places, as they came.
    """
    part = graph("Unsqueeze", graph("Gather", iuv, np.array(0), axis=3), np.array([1]))
    fine = graph("Transpose", places, perm=[0, 3, 1, 2])
    known = graph.join(graph("Cast", part, to=FLOAT), fine)
    for side in SMOOTHED_OVER:
        reach = side // 2
        pads = np.array([0, 0, reach, reach, 0, 0, reach, reach])
        around = graph("Pad", known, pads, -1)  # beyond the image: no part is -1
        window = {"kernel_shape": [side, side], "strides": [1, 1]}
        highest = graph("MaxPool", around, **window)
        lowest = graph("Neg", graph("MaxPool", graph("Neg", around), **window))
        spread = graph("Sub", highest, lowest)
        # a part is a whole number
        limits = np.array([0.5, MAX_SPREAD, MAX_SPREAD], np.float32)[:, None, None]
        over = graph("ReduceMax", graph("Sub", spread, limits), axes=[1])
        mean = graph.part(graph("AveragePool", around, **window), 1, 3)
        fine = graph("Where", graph("Less", over, 0), mean, fine)
    return graph("Transpose", fine, perm=[0, 2, 3, 1])


def _chart_rows(graph: Graph, iuv: str) -> str:
    """The row of the flat table of charts, 1 x H x W, of each pixel; the background is part 1's."""
    codes = graph("Cast", iuv, to=INT32)
    part, u, v = (graph("Gather", codes, np.array(channel), axis=3) for channel in range(3))
    one, side = np.array(1, np.int32), np.array(CHART_SIZE, np.int32)
    chart = graph("Sub", graph("Max", part, one), one)
    row = graph("Add", graph("Mul", chart, side), v)
    return graph("Add", graph("Mul", row, side), u)


def spread_colours(graph: Graph, x: str, known: str, levels: int, channels: int) -> str:
    """Carry what is known beyond its outline, see `nhrr_core.sampling.spread_colours`.

    Args:
        x, known: 1 x C x H x W, and 1 x 1 x H x W, 1 or 0.
        channels: C.
    """
    size = graph("Slice", graph("Shape", known), np.array([2]), np.array([4]))
    padding = graph("Mod", graph("Neg", size), np.array(2**levels))
    pads = graph("Concat", np.zeros(6, np.int64), padding, axis=0)
    means = [graph("Pad", graph("Mul", graph.join(x, known), known), pads, 0)]
    for _ in range(levels):
        mean = graph("AveragePool", means[-1], kernel_shape=[2, 2], strides=[2, 2])
        weight = graph.part(mean, channels, channels + 1)
        means.append(graph("Div", mean, graph("Max", weight, TINY)))
    filled = means.pop()
    while means:
        finer = means.pop()
        filled = enlarge(graph, filled, 2)
        weight = graph.part(filled, channels, channels + 1)
        filled = graph("Div", filled, graph("Max", weight, TINY))
        certain = graph("Greater", graph.part(finer, channels, channels + 1), 0)
        filled = graph("Where", certain, finer, filled)
    whole = graph("Slice", filled, np.array([0, 0]), size, np.array([2, 3]))
    return graph.part(whole, 0, channels)


def signed_distance(graph: Graph, body: str, reach: int) -> str:
    """Measure the distance to the outline, see `nhrr_core.sampling.signed_distance`.

    Args:
        body: 1 x 1 x H x W, 1 or 0.
    """
    outside = graph("Sub", 1, body)
    squared = graph("Mul", graph.join(outside, body), float((reach + 1) ** 2))
    for axis in (2, 3):  # squares add up, so one axis after the other is exact
        squared = _nearest_along(graph, squared, axis, reach)
    lengths = graph("Sqrt", squared)
    beyond, within = graph.part(lengths, 0, 1), graph.part(lengths, 1, 2)
    inside = graph("Greater", body, 0)
    distance = graph("Where", inside, graph("Sub", 0.5, within), graph("Sub", beyond, 0.5))
    return graph("Clip", distance, float(-reach), float(reach))


def _nearest_along(graph: Graph, squared: str, axis: int, reach: int) -> str:
    """The least sum of a squared distance within reach along an axis, and that way squared."""
    length = graph("Slice", graph("Shape", squared), *(np.array([axis + i]) for i in (0, 1)))
    last = graph("Sub", graph("Squeeze", length), np.array(1))
    own = graph("Range", np.array(0), graph("Add", last, np.array(1)), np.array(1))
    step = np.arange(-reach, reach + 1)
    # beyond the edge its last pixel counts again, from farther away
    shifted = graph("Add", graph("Unsqueeze", own, np.array([0])), step[:, None])
    index = graph("Min", graph("Max", shifted, np.array(0)), last)
    away = np.square(step).astype(np.float32).reshape(-1, *[1] * (4 - axis))
    sums = graph("Add", graph("Gather", squared, index, axis=axis), away)
    return graph("ReduceMin", sums, axes=[axis], keepdims=0)


def pixels_per_texel(graph: Graph, places: str, body: str) -> str:
    """Measure how large the body is in its image, 1 x 1 x 1 x 1, see `nhrr_core.clearance`."""
    texels = graph("Mul", places, float(CLEARANCE_SIZE))
    texels = graph("Cast", graph("Clip", texels, 0, float(CLEARANCE_SIZE - 1)), to=INT64)
    row = graph("Mul", texels, np.array([1, CLEARANCE_SIZE]))
    index = graph("Reshape", graph("ReduceSum", row, np.array([3]), keepdims=0), np.array([-1]))
    flat = graph("Reshape", body, np.array([-1]))
    # what is not the body's falls on one more texel, which does not count
    beyond = np.array(CLEARANCE_SIZE**2)
    index = graph("Where", graph("Greater", flat, 0), index, beyond)
    blank = np.zeros(CLEARANCE_SIZE**2 + 1, np.float32)
    hit = graph("ScatterElements", blank, index, flat, axis=0)
    pixels, texels = (graph("ReduceSum", each, keepdims=0) for each in (flat, hit))
    ratio = graph("Div", pixels, graph("Max", texels, 1))
    scale = graph("Where", graph("Greater", pixels, 0), graph("Sqrt", ratio), 1)
    return graph("Reshape", scale, np.array([1, 1, 1, 1]))


def detail_share(graph: Graph, scale: str, size: int) -> str:
    """Tell how much of a source's detail is drawn, 1 x 1 x 1 x 1, see `nhrr_core.clearance`."""
    apart = graph("Div", size / CLEARANCE_SIZE, scale)
    share = graph("Mul", graph("Sub", DETAIL_NONE, apart), 1 / (DETAIL_NONE - DETAIL_FULL))
    return graph("Clip", share, 0.0, 1.0)
