"""Rebuild the demo's person: a painted photo, its exact IUV, and another body's motion.

Needs, besides this project's own requirements: ``pip install anny==0.6.2 warp-lang``.

Run: ``python tools/demo_assets/build_assets.py --charts CHARTS.npz --out DIR``

CHARTS holds, for each triangle of ``anny.Anny()`` in the order of its ``faces``, ``part`` (uint8,
1..24) and ``uv`` (three corners, two DensePose chart coordinates in [0, 1]). The first start of
``anny`` takes about two minutes: it writes a cache. There is no randomness: the same package
versions give the same files.

Convention: metres, z up, the person faces -y and has the left hand at +x; turning is
counter-clockwise seen from above. Angles are radians. IUV is uint8 (I, U, V), 0 is background; in
files red is V, green is U, blue is I, so that ``cv2.imread`` returns (I, U, V).
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import warp as wp
from numpy.typing import NDArray
from painted_body import (
    Array,
    Indices,
    Person,
    Surface,
    albedo,
    dress,
    step,
    vertex_normals,
)

SOURCE_SIZE = (512, 768)  # width, height
DRIVER_SIZE = (256, 256)
DRIVER_FRAMES = 90
FRAMES_PER_SECOND = 30
SOURCE_SHAPE = {"gender": 0.95, "age": 0.62, "weight": 0.35, "height": 0.6, "proportions": 0.75}
DRIVER_SHAPE = {"gender": 0.0, "age": 0.68, "muscle": 0.62, "height": 0.55, "proportions": 0.6}
EXPRESSION = {
    "mouthSmileLeft": 0.55,
    "mouthSmileRight": 0.55,
    "eyeBlinkLeft": 0.12,
    "eyeBlinkRight": 0.12,
}


@dataclass(frozen=True)
class Arm:
    """Angles of one arm; all zero hangs straight down, the palm to the body."""

    abduction: float = 0.2
    swing: float = 0.0
    turn_out: float = 0.0
    elbow: float = 0.3


@dataclass(frozen=True)
class Leg:
    """Angles of one leg, as added to the upright rest pose; positive hip lifts it forward."""

    hip: float = 0.0
    out: float = 0.0
    knee: float = 0.0
    ankle: float = 0.0


@dataclass(frozen=True)
class Pose:
    """A whole body. ``spine`` and ``head`` are rotation vectors about x, y, z."""

    turn: float = 0.0
    left_arm: Arm = field(default_factory=Arm)
    right_arm: Arm = field(default_factory=Arm)
    left_leg: Leg = field(default_factory=Leg)
    right_leg: Leg = field(default_factory=Leg)
    pelvis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spine: tuple[float, float, float] = (0.0, 0.0, 0.0)
    head: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Camera:
    """A level pinhole camera at (0, -distance, height) that looks along +y."""

    width: int
    height_px: int
    distance: float
    height: float
    focal: float

    @classmethod
    def framing(
        cls, size: tuple[int, int], body_height: float, *, share: float, aim: float
    ) -> "Camera":
        """See a standing body fill ``share`` of the height, from 5 m; ``aim`` of it is centred."""
        return cls(*size, 5.0, body_height * aim, share * size[1] * 5.0 / body_height)

    def scaled(self, factor: int) -> "Camera":
        """The same view with ``factor`` times as many pixels along each side."""
        w, h, f = self.width * factor, self.height_px * factor, self.focal * factor
        return Camera(w, h, self.distance, self.height, f)

    def rays(self) -> tuple[Array, Array]:
        """Origins and unit directions through the pixel centres, row by row: two (H * W, 3)."""
        rows, columns = np.mgrid[: self.height_px, : self.width] + 0.5
        x = (columns - self.width / 2) / self.focal
        z = (self.height_px / 2 - rows) / self.focal
        direction = np.stack([x, np.ones_like(x), z], -1).reshape(-1, 3)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        origin = np.tile([0.0, -self.distance, self.height], (len(direction), 1))
        return origin.astype(np.float32), direction.astype(np.float32)


def rotation(vector: Array | tuple[float, ...]) -> Array:
    """The 3 x 3 matrix of a rotation vector."""
    return cv2.Rodrigues(np.asarray(vector, np.float64).reshape(3, 1))[0]


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def arm_rotations(arm: Arm, joints: dict[str, Array]) -> dict[str, Array]:
    """Bone rotations of the left arm, in the rest pose's axes.

    The rest pose holds the arms out with bent elbows, so its own angles are subtracted. The elbow
    is a hinge about the normal of the plane that the resting upper and lower arm span.
    """
    upper = joints["lowerarm01.L"] - joints["upperarm01.L"]
    lower = unit(joints["wrist.L"] - joints["lowerarm01.L"])
    rest_abduction = np.arctan2(upper[0], -upper[2])
    upper = unit(upper)
    rest_elbow = np.arccos(upper @ lower)
    hinge = unit(np.cross(upper, lower))
    lift = max(0.0, arm.abduction - 1.0) * 0.3  # the shoulder blade takes part in high lifts
    down = rest_abduction + lift - arm.abduction
    shoulder = rotation((-arm.swing, 0, 0)) @ rotation((0, down, 0))
    half_turn = rotation(-0.5 * arm.turn_out * upper)
    return {
        "clavicle": rotation((0, -lift, 0)),
        "upperarm01": shoulder @ half_turn,
        "upperarm02": half_turn,
        "lowerarm01": rotation(hinge * (arm.elbow - rest_elbow)),
    }


def leg_rotations(leg: Leg) -> dict[str, Array]:
    """Bone rotations of the left leg, in the rest pose's axes."""
    return {
        "upperleg01": rotation((-leg.hip, 0, 0)) @ rotation((0, -leg.out, 0)),
        "lowerleg01": rotation((leg.knee, 0, 0)),
        "foot": rotation((-leg.ankle, 0, 0)),
    }


def bone_rotations(pose: Pose, joints: dict[str, Array]) -> dict[str, Array]:
    """Every turned bone's rotation; the right side is the left one's mirror image."""
    spine = rotation(np.asarray(pose.spine) / 3)
    bones = {
        "root": rotation((0, 0, pose.turn)) @ rotation(pose.pelvis),
        **dict.fromkeys(("spine05", "spine03", "spine02"), spine),
        "neck02": rotation(np.asarray(pose.head) / 2),
        "head": rotation(np.asarray(pose.head) / 2),
    }
    mirror = np.diag([-1.0, 1.0, 1.0])
    left = arm_rotations(pose.left_arm, joints) | leg_rotations(pose.left_leg)
    right = arm_rotations(pose.right_arm, joints) | leg_rotations(pose.right_leg)
    bones |= {f"{name}.L": matrix for name, matrix in left.items()}
    bones |= {f"{name}.R": mirror @ matrix @ mirror for name, matrix in right.items()}
    return bones


@wp.kernel
def cast_rays(
    mesh: wp.uint64,
    origin: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    face: wp.array(dtype=wp.int32),
    barycentric: wp.array(dtype=wp.vec3),
) -> None:
    """The first triangle along each ray (-1: none) and where in it the ray lands."""
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, origin[i], direction[i], 100.0)
    face[i] = -1
    if hit.result:
        face[i] = hit.face
        barycentric[i] = wp.vec3(hit.u, hit.v, 1.0 - hit.u - hit.v)


@wp.kernel
def gather_light(
    mesh: wp.uint64,
    point: wp.array(dtype=wp.vec3),
    normal: wp.array(dtype=wp.vec3),
    toward: wp.array(dtype=wp.vec3),
    radiance: wp.array(dtype=wp.vec3),
    light: wp.array(dtype=wp.vec3),
) -> None:
    """Sum the lamps that each point sees past the mesh, each times its cosine."""
    i = wp.tid()
    total = wp.vec3(0.0, 0.0, 0.0)
    for k in range(toward.shape[0]):
        cosine = wp.dot(normal[i], toward[k])
        if cosine > 0.0:
            start = point[i] + normal[i] * 0.003
            if not wp.mesh_query_ray_anyhit(mesh, start, toward[k], 10.0):
                total += radiance[k] * cosine
    light[i] = total


class Scene:
    """A triangle mesh that rays can be shot at."""

    def __init__(self, points: Array, faces: Indices) -> None:
        vertices = wp.array(points.astype(np.float32), dtype=wp.vec3)
        self.mesh = wp.Mesh(points=vertices, indices=wp.array(faces.ravel(), dtype=wp.int32))

    def hits(self, camera: Camera) -> tuple[Indices, Array]:
        """For each pixel, row by row: the triangle seen (-1: none) and barycentric weights."""
        rays = [wp.array(values, dtype=wp.vec3) for values in camera.rays()]
        face = wp.empty(len(rays[0]), dtype=wp.int32)
        weights = wp.zeros(len(rays[0]), dtype=wp.vec3)
        wp.launch(cast_rays, len(rays[0]), inputs=[self.mesh.id, *rays], outputs=[face, weights])
        return face.numpy(), weights.numpy()

    def light(self, points: Array, normals: Array, lamps: tuple[Array, Array]) -> Array:
        """The light (N, 3) that arrives at points; lamps are directions and radiances."""
        inputs = [wp.array(a.astype(np.float32), dtype=wp.vec3) for a in (points, normals, *lamps)]
        light = wp.empty(len(points), dtype=wp.vec3)
        wp.launch(gather_light, len(points), inputs=[self.mesh.id, *inputs], outputs=[light])
        return light.numpy()


def studio_lamps() -> tuple[Array, Array]:
    """A pale dome and a large warm lamp up front on the picture's left: directions, radiances.

    Scaled so that an unshadowed surface that faces up receives about 1.
    """
    count, golden = 96, np.pi * (3 - np.sqrt(5))
    index = np.arange(count) + 0.5
    z = index / count
    ring = np.sqrt(1 - z**2)
    dome = np.stack([ring * np.cos(golden * index), ring * np.sin(golden * index), z], 1)
    spread = 0.16 * np.sqrt(index / count)
    lamp = np.array([-0.55, -0.75, 0.85])
    across, upward = unit(np.cross(lamp, [0, 0, 1])), np.array([0, 0, 1.0])
    lamp = lamp + np.outer(spread * np.cos(golden * index), across)
    lamp = lamp + np.outer(spread * np.sin(golden * index), upward)
    lamp /= np.linalg.norm(lamp, axis=1, keepdims=True)
    sky = np.tile([0.98, 1.0, 1.04], (count, 1)) * 1.1 / count
    sun = np.tile([1.06, 1.0, 0.92], (count, 1)) * 0.85 / count
    return np.concatenate([dome, lamp]), np.concatenate([sky, sun])


def backdrop(scene: Scene, camera: Camera, lamps: tuple[Array, Array]) -> Array:
    """A pale floor that runs into a pale wall, with the person's soft shadow: (H * W, 3)."""
    origin, direction = camera.rays()
    down = np.minimum(direction[:, 2], -1e-3)
    distance = np.clip(-origin[:, 2] / down, 0, 12)
    spot = (origin + distance[:, None] * direction) * [1, 1, 0]
    light = np.ones_like(spot)
    near = (direction[:, 2] < 0) & (np.abs(spot[:, 1]) < 3)
    up = np.tile([0.0, 0.0, 1.0], (near.sum(), 1))
    open_floor = (lamps[1] * np.maximum(lamps[0][:, 2:], 0)).sum(0)
    light[near] = scene.light(spot[near], up, lamps) / open_floor
    rows = np.linspace(0, 1, camera.height_px).repeat(camera.width)
    columns = np.tile(np.linspace(-1, 1, camera.width), camera.height_px)
    tone = 0.70 - 0.10 * columns**2 - 0.16 * (rows - 0.45) ** 2 + 0.10 * step(rows, 0.86, 0.3)
    return tone[:, None] * np.array([1.0, 0.985, 0.96]) * light


def interpolate(values: Array, faces: Indices, weights: Array) -> Array:
    """Values of vertices (N, C) at places inside triangles: faces (P, 3), weights (P, 3)."""
    return np.einsum("pk,pkc->pc", weights, values[faces])


def photo(surface: Surface, person: Person, camera: Camera) -> NDArray[np.uint8]:
    """Render RGB (H, W, 3), averaged from 2 x 2 samples a pixel."""
    fine = camera.scaled(2)
    scene, lamps = Scene(surface.points, surface.faces), studio_lamps()
    face, weights = scene.hits(fine)
    colour = backdrop(scene, fine, lamps)
    seen = face >= 0
    corners, weights = surface.faces[face[seen]], weights[seen]
    normals = interpolate(vertex_normals(surface.points, surface.faces), corners, weights)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = interpolate(surface.points, corners, weights)
    paint = albedo(
        interpolate(surface.rest, corners, weights),
        interpolate(surface.limbs, corners, weights),
        person,
    )
    bounce = 0.22 * (1 - 0.5 * normals[:, 2:])  # from the pale floor
    colour[seen] = paint * (scene.light(points, normals, lamps) + bounce)
    linear = colour.reshape(camera.height_px, 2, camera.width, 2, 3).mean((1, 3))
    return (np.clip(linear, 0, 1) ** (1 / 2.2) * 255).round().astype(np.uint8)


def iuv_picture(surface: Surface, camera: Camera) -> NDArray[np.uint8]:
    """The exact IUV (H, W, 3) at pixel centres."""
    face, weights = Scene(surface.points, surface.faces).hits(camera)
    seen = face >= 0
    picture = np.zeros((len(face), 3), np.uint8)
    chart = np.einsum("pk,pkc->pc", weights[seen], surface.corner_uv[face[seen]])
    picture[seen, 0] = surface.part[face[seen]]
    picture[seen, 1:] = np.clip(chart * 255, 0, 255).round()
    return picture.reshape(camera.height_px, camera.width, 3)


def bare_surface(person: Person, pose: Pose, charts: Path) -> Surface:
    """The bare posed body with the chart table on its triangles."""
    points = person.posed(bone_rotations(pose, person.joints))
    with np.load(charts) as table:
        part, uv = table["part"], table["uv"].astype(np.float64)
    return Surface(points, person.rest, person.limbs, person.faces, part, uv)


def catalogue_pose() -> Pose:
    """Relaxed, turned a little to the picture's right."""
    return Pose(
        turn=0.3,
        left_arm=Arm(abduction=0.3, swing=0.05, elbow=0.35),
        right_arm=Arm(abduction=0.3, swing=-0.05, elbow=0.3),
        left_leg=Leg(out=-0.06, hip=0.1, knee=0.15, ankle=0.05),
        right_leg=Leg(out=-0.08),
        head=(0.0, 0.0, -0.2),
    )


def dance_pose(phase: float) -> Pose:
    """One instant of a loop, phase in 0..1: steps on the spot, waves, one full turn.

    The right arm waves in the first half and the left one in the second.
    """
    turn = 2 * np.pi * phase
    stride, bounce = np.sin(3 * turn), np.sin(6 * turn)
    left_leg, right_leg = (
        Leg(
            out=-0.05,
            hip=0.28 * s * stride + 0.42 * max(0.0, s * np.cos(3 * turn)) ** 2,
            knee=0.12 + 0.85 * max(0.0, s * np.cos(3 * turn)) ** 2,
            ankle=-0.1,
        )
        for s in (1, -1)
    )
    arms = []
    for side in (1, -1):
        raised = (0.5 - 0.5 * side * np.sin(turn)) ** 1.5
        arms.append(
            Arm(
                abduction=0.25 + 0.95 * raised,
                swing=-0.45 * side * stride * (1 - raised) + 0.15 * raised,
                turn_out=1.2 * raised,
                elbow=0.5 + raised * (0.65 + 0.3 * np.sin(6 * turn)),
            )
        )
    return Pose(
        turn=turn,
        left_arm=arms[0],
        right_arm=arms[1],
        left_leg=left_leg,
        right_leg=right_leg,
        pelvis=(0.0, 0.05 * np.cos(3 * turn), 0.08 * stride),
        spine=(0.06 + 0.02 * bounce, -0.08 * np.cos(3 * turn), -0.2 * stride),
        head=(0.03 * bounce, 0.08 * np.cos(3 * turn), 0.1 * stride),
    )


def driver_frames(charts: Path) -> Iterator[NDArray[np.uint8]]:
    """The driver's IUV pictures in order."""
    person = Person(DRIVER_SHAPE, {})
    surface = bare_surface(person, Pose(), charts)
    height = np.ptp(surface.points[:, 2])
    camera = Camera.framing(DRIVER_SIZE, height, share=0.83, aim=0.53)  # room for raised hands
    for index in range(DRIVER_FRAMES):
        pose = dance_pose(index / DRIVER_FRAMES)
        points = person.posed(bone_rotations(pose, person.joints))
        yield iuv_picture(replace(surface, points=points), camera)


def write_png(path: Path, rgb: NDArray[np.uint8]) -> None:
    options = [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_STRATEGY, 0]
    if not cv2.imwrite(str(path), rgb[..., ::-1], options):
        raise OSError(f"could not write {path}")


def write_video(path: Path, frames: Iterator[NDArray[np.uint8]]) -> None:
    """Write RGB frames as lossless FFV1, without random identifiers or dates."""
    with av.open(str(path), "w", options={"fflags": "+bitexact"}) as container:
        stream = container.add_stream("ffv1", rate=Fraction(FRAMES_PER_SECOND))
        stream.width, stream.height = DRIVER_SIZE
        stream.pix_fmt = "bgr0"  # what the FFV1 encoder calls lossless 8-bit RGB
        stream.options = {"level": "3", "coder": "1", "context": "1", "flags": "+bitexact"}
        stream.codec_context.gop_size = DRIVER_FRAMES
        for rgb in frames:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb), format="rgb24")
            container.mux(stream.encode(frame.reformat(format="bgr0")))
        container.mux(stream.encode(None))


def write_source(charts: Path, folder: Path) -> None:
    """Write the photo and its IUV."""
    person = Person(SOURCE_SHAPE, EXPRESSION)
    surface = dress(bare_surface(person, catalogue_pose(), charts), person)
    height = np.ptp(surface.points[:, 2])
    camera = Camera.framing(SOURCE_SIZE, height, share=0.86, aim=0.5)
    write_png(folder / "source.png", photo(surface, person, camera))
    write_png(folder / "source_IUV.png", iuv_picture(surface, camera)[..., ::-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--charts", type=Path, required=True, help="chart table (.npz)")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_source(arguments.charts, arguments.out)
    frames = (iuv[..., ::-1] for iuv in driver_frames(arguments.charts))
    write_video(arguments.out / "driver.mkv", frames)


if __name__ == "__main__":
    main()
