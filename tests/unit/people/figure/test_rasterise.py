"""The rasteriser against loops that say what it means."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.figure.rasterise import (
    EMPTY,
    Triangles,
    depths,
    rasterise,
    triangle_ids,
)

WIDTH, HEIGHT = 24, 18


def reference(screen: np.ndarray, triangles: Triangles) -> tuple[np.ndarray, np.ndarray]:
    """Nearest triangle and its depth at every pixel centre, by solving for each of them."""
    ids, nearest = np.full((HEIGHT, WIDTH), -1), np.full((HEIGHT, WIDTH), np.inf)
    for number, corners in enumerate(triangles.faces):
        a, b, c = screen[corners].astype(float)
        matrix = np.array([[a[0], b[0], c[0]], [a[1], b[1], c[1]], [1, 1, 1]])
        turn = np.linalg.det(matrix)
        if min(a[2], b[2], c[2]) <= 0 or turn == 0 or (triangles.cull[number] and turn > 0):
            continue
        for y in range(HEIGHT):
            for x in range(WIDTH):
                weights = np.linalg.solve(matrix, [x + 0.5, y + 0.5, 1])
                if (weights < 0).any() or weights @ triangles.keep[corners] < 0:
                    continue
                depth = 1 / (weights / screen[corners, 2]).sum()
                if depth < nearest[y, x]:
                    ids[y, x], nearest[y, x] = number, depth
    return ids, nearest


@pytest.mark.parametrize("seed", range(6))
def test_equals_the_reference(seed):
    rng = np.random.default_rng(seed)
    screen = rng.uniform((-4, -4, 1), (WIDTH + 4, HEIGHT + 4, 5), (36, 3)).astype(np.float32)
    faces = np.arange(36, dtype=np.int32).reshape(-1, 3)
    keep = rng.uniform(-0.5, 1, 36).astype(np.float32)
    triangles = Triangles(faces, keep, rng.integers(0, 2, 12).astype(np.uint8))
    nearest = rasterise(screen, triangles, WIDTH, HEIGHT)
    ids, depth = reference(screen, triangles)
    assert (ids >= 0).mean() > 0.2
    assert (triangle_ids(nearest).reshape(HEIGHT, WIDTH) == ids).all()
    seen = ids >= 0
    np.testing.assert_allclose(depths(nearest).reshape(HEIGHT, WIDTH)[seen], depth[seen], rtol=1e-5)


def test_by_default_backs_are_culled_and_everything_is_kept():
    corners = np.array([[2, 2, 1], [20, 3, 1], [3, 15, 1]], np.float32)  # clockwise: a back
    front = rasterise(corners, Triangles(np.array([[0, 2, 1]], np.int32)), WIDTH, HEIGHT)
    back = rasterise(corners, Triangles(np.array([[0, 1, 2]], np.int32)), WIDTH, HEIGHT)
    both = rasterise(corners, Triangles.two_sided(np.array([[0, 1, 2]], np.int32)), WIDTH, HEIGHT)
    assert (front != EMPTY).sum() == (both != EMPTY).sum() > 0
    assert (back == EMPTY).all()


def test_nothing_is_seen_of_nothing():
    behind = np.array([[0, 0, -1], [20, 0, -1], [0, 20, -1]], np.float32)
    one = Triangles.two_sided(np.array([[0, 1, 2]], np.int32))
    nearest = rasterise(behind, one, WIDTH, HEIGHT)
    assert (nearest == EMPTY).all()
    assert (triangle_ids(nearest) == -1).all()
    assert np.isnan(depths(nearest)).all()


def test_neighbours_share_an_edge_without_a_gap():
    square = np.array([[2, 2, 1], [20, 3, 1], [19, 15, 1], [3, 16, 1]], np.float32)
    two = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    filled = rasterise(square, Triangles.two_sided(two), WIDTH, HEIGHT)
    filled = filled.reshape(HEIGHT, WIDTH)
    columns = [np.flatnonzero(row != EMPTY) for row in filled]
    assert all(len(c) == c[-1] - c[0] + 1 for c in columns if len(c))
