"""The head as a map: points of any body's head by direction from the head's middle.

Convention: the map is the plane of the azimuthal equidistant projection about the vertical: a
direction at an angle p from straight up lies p from the middle, to the right (+x) for the left
hand's side and down (+y) for the back, so that the face is up. Ears are smoothed away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array

from motion_transfer.people.figure.body import Body, BodyModel, SkinWeights
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids
from motion_transfer.people.head.skin_atlas import components, unit

MIDDLE = np.array([0.0, -0.045, 1.725], np.float32)  # of the template's head
REACH = 2.65  # radians from straight up to the map's edge: the nape and the throat are on it
SIZE = 97  # pixels a side: some 6 mm of scalp each
PlanePoints = Float32[np.ndarray, "*places 2"]


@dataclass(frozen=True)
class HeadMap:
    """One body's head.

    Attributes:
        layers: SIZE x SIZE x 9: the point, its outward normal, and the template's point (the
            place's name); metres.
        middle: The point that directions are taken from.
    """

    layers: Float32[np.ndarray, "rows columns 9"]
    middle: Float32[np.ndarray, " 3"]

    def at(self, plane: PlanePoints) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Look up points, outward normals and template points at places of the map (radians)."""
        pixel = (plane.astype(np.float32) / np.float32(2 * REACH) + 0.5) * (SIZE - 1)
        flat = pixel.reshape(-1, pixel.shape[-2], 2)
        args = (flat[..., 0], flat[..., 1], cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE)
        # cv2 takes at most four channels at a time
        layers = [np.ascontiguousarray(self.layers[..., k : k + 3]) for k in (0, 3, 6)]
        shape = (*plane.shape[:-1], 3)
        points, normals, places = (cv2.remap(layer, *args).reshape(shape) for layer in layers)
        return points, unit(normals), places


def head_map(body: Body, model: BodyModel) -> HeadMap:
    """Make the map of one body's head."""
    lookup, weight, place = _chart(model)
    points = (lookup @ body.points).reshape(SIZE, SIZE, 3)
    shift = MIDDLE - model.template.joint("head")
    middle = (body.joint("head") + shift).astype(np.float32)
    points = _smooth(points, weight, middle)
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    layers = np.concatenate([points, normals, place], 2).astype(np.float32)
    return HeadMap(np.ascontiguousarray(layers), middle)


def rigid(model: BodyModel, count: int) -> SkinWeights:
    """Give the weights of so many points that move with the head."""
    columns = np.full(count, model.skeleton.index["head"])
    entries = (np.ones(count, np.float32), (np.arange(count), columns))
    return SkinWeights(csr_array(entries, shape=(count, len(model.skeleton.names))))


def to_plane(points: Float32[np.ndarray, "*places 3"]) -> PlanePoints:
    """Find where the template's points lie on the map."""
    x, y, z = np.moveaxis(points - MIDDLE, -1, 0)
    aside = np.hypot(x, y)
    scale = np.arctan2(aside, z) / np.maximum(aside, 1e-9)
    return np.stack([x * scale, y * scale], -1)


def _smooth(points: np.ndarray, chart_weight: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Bring the ears down to what is around them; soften all a little.

    Only distances from the middle are filled in: directions are the ears' own, so that the map
    does not fold; and blurring distances does not draw a round surface inward as points would.
    """
    # widths of the blurs are pixels of the map, chosen by eye
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
    across = np.linalg.norm(toward, axis=2, keepdims=True)
    return middle + toward * (length / np.maximum(across, 1e-6))


@lru_cache(maxsize=1)
def _chart(
    model: BodyModel,
) -> tuple[csr_array, Float32[np.ndarray, "rows columns 1"], Float32[np.ndarray, "rows columns 3"]]:
    """Find what the map is made from; the same for all shapes.

    Returns: SIZE**2 x V, the outermost point in each direction; 0 where it is an ear or nothing;
        the template's points.
    """
    points, faces = model.template.points, model.faces
    faces = faces[components(faces, len(points))[faces[:, 0]] == 0]  # the skin without the eyes
    corners = points[faces]
    faces = faces[(corners[..., 2].min(1) > 1.56) & (np.abs(corners[..., 0]).max(1) < 0.12)]
    plane = to_plane(points)
    radius = np.linalg.norm(points - MIDDLE, axis=1)
    pixel = (plane / (2 * REACH) + 0.5) * (SIZE - 1) + 0.5
    screen = np.column_stack([pixel, 2 - radius]).astype(np.float32)  # the outermost is nearest
    # a triangle around the lowest direction would cover the whole map
    faces = faces[np.ptp(plane[faces], axis=1).max(1) < 1.0]
    ids = triangle_ids(rasterise(screen, Triangles.two_sided(faces), SIZE, SIZE))
    known = ids >= 0
    seen = np.flatnonzero(known)
    corners = faces[ids[seen]].T
    a, b, c = pixel[corners]
    at = np.stack([seen % SIZE, seen // SIZE], 1) + 0.5
    areas = [_cross(b - at, c - at), _cross(c - at, a - at), _cross(a - at, b - at)]
    shares = np.concatenate(areas) / np.tile(_cross(b - a, c - a), 3)
    entries = (shares, (np.tile(seen, 3), corners.ravel()))
    lookup = csr_array(entries, shape=(SIZE * SIZE, len(points)), dtype=np.float32)
    place = (lookup @ points).reshape(SIZE, SIZE, 3)
    x, y, z = np.abs(place[..., 0]), place[..., 1], place[..., 2]
    # a box around the template's ears, read off it by eye
    ear = (x > 0.070) & (y > -0.076) & (y < -0.018) & (z > 1.662) & (z < 1.738)
    ear = cv2.dilate(ear.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    weight = (known.reshape(SIZE, SIZE) & ~ear).astype(np.float32)[..., None]
    return lookup, weight, _smooth(place, weight, MIDDLE).astype(np.float32)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
