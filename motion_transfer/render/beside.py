"""Where a photo's IUV lies when nobody says."""

from __future__ import annotations

from pathlib import Path

from motion_transfer.errors import InputError


def list_iuv_names(photo: Path) -> list[Path]:
    """Where a photo's IUV is looked for: `<stem>_IUV.png` and `<stem>_iuv.png` next to it."""
    return [photo.with_name(f"{photo.stem}_{word}.png") for word in ("IUV", "iuv")]


def find_iuv_beside(photo: Path) -> Path:
    """`<stem>_IUV.png` or `<stem>_iuv.png` next to a photo. Raises: InputError if neither is."""
    if not photo.exists():
        raise InputError(f"source {photo} does not exist")
    candidates = list_iuv_names(photo)
    for candidate in candidates:
        if candidate.exists():
            return candidate
    raise InputError(
        f"no IUV found for {photo}: neither {candidates[0].name} nor {candidates[1].name} is beside"
        " it; make one with DensePose and name it with --source-iuv"
    )
