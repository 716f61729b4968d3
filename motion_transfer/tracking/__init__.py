"""The body model fitted to people in clips: a clip becomes 3D motion.

Public names are loaded when they are first used: the body model is not needed to ask for one.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from motion_transfer.extras import require_extra

if TYPE_CHECKING:
    from motion_transfer.tracking.clip import Track, track_clip
    from motion_transfer.tracking.run import TrackOptions, track_motion

__all__ = ["Track", "TrackOptions", "track_clip", "track_motion"]

_HOMES = {
    "Track": "clip",
    "TrackOptions": "run",
    "track_clip": "clip",
    "track_motion": "run",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    require_extra("people")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
