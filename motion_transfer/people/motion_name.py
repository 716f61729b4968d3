"""How a driver's name says that it is a motion; light, as every run asks."""

from __future__ import annotations

from pathlib import Path

SCHEME = "people:"


def is_motion(path: Path | str) -> bool:
    """Whether a driver's name means a motion and not a file."""
    return str(path).startswith(SCHEME)
