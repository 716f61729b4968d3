"""The two flat pictures of a body that its clothes are made by: tubes and charts.

A tube is what a limb or the trunk is measured with, and what cloth hangs on: a small table with one
row for each level along the limb and one column for each angle about it. A sparse operator averages
the skin's vertices into cells, another one reads cells at vertices.

A chart is a surface cut along seams and unfolded so that the cloth's grain runs where asked: a
garment's panel. Its coordinates (u, v) are metres, u to the right and v down as seen from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Int32
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from motion_transfer.media.nearest import nearest_pixels
from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids

ANGLES = 24  # columns of a tube's table
GAP_METRES = 0.012  # between charts, so that cloth may be continued beyond their edges
Table = Float32[np.ndarray, "levels angles"]


class Tube:
    """Levels and angles over part of the skin.

    Convention: angle 0 is in front (-y), positive towards the outside of a limb or the person's
    left hand on the trunk. Column k lies at angle 2 pi k / ANGLES.

    Attributes:
        levels: Metres along the limb on the template, ascending.
        angles: The columns', radians.
        inside: V; the skin's vertices that the table averages.
    """

    def __init__(
        self, level: np.ndarray, angle: np.ndarray, inside: np.ndarray, levels: np.ndarray
    ) -> None:
        self.levels = levels.astype(np.float32)
        self.inside = inside
        self._level, self._angle = level, angle
        self.angles = np.arange(ANGLES, dtype=np.float32) * np.float32(2 * np.pi / ANGLES)
        # each cell is the mean of its three nearest vertices, by nearness; cells x V
        index = np.nonzero(inside)[0]
        tree = KDTree(self._on_circle(level[index], angle[index]))
        cells = np.meshgrid(self.levels, self.angles, indexing="ij")
        distance, nearest = tree.query(self._on_circle(*cells).reshape(-1, 3), k=3)
        share = 1 / (distance + 0.003)  # so that a vertex in a cell's middle is not all of it
        share /= share.sum(1, keepdims=True)
        places = np.repeat(np.arange(len(share)), 3), index[nearest.ravel()]
        size = (len(share), len(inside))
        self._gather = csr_array((share.ravel().astype(np.float32), places), size)

    @staticmethod
    def _on_circle(level: np.ndarray, angle: np.ndarray) -> np.ndarray:
        radius = 0.1  # metres, about a limb's: makes angles comparable to levels
        return np.stack([level, radius * np.cos(angle), radius * np.sin(angle)], -1)

    def gather(self, values: np.ndarray) -> np.ndarray:
        """Average values over the skin into cells: V x C or V -> levels x ANGLES (x C)."""
        shape = (len(self.levels), ANGLES, *values.shape[1:])
        return (self._gather @ values).reshape(shape)

    def at(self, level: np.ndarray, angle: np.ndarray) -> csr_array:
        """Make the operator that averages the skin's values between the cells, N x V."""
        return csr_array(self._between(level, angle) @ self._gather, dtype=np.float32)

    def reader(self, index: np.ndarray) -> csr_array:
        """Make the operator that reads a flattened table at some vertices (bilinear).

        Levels beyond the table's are held at its edges.
        """
        return self._between(self._level[index], self._angle[index])

    def _between(self, level: np.ndarray, angle: np.ndarray) -> csr_array:
        row = np.interp(level, self.levels, np.arange(len(self.levels)))
        column = np.mod(angle / (2 * np.pi) * ANGLES, ANGLES)
        r0 = np.minimum(row.astype(int), len(self.levels) - 2)
        c0 = column.astype(int) % ANGLES
        fr, fc = row - r0, column - np.floor(column)
        cells, shares = [], []
        for dr, wr in ((0, 1 - fr), (1, fr)):
            for dc, wc in ((0, 1 - fc), (1, fc)):
                cells.append((r0 + dr) * ANGLES + (c0 + dc) % ANGLES)
                shares.append(wr * wc)
        rows = np.tile(np.arange(len(level)), 4)
        data = np.concatenate(shares).astype(np.float32)
        size = (len(level), len(self.levels) * ANGLES)
        return csr_array((data, (rows, np.concatenate(cells))), size)


def bridged(radii: Table, rounds: int = 3) -> Table:
    """Pull cloth over hollows: no radius stays below the mean of its neighbours around the tube."""
    for _ in range(rounds):
        radii = np.maximum(radii, (np.roll(radii, 1, 1) + np.roll(radii, -1, 1)) / 2)
    return radii


def hanging(radii: Table, drops: Float32[np.ndarray, " levels-1"]) -> Table:
    """Let cloth hang from what is above it.

    Args:
        drops: By how much the radius may shrink from each level to the next, metres; 0 hangs
            straight down, large values let it follow the body.
    """
    out = radii.copy()
    for level in range(1, len(out)):
        out[level] = np.maximum(out[level], out[level - 1] - drops[level - 1])
    return out


IsCut = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Two arrays of triangles that share an edge -> whether a seam parts them."""


@dataclass(frozen=True)
class Charts:
    """A surface laid flat.

    Attributes:
        corner_uv: F x 3 x 2, metres, all >= 0.
        chart: F; the connected chart in which a triangle lies, numbered by their least triangle.
        size: Width and height that hold all charts, metres.
    """

    corner_uv: Float32[np.ndarray, "F 3 2"]
    chart: Int32[np.ndarray, " F"]
    size: tuple[float, float]


def _face_normals(points: Points, faces: Faces) -> np.ndarray:
    """Compute normals of triangles, F x 3, as long as twice their areas."""
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    return np.cross(b - a, c - a)


def corner_sums(faces: Faces, count: int) -> csr_array:
    """Make the operator that sums triangles' values at their vertices, V x F."""
    columns = np.repeat(np.arange(len(faces)), 3)
    ones = np.ones(faces.size, np.float32)
    return csr_array((ones, (faces.ravel(), columns)), (count, len(faces)))


def vertex_normals(points: Points, faces: Faces, sums: csr_array | None = None) -> np.ndarray:
    """Compute unit normals of vertices, weighted by area; `sums` saves building `corner_sums`."""
    sums = corner_sums(faces, len(points)) if sums is None else sums
    normals = sums @ _face_normals(points, faces)
    normals /= np.sqrt(np.einsum("vi,vi->v", normals, normals))[:, None] + 1e-12
    return normals


def _wedges(faces: Faces, is_cut: IsCut) -> tuple[np.ndarray, np.ndarray]:
    """Number the vertices after cutting, F x 3, and each triangle's chart.

    A vertex on a seam falls apart into one for each fan of triangles that stay sewn together.
    """
    count = len(faces)
    corners = np.stack([faces, np.roll(faces, -1, 1)], 2).reshape(-1, 2)
    key = np.sort(corners, 1)
    order = np.lexsort(key.T)  # the two triangles of an edge come one after the other
    same = (key[order][1:] == key[order][:-1]).all(1)
    first, second = order[:-1][same], order[1:][same]
    fa, fb = first // 3, second // 3
    sewn = ~is_cut(fa, fb)
    first, second, fa, fb = first[sewn], second[sewn], fa[sewn], fb[sewn]
    # the edge's two ends, as corners of either triangle (they run in opposite directions)
    a0, a1 = first, fa * 3 + (first % 3 + 1) % 3
    b0, b1 = second, fb * 3 + (second % 3 + 1) % 3
    flip = faces.ravel()[a0] == faces.ravel()[b0]
    b0, b1 = np.where(flip, b0, b1), np.where(flip, b1, b0)
    links = (np.concatenate([a0, a1]), np.concatenate([b0, b1]))
    graph = coo_array((np.ones(len(links[0])), links), (count * 3, count * 3))
    _, wedge = connected_components(graph, directed=False)
    faces_graph = coo_array((np.ones(len(fa)), (fa, fb)), (count, count))
    _, chart = connected_components(faces_graph, directed=False)
    return wedge.reshape(-1, 3), chart.astype(np.int32)


def unfold(points: Points, faces: Faces, down: np.ndarray, is_cut: IsCut) -> Charts:
    """Lay a surface flat so that v runs along `down` and u across it, both to scale.

    Args:
        down: F x 3, where the cloth's grain runs; its part along the surface counts.
    Source: Poisson parametrisation: least squares on the gradients of the hat functions.
    """
    wedge, chart = _wedges(faces, is_cut)
    normals = _face_normals(points, faces).astype(np.float64)
    area = np.linalg.norm(normals, axis=1)
    normals /= area[:, None] + 1e-15
    along = down - (down * normals).sum(1, keepdims=True) * normals
    along /= np.linalg.norm(along, axis=1, keepdims=True) + 1e-9
    across = np.cross(normals, along)
    corners = points[faces].astype(np.float64)
    # gradient of each corner's hat function
    hats = [
        np.cross(normals, corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3])
        / (area[:, None] + 1e-15)
        for k in range(3)
    ]
    count = len(faces) * 3
    columns = np.concatenate([np.repeat(wedge[:, k], 3) for k in range(3)])
    entries = np.concatenate([hat.ravel() for hat in hats])
    places = (np.tile(np.arange(count), 3), columns)
    gradient = csr_array((entries, places), (count, wedge.max() + 1))
    weight = diags_array(np.repeat(area, 3))
    system = gradient.T @ weight @ gradient
    # each chart may lie anywhere: a trifle on the diagonal decides where
    system = system + diags_array(np.full(system.shape[0], 1e-9))
    wanted = np.stack([across.ravel(), along.ravel()], 1)
    flat = splu(system.tocsc()).solve(gradient.T @ (weight @ wanted))
    uv = flat[wedge].astype(np.float32)
    gap = left = GAP_METRES
    height = 0.0
    for number in range(chart.max() + 1):  # side by side
        own = chart == number
        low, high = uv[own].min((0, 1)), uv[own].max((0, 1))
        uv[own] += np.array([left, gap], np.float32) - low
        left += float(high[0] - low[0]) + gap
        height = max(height, float(high[1] - low[1]) + 2 * gap)
    return Charts(uv, chart, (left, height))


def flat_map(
    charts: Charts, values: np.ndarray, faces: Faces, texels_per_metre: float
) -> tuple[np.ndarray, np.ndarray]:
    """Draw values at vertices onto the flat charts.

    Args:
        values: V x C float32.
    Returns: H x W x C float32, continued beyond the charts' borders; and H x W float32: how far
        inside its chart a texel lies, metres, 0 outside.
    """
    width, height = (max(1, round(side * texels_per_metre)) for side in charts.size)
    flat = charts.corner_uv.reshape(-1, 2) * texels_per_metre
    screen = np.concatenate([flat, np.ones((len(flat), 1), np.float32)], 1)  # all equally far
    loose = np.arange(len(flat), dtype=np.int32).reshape(-1, 3)
    ids = triangle_ids(rasterise(screen, Triangles.two_sided(loose), width, height))
    out = np.zeros((height * width, values.shape[1]), np.float32)
    seen = np.nonzero(ids >= 0)[0]
    y, x = np.divmod(seen, width)
    place = np.stack([x + 0.5, y + 0.5], 1)
    a, b, c = (flat[loose[ids[seen], k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    p = place - a
    wb = (p[:, 0] * (c - a)[:, 1] - p[:, 1] * (c - a)[:, 0]) / area
    wc = ((b - a)[:, 0] * p[:, 1] - (b - a)[:, 1] * p[:, 0]) / area
    share = np.stack([1 - wb - wc, wb, wc], 1)
    out[seen] = np.einsum("nk,nkc->nc", share, values[faces[ids[seen]]])
    mask = (ids >= 0).reshape(height, width).astype(np.uint8)
    depth = cv2.distanceTransform(mask, cv2.DIST_L2, 5) / texels_per_metre
    return out[nearest_pixels(mask > 0)[1]], depth.astype(np.float32)
