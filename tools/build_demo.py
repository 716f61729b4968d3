"""Make the demo's photo, its IUV and its drivers anew: `python tools/build_demo.py ASSETS`.

They are a synthetic person in MakeHuman's assets, whose folder is named, and motions of this
project's own (`motion_transfer.people`), so that the same assets and package versions on the same
machine give the same files.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from motion_transfer.media.pictures.photo import write_png
from motion_transfer.people import MotionOptions, PeopleStream, Shape, record_motion
from motion_transfer.people.motion.pose_sampler import sample_pose
from motion_transfer.people.motion.poses import Bend
from motion_transfer.people.picture.backgrounds import sample_background

DEMO = Path(__file__).parents[1] / "motion_transfer" / "demo"
SEED, PERSON = 11, 5  # chosen by eye
SOURCE_SIZE = (512, 768)
WAVE = MotionOptions(
    motion="wave",
    frame_count=30,
    frame_rate=Fraction(15),
    size=(240, 240),
    framing="upper",
    shape=Shape(gender=1.0, height=0.5),
)
DRIVER = MotionOptions(
    motion="dance",
    frame_count=120,
    frame_rate=Fraction(15),
    size=(320, 320),
    shape=Shape(gender=0.0, muscle=0.6, height=0.55),
)


def main(assets: Path) -> None:
    stream = PeopleStream(seed=SEED, size=SOURCE_SIZE, assets=assets, free_share=1.0)
    rng = np.random.default_rng(PERSON)
    shot = replace(
        stream.shot(PERSON, 0),
        framing="full",
        pose=replace(sample_pose(rng, "standing"), turn=math.radians(12), head=Bend()),
        background=sample_background(rng, "studio"),
        elevation=0.03,
        distance=5.0,
        roll=0.0,
        shift=(0.0, 0.0),
    )
    photo = stream.take(stream.dress(PERSON), shot)
    write_png(DEMO / "source.png", photo.rgb)
    write_png(DEMO / "source_IUV.png", photo.iuv[..., ::-1])
    record_motion(DRIVER, DEMO / "driver.mkv", force=True)
    record_motion(WAVE, DEMO / "wave.mkv", force=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
