"""Build the hand that estimated IUV is drawn with, motion_transfer/estimate/surfaces/hand.npz.

    python tools/build_hand_surface.py [--out FILE]

The surface is that of the body model in the middle of all ranges: its left hand, and as much of the
forearm as joins it; the right one is its mirror image, with charts of its own. Needs the extra
`people`. The arrays are those of `motion_transfer.estimate.surfaces.surface.HandSurface`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from motion_transfer.people import load_body_model
from motion_transfer.people.figure.charts import load_charts

OUT = Path("motion_transfer/estimate/surfaces/hand.npz")
HAND = 4  # the left one's part
FOREARM_METRES = 0.08  # from the wrist: what is kept of the forearm
TO_PICTURE = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # x right, y down, z away from who looks
FINGERS = ("finger1", "finger2", "finger3", "finger4", "finger5")
BONES = ("forearm", "palm", *(f"{finger}-{joint}" for finger in FINGERS for joint in (1, 2, 3)))
OFFSETS_MM = (
    (6.4, 6.7, -9.1),
    (-16, 4.1, -0.7),
    (-1.5, 6.3, -9.9),
    (3.8, 3.8, 0.7),
    (3.6, -1.8, 4.8),
    (-4.3, 0.8, 6.7),
    (-3, 5.6, -3.4),
    (-2.1, 3.5, -1.9),
    (-1.1, -2.7, 5.9),
    (-7.1, -0.3, 3.3),
    (-3.8, 3.5, -3.6),
    (-4, 1.3, -0.4),
    (-3.9, -3.1, 5.3),
    (-7.7, 0.6, 3),
    (-3.6, 4.8, -3),
    (-3.4, 2.7, -1.9),
    (-4.9, -6.5, 2.2),
    (-7, -2, 1.4),
    (-3.8, 3.4, -1.2),
    (-1.6, 3.3, -2.6),
    (-2.5, -3.3, -1.5),
)
"""From a joint, or a finger's tip, to what the hand network calls the point, in the axes of the
rest pose. Measured by tools/fit_hand_points.py."""

TIP_POINTS = 12  # the tip is the middle of so many points, those farthest along the last bone


def bone_of(name: str) -> int:
    """Tell which of BONES moves what a bone of the body's left side moves; the last one: none."""
    kind = name.removesuffix(".L")
    if kind in ("wrist", *(f"metacarpal{n}" for n in (1, 2, 3, 4))):
        return BONES.index("palm")
    if kind in ("lowerarm01", "lowerarm02"):
        return BONES.index("forearm")
    return BONES.index(kind) if kind in BONES else len(BONES)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--out", type=Path, default=OUT)
    out = parser.parse_args().out
    model, charts = load_body_model(), load_charts()
    body = model.template
    wrist = body.joint("wrist.L")
    places = (body.points - wrist) @ TO_PICTURE.T

    names = model.skeleton.names
    sums = np.zeros((len(names), len(BONES) + 1))
    sums[np.arange(len(names)), [bone_of(name) for name in names]] = 1
    weights = model.weights.matrix @ sums

    near = np.linalg.norm(places, axis=1) < FOREARM_METRES
    on_arm = weights[:, -1] < 0.01
    kept = (charts.part == HAND) | (near & on_arm)[model.faces].all(1)
    kept &= on_arm[model.faces].all(1)
    faces = model.faces[kept]
    index, local = np.unique(faces, return_inverse=True)

    # the same triangle of the other side, and its corners in the order of ours
    mirror = KDTree(body.points).query(body.points * [-1, 1, 1])[1]
    number = {tuple(sorted(face)): i for i, face in enumerate(model.faces.tolist())}
    others = np.array([number[tuple(sorted(mirror[face].tolist()))] for face in faces])
    order = (model.faces[others][:, None] == mirror[faces][:, :, None]).argmax(2)
    uv = [charts.uv[kept], np.take_along_axis(charts.uv[others], order[..., None], 1)]

    joints = [np.zeros(3)]
    for finger in FINGERS:
        heads = [(body.joint(f"{finger}-{n}.L") - wrist) @ TO_PICTURE.T for n in (1, 2, 3)]
        tip = places[weights[:, BONES.index(f"{finger}-3")] > 0.5]
        along = (tip - heads[2]) @ (heads[2] - heads[1])
        joints += [*heads, tip[np.argsort(along)[-TIP_POINTS:]].mean(0)]
    elbow = (body.joint("lowerarm01.L") - wrist) @ TO_PICTURE.T

    np.savez_compressed(
        out,
        points=places[index].astype(np.float32),
        faces=local.reshape(-1, 3).astype(np.uint16),
        weights=np.rint(weights[index, :-1] / weights[index, :-1].sum(1, keepdims=True) * 255)
        .astype(np.uint8),
        joints=(np.stack(joints) + np.array(OFFSETS_MM) / 1000).astype(np.float32),
        elbow=elbow.astype(np.float32),
        part=np.stack([charts.part[kept], charts.part[others]]),
        uv=np.rint(np.stack(uv) * 255).astype(np.uint8),
    )  # fmt: skip
    print(f"{out}: {len(index)} points, {len(faces)} triangles, {out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
