"""Where BlazePose's 33 landmarks lie on the body model.

Each is a place at rest (a joint, or a place on the skin) that moves with one bone, plus a
systematic offset between that place and what BlazePose calls the landmark. The offsets were fitted
by tools/fit_body_landmarks.py to BlazePose's own answers on photos of synthetic people.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float32, Float64

from motion_transfer.estimate.interface import LANDMARK_NAMES, Landmarks
from motion_transfer.people import (
    Body,
    BodyModel,
    Camera,
    PosedBody,
    Triangles,
    depths,
    rasterise,
)

COVERED_BEHIND_METRES = 0.15
"""A point this far behind the surface that its pixel shows is covered: joints lie up to a hip's
half depth inside."""


@dataclass(frozen=True)
class Anchor:
    """What a landmark is fixed to.

    Attributes:
        bone: Carries it; without the side.
        place: A bone's name, whose beginning it is, or `skin:` and a name in `skin_places`.
        offset: From there, in shares of the body's height, in the axes of the rest pose (x to the
            left hand, y to the back, z up), for the left side.
    """

    bone: str
    place: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


# The places follow BlazePose's list of key points; hips, shoulders and so on are joints, fingers
# the first knuckles of little finger and index and the second of the thumb.
ANCHORS: dict[str, Anchor] = {
    "nose": Anchor("head", "skin:nose", (0.0, 0.0076, 0.0068)),
    "eye-inner": Anchor("head", "skin:eye-inner", (0.0016, 0.0039, 0.0038)),
    "eye-middle": Anchor("head", "skin:eye-middle", (-0.001, 0.0079, 0.0021)),
    "eye-outer": Anchor("head", "skin:eye-outer", (-0.0032, 0.0073, 0.0036)),
    "ear": Anchor("head", "skin:ear", (-0.0171, -0.0221, -0.002)),
    "mouth": Anchor("head", "skin:mouth", (-0.0022, 0.0044, 0.007)),
    "shoulder": Anchor("shoulder01", "upperarm01", (-0.001, 0.001, 0.0144)),
    "elbow": Anchor("upperarm02", "lowerarm01", (-0.0071, 0.0003, 0.0054)),
    "wrist": Anchor("lowerarm02", "wrist", (0.0002, -0.0038, -0.0014)),
    "pinky": Anchor("finger5-1", "finger5-1", (-0.0145, -0.0064, 0.008)),
    "index": Anchor("finger2-1", "finger2-1", (-0.0079, 0.0147, -0.0045)),
    "thumb": Anchor("finger1-2", "finger1-2", (0.0123, 0.004, -0.0073)),
    "hip": Anchor("root", "upperleg01", (-0.0078, -0.0174, -0.0033)),
    "knee": Anchor("upperleg02", "lowerleg01", (-0.0029, 0.0004, 0.0016)),
    "ankle": Anchor("lowerleg02", "foot", (-0.0016, -0.0021, 0.0143)),
    "heel": Anchor("foot", "skin:heel", (-0.0045, -0.0108, 0.0083)),
    "foot-index": Anchor("toe2-1", "skin:toe", (-0.0034, 0.0151, 0.0068)),
}


def anchor_of(landmark: str) -> tuple[str, str]:
    """Name a landmark's anchor and side: `left-elbow` -> (`elbow`, `L`); the nose has no side."""
    if landmark.startswith("mouth-"):
        return "mouth", landmark[len("mouth-")].upper()
    side, _, kind = landmark.partition("-")
    return (kind, side[0].upper()) if kind else (landmark, "")


@lru_cache(maxsize=1)
def skin_places(model: BodyModel) -> dict[str, int]:
    """Find vertices of the skin by name, on the template; `.L` and `.R` are the person's.

    Distances are in metres, chosen by eye on that body.
    """
    body = model.template
    x, y, z = body.points.T
    head = model.weights.matrix[:, [body.skeleton.index["head"]]]
    on_head = np.asarray(head.toarray())[:, 0] > 0.5
    places: dict[str, int] = {}
    for side, sign in (("L", 1), ("R", -1)):
        eye = body.joint(f"eye.{side}")
        # ears are as high as the eyes, and nothing of the head is farther out
        level = on_head & (np.abs(z - eye[2]) < 0.03) & (sign * x > 0)
        places[f"ear.{side}"] = _best(sign * x, level)
        for name, across, up in (
            ("eye-inner", -0.016, 0.0),
            ("eye-middle", 0.0, 0.0),
            ("eye-outer", 0.016, 0.0),
            ("mouth", -0.006, -0.077),
        ):
            wanted = eye + np.array([sign * across, 0.0, up])
            away = np.hypot(x - wanted[0], z - wanted[2])
            # foremost of the vertices there, seen from the front: aside counts 20 times as much
            places[f"{name}.{side}"] = _best(-y - 20 * away, on_head & (y < eye[1] + 0.03))
        foot = body.joint(f"foot.{side}")
        near = (z < foot[2]) & (sign * x > 0)
        # the hindmost, preferably at a third of the ankle's height: not the edge of the sole
        places[f"heel.{side}"] = _best(y - 2 * np.abs(z - 0.3 * foot[2]), near)
        toe = body.joint(f"toe2-3.{side}")
        places[f"toe.{side}"] = _best(-y - np.abs(x - toe[0]), near)
    # below the eyes and above the mouth, the nose stands out farthest
    middle = on_head & (np.abs(x) < 0.01) & (z < eye[2] - 0.015) & (z > eye[2] - 0.06)
    places["nose."] = _best(-y, middle)
    return places


def _best(value: np.ndarray, allowed: np.ndarray) -> int:
    return int(np.where(allowed, value, -np.inf).argmax())


def rest_places(body: Body, model: BodyModel) -> Float64[np.ndarray, "33 3"]:
    """Place the landmarks on the body at rest, metres."""
    rows = []
    for name in LANDMARK_NAMES:
        kind, side = anchor_of(name)
        anchor = ANCHORS[kind]
        if anchor.place.startswith("skin:"):
            vertex = skin_places(model)[f"{anchor.place.removeprefix('skin:')}.{side}"]
            place = body.points[vertex].astype(np.float64)
        else:
            place = body.joint(f"{anchor.place}.{side}")
        mirror = np.array([-1.0 if side == "R" else 1.0, 1.0, 1.0])
        rows.append(place + mirror * np.array(anchor.offset) * body.height)
    return np.stack(rows)


def carrying_bones(body: Body) -> list[int]:
    """List the bone that each landmark moves with."""
    kinds = [anchor_of(name) for name in LANDMARK_NAMES]
    index = body.skeleton.index
    bones = [(ANCHORS[kind].bone, side) for kind, side in kinds]
    return [index[bone] if bone in index else index[f"{bone}.{side}"] for bone, side in bones]


def posed_places(posed: PosedBody, model: BodyModel) -> Float32[np.ndarray, "33 3"]:
    """Place the landmarks on a posed body, world, metres."""
    matrices = posed.transforms[carrying_bones(posed.body)]
    rest = rest_places(posed.body, model)
    return (np.einsum("lij,lj->li", matrices[..., :3], rest) + matrices[..., 3]).astype(np.float32)


def exact_landmarks(posed: PosedBody, model: BodyModel, camera: Camera) -> Landmarks:
    """Compute what BlazePose should say of a posed body seen by a camera.

    Depth is scaled as the picture is at the hips' distance. Visibility is 1 or 0, of the bare body.
    """
    places = posed_places(posed, model)
    screen = camera.project(places)
    hips = [LANDMARK_NAMES.index(f"{side}-hip") for side in ("left", "right")]
    middle = places[hips].mean(0)
    distance = float(screen[hips, 2].mean())
    depth = (screen[:, 2] - distance) * camera.focal_px / distance
    inside = (screen[:, :2] >= 0).all(1) & (screen[:, :2] < (camera.width, camera.height)).all(1)
    nearest = depths(
        rasterise(camera.project(posed.points), Triangles(model.faces), camera.width, camera.height)
    ).reshape(camera.height, camera.width)
    column, row = (screen[:, :2].clip(0, (camera.width - 1, camera.height - 1))).astype(int).T
    surface = np.nan_to_num(nearest[row, column], nan=np.inf)
    seen = inside & (screen[:, 2] < surface + COVERED_BEHIND_METRES)
    return Landmarks(
        image=np.concatenate([screen[:, :2], depth[:, None]], 1).astype(np.float32),
        world=((places - middle) @ camera.axes.T).astype(np.float32),
        visibility=seen.astype(np.float32),
        presence=np.asarray(inside, np.float32),
    )
