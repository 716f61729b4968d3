"""The head as a map: points of any body's head by direction from the head's middle.

Convention: the map is the plane of the azimuthal equidistant projection about the vertical: a
direction at an angle p from straight up lies p from the middle, to the right (+x) for the left
hand's side and down (+y) for the back, so that the face is up. Ears are smoothed away.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import cv2
import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids
from motion_transfer.people.head.skin_atlas import components

MIDDLE = np.array([0.0, -0.045, 1.725], np.float32)  # of the template's head
REACH = 2.65  # radians from straight up to the map's edge
SIZE = 97
PlanePoints = Float32[np.ndarray, "*places 2"]


@dataclass(frozen=True)
class HeadMap:
    """One body's head.

    Attributes:
        layers: SIZE x SIZE x 9: the point, its outward normal, and the template's point (the
            place's name); metres.
        middle: of the head.
    """

    layers: Float32[np.ndarray, "rows columns 9"]
    middle: Float32[np.ndarray, " 3"]

    def at(self, plane: PlanePoints) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points, outward normals and template points at places of the map (radians)."""
        pixel = (plane.astype(np.float32) / np.float32(2 * REACH) + 0.5) * (SIZE - 1)
        flat = pixel.reshape(-1, pixel.shape[-2], 2)
        args = (flat[..., 0], flat[..., 1], cv2.INTER_LINEAR)
        # cv2 takes at most four channels at a time
        looked_up = [
            cv2.remap(
                np.ascontiguousarray(self.layers[..., k : k + 3]),
                *args,
                borderMode=cv2.BORDER_REPLICATE,
            )
            for k in (0, 3, 6)
        ]
        shape = (*plane.shape[:-1], 3)
        points, normals, places = (values.reshape(shape) for values in looked_up)
        normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
        return points, normals, places


@dataclass(frozen=True)
class _Chart:
    """What the map is made from; the same for all shapes.

    Attributes:
        lookup: SIZE**2 x V: the outermost point in each direction.
        weight: 0 where it is an ear or nothing, SIZE x SIZE.
        place: SIZE x SIZE x 3: of the template.
    """

    lookup: csr_array
    weight: Float32[np.ndarray, "rows columns 1"]
    place: Float32[np.ndarray, "rows columns 3"]


_CHARTS: WeakKeyDictionary[BodyModel, _Chart] = WeakKeyDictionary()


def head_map(body: Body, model: BodyModel) -> HeadMap:
    """Make the map of one body's head."""
    chart = _CHARTS.get(model)
    if chart is None:
        chart = _CHARTS[model] = _chart(model)
    points = (chart.lookup @ body.points).reshape(SIZE, SIZE, 3)
    middle = _middle(body, model)
    points = _smooth(points, chart.weight, middle)
    down = np.gradient(points, axis=0)
    right = np.gradient(points, axis=1)
    normals = np.cross(right, down)
    layers = np.concatenate([points, normals, chart.place], 2).astype(np.float32)
    return HeadMap(np.ascontiguousarray(layers), middle)


def _middle(body: Body, model: BodyModel) -> Float32[np.ndarray, " 3"]:
    shift = MIDDLE - model.template.joint("head")
    return (body.joint("head") + shift).astype(np.float32)


def to_plane(points: Float32[np.ndarray, "*places 3"]) -> PlanePoints:
    """Where the template's points lie on the map."""
    x, y, z = np.moveaxis(points - MIDDLE, -1, 0)
    aside = np.hypot(x, y)
    scale = np.arctan2(aside, z) / np.maximum(aside, 1e-9)
    return np.stack([x * scale, y * scale], -1)


def _smooth(points: np.ndarray, chart_weight: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Bring the ears down to what is around them; soften all a little.

    Only distances from the middle are filled in: directions are the ears' own, so that the map
    does not fold; and blurring distances does not draw a round surface inward as points would.
    """
    away = points - middle
    length = np.linalg.norm(away, axis=2, keepdims=True)
    known = (length < 0.5).astype(np.float32)  # nothing was seen: the point is the origin
    toward = away / np.maximum(length, 1e-6) * known
    weight = chart_weight * known
    spread = cv2.GaussianBlur(weight, (0, 0), 4.0)[..., None]
    filled = cv2.GaussianBlur(length * weight, (0, 0), 4.0)[..., None] / np.maximum(spread, 1e-4)
    own = np.clip(2 * cv2.GaussianBlur(weight, (0, 0), 1.5) - 1, 0, 1)[..., None]
    length = cv2.GaussianBlur(length * own + filled * (1 - own), (0, 0), 1.0)[..., None]
    toward = cv2.GaussianBlur(toward, (0, 0), 1.0)
    return middle + toward * (
        length / np.maximum(np.linalg.norm(toward, axis=2, keepdims=True), 1e-6)
    )


def _chart(model: BodyModel) -> _Chart:
    points, faces = model.template.points, model.faces
    faces = faces[components(faces, len(points))[faces[:, 0]] == 0]
    corners = points[faces]
    faces = faces[(corners[..., 2].min(1) > 1.56) & (np.abs(corners[..., 0]).max(1) < 0.12)]
    plane = to_plane(points)
    radius = np.linalg.norm(points - MIDDLE, axis=1)
    pixel = (plane / (2 * REACH) + 0.5) * (SIZE - 1) + 0.5
    screen = np.column_stack([pixel, 2 - radius]).astype(np.float32)
    # a triangle around the lowest direction would cover the whole map
    faces = faces[np.ptp(plane[faces], axis=1).max(1) < 1.0]
    ids = triangle_ids(rasterise(screen, Triangles.two_sided(faces), SIZE, SIZE))
    known = ids >= 0
    rows, columns, shares = [], [], []
    seen = np.flatnonzero(known)
    a, b, c = (pixel[faces[ids[seen], k]] for k in range(3))
    at = np.stack([seen % SIZE, seen // SIZE], 1) + 0.5
    double = _cross(b - a, c - a)
    for k, share in enumerate(
        (_cross(b - at, c - at), _cross(c - at, a - at), _cross(a - at, b - at))
    ):
        rows.append(seen)
        columns.append(faces[ids[seen], k])
        shares.append(share / double)
    entries = (np.concatenate(shares), (np.concatenate(rows), np.concatenate(columns)))
    lookup = csr_array(entries, shape=(SIZE * SIZE, len(points)), dtype=np.float32)
    place = (lookup @ points).reshape(SIZE, SIZE, 3)
    x, y, z = np.abs(place[..., 0]), place[..., 1], place[..., 2]
    ear = (x > 0.070) & (y > -0.076) & (y < -0.018) & (z > 1.662) & (z < 1.738)
    ear = cv2.dilate(ear.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    weight = (known.reshape(SIZE, SIZE) & ~ear).astype(np.float32)[..., None]
    return _Chart(lookup, weight, _smooth(place, weight, MIDDLE).astype(np.float32))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
