"""Small pictures for the report."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_photo, write_png
from motion_transfer.media.video import PictureVideo

POSTER_PX = 160


def write_posters(source: Path, output: Path, stem: Path) -> bool:
    """Pictures of a source and of the middle of an output, beside each other in one folder.

    Args:
        stem: `-source.png` and `-result.png` are added to it.
    Returns: False where a picture could not be had, which no job fails for.
    """
    try:
        stem.parent.mkdir(parents=True, exist_ok=True)
        write_png(stem.with_name(f"{stem.name}-source.png"), _small(read_photo(source).rgb))
        write_png(stem.with_name(f"{stem.name}-result.png"), _small(_middle(output)))
    except (InputError, OSError):
        return False
    return True


def _middle(output: Path) -> np.ndarray:
    if output.is_dir():
        frames = sorted(output.iterdir())
        return read_photo(frames[len(frames) // 2]).rgb
    if output.suffix in (".png", ".gif"):
        return read_photo(output).rgb
    video = PictureVideo(output)
    return video.read(video.frame_count // 2)


def _small(rgb: np.ndarray) -> np.ndarray:
    scale = min(1, POSTER_PX / max(rgb.shape[:2]))
    size = (max(1, round(rgb.shape[1] * scale)), max(1, round(rgb.shape[0] * scale)))
    return cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
