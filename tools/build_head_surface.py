"""Build the head that estimated IUV is drawn with, motion_transfer/estimate/surfaces/head.npz.

    python tools/build_head_surface.py --assets makehuman/ [--people 130] [--out FILE]

The surface is that of the body model in the middle of all ranges, seen from the head's middle: a
grid of directions on each side, as far down as the head's own bone moves it. Where the face
network's points lie beside it is measured on photos of training people, whose heads' turn is known:
the median, over all that the network is sure of. Needs the extra `people`, and `mt models fetch`.
The arrays are those of `motion_transfer.estimate.surfaces.head_surface.HeadSurface`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.blazepose.faces import FaceModel
from motion_transfer.estimate.surfaces.hand_surface import fit_turn
from motion_transfer.people import PeopleStream, load_body_model, load_charts

OUT = Path("motion_transfer/estimate/surfaces/head.npz")
PARTS = (23, 24)  # right and left
SIZE = (512, 512)
TO_PICTURE = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # x right, y down, z away from who looks
MIDDLE = np.array([0.0, -0.045, 1.725])  # of the template's head, as in people/head/head_map.py
RINGS, SPOKES = 12, 36  # of each half: directions from its side to the plane between both, around
LEAST_OWN = 0.5  # weight of the head's bones; where it is less the neck moves the skin
BONES = ("head", "eye.L", "eye.R")
ROUNDS = 20


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--assets", type=Path)
    parser.add_argument("--people", type=int, default=130)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    surface = grid_surface()
    marks = measure_marks(options.people, options.assets)
    with options.out.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, marks=marks.astype(np.float32), **surface)
    size = options.out.stat().st_size
    print(f"{options.out}: {len(surface['faces'])} triangles, {size} bytes")


def grid_surface() -> dict[str, np.ndarray]:
    """Look at the head from its middle, in a grid of directions on each side."""
    model, charts = load_body_model(), load_charts()
    rest = (model.template.points - MIDDLE) @ TO_PICTURE.T
    own = model.weights.matrix[:, [model.skeleton.index[name] for name in BONES]].sum(1)
    points, faces, parts, uv = [], [], [], []
    for part in PARTS:
        outwards = -1 if part == PARTS[0] else 1  # the person's right is the picture's left
        theta = np.linspace(0.02, np.pi / 2 - 0.002, RINGS)
        phi = np.arange(SPOKES) * 2 * np.pi / SPOKES
        ring, spoke = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
        rays = np.stack(
            [outwards * np.cos(ring), np.sin(ring) * np.cos(spoke), np.sin(ring) * np.sin(spoke)], 1
        )
        chosen = charts.part == part
        corners = model.faces[chosen]
        triangle, shares = cast(rays, rest[corners])
        hit = triangle >= 0
        found = np.where(hit[:, None], (shares[..., None] * rest[corners[triangle]]).sum(1), np.nan)
        weight = np.where(hit, (shares * own[corners[triangle]]).sum(1), 0)
        place = (shares[..., None] * charts.uv[chosen][triangle]).sum(1)
        for r in range(RINGS - 1):
            for s in range(SPOKES):
                t = (s + 1) % SPOKES
                quad = [r * SPOKES + s, r * SPOKES + t, (r + 1) * SPOKES + t, (r + 1) * SPOKES + s]
                for face in (quad[:3], [quad[0], *quad[2:]]):
                    if (weight[face] < LEAST_OWN).any():
                        continue
                    normal = np.cross(*(found[face[k]] - found[face[0]] for k in (1, 2)))
                    # clockwise in the picture, y down: the normal points inwards
                    face = face if normal @ found[face].mean(0) < 0 else face[::-1]
                    faces.append(np.array(face) + len(points) * RINGS * SPOKES)
                    parts.append(part)
                    uv.append(place[face])
        found[-SPOKES:, 0] = 0  # both halves meet there, without a gap
        if points:
            found[-SPOKES:] = points[0][-SPOKES:]
        points.append(found)
    used, local = np.unique(faces, return_inverse=True)
    return {
        "points": np.concatenate(points)[used].astype(np.float32),
        "faces": local.reshape(-1, 3).astype(np.uint16),
        "part": np.array(parts, np.uint8),
        "uv": np.rint(np.array(uv) * 255).astype(np.uint8),
    }


def cast(rays: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the farthest triangle that each ray from the middle meets, -1 for none, and the shares
    of its corners there."""
    triangles, shares = np.full(len(rays), -1), np.zeros((len(rays), 3))
    inverse = np.linalg.pinv(corners.transpose(0, 2, 1))
    for index, ray in enumerate(rays):
        amounts = inverse @ ray  # the ray's point at distance 1 / sum has shares amounts / sum
        total = amounts.sum(1)
        meets = (amounts >= -1e-9).all(1) & (total > 1e-9)
        if meets.any():
            farthest = np.flatnonzero(meets)[total[meets].argmin()]
            triangles[index] = farthest
            shares[index] = amounts[farthest] / total[farthest]
    return triangles, shares


def measure_marks(count: int, assets: Path | None) -> np.ndarray:
    """Measure where the face network's points lie beside the head at rest, metres."""
    model, charts = load_body_model(), load_charts()
    people = PeopleStream(split="train", size=SIZE, assets=assets)
    own = model.weights.matrix[:, [model.skeleton.index["head"]]].toarray()[:, 0] > LEAST_OWN
    head = np.intersect1d(model.faces[np.isin(charts.part, PARTS)], np.flatnonzero(own))
    rest = (model.template.points[head] - MIDDLE) @ TO_PICTURE.T
    estimator, faces = BlazePoseEstimator(most_people=1), FaceModel()
    seen, axes = [], []
    for number in range(count):
        dressed = people.dress(number)
        for view in range(2):
            shot = people.shot(number, view)
            photo = people.take(dressed, shot)
            estimator.start_shot()
            found = estimator.estimate(photo.rgb)
            if not found or (landmarks := found[0].landmarks) is None:
                continue
            marks = faces.find(photo.rgb, landmarks)
            if marks is None:
                continue
            true = photo.camera.project(dressed.posed(shot.pose).points[head]).astype(np.float64)
            metres = true[:, 2].mean()
            true[:, 2] = (true[:, 2] - metres) * photo.camera.focal_px / metres
            scale, turn = fit_turn(rest.astype(np.float32), true.astype(np.float32))
            place = (true - scale * rest @ turn.T).mean(0)
            seen.append((marks - place) / scale @ turn)
            axes.append(turn[2])
    places, views = np.stack(seen), np.stack(axes)
    middle = np.median(places, 0)
    for _ in range(ROUNDS):  # how deep the network's zero lies is unknown, for each photo
        depth = ((middle - places) * views[:, None]).sum(-1).mean(1)
        middle = np.median(places + depth[:, None, None] * views[:, None], 0)
    print(f"{len(places)} faces")
    return middle


if __name__ == "__main__":
    main()
