"""A photo of a synthetic person, with everything that a real photo does not tell."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, cast

import numpy as np
from jaxtyping import UInt8

from motion_transfer.people.figure.camera import Camera, Framing, frame_points, lowest_in
from motion_transfer.people.figure.charts import load_charts, render_iuv
from motion_transfer.people.motion.pose_sampler import sample_pose
from motion_transfer.people.motion.poses import Pose
from motion_transfer.people.person import DressedPerson
from motion_transfer.people.picture.backgrounds import (
    Background,
    paint_background,
    sample_background,
)
from motion_transfer.people.picture.iuv_noise import IuvNoise, add_iuv_noise
from motion_transfer.people.picture.light import Light, floor_shadow, sample_light
from motion_transfer.people.picture.shade import develop

FRAMING_SHARES: dict[Framing, float] = {"full": 0.6, "three-quarters": 0.25, "upper": 0.15}
"""How often each framing is sampled; chosen so that whole bodies prevail."""

FRAMED_STEP = 11
"""One in so many vertices is enough to point a camera by."""

SENSOR_NOISE = 0.006
"""The most that a small photo has, as a share of white; chosen by eye."""


@dataclass(frozen=True)
class Shot:
    """One picture of somebody: pose, camera, light and surroundings.

    Attributes:
        distance: Of the camera, metres.
        elevation, roll: Of the camera, radians.
        margin: Share of the picture left free around the person.
        shift: Of the person within what is free, each in [-1, 1].
        grain: Sensor noise, standard deviation as a share of white; drawn from `seed`.
    """

    pose: Pose
    framing: Framing
    distance: float
    elevation: float
    roll: float
    margin: float
    shift: tuple[float, float]
    light: Light
    background: Background
    grain: float
    seed: int

    def description(self) -> dict[str, Any]:
        """Describe the shot in plain numbers, words and lists, for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class PersonPhoto:
    """What a shot shows.

    Attributes:
        alpha: How much of each pixel the person covers, clothes and hair included; 255 is all.
        iuv: (I, U, V) of the bare body, with noise where it was asked for.
    """

    rgb: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"]
    iuv: UInt8[np.ndarray, "H W 3"]
    camera: Camera


def sample_shot(rng: np.random.Generator, *, framing: Framing | None = None) -> Shot:
    """Sample a catalogue or street photo: any pose, most cameras at chest height."""
    names = list(FRAMING_SHARES)
    chosen = framing or names[rng.choice(len(names), p=list(FRAMING_SHARES.values()))]
    return Shot(
        pose=sample_pose(rng),
        framing=cast(Framing, chosen),
        distance=float(rng.uniform(2.2, 6.0)),
        elevation=float(rng.normal(0.05, 0.07)),
        roll=float(rng.normal(0, 0.015)),
        margin=float(rng.uniform(0.02, 0.1)),
        shift=(float(rng.uniform(-0.3, 0.3)), float(rng.uniform(-0.3, 0.3))),
        light=sample_light(rng),
        background=sample_background(rng),
        grain=float(SENSOR_NOISE * max(0.0, rng.uniform(-0.7, 1)) ** 2),  # four in ten have none
        seed=int(rng.integers(2**32)),
    )


def take_photo(
    dressed: DressedPerson,
    shot: Shot,
    size: tuple[int, int],
    noise: IuvNoise | None = None,
    camera: Camera | None = None,
) -> PersonPhoto:
    """Take a shot of a dressed person.

    Args:
        size: (width, height) of the photo in px.
        noise: Faults of DensePose to put into the IUV; None: exact.
        camera: One that stays where it is, for frames of a clip; None: as the shot says.
    """
    rng = np.random.default_rng(shot.seed)
    posed = dressed.posed(shot.pose)
    points = np.concatenate([piece.posed(posed) for piece in dressed.pieces])
    if camera is None:
        lowest = lowest_in(posed.joints, dressed.model.skeleton, shot.framing)
        outline = points[::FRAMED_STEP]
        camera = frame_points(
            outline[outline[:, 2] >= lowest],
            size,
            distance=shot.distance,
            elevation=shot.elevation,
            roll=shot.roll,
            margin=shot.margin,
            shift=shot.shift,
        )
    seen = dressed.scene.shade(points, camera, shot.light)
    alpha = np.rint(seen.coverage * 255).astype(np.uint8)
    # a camera in the floor would see no floor
    background = replace(shot.background, camera_metres=max(float(camera.position[2]), 0.2))
    horizon = camera.height / 2 - camera.focal_px * np.tan(camera.elevation)
    pixels_per_metre = camera.focal_px / camera.distance
    behind = paint_background(
        background, camera.height, camera.width, float(horizon), pixels_per_metre
    )
    if shot.background.has_floor:
        behind *= 1 - floor_shadow(posed.points, camera, shot.light)[..., None]
    rgb = develop(seen, behind, shot.grain, rng)
    iuv = render_iuv(posed.points, dressed.model.faces, load_charts(), camera)
    if noise is not None:
        iuv = add_iuv_noise(iuv, noise, rng)
    return PersonPhoto(rgb, alpha, iuv, camera)
