"""What sits on the face with geometry of its own: a grown beard, glasses.

Lengths are metres; shapes and sizes were chosen by eye, on the template's face.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from motion_transfer.people.figure.body import Body, BodyModel, Faces, Points
from motion_transfer.people.figure.mesh import Material, Piece
from motion_transfer.people.head.brushes import MOUTH_Z, beard_field
from motion_transfer.people.head.faces import Face, greyed
from motion_transfer.people.head.hair.cap import paint_hair
from motion_transfer.people.head.head_map import rigid
from motion_transfer.people.head.skin_atlas import head_angle, skin_atlas, vertex_normals
from motion_transfer.people.picture.paint import to_linear

# half width and half height of a lens in millimetres, and how square it is (2 is an ellipse)
_LENSES = {
    "round": (23.0, 22.0, 2.0),
    "square": (26.0, 18.0, 4.5),
    "wide": (28.0, 22.0, 3.0),
    "sun": (29.0, 24.0, 3.2),
}
_AROUND = 28  # points of a rim
_CURVED = 3.0  # around the face: a rim lies 3 x^2 metres behind the bridge, x metres beside it
_EYES_APART = 0.0626  # the template's


def wear_pieces(face: Face, body: Body, model: BodyModel) -> list[Piece]:
    """Make `beard` where it is longer than 3 mm, `glasses` where there are any."""
    pieces = []
    if face.beard in ("moustache", "goatee", "full") and face.beard_length > 3:
        pieces.append(_beard(face, body, model))
    if face.glasses != "none":
        pieces.append(_glasses(face, body, model))
    return pieces


@lru_cache(maxsize=1)
def _beard_skin(model: BodyModel) -> tuple[np.ndarray, Faces, Points]:
    """Find the face's lower half: vertices, the triangles among them, and their normals."""
    points, faces = model.template.points, skin_atlas(model).skin
    low = (points[:, 2] < 1.735) & (points[:, 2] > 1.575)
    low &= (np.abs(points[:, 0]) < 0.082) & (points[:, 1] < -0.05)
    # a beard that reached further down would be torn when the head turns
    low &= np.asarray(model.weights.matrix[:, [model.skeleton.index["head"]]].sum(1)).ravel() > 0.2
    index, flat = np.unique(faces[low[faces].all(1)], return_inverse=True)
    return index, flat.reshape(-1, 3).astype(np.int32), vertex_normals(points, faces)[index]


def _beard(face: Face, body: Body, model: BodyModel) -> Piece:
    index, faces, normals = _beard_skin(model)
    place = model.template.points[index]
    rng = np.random.default_rng(face.seed)
    cover = beard_field(face.beard, place, head_angle(place))
    # hair grows out of the skin and falls: the longer, the further down, most of all at the chin
    length = face.beard_length / 1000
    chin = np.exp(-((place[:, 0] / 0.04) ** 2)) * np.clip((1.65 - place[:, 2]) / 0.04, 0, 1)
    off = (0.0015 + length * (0.30 + 0.5 * chin)) * np.clip(cover * 1.3 - 0.25, 0, 1)
    off = off * np.where(place[:, 2] > MOUTH_Z + 0.004, 0.55, 1.0)  # lips stay free
    off = off * (1 + 0.15 * rng.standard_normal(len(index)))
    way = normals + np.array([0, 0, -0.35], np.float32) * (off[:, None] > 0.004)
    u = 0.5 + head_angle(place) / np.pi
    v = np.clip((1.735 - place[:, 2]) / 0.16, 0, 1)  # from the highest beard to under the chin
    uv = np.stack([u, v], 1).astype(np.float32)
    colour = greyed(face.hair_colour, min(1.0, 1.1 * face.grey))
    texture = paint_hair(colour, curl=0.7, tips=0.1, contrast=0.3, relief=0.0015, seed=face.seed)
    return Piece(
        name="beard",
        points=(body.points[index] + off[:, None] * way).astype(np.float32),
        faces=faces,
        weights=model.weights.rows(index),
        corner_uv=uv[faces],
        material=Material(texture, (0.25, 0.16), gloss=0.02, sharpness=10.0, translucency=0.15),
        # single vertices in or out make a ragged edge
        keep=(cover - 0.35 + 0.06 * rng.standard_normal(len(index))).astype(np.float32),
        two_sided=True,
    )


def _glasses(face: Face, body: Body, model: BodyModel) -> Piece:
    """Make two rims, a bridge and temples; sunglasses have dark lenses."""
    wide, high, power = _LENSES[face.glasses]
    thin = 0.0011 + 0.0012 * (sum(face.frame) < 0.6)  # dark frames are of horn, others of wire
    eyes = np.stack([body.joint("eye.L"), body.joint("eye.R")])
    scale = (eyes[0, 0] - eyes[1, 0]) / _EYES_APART
    nose_y = float(eyes[0, 1]) - (0.034 if face.glasses == "sun" else 0.030) * scale
    strips: list[tuple[np.ndarray, np.ndarray]] = []
    lenses = []
    turn = np.linspace(0, 2 * np.pi, _AROUND)
    for eye, side in zip(eyes, (1.0, -1.0), strict=True):
        c, s = np.cos(turn), np.sin(turn)
        x = np.sign(c) * np.abs(c) ** (2 / power) * wide / 1000 * scale
        z = np.sign(s) * np.abs(s) ** (2 / power) * high / 1000 * scale
        x = side * (x + 0.0025) + eye[0]
        y = nose_y + _CURVED * x**2
        rim = np.stack([x, y, eye[2] - 0.004 + z], 1)
        strips.append((rim, rim - rim.mean(0)))
        lenses.append(rim)
        # a temple rests on top of the ear's root
        root = model.template.points - np.array([side * 0.0775, -0.048, 1.722], np.float32)
        ear = body.points[np.argmin((root**2).sum(1))] + np.array([0, 0.004, 0.004], np.float32)
        temple = np.linspace(rim[0] + [0, 0, 0.006 * scale], ear, 8)
        # bowed outwards, or it would cut into a broad head
        temple[:, 0] += side * 0.004 * np.sin(np.linspace(0, np.pi, 8))
        strips.append((temple, np.tile([0.0, 0.0, 1.0], (8, 1))))
    x = np.linspace(-1, 1, 7) * (eyes[0, 0] + (0.0025 - wide / 1000) * scale)
    y, z = nose_y + _CURVED * x**2 - 0.001, eyes[0, 2] + 0.003 + 0.003 * np.cos(120 * x)
    strips.append((np.stack([x, y, z], 1), np.tile([0.0, 0.0, 1.0], (7, 1))))
    points, faces = _tubes(strips, thin)
    u = np.full(len(points), 0.25)
    if face.glasses == "sun":
        for rim in lenses:  # a fan of triangles around its middle closes each
            fan = len(points) + np.arange(len(rim) - 1)
            middle = np.full(len(fan), len(points) + len(rim))
            faces = np.concatenate([faces, np.stack([fan, fan + 1, middle], 1)])
            points = np.concatenate([points, rim, rim.mean(0, keepdims=True)]).astype(np.float32)
        u = np.append(u, np.full(len(points) - len(u), 0.75))
    # the frame's colour on the left, dark glass on the right
    texture = np.zeros((4, 8, 4), np.float32)
    texture[:, :4, :3] = to_linear(face.frame)
    texture[:, 4:, :3] = 0.012
    corner_uv = np.stack([u[faces], np.full(faces.shape, 0.5)], -1)
    return Piece(
        name="glasses",
        points=points,
        faces=np.ascontiguousarray(faces, np.int32),
        weights=rigid(model, len(points)),
        corner_uv=corner_uv.astype(np.float32),
        material=Material(texture, (0.1, 0.05), gloss=0.3, sharpness=50.0),
        keep=np.ones(len(points), np.float32),
        two_sided=True,
    )


def _tubes(strips: list[tuple[np.ndarray, np.ndarray]], half: float) -> tuple[Points, Faces]:
    """Lay a square tube around each line; the second of a pair says which way its width goes."""
    points, faces, start = [], [], 0
    for line, across in strips:
        along = np.gradient(line, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        wide = across - (across * along).sum(1, keepdims=True) * along
        wide /= np.maximum(np.linalg.norm(wide, axis=1, keepdims=True), 1e-9)
        deep = np.cross(along, wide)
        for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
            points.append(line + half * (a * wide + b * deep))
        count = len(line)
        k = np.arange(count - 1)
        for side in range(4):
            p, q = start + side * count + k, start + (side + 1) % 4 * count + k
            faces += [np.stack([p, q, q + 1], 1), np.stack([p, q + 1, p + 1], 1)]
        start += 4 * count
    return np.concatenate(points).astype(np.float32), np.concatenate(faces).astype(np.int32)
