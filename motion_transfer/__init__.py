"""One photo of a person plus the motion of another becomes a video.

>>> from motion_transfer import render_video
>>> render_video(source="me.jpg", driver="dance_iuv/", output="me_dancing.mp4")

Frame by frame, from files or arrays:

>>> from motion_transfer import MotionTransfer
>>> model = MotionTransfer.from_pretrained("lite")
>>> frames = model.render(model.encode("me.jpg"), "dance_iuv/")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from motion_transfer.version import __version__

if TYPE_CHECKING:
    from motion_transfer.api import render_video
    from motion_transfer.errors import MotionTransferError
    from motion_transfer.estimate.frames import estimate_frames
    from motion_transfer.render.memory import EncodedSource, MotionTransfer, RenderedFrames
    from motion_transfer.render.options import Garment, Partner, RenderOptions
    from motion_transfer.render.run import RenderReport

__all__ = [
    "EncodedSource",
    "Garment",
    "MotionTransfer",
    "MotionTransferError",
    "Partner",
    "RenderOptions",
    "RenderReport",
    "RenderedFrames",
    "__version__",
    "estimate_frames",
    "render_video",
]

_HOMES = {
    "EncodedSource": "motion_transfer.render.memory",
    "Garment": "motion_transfer.render.options",
    "Partner": "motion_transfer.render.options",
    "MotionTransfer": "motion_transfer.render.memory",
    "MotionTransferError": "motion_transfer.errors",
    "RenderOptions": "motion_transfer.render.options",
    "RenderReport": "motion_transfer.render.run",
    "RenderedFrames": "motion_transfer.render.memory",
    "estimate_frames": "motion_transfer.estimate.frames",
    "render_video": "motion_transfer.api",
}


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used, so that `mt --help` need not load torch."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOMES[name]), name)
