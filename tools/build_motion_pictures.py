"""Draw the pictures of the built-in motions that the preview's page shows: the middle of each.

python tools/build_motion_pictures.py      # needs the extra `people`
"""

from __future__ import annotations

from pathlib import Path

import cv2

from motion_transfer.people import MOTIONS, open_motion
from motion_transfer.preview.thumbs import draw_figure

FOLDER = Path("motion_transfer/preview/motions")
FRAMES = 16  # of one loop; the picture shows the one that tells most
SHOWN = {"walk": 2, "turntable": 3, "dance": 5, "wave": 4, "jumping-jacks": 8}

if __name__ == "__main__":
    for name in MOTIONS:
        stream = open_motion(Path(f"people:{name},frames={FRAMES},size=384x512"))
        frame = next(iter(stream.read_raw(SHOWN[name], SHOWN[name] + 1)))
        picture = draw_figure(frame)
        cv2.imwrite(
            str(FOLDER / f"{name}.png"), picture[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9]
        )
