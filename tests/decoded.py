"""What an output shows, whatever its file says of itself."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
from PIL import Image


def decoded(path: Path) -> dict[str, bytes]:
    """Decode a picture, a folder of them or a video: shape and pixels, by name."""
    if path.is_dir():
        return {
            name: pixels
            for file in sorted(path.iterdir())
            for name, pixels in decoded(file).items()
        }
    if path.suffix == ".png":
        return {path.name: _told(np.asarray(Image.open(path)))}
    with av.open(str(path)) as container:
        frames = container.decode(video=0)
        return {f"{i}": _told(frame.to_ndarray(format="rgb48le")) for i, frame in enumerate(frames)}


def _told(picture: np.ndarray) -> bytes:
    return repr(picture.shape).encode() + picture.tobytes()
