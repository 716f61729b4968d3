"""A job: one run of a manifest."""

from __future__ import annotations

from dataclasses import dataclass

from motion_transfer.render.options import RenderOptions


@dataclass(frozen=True)
class Job:
    """One run of a manifest.

    Attributes:
        index: From 0, in the manifest's order.
        name: What the report calls it.
        options: Its paths are absolute.
    """

    index: int
    name: str
    priority: int
    options: RenderOptions
