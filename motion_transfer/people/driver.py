"""Drivers from motion: a reposed body, seen by a camera, as IUV frames.

This is the paper's second kind of target pose, "obtained by reposing the mesh" (its Sec. 3). A
still pose that turns once in front of the camera is a novel view.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from fractions import Fraction
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError
from motion_transfer.people.figure.body import Body, BodyModel, Shape, load_body_model
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.charts import load_charts
from motion_transfer.people.figure.exact_iuv import render_iuv
from motion_transfer.people.figure.framing import FRAMINGS, Framing, frame_points, lowest_in
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.motion.bvh import bvh_poses, read_bvh
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.posing import moved, posed

PosedAt = Callable[[int], PosedBody]
"""Frame number -> body."""

LONGEST_SIDE = 4096
CAMERA_POSES = 48
"""Instants of a motion that the camera is made to hold."""


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """A motion, a body to do it, and a camera to watch.

    Attributes:
        motion: a name in `MOTIONS`, or the path of a BVH file.
        frame_count: None: one loop at its natural pace, or the length of the file. Named motions
            always loop seamlessly, as often as brings their pace closest to the natural one.
        frame_rate: frames per second.
        size: (width, height) in px.
        shape: of the body.
        framing: what the camera sees of the body.
        azimuth, elevation: of the camera, degrees; positive azimuth stands on the person's left.
        distance: of the camera, metres.
        travel: the body goes where a BVH file takes it; off, it stays on the spot.
    """

    motion: str
    frame_count: int | None = None
    frame_rate: Fraction = Fraction(30)
    size: tuple[int, int] = (512, 512)
    shape: Shape = field(default_factory=Shape)
    framing: Framing = "full"
    azimuth: float = 0.0
    elevation: float = 4.0
    distance: float = 4.0
    travel: bool = False

    def __post_init__(self) -> None:
        if self.frame_count is not None and self.frame_count < 1:
            raise InputError(f"frames is {self.frame_count}; a driver needs at least 1")
        if not all(16 <= side <= LONGEST_SIDE for side in self.size):
            raise InputError(
                f"size {self.size[0]}x{self.size[1]}; each side must lie in 16..{LONGEST_SIDE} px"
            )
        if self.framing not in FRAMINGS:
            raise InputError(f"framing {self.framing!r}; supported are {', '.join(FRAMINGS)}")
        if not 1 <= self.distance <= 100:
            raise InputError(f"distance is {self.distance} m; it must lie in 1..100")
        if not -80 <= self.elevation <= 80:
            raise InputError(f"elevation is {self.elevation} degrees; it must lie in -80..80")
        for name in (entry.name for entry in fields(self.shape)):
            if not 0 <= getattr(self.shape, name) <= 1:
                raise InputError(f"{name} is {getattr(self.shape, name)}; it must lie in 0..1")


class MotionDriver:
    """IUV frames of a body in motion, each made when asked for.

    Attributes:
        frame_count, frame_rate: of the whole driver.
        camera: one, steady, that holds the whole motion.
    """

    def __init__(self, options: MotionOptions) -> None:
        """Raises: InputError for an unknown motion or a file that is not BVH."""
        check_motion(options.motion)
        self.options = options
        self.frame_rate = options.frame_rate
        self._model: BodyModel = load_body_model()
        self._charts = load_charts()
        body = self._model.body(options.shape)
        find = _named_motion if options.motion in MOTIONS else _captured_motion
        self.frame_count, self._posed = find(options, body, self._model)
        self.camera = self._frame(body)

    def iuv(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """One frame, (I, U, V)."""
        points = self._posed(index).points
        return render_iuv(points, self._model.faces, self._charts, self.camera)

    def _frame(self, body: Body) -> Camera:
        options = self.options
        above = body.points[:, 2] >= lowest_in(body.heads, body.skeleton, options.framing)
        index = np.flatnonzero(above)[::8]
        instants = np.linspace(0, self.frame_count - 1, min(CAMERA_POSES, self.frame_count))
        seen = [self._posed(round(instant)).points[index] for instant in instants]
        return frame_points(
            np.concatenate(seen),
            options.size,
            distance=options.distance,
            azimuth=math.radians(options.azimuth),
            elevation=math.radians(options.elevation),
        )


def check_motion(name: str) -> None:
    """Raises: InputError for what is neither the name of a motion nor a BVH file."""
    if name in MOTIONS:
        return
    if Path(name).suffix.lower() != ".bvh":
        raise InputError(f"unknown motion {name!r}; supported are {', '.join(MOTIONS)}, FILE.bvh")
    if not Path(name).is_file():
        raise InputError(f"motion {name} does not exist")


def _named_motion(options: MotionOptions, body: Body, model: BodyModel) -> tuple[int, PosedAt]:
    """A loop, as often as brings its pace closest to the natural one."""
    motion = MOTIONS[options.motion]
    count = options.frame_count or max(1, round(motion.seconds * options.frame_rate))
    cycles = max(1, round(count / (motion.seconds * options.frame_rate)))
    return count, lambda index: posed(body, motion.pose(index * cycles / count), model)


def _captured_motion(options: MotionOptions, body: Body, model: BodyModel) -> tuple[int, PosedAt]:
    """A BVH file's motion, at the wanted rate."""
    captured = read_bvh(Path(options.motion))
    seconds = len(captured.frames) / captured.frame_rate
    count = options.frame_count or max(1, round(seconds * options.frame_rate))
    poses = bvh_poses(captured, body, travel=options.travel)
    poses = poses.resampled(count, options.frame_rate)

    def posed_at(index: int) -> PosedBody:
        rotations, offset = poses[index]
        return moved(body, rotations, offset, model)

    return count, posed_at
