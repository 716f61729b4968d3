"""Surfaces laid flat: cut along seams and unfolded so that the cloth's grain runs where asked.

Convention: flat coordinates (u, v) in metres, u to the right and v down as seen from outside.
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

from motion_transfer.media.nearest import nearest_pixels
from motion_transfer.people.figure.body import Faces, Points
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids

IsCut = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Two arrays of triangles that share an edge -> whether a seam parts them."""


@dataclass(frozen=True)
class Charts:
    """A surface laid flat.

    Attributes:
        corner_uv: F x 3 x 2, metres, all >= 0.
        chart: F; which connected chart a triangle lies in, numbered by their least triangle.
        size: width and height that hold all charts, metres.
    """

    corner_uv: Float32[np.ndarray, "F 3 2"]
    chart: Int32[np.ndarray, " F"]
    size: tuple[float, float]


def face_normals(points: Points, faces: Faces) -> np.ndarray:
    """Normals of triangles, F x 3, as long as twice their areas."""
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
    return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], 1)


def corner_sums(faces: Faces, count: int) -> csr_array:
    """The operator that sums triangles' values at their vertices, V x F."""
    columns = np.repeat(np.arange(len(faces)), 3)
    ones = np.ones(faces.size, np.float32)
    return csr_array((ones, (faces.ravel(), columns)), (count, len(faces)))


def vertex_normals(points: Points, faces: Faces, sums: csr_array | None = None) -> np.ndarray:
    """Unit normals of vertices, V x 3, weighted by area; `sums` saves building `corner_sums`."""
    sums = corner_sums(faces, len(points)) if sums is None else sums
    normals = sums @ face_normals(points, faces)
    normals /= np.sqrt(np.einsum("vi,vi->v", normals, normals))[:, None] + 1e-12
    return normals


def _wedges(faces: Faces, is_cut: IsCut) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the vertices after cutting, F x 3, and each triangle's chart."""
    count = len(faces)
    corners = np.stack([faces, np.roll(faces, -1, 1)], 2).reshape(-1, 2)
    key = np.sort(corners, 1)
    order = np.lexsort(key.T)
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

    Least squares over each triangle's gradients, weighted by its area.

    Args:
        down: F x 3, where the cloth's grain runs; its part along the surface counts.
    """
    wedge, chart = _wedges(faces, is_cut)
    normals = face_normals(points, faces).astype(np.float64)
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
    rows = np.arange(len(faces) * 3).reshape(-1, 3)
    gradient = csr_array(
        (
            np.concatenate([hat.ravel() for hat in hats]),
            (
                np.tile(rows.ravel(), 3),
                np.concatenate([np.repeat(wedge[:, k], 3) for k in range(3)]),
            ),
        ),
        (rows.size, wedge.max() + 1),
    )
    weight = diags_array(np.repeat(area, 3))
    system = gradient.T @ weight @ gradient
    system = system + diags_array(np.full(system.shape[0], 1e-9))
    solver = splu(system.tocsc())
    wanted = np.stack([across.ravel(), along.ravel()], 1)
    flat = solver.solve(gradient.T @ (weight @ wanted))
    return _packed(flat[wedge].astype(np.float32), chart)


def _packed(uv: np.ndarray, chart: np.ndarray, gap: float = 0.012) -> Charts:
    """Charts side by side, in the order of their numbers."""
    left = gap
    height = 0.0
    for number in range(chart.max() + 1):
        own = chart == number
        low, high = uv[own].min((0, 1)), uv[own].max((0, 1))
        uv[own] += np.array([left, gap], np.float32) - low
        left += float(high[0] - low[0]) + gap
        height = max(height, float(high[1] - low[1]) + 2 * gap)
    return Charts(uv, chart, (left, height))


def flat_map(
    charts: Charts, values: np.ndarray, faces: Faces, texels_per_metre: float
) -> tuple[np.ndarray, np.ndarray]:
    """Values at vertices drawn onto the flat charts.

    Args:
        values: V x C float32.

    Returns: H x W x C float32, continued beyond the charts' borders; and H x W float32: how far
        inside its chart a texel lies, metres, 0 outside.
    """
    width, height = (max(1, round(side * texels_per_metre)) for side in charts.size)
    flat = charts.corner_uv.reshape(-1, 2) * texels_per_metre
    screen = np.concatenate([flat, np.ones((len(flat), 1), np.float32)], 1)
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
