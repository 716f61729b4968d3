"""Drivers from motion: a reposed body, seen by a camera, as IUV frames.

This is the paper's second kind of target pose, "obtained by reposing the mesh" (its Sec. 3). A
still pose that turns once in front of the camera is a novel view. A motion can be opened wherever
a driver is (`people:walk`), or be written down as a folder of IUV images or a lossless video.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, OutputError
from motion_transfer.extras import require_extra
from motion_transfer.media.files import check_readable
from motion_transfer.media.iuv.stream import IuvStream, Raw
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv
from motion_transfer.media.publish import check_destination
from motion_transfer.option import parse_rate, parse_size, read_whole
from motion_transfer.people.figure.body import (
    Body,
    BodyModel,
    Points,
    Shape,
    load_body_model,
)
from motion_transfer.people.figure.camera import (
    FRAMINGS,
    Camera,
    Framing,
    check_size,
    frame_points,
    lowest_in,
)
from motion_transfer.people.figure.charts import load_charts, render_iuv
from motion_transfer.people.figure.mesh import PosedBody
from motion_transfer.people.motion.bvh import bvh_poses, read_bvh
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.poses import moved, posed

PosedAt = Callable[[int], PosedBody]
"""Frame number -> body."""

LONGEST_SIDE = 4096
"""Pixels; chosen as a bound against slips of the pen."""

MOST_FRAMES = 1_000_000  # nine hours

CAMERA_POSES = 48
"""Instants of a motion that the camera is made to hold; between them a body moves little."""

CAMERA_STEP = 8
"""One in so many vertices is enough to point a camera by."""

SETTINGS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "frames": ("frame_count", read_whole),
    "fps": ("frame_rate", parse_rate),
    "size": ("size", parse_size),
    "framing": ("framing", str),
    "azimuth": ("azimuth", float),
    "elevation": ("elevation", float),
    "distance": ("distance", float),
}
"""What may follow a motion's name -> the option it sets, and how it is read."""


@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """A motion, a body to do it, and a camera to watch.

    Attributes:
        motion: A name in `MOTIONS`, or the path of a BVH file.
        frame_count: None: one loop at its natural pace, or the length of the file. Named motions
            always loop seamlessly, as often as brings their pace closest to the natural one.
        frame_rate: Frames per second.
        size: (width, height) in px.
        azimuth, elevation: Of the camera, degrees; positive azimuth stands on the person's left.
        distance: Of the camera, metres.
        travel: The body goes where a BVH file takes it; off, it stays on the spot.
    Raises: InputError for a value out of its range.
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
        if self.frame_count is not None and self.frame_count > MOST_FRAMES:
            raise InputError(f"frames is {self.frame_count}; a driver has {MOST_FRAMES:,} at most")
        check_size(self.size, 16, LONGEST_SIDE)
        if self.framing not in FRAMINGS:
            raise InputError(f"framing {self.framing!r}; supported are {', '.join(FRAMINGS)}")
        if not 1 <= self.distance <= 100:
            raise InputError(f"distance is {self.distance} m; it must lie in 1..100")
        if not -360 <= self.azimuth <= 360:
            raise InputError(f"azimuth is {self.azimuth} degrees; it must lie in -360..360")
        if not -80 <= self.elevation <= 80:
            raise InputError(f"elevation is {self.elevation} degrees; it must lie in -80..80")
        for name in (entry.name for entry in fields(self.shape)):
            if not 0 <= getattr(self.shape, name) <= 1:
                raise InputError(f"{name} is {getattr(self.shape, name)}; it must lie in 0..1")


class MotionDriver:
    """IUV frames of a body in motion, each made when asked for.

    Attributes:
        frame_count, frame_rate: Of the whole driver.
        camera: One, steady, that holds the whole motion.
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
        above = body.points[:, 2] >= lowest_in(body.heads, body.skeleton, options.framing)
        self.camera = hold_motion(
            lambda frame: self._posed(frame).points[above],
            range(self.frame_count),
            options.size,
            distance=options.distance,
            azimuth=math.radians(options.azimuth),
            elevation=math.radians(options.elevation),
        )

    def iuv(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """Draw one frame, (I, U, V)."""
        points = self._posed(index).points
        return render_iuv(points, self._model.faces, self._charts, self.camera)


def hold_motion(
    points_at: Callable[[int], Points],
    frames: range,
    size: tuple[int, int],
    *,
    distance: float,
    azimuth: float,
    elevation: float,
) -> Camera:
    """Point a camera, once, so that it holds a whole motion.

    Args:
        points_at: Frame number -> the vertices that have to be seen.
        size, distance, azimuth, elevation: See `frame_points`.
    """
    instants = np.linspace(frames[0], frames[-1], min(CAMERA_POSES, len(frames)))
    seen = [points_at(round(instant))[::CAMERA_STEP] for instant in instants]
    return frame_points(
        np.concatenate(seen), size, distance=distance, azimuth=azimuth, elevation=elevation
    )


def check_motion(name: str) -> None:
    """Raise InputError for what is neither the name of a motion nor a BVH file."""
    if name in MOTIONS:
        return
    if Path(name).suffix.lower() != ".bvh":
        raise InputError(f"unknown motion {name!r}; supported are {', '.join(MOTIONS)}, FILE.bvh")
    check_readable(Path(name), "motion")


def _named_motion(options: MotionOptions, body: Body, model: BodyModel) -> tuple[int, PosedAt]:
    motion = MOTIONS[options.motion]
    count = options.frame_count or max(1, round(motion.seconds * options.frame_rate))
    # whole loops only, or the last frame would not lead into the first
    cycles = max(1, round(count / (motion.seconds * options.frame_rate)))
    return count, lambda index: posed(body, motion.pose(index * cycles / count), model)


def _captured_motion(options: MotionOptions, body: Body, model: BodyModel) -> tuple[int, PosedAt]:
    captured = read_bvh(Path(options.motion))
    seconds = len(captured.frames) / captured.frame_rate
    count = options.frame_count or max(1, round(seconds * options.frame_rate))
    if count > MOST_FRAMES:
        raise InputError(f"{options.motion} lasts {count} frames; {MOST_FRAMES:,} at most are made")
    poses = bvh_poses(captured, body, travel=options.travel)
    poses = poses.resampled(count, options.frame_rate)
    return count, lambda index: moved(body, *poses[index], model)


class MotionStream(IuvStream):
    """IUV frames of a synthetic body, in the order I, U, V, drawn when they are read."""

    def __init__(self, name: Path, driver: MotionDriver) -> None:
        super().__init__(name, f"motion ({driver.options.motion})", driver.frame_count)
        self.frame_rate = driver.frame_rate
        self._driver = driver

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        return (self._driver.iuv(index) for index in range(start, stop))

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path}"


def open_motion(path: Path) -> MotionStream:
    """Open `people:MOTION` or `people:FILE.bvh`, settings after commas.

    Example: `people:walk,frames=60,fps=25,size=384x512,gender=1,azimuth=30`.
    Raises: InputError for an unknown motion or setting, and without the extra.
    """
    require_extra("people")
    _scheme, _, rest = str(path).partition(":")
    motion, *settings = rest.split(",")
    options = MotionOptions(motion=motion)
    for setting in settings:
        options = _with_setting(options, setting, str(path))
    return MotionStream(path, MotionDriver(options))


def _with_setting(options: MotionOptions, setting: str, where: str) -> MotionOptions:
    name, _, value = setting.partition("=")
    shape = [entry.name for entry in fields(options.shape)]
    try:
        if name in SETTINGS:
            option, read = SETTINGS[name]
            return replace(options, **{option: read(value)})
        if name in shape:
            return replace(options, shape=replace(options.shape, **{name: float(value)}))
    except (ValueError, ZeroDivisionError):
        raise InputError(f"{where}: {setting!r} has no number that can be used") from None
    known = ", ".join([*SETTINGS, *shape])
    raise InputError(f"{where}: unknown setting {name!r}; supported are {known}")


def record_motion(
    options: MotionOptions,
    output: Path,
    *,
    force: bool = False,
    done: Callable[[int], object] = int,
) -> MotionDriver:
    """Write a driver. Colours of the files are V, U, I, as those of Caffe2's DensePose.

    Args:
        done: Called after each frame.
    Raises: InputError and its kinds, before any work where it can be known; nothing half-written
        stays behind.
    """
    if output.suffix.lower() not in ("", ".mkv"):
        raise OutputError(
            f"cannot write {output}: a driver is a folder of PNG (no ending) or a lossless .mkv"
        )
    check_destination(output, force=force)  # now: to find the motion may take a while
    driver = MotionDriver(options)
    width, height = options.size
    settings = IuvOutput(
        frame_count=driver.frame_count,
        height=height,
        width=width,
        frame_rate=options.frame_rate,
        force=force,
    )
    write_iuv(map(driver.iuv, range(driver.frame_count)), output, settings, done)
    return driver
