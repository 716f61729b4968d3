"""Make the legs anew that stand in where no photo shows any: `python tools/build_jeans.py ASSETS`.

They are those of the demo's person, from the front and from behind, in MakeHuman's assets, whose
folder is named: the same assets and package versions on the same machine give the same files.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from build_demo import PERSON, SEED

from motion_transfer.media.pictures.photo import write_png
from motion_transfer.people import PeopleStream
from motion_transfer.people.free.person import FreePerson
from motion_transfer.people.motion.poses import Arm, Leg, Pose
from motion_transfer.people.person import DressedPerson
from motion_transfer.people.picture.light import Lamp, Light
from nhrr_core.parts import PART_GROUPS

JEANS = Path(__file__).parents[1] / "motion_transfer" / "render" / "jeans"
SIZE = (640, 1024)
LEGS = [part for group in ("upper-legs", "lower-legs", "feet") for part in PART_GROUPS[group]]
ROOM_PX = 8
EVEN = Light(
    lamps=(Lamp(azimuth=0.3, elevation=0.5, colour=(0.35, 0.35, 0.35)),),
    sky=(0.7, 0.7, 0.7),
    ground=(0.55, 0.55, 0.55),
)
TURNS = {"front": 0.0, "back": math.pi}


def main(assets: Path) -> None:
    stream = PeopleStream(seed=SEED, size=SIZE, assets=assets, free_share=1.0)
    person = stream.person(PERSON)
    assert isinstance(person, FreePerson)
    # the jacket's hem hides where the legs begin
    lower = tuple(worn for worn in person.look.clothes if worn.part != "upper")
    dressed = DressedPerson(replace(person, look=replace(person.look, clothes=lower)), stream.model)
    arm, leg = Arm(abduction=0.9), Leg(out=0.13, roll=0.13)
    JEANS.mkdir(exist_ok=True)
    for name, turn in TURNS.items():
        shot = replace(
            stream.shot(PERSON, 0),
            framing="full",
            pose=Pose(turn=turn, left_arm=arm, right_arm=arm, left_leg=leg, right_leg=leg),
            light=EVEN,
            elevation=0.0,
            distance=6.0,
            margin=0.02,
            roll=0.0,
            shift=(0.0, 0.0),
            grain=0.0,
        )
        photo = stream.take(dressed, shot)
        rows, columns = np.nonzero(np.isin(photo.iuv[..., 0], LEGS))
        legs = np.s_[
            rows.min() : rows.max() + ROOM_PX, columns.min() - ROOM_PX : columns.max() + ROOM_PX
        ]
        write_png(JEANS / f"{name}.png", np.dstack([photo.rgb, photo.alpha])[legs])
        write_png(JEANS / f"{name}_IUV.png", photo.iuv[legs][..., ::-1])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
