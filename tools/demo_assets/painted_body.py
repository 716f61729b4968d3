"""A person to show: a parametric body in any pose, with clothes, hair and a face painted on.

Everything painted is placed in the rest pose (arms held out, the person faces -y, left hand at +x,
z up, metres), from joints and from the head's own vertices, so that it does not depend on the pose
shown. Colours are linear RGB in [0, 1].
"""

from dataclasses import dataclass, replace

import anny
import numpy as np
import torch
from numpy.typing import NDArray

Array = NDArray[np.floating]
Indices = NDArray[np.int32]
Colour = tuple[float, float, float]

SKIN, BLUSH = (0.70, 0.42, 0.29), (0.72, 0.30, 0.21)
LIPS, BROWS, LASHES = (0.52, 0.14, 0.12), (0.08, 0.04, 0.022), (0.06, 0.03, 0.02)
EYE_WHITE, IRIS, PUPIL, GLINT = (0.70, 0.68, 0.65), (0.06, 0.11, 0.07), (0.01,) * 3, (1.0,) * 3
HAIR, HAIR_LIGHT = (0.055, 0.024, 0.012), (0.21, 0.095, 0.042)
SHIRT, STRIPE, LEFT_SLEEVE = (0.80, 0.78, 0.72), (0.025, 0.05, 0.16), (0.72, 0.12, 0.06)
TROUSERS, SHOES, SOLES = (0.045, 0.15, 0.14), (0.60, 0.36, 0.06), (0.75, 0.73, 0.68)

LIMBS = {  # how the names of their bones begin
    "arm": ("upperarm", "lowerarm", "wrist", "finger", "metacarpal"),
    "head": ("head", "eye"),
    "eye": ("eye",),
}


class Person:
    """One body shape in its rest pose, and its vertices in any other pose.

    ``rest`` is (N, 3), ``faces`` (F, 3), ``joints`` maps bone names to rest positions, ``limbs``
    (N, one column for each of ``LIMBS``) says how much of a vertex's motion is owed to that limb,
    ``mouth`` is the middle of the mouth at rest.
    """

    def __init__(self, shape: dict[str, float], expression: dict[str, float]) -> None:
        self._model = anny.Anny(facial_actions="all").float()
        self._shape = {name: torch.tensor([value]) for name, value in shape.items()}
        self._expression = {name: torch.tensor([value]) for name, value in expression.items()}
        still = self._run(self._expression)
        self.rest = still["rest_vertices"][0].numpy().astype(np.float64)
        self.faces: Indices = self._model.faces.numpy().astype(np.int32)
        heads = still["rest_bone_heads"][0].numpy().astype(np.float64)
        self.joints = dict(zip(self._model.bone_labels, heads, strict=True))
        self.limbs = np.stack([self._share(prefixes) for prefixes in LIMBS.values()], 1)
        # The mouth is what moves most when the lips pucker.
        puckered = self._run({"mouthPucker": torch.ones(1)})["vertices"][0]
        moved = (puckered - still["vertices"][0]).norm(dim=1).numpy()
        self.mouth = self.rest[moved > moved.max() / 2].mean(0)

    def _run(
        self, expression: dict[str, torch.Tensor], **pose: torch.Tensor
    ) -> dict[str, torch.Tensor]:
        with torch.no_grad():
            return self._model(phenotype_kwargs=self._shape, facial_actions=expression, **pose)

    def _share(self, prefixes: tuple[str, ...]) -> Array:
        own = np.array([name.startswith(prefixes) for name in self._model.bone_labels])
        bones = self._model.vertex_bone_indices.numpy()
        return (self._model.vertex_bone_weights.numpy() * own[bones]).sum(1)

    def posed(self, rotations: dict[str, Array]) -> Array:
        """Vertices (N, 3) with bones turned from rest, the lowest vertex on the floor z = 0."""
        pose = torch.eye(4).repeat(1, self._model.bone_count, 1, 1)
        for name, matrix in rotations.items():
            pose[0, self._model.bone_labels.index(name), :3, :3] = torch.from_numpy(matrix)
        vertices = self._run(self._expression, pose_parameters=pose)["vertices"][0]
        return on_the_floor(vertices.numpy().astype(np.float64))


@dataclass(frozen=True)
class Surface:
    """A triangle mesh with what painting and IUV need.

    ``points``, ``rest`` (both (N, 3)) and ``limbs`` belong to vertices; ``faces`` is (F, 3); charts
    belong to triangles: ``part`` (F,) and ``corner_uv`` (F, 3, 2).
    """

    points: Array
    rest: Array
    limbs: Array
    faces: Indices
    part: NDArray[np.uint8]
    corner_uv: Array

    def subdivided(self) -> "Surface":
        """Each triangle cut into four at the middles of its sides; the shape stays the same."""
        sides = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        keys, middle = np.unique(sides @ [len(self.points), 1], return_inverse=True)
        ends = np.stack(np.divmod(keys, len(self.points)), 1)

        def four(first: Array, second: Array, third: Array, mids: list[Array]) -> Array:
            ab, bc, ca = mids
            corners = [first, ab, ca, ab, second, bc, ca, bc, third, ab, bc, ca]
            stacked = np.stack(corners, 1)
            return stacked.reshape(-1, 3, *stacked.shape[2:])

        def extended(values: Array) -> Array:
            return np.concatenate([values, values[ends].mean(1)])

        new = (middle.reshape(-1, 3) + len(self.points)).T
        uv = self.corner_uv.transpose(1, 0, 2)
        return Surface(
            points=extended(self.points),
            rest=extended(self.rest),
            limbs=extended(self.limbs),
            faces=four(*self.faces.T, list(new)).astype(np.int32),
            part=self.part.repeat(4),
            corner_uv=four(*uv, [(uv[i] + uv[(i + 1) % 3]) / 2 for i in range(3)]),
        )


def on_the_floor(points: Array) -> Array:
    return points - [0, 0, points[:, 2].min()]


def vertex_normals(points: Array, faces: Indices) -> Array:
    """Unit normals, each the area-weighted mean over the triangles around a vertex."""
    a, b, c = points[faces].transpose(1, 0, 2)
    columns = np.cross(b - a, c - a).repeat(3, axis=0).T
    normals = np.stack([np.bincount(faces.ravel(), column, len(points)) for column in columns], 1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def smoothed(values: Array, faces: Indices, amount: Array, rounds: int) -> Array:
    """Move values (N, C) of vertices toward their neighbours' mean, ``amount`` (N,) of the way."""
    start = faces[:, [0, 1, 1, 2, 2, 0]].ravel()
    end = faces[:, [1, 0, 2, 1, 0, 2]].ravel()
    count = np.maximum(np.bincount(start, minlength=len(values)), 1)
    for _ in range(rounds):
        columns = values[end].T
        sums = np.stack([np.bincount(start, column, len(values)) for column in columns], 1)
        values = values + amount[:, None] * (sums / count[:, None] - values)
    return values


def convex(points: Array, margin: float) -> Array:
    """Points (N, 3) pushed outward from their middle to a rounded convex hull and beyond.

    The hull is cut by 1,000 evenly spread planes, ``margin`` metres further out than the points;
    a high power stands for the nearest plane, which rounds the edges.
    """
    index = np.arange(1000) + 0.5
    height, angle = 1 - index / 500, np.pi * (3 - np.sqrt(5)) * index
    ring = np.sqrt(1 - height**2)
    planes = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], 1)
    middle = (points.min(0) + points.max(0)) / 2
    along = (points - middle) @ planes.T
    closeness = np.maximum(along, 0) / (along.max(0) + margin)
    return middle + (points - middle) / ((closeness**40).sum(1) ** (1 / 40))[:, None]


def shod(surface: Surface, feet: Array) -> Surface:
    """Wrap each foot in a smooth shoe; ``feet`` (N,) is positive on what belongs inside.

    Between the toes the wrapped skin lies in folds: triangles that face inward are turned over.
    """
    points, rest, faces, uv = (
        values.copy() for values in (surface.points, surface.rest, surface.faces, surface.corner_uv)
    )
    for side in (-1, 1):
        foot = (feet > 0.5) & (side * rest[:, 0] > 0)
        points[foot], rest[foot] = convex(points[foot], 0.012), convex(rest[foot], 0.012)
        whole = foot[faces].all(1)
        a, b, c = points[faces].transpose(1, 0, 2)
        outward = (a + b + c) / 3 - (points[foot].min(0) + points[foot].max(0)) / 2
        inverted = whole & ((np.cross(b - a, c - a) * outward).sum(1) < 0)
        faces[inverted], uv[inverted] = faces[inverted, ::-1], uv[inverted, ::-1]
    return replace(surface, points=points, rest=rest, faces=faces, corner_uv=uv)


def column(limbs: Array, name: str) -> Array:
    return limbs[:, list(LIMBS).index(name)]


def step(values: Array, edge: float, width: float) -> Array:
    """0 below ``edge``, 1 above it, smooth over ``width``."""
    t = np.clip((values - edge) / width + 0.5, 0, 1)
    return t * t * (3 - 2 * t)


class Wardrobe:
    """Where clothes, hair and features lie on one person.

    Methods take points in the rest pose (N, 3), mostly with their ``limbs``, and return coverage
    (N,) in 0..1. Lengths are metres. ``inset`` draws garments in, ``soft`` blurs them.
    """

    def __init__(self, person: Person, inset: float = 0.0, soft: float = 0.004) -> None:
        eyes = person.rest[column(person.limbs, "eye") > 0.5]
        self.eye = eyes[eyes[:, 0] > 0].mean(0)  # the left one; the right one is its mirror image
        self.mouth, self.joints = person.mouth, person.joints
        self.floor = person.rest[:, 2].min()
        self.inset, self.soft = inset, soft

    def _inside(self, depth: Array) -> Array:
        """Coverage from the distance to an edge, positive inside."""
        return step(depth, self.inset, self.soft)

    def _limb(self, limbs: Array, name: str) -> Array:
        return step(column(limbs, name), 0.5, 0.08)

    def sleeve(self, rest: Array, limbs: Array) -> Array:
        """Either arm, 19 cm down from the shoulder joint."""
        bone = self.joints["lowerarm01.L"] - self.joints["upperarm01.L"]
        mirrored = rest * np.where(rest[:, :1] < 0, [[-1, 1, 1]], [[1, 1, 1]])
        along = (mirrored - self.joints["upperarm01.L"]) @ bone / np.linalg.norm(bone)
        return self._limb(limbs, "arm") * self._inside(0.19 - along)

    def shirt(self, rest: Array, limbs: Array) -> Array:
        """Torso and sleeves; the neckline is a plane that falls toward the chest."""
        aside = np.maximum(np.abs(rest[:, 0]) - 0.06, 0)
        neckline = self.joints["neck01"][2] + 0.02 + 0.7 * (rest[:, 1] - 0.03) + 0.5 * aside
        hem = self.joints["spine05"][2] - 0.03
        torso = self._inside(np.minimum(rest[:, 2] - hem, neckline - rest[:, 2]))
        return torso * (1 - self._limb(limbs, "arm")) + self.sleeve(rest, limbs)

    def trousers(self, rest: Array, limbs: Array) -> Array:
        top, bottom = self.joints["spine05"][2] + 0.05, self.joints["foot.L"][2] + 0.05
        depth = np.minimum(top - rest[:, 2], rest[:, 2] - bottom)
        return self._inside(depth) * (1 - self._limb(limbs, "arm"))

    def shoes(self, rest: Array) -> Array:
        return self._inside(self.joints["foot.L"][2] - 0.005 - rest[:, 2])

    def soles(self, rest: Array) -> Array:
        return self._inside(self.floor + 0.016 - rest[:, 2])

    def hair(self, rest: Array, limbs: Array) -> Array:
        """A bob with a side parting: the head down to the jaw, less an oval for the face."""
        x, y, z = (rest - self.eye * [0, 1, 1]).T
        oval = np.hypot(x / 0.064, (z + 0.02 - 0.3 * x) / 0.092) - 1
        depth = np.minimum(np.maximum(0.075 * oval, y - 0.052), rest[:, 2] - self.mouth[2] + 0.03)
        head = step(column(limbs, "head"), 0.02, 0.02)
        return self._inside(depth) * head

    def lips(self, rest: Array) -> Array:
        x, _, z = (rest - self.mouth).T
        x = np.minimum(np.abs(x) / 0.025, 1)
        above = 0.012 * (1 - x**2) - 0.002 * np.exp(-((x / 0.15) ** 2))
        below = 0.0135 * (1 - x**2) ** 0.7
        coverage = step(above - z, 0, 0.002) * step(z + below, 0, 0.002) * step(1 - x, 0.03, 0.06)
        return coverage * (rest[:, 1] < self.eye[1])

    def around_eye(self, rest: Array) -> tuple[Array, Array]:
        """Metres outward and up from the middle of the nearer eye."""
        return np.abs(rest[:, 0]) - self.eye[0], rest[:, 2] - self.eye[2]

    def brows(self, rest: Array) -> Array:
        x, z = self.around_eye(rest)
        middle = 0.0245 + 0.1 * x - 9 * (x - 0.006) ** 2
        thick = 0.003 - 0.07 * np.maximum(x, 0)
        across = step(x, -0.018, 0.006) * step(0.022 - x, 0, 0.006)
        return across * step(thick - np.abs(z - middle), 0, 0.003) * (rest[:, 1] < self.eye[1])

    def lashes(self, rest: Array) -> Array:
        """A dark rim on the lids, wider above the eye."""
        x, z = self.around_eye(rest)
        rim = np.hypot(x / 0.0175, z / np.where(z > 0, 0.0088, 0.0062))
        return 0.85 * (1 - step(rim, 1, 0.3)) * (rest[:, 1] < self.eye[1])

    def blush(self, rest: Array) -> Array:
        x, z = self.around_eye(rest)
        distance = np.hypot((x - 0.012) / 0.028, (z + 0.04) / 0.02)
        return 0.5 * np.exp(-(distance**2)) * (rest[:, 1] < self.eye[1] + 0.03)

    def eyeballs(self, rest: Array) -> Array:
        """Colours (N, 3) of points on the eyeballs."""
        x, z = self.around_eye(rest)
        colour = np.tile(EYE_WHITE, (len(rest), 1))
        colour = over(colour, IRIS, 1 - step(np.hypot(x, z), 0.0070, 0.0015))
        colour = over(colour, PUPIL, 1 - step(np.hypot(x, z), 0.0032, 0.001))
        right_of_iris = rest[:, 0] - np.sign(rest[:, 0]) * self.eye[0] + 0.0025
        return over(colour, GLINT, 1 - step(np.hypot(right_of_iris, z - 0.0025), 0.0016, 0.001))


def over(colour: Array, paint: Colour | Array, coverage: Array) -> Array:
    """Lay a paint over colours (N, 3)."""
    return colour + coverage[:, None] * (np.asarray(paint) - colour)


def strands(rest: Array) -> Array:
    """Thin vertical streaks around the head, (N,) in 0..1."""
    angle = np.arctan2(rest[:, 0], rest[:, 1] + 0.06)
    waves = [np.sin(k * angle + 2.3 * k + 9 * rest[:, 2]) for k in (5, 13, 29, 47, 71)]
    return np.clip(0.45 + 0.16 * np.sum(waves, 0), 0, 1)


def folds(rest: Array) -> Array:
    """A gentle relief of cloth, (N,) in about -1..1."""
    x, y, z = rest.T
    slow = np.sin(23 * x + 9 * np.sin(7 * z) + 6 * y) * np.sin(11 * z + 8 * y + 1)
    return 0.7 * slow + 0.3 * np.sin(41 * z + 12 * np.sin(9 * x) + 20 * y)


def dress(surface: Surface, person: Person) -> Surface:
    """Turn a bare posed body into a clothed one with hair, standing on z = 0.

    Cloth, shoes and hair are the body's own surface, smoothed (ears disappear), cut finer and moved
    outward, so every triangle keeps its chart. The rest pose is smoothed alike, so that
    what is painted there stays in place.
    """
    wardrobe = Wardrobe(person)
    rest, limbs, faces = surface.rest, surface.limbs, surface.faces
    cloth = np.maximum(wardrobe.shirt(rest, limbs), wardrobe.trousers(rest, limbs))
    both = np.concatenate([surface.points, rest], 1)
    both = smoothed(both, faces, cloth / 2, 8)
    both = smoothed(both, faces, wardrobe.hair(rest, limbs) / 2, 30)
    surface = replace(surface, points=both[:, :3], rest=both[:, 3:]).subdivided().subdivided()

    faces, limbs, evenly = surface.faces, surface.limbs, np.full(len(surface.points), 0.5)
    both = smoothed(np.concatenate([surface.points, surface.rest], 1), faces, evenly, 3)
    both = smoothed(both, faces, wardrobe.shirt(both[:, 3:], limbs) / 2, 60)
    points, rest = both[:, :3], both[:, 3:]
    # Garments rise inside their painted edges, so that the edges' sides are painted too.
    wardrobe = Wardrobe(person, inset=0.005, soft=0.008)
    shirt, trousers = wardrobe.shirt(rest, limbs), wardrobe.trousers(rest, limbs)
    below_hip = np.clip((person.joints["upperleg01.L"][2] - rest[:, 2]) / 0.5, 0, 1)
    outward = (0.010 + 0.006 * below_hip) * trousers
    outward += (0.016 - outward) * shirt
    outward += 0.003 * folds(rest) * np.maximum(shirt, trousers)
    outward += (0.024 + 0.005 * strands(rest)) * wardrobe.hair(rest, limbs)
    outward = smoothed(outward[:, None], faces, evenly, 3)
    points = points + outward * vertex_normals(points, faces)
    surface = shod(replace(surface, points=points, rest=rest), wardrobe.shoes(rest))
    return replace(surface, points=on_the_floor(surface.points))


def albedo(rest: Array, limbs: Array, person: Person) -> Array:
    """The painted colour (N, 3) of points given in the rest pose."""
    wardrobe = Wardrobe(person)
    colour = np.tile(SKIN, (len(rest), 1))
    colour = over(colour, BLUSH, wardrobe.blush(rest))
    colour = over(colour, LIPS, wardrobe.lips(rest))
    colour = over(colour, LASHES, wardrobe.lashes(rest))
    colour = over(colour, BROWS, wardrobe.brows(rest))
    colour = over(colour, wardrobe.eyeballs(rest), column(limbs, "eye") > 0.5)
    colour = over(colour, TROUSERS, wardrobe.trousers(rest, limbs))
    stripe = step(np.sin(2 * np.pi * rest[:, 2] / 0.05), 0.1, 0.3)
    shirt = over(np.tile(SHIRT, (len(rest), 1)), STRIPE, stripe)
    shirt = over(shirt, LEFT_SLEEVE, wardrobe.sleeve(rest, limbs) * (rest[:, 0] > 0))
    colour = over(colour, shirt, wardrobe.shirt(rest, limbs))
    shoes = over(np.tile(SHOES, (len(rest), 1)), SOLES, wardrobe.soles(rest))
    colour = over(colour, shoes, wardrobe.shoes(rest))
    hair = np.asarray(HAIR) + strands(rest)[:, None] * np.subtract(HAIR_LIGHT, HAIR)
    return over(colour, hair, wardrobe.hair(rest, limbs))
