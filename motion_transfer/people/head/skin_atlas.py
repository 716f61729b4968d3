"""Where on the skin's texture each place of the body lies; the same for all shapes.

The upper part of the texture shows the head, unrolled: columns go by the angle about a vertical
axis through the head (the seam runs down the back, the face has the finest columns), rows by
height. Below lies a strip for all other skin, whose rows are kinds of skin from pale palms to ruddy
knees.

Convention: places are named in the template body's coordinates, metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from jaxtyping import Bool, Float32
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from motion_transfer.people.figure.body import BodyModel, Faces, Points
from motion_transfer.people.figure.rasterise import Triangles, rasterise, triangle_ids

WIDTH, HEAD_ROWS, STRIP_ROWS = 448, 256, 32
AXIS_Y = -0.05  # of the head's vertical axis; x is 0
TOP, BOTTOM = 1.845, 1.575  # heights of the head's first and last row
EYE_PX, EYE_SPAN = 48, 0.030  # an eye's tile, and the width of the eyeball it shows
_FRONT = 0.4  # the front has 1 + _FRONT times the columns an even unrolling would give it


@dataclass(frozen=True, eq=False)  # identity is enough, and it can be a key
class SkinAtlas:
    """The texture's layout. The head has HEAD_ROWS rows and WIDTH columns.

    Attributes:
        skin, eyes: Triangles of the body that belong to the skin and to the eyeballs.
        skin_uv, eye_uv: Their corners' texture coordinates.
        eye_points: Vertices of both eyeballs, left first; `eyes` indexes into them.
        angle: Each column's, radians, 0 in front, positive towards the left hand.
        z: Each row's height, metres.
        place: HEAD_ROWS x WIDTH x 3: the outermost point of the template there.
        opening: Millimetres from the opening between the lids, 0 inside.
    """

    skin: Faces
    eyes: Faces
    skin_uv: Float32[np.ndarray, "F 3 2"]
    eye_uv: Float32[np.ndarray, "E 3 2"]
    eye_points: np.ndarray
    angle: Float32[np.ndarray, " columns"]
    z: Float32[np.ndarray, " rows"]
    place: Float32[np.ndarray, "rows columns 3"]
    opening: Float32[np.ndarray, "rows columns"]


@lru_cache(maxsize=1)
def skin_atlas(model: BodyModel) -> SkinAtlas:
    """Lay out the texture for a body model; made once."""
    points, faces = model.template.points, model.faces
    # the parts: 0 the skin, 1 the inside of the mouth, then the eyeballs
    part = components(faces, len(points))[faces[:, 0]]
    eye_faces = faces[part >= 2]
    eye_points = np.unique(eye_faces)
    eye_points = eye_points[np.argsort(points[eye_points, 0] < 0, kind="stable")]
    renumber = np.zeros(len(points), np.int32)
    renumber[eye_points] = np.arange(len(eye_points))
    inner = part[part < 2] == 1
    skin = faces[part < 2]
    middle = points[skin].mean(1)
    head = (middle[:, 2] > BOTTOM + 0.004) & (np.abs(middle[:, 0]) < 0.11)
    head_uv = _head_uv(points[skin])
    uv = np.where(head[:, None, None], head_uv, _strip_uv(model)[skin])
    uv[inner] = (0.999, 0.999)  # the mouth's inside: the strip's last texel is kept dark
    turns = np.linspace(-1, 1, 2001) * np.pi  # `column` has no inverse: a table will do
    angle = np.interp((np.arange(WIDTH) + 0.5) / WIDTH, column(turns), turns)
    rows = TOP - (np.arange(HEAD_ROWS) + 0.5) / HEAD_ROWS * (TOP - BOTTOM)
    place, seen_eye = _places(points, skin[head & ~inner], eye_faces)
    distance = cv2.distanceTransform((~seen_eye).astype(np.uint8), cv2.DIST_L2, 5)
    return SkinAtlas(
        skin=np.ascontiguousarray(skin),
        eyes=renumber[eye_faces],
        skin_uv=uv.astype(np.float32),
        eye_uv=_eye_uv(model, eye_faces),
        eye_points=eye_points,
        angle=angle.astype(np.float32),
        z=rows.astype(np.float32),
        place=place,
        opening=distance.astype(np.float32) * np.float32((TOP - BOTTOM) / HEAD_ROWS * 1000),
    )


def head_angle(points: Points) -> Float32[np.ndarray, " V"]:
    """Measure angles about the head's axis, 0 in front, positive towards the left hand."""
    return np.arctan2(points[..., 0], AXIS_Y - points[..., 1])


def column(angle: Float32[np.ndarray, " V"]) -> Float32[np.ndarray, " V"]:
    """Find the texture's u at an angle: the face gets more of it than the back of the head."""
    turn = angle / np.pi
    return 0.5 + 0.5 * turn * (1 + _FRONT * (1 - turn**2))


def components(faces: Faces, count: int) -> np.ndarray:
    """Number each vertex's connected part: 0 is the largest, the skin."""
    ends = faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    _, label = connected_components(links, directed=False)
    order = np.argsort(-np.bincount(label), kind="stable")
    return np.argsort(order)[label]


def _head_uv(corners: Float32[np.ndarray, "F 3 3"]) -> Float32[np.ndarray, "F 3 2"]:
    u = column(head_angle(corners))
    # triangles across the seam: move their left corners to the right of the texture's edge
    across = (u.max(1) - u.min(1)) > 0.5
    u[across] = np.where(u[across] < 0.5, 0.999, u[across])
    v = (TOP - corners[..., 2]) / (TOP - BOTTOM) * (HEAD_ROWS / (HEAD_ROWS + STRIP_ROWS))
    last = (HEAD_ROWS - 1) / (HEAD_ROWS + STRIP_ROWS)
    return np.stack([u, np.clip(v, 0, last)], 2)


def _strip_uv(model: BodyModel) -> Float32[np.ndarray, "V 2"]:
    points = model.template.points
    # only noise varies along the strip: u need but change slowly in all directions
    u = 0.5 + (0.55 * points[:, 0] + 0.30 * points[:, 2] - 0.25 + 0.4 * points[:, 1]) / 1.6
    first, size = HEAD_ROWS + 2, STRIP_ROWS - 6
    v = (first + _kind(model) * size) / (HEAD_ROWS + STRIP_ROWS)
    return np.stack([np.clip(u, 0, 0.98), v], 1)


def _kind(model: BodyModel) -> Float32[np.ndarray, " V"]:
    """Tell kinds of skin: from 0, palms and soles, through 0.5, most skin, to 1, knees and elbows.

    Where each begins and how soft its border is was chosen by eye.
    """
    points, body = model.template.points, model.template
    kind = np.full(len(points), 0.5)
    for side in ("L", "R"):
        knee, elbow = body.joint(f"lowerleg01.{side}"), body.joint(f"lowerarm01.{side}")
        kind += 0.4 * np.exp(-((points - knee - [0, -0.06, 0]) ** 2).sum(1) / 0.05**2)
        kind += 0.4 * np.exp(-((points - elbow - [0, 0.05, 0]) ** 2).sum(1) / 0.04**2)
        wrist = body.joint(f"wrist.{side}")
        index, little = (body.joint(f"finger{k}-1.{side}") for k in (2, 5))
        across = np.cross(index - wrist, little - wrist)
        across *= -np.sign(across[2]) / np.linalg.norm(across)  # palms look down at rest
        hand = np.array(
            [n.startswith(("wrist", "finger", "metacarpal")) for n in body.skeleton.names]
        )
        hand &= np.array([n.endswith(side) for n in body.skeleton.names])
        share = np.asarray(model.weights.matrix[:, np.flatnonzero(hand)].sum(1)).ravel()
        facing = (vertex_normals(points, model.faces) @ across).clip(0, 1)
        kind += np.where(share > 0.5, 0.15 - 0.65 * facing**0.5 * (share > 0.8), 0)
    sole = (points[:, 2] < 0.02) & (vertex_normals(points, model.faces)[:, 2] < -0.3)
    return np.clip(np.where(sole, 0, kind), 0, 1)


def vertex_normals(points: Points, faces: Faces) -> Points:
    """Find unit normals, each the area-weighted mean over the triangles around a vertex."""
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    across = np.cross(b - a, c - a)
    out = np.empty_like(points)
    for axis in range(3):
        out[:, axis] = np.bincount(faces.ravel(), across[:, axis].repeat(3), len(points))
    return unit(out, 1e-12)


def unit(vectors: np.ndarray, least: float = 1e-6) -> np.ndarray:
    """Find the directions of vectors (along the last axis); 0 where they are shorter than least."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), least)


def _eye_uv(model: BodyModel, faces: Faces) -> Float32[np.ndarray, "E 3 2"]:
    """Show each eyeball as seen from in front; the left eye's tile is the first."""
    corners = model.template.points[faces]
    right = corners.mean(1)[:, 0] < 0
    joints = np.stack([model.template.joint("eye.L"), model.template.joint("eye.R")])
    offset = corners - joints[right.astype(int)][:, None]
    u = np.clip(offset[..., 0] / EYE_SPAN + 0.5, 0.02, 0.98)
    v = np.clip(0.5 - offset[..., 2] / EYE_SPAN, 0.02, 0.98)
    return np.stack([(u + right[:, None]) / 2, v], 2).astype(np.float32)


def _places(
    points: Points, skin: Faces, eyes: Faces
) -> tuple[Float32[np.ndarray, "rows columns 3"], Bool[np.ndarray, "rows columns"]]:
    """Find the outermost point of the head at every texel, and whether an eyeball is seen there."""
    u, v = column(head_angle(points)), (TOP - points[:, 2]) / (TOP - BOTTOM)
    radius = np.hypot(points[:, 0], points[:, 1] - AXIS_Y)
    chart = np.stack([u * WIDTH, v * HEAD_ROWS, 2 - radius], 1).astype(np.float32)
    faces = np.concatenate([skin, eyes])
    # triangles across the seam would cover the whole width
    wraps = np.ptp(u[faces], axis=1) > 0.5
    faces, is_eye = faces[~wraps], (np.arange(len(faces)) >= len(skin))[~wraps]
    seen = rasterise(chart, Triangles.two_sided(faces), WIDTH, HEAD_ROWS)
    ids = triangle_ids(seen).reshape(HEAD_ROWS, WIDTH)
    place = points[faces[ids]].mean(2)
    # triangles are millimetres in the face: their middles, blurred, are near enough
    known = (ids >= 0).astype(np.float32)
    weight = cv2.GaussianBlur(known, (0, 0), 1.5)[..., None]
    blurred = cv2.GaussianBlur(place * known[..., None], (0, 0), 1.5) / np.maximum(weight, 1e-6)
    place = np.where(weight > 1e-3, blurred, place).astype(np.float32)
    return place, (ids >= 0) & is_eye[ids]
