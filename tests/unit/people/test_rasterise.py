"""The rasteriser against loops that say what it means."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.rasterise import (  # noqa: E402
    EMPTY,
    Layer,
    depths,
    rasterise,
    triangle_ids,
)

WIDTH, HEIGHT = 24, 18


def reference(layers: list[Layer]) -> tuple[np.ndarray, np.ndarray]:
    """Nearest triangle and its depth at every pixel centre, by solving for each of them."""
    ids, nearest = np.full((HEIGHT, WIDTH), -1), np.full((HEIGHT, WIDTH), np.inf)
    first = 0
    for layer in layers:
        keep = np.ones(len(layer.screen)) if layer.keep is None else layer.keep
        for number, corners in enumerate(layer.faces):
            a, b, c = layer.screen[corners].astype(float)
            matrix = np.array([[a[0], b[0], c[0]], [a[1], b[1], c[1]], [1, 1, 1]])
            turn = np.linalg.det(matrix)
            if min(a[2], b[2], c[2]) <= 0 or turn == 0 or (layer.cull and turn > 0):
                continue
            for y in range(HEIGHT):
                for x in range(WIDTH):
                    weights = np.linalg.solve(matrix, [x + 0.5, y + 0.5, 1])
                    if (weights < 0).any() or weights @ keep[corners] < 0:
                        continue
                    depth = 1 / (weights / layer.screen[corners, 2]).sum()
                    if depth < nearest[y, x]:
                        ids[y, x], nearest[y, x] = first + number, depth
        first += len(layer.faces)
    return ids, nearest


def random_layer(rng: np.random.Generator, triangles: int, **settings) -> Layer:
    count = 3 * triangles
    screen = rng.uniform((-4, -4, 1), (WIDTH + 4, HEIGHT + 4, 5), (count, 3)).astype(np.float32)
    return Layer(screen, np.arange(count, dtype=np.int32).reshape(-1, 3), **settings)


@pytest.mark.parametrize("cull", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_equals_the_reference(seed, cull):
    rng = np.random.default_rng(seed)
    cut = rng.uniform(-1, 1, 18).astype(np.float32)
    layers = [random_layer(rng, 5, cull=cull), random_layer(rng, 6, keep=cut, cull=cull)]
    nearest = rasterise(layers, WIDTH, HEIGHT)
    ids, depth = reference(layers)
    assert (ids >= 0).mean() > 0.2
    assert (triangle_ids(nearest).reshape(HEIGHT, WIDTH) == ids).all()
    seen = ids >= 0
    np.testing.assert_allclose(depths(nearest).reshape(HEIGHT, WIDTH)[seen], depth[seen], rtol=1e-5)


def test_nothing_is_seen_of_nothing():
    behind = Layer(
        np.array([[0, 0, -1], [20, 0, -1], [0, 20, -1]], np.float32),
        np.array([[0, 1, 2]], np.int32),
        cull=False,
    )
    nearest = rasterise([behind], WIDTH, HEIGHT)
    assert (nearest == EMPTY).all()
    assert (triangle_ids(nearest) == -1).all()
    assert np.isnan(depths(nearest)).all()


def test_neighbours_share_an_edge_without_a_gap():
    square = np.array([[2, 2, 1], [20, 3, 1], [19, 15, 1], [3, 16, 1]], np.float32)
    two = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    filled = rasterise([Layer(square, two, cull=False)], WIDTH, HEIGHT).reshape(HEIGHT, WIDTH)
    columns = [np.flatnonzero(row != EMPTY) for row in filled]
    assert all(len(c) == c[-1] - c[0] + 1 for c in columns if len(c))
