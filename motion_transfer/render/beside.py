"""Where a photo's IUV lies when nobody says."""

from __future__ import annotations

from pathlib import Path

from motion_transfer.errors import InputError


def list_iuv_names(photo: Path) -> list[Path]:
    """Where a photo's IUV is looked for: `<stem>_IUV.png` and `<stem>_iuv.png` next to it."""
    return [photo.with_name(f"{photo.stem}_{word}.png") for word in ("IUV", "iuv")]


def find_iuv_beside(photo: Path) -> Path | None:
    """`<stem>_IUV.png` or `<stem>_iuv.png` next to a photo; None: it has to be estimated.

    Raises: InputError if there is no such photo.
    """
    if not photo.exists():
        raise InputError(f"source {photo} does not exist")
    return next((path for path in list_iuv_names(photo) if path.exists()), None)
