"""Synthetic people: photos with exact IUV, and drivers from motion.

Everything that the rest of the program may use has its name here. A name is loaded when it is first
used: every run asks whether its driver is a motion, and few need the body model.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.extras import require_extra

if TYPE_CHECKING:
    from motion_transfer.people.album import AlbumOptions, write_album
    from motion_transfer.people.dataset import PeopleDataset, PeopleStream, Split
    from motion_transfer.people.driver import (
        MotionDriver,
        MotionOptions,
        check_motion,
        hold_motion,
        open_motion,
        record_motion,
    )
    from motion_transfer.people.figure.body import (
        FIRST_USE,
        Body,
        BodyModel,
        Shape,
        is_cached,
        load_body_model,
    )
    from motion_transfer.people.figure.camera import Camera
    from motion_transfer.people.figure.charts import load_charts, render_iuv
    from motion_transfer.people.figure.mesh import PosedBody
    from motion_transfer.people.figure.rasterise import Triangles, depths, rasterise
    from motion_transfer.people.free.assets import check_share, find_assets, load_assets
    from motion_transfer.people.free.binding import (
        HELPERS_FIRST_USE,
        are_helpers_cached,
        load_helpers,
    )
    from motion_transfer.people.free.person import FreePerson
    from motion_transfer.people.motion.bvh.writing import write_bvh
    from motion_transfer.people.motion.limbs import (
        ARM_AT_ZERO,
        LEG_AT_ZERO,
        NECK,
        SPINE,
        Bones,
        Rest,
        arm_bones,
        finger_bones,
        leg_bones,
        mirrored_matrix,
        rotation,
        turned,
        whole_body,
    )
    from motion_transfer.people.motion.motions import MOTIONS
    from motion_transfer.people.motion.pose_sampler import sample_pose
    from motion_transfer.people.motion.poses import Arm, Leg, Pose, arm_chain, leg_chain
    from motion_transfer.people.person import DressedPerson, Person, sample_person
    from motion_transfer.people.photo import PersonPhoto, Shot, sample_shot
    from motion_transfer.people.picture.iuv_noise import IuvNoise

__all__ = [
    "ARM_AT_ZERO", "FIRST_USE", "HELPERS_FIRST_USE", "LEG_AT_ZERO", "MOTIONS", "NECK", "SCHEME",
    "SPINE", "AlbumOptions", "Arm", "Body", "BodyModel", "Bones", "Camera", "DressedPerson",
    "FreePerson", "IuvNoise", "Leg", "MotionDriver", "MotionOptions", "PeopleDataset",
    "PeopleStream", "Person", "PersonPhoto", "Pose", "PosedBody", "Rest", "Shape", "Shot", "Split",
    "Triangles", "are_helpers_cached", "arm_bones", "arm_chain", "check_motion", "check_share",
    "depths", "find_assets", "finger_bones", "hold_motion", "is_cached", "is_motion", "leg_bones",
    "leg_chain", "load_assets", "load_body_model", "load_charts", "load_helpers", "mirrored_matrix",
    "open_motion", "rasterise", "record_motion", "render_iuv", "rotation", "sample_person",
    "sample_pose", "sample_shot", "turned", "whole_body", "write_album", "write_bvh",
]  # fmt: skip

_NAMES_OF = {
    "album": "AlbumOptions write_album",
    "dataset": "PeopleDataset PeopleStream Split",
    "driver": "MotionDriver MotionOptions check_motion hold_motion open_motion record_motion",
    "figure.body": "FIRST_USE Body BodyModel Shape is_cached load_body_model",
    "figure.camera": "Camera",
    "figure.charts": "load_charts render_iuv",
    "figure.mesh": "PosedBody",
    "figure.rasterise": "Triangles depths rasterise",
    "free.assets": "check_share find_assets load_assets",
    "free.binding": "HELPERS_FIRST_USE are_helpers_cached load_helpers",
    "free.person": "FreePerson",
    "motion.bvh.writing": "write_bvh",
    "motion.limbs": "ARM_AT_ZERO LEG_AT_ZERO NECK SPINE Bones Rest arm_bones finger_bones leg_bones"
    " mirrored_matrix rotation turned whole_body",
    "motion.motions": "MOTIONS",
    "motion.pose_sampler": "sample_pose",
    "motion.poses": "Arm Leg Pose arm_chain leg_chain",
    "person": "DressedPerson Person sample_person",
    "photo": "PersonPhoto Shot sample_shot",
    "picture.iuv_noise": "IuvNoise",
}
_HOMES = {name: home for home, names in _NAMES_OF.items() for name in names.split()}

SCHEME = "people:"
"""How the name of a driver begins that is a motion and no file."""


def is_motion(path: Path | str) -> bool:
    """Tell whether a driver's name means a motion and not a file."""
    return str(path).startswith(SCHEME)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    except ModuleNotFoundError:
        require_extra("people")  # says how to install what is missing
        raise
