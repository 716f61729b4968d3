"""Synthetic people: photos with exact IUV, and drivers from motion.

Public names are loaded when they are first used, so that asking for one thing (whether a driver is
a motion, say) does not load all of it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from motion_transfer.people.album import AlbumOptions, write_album
    from motion_transfer.people.dataset import PeopleDataset, PeopleStream
    from motion_transfer.people.driver import MotionDriver, MotionOptions
    from motion_transfer.people.figure.body import Shape
    from motion_transfer.people.person import Person, sample_person
    from motion_transfer.people.photo import PersonPhoto, Shot, sample_shot
    from motion_transfer.people.picture.iuv_noise import IuvNoise
    from motion_transfer.people.recording import record_motion

_HOMES = {
    "AlbumOptions": "album",
    "write_album": "album",
    "PeopleDataset": "dataset",
    "PeopleStream": "dataset",
    "MotionDriver": "driver",
    "MotionOptions": "driver",
    "Shape": "figure.body",
    "Person": "person",
    "sample_person": "person",
    "PersonPhoto": "photo",
    "Shot": "photo",
    "sample_shot": "photo",
    "IuvNoise": "picture.iuv_noise",
    "record_motion": "recording",
}

__all__ = [
    "AlbumOptions",
    "IuvNoise",
    "MotionDriver",
    "MotionOptions",
    "PeopleDataset",
    "PeopleStream",
    "Person",
    "PersonPhoto",
    "Shape",
    "Shot",
    "record_motion",
    "sample_person",
    "sample_shot",
    "write_album",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
