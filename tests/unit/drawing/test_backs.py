"""Backs that no photo shows: what is open in front is closed behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.drawing.backs import clothe_back, find_torso
from motion_transfer.drawing.source import Source
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import load_uv_tables

SIZE = 256
HEIGHT = load_uv_tables().position[..., 1]
TORSO = find_torso()
JACKET, SHIRT, SKIN = (-0.7, -0.6, -0.4), (0.8, 0.8, 0.7), (0.4, 0.0, -0.2)
BUTTON, COLLAR = -0.05, 0.2  # metres: a jacket is open from the one up, a T-shirt from the other


def degrees() -> np.ndarray:
    """How far each texel of the torso lies from the front; 180 elsewhere."""
    around = np.full(SIZE**2, 180.0)
    around[TORSO.texels] = np.abs((TORSO.turns * 360 + 180) % 360 - 180)
    return around.reshape(SIZE, SIZE)


AWAY = degrees()
FRONT, BEHIND = AWAY < 85, np.zeros((SIZE, SIZE), bool)
BEHIND.reshape(-1)[TORSO.texels[TORSO.back]] = True


def wear(*layers: tuple[np.ndarray, tuple[float, float, float]]) -> Source:
    """Somebody seen from the front; later layers lie over earlier ones."""
    texture = np.zeros((3, SIZE, SIZE), np.float32)
    for where, colour in layers:
        texture[:, where] = np.array(colour, np.float32)[:, None]
    photo = Photo(Path("me.png"), np.zeros((8, 8, 3), np.uint8), None, turned=False)
    seen = FRONT[None].astype(np.float32)
    return Source(photo, np.zeros((8, 8, 3), np.uint8), None, texture * seen, seen)


SUIT = wear((FRONT, JACKET), ((AWAY < 20) & (HEIGHT > BUTTON), SHIRT))


def test_a_jacket_that_is_open_in_front_is_closed_behind() -> None:
    worn = clothe_back(SUIT)
    open_rows = BEHIND & (HEIGHT > BUTTON + 0.02) & (HEIGHT < 0.26)
    assert worn.visibility[0, open_rows].all()
    assert np.abs(worn.texture[:, open_rows] - np.array(JACKET)[:, None]).max() < 0.02
    assert (worn.texture[:, FRONT] == SUIT.texture[:, FRONT]).all(), "what is seen stays"
    closed_rows = BEHIND & (HEIGHT < BUTTON - 0.05)
    assert not worn.visibility[0, closed_rows].any(), "below the button nothing has to be told"
    assert (worn.texture[:, worn.visibility[0] == 0] == 0).all()
    assert SUIT.visibility[0, BEHIND].sum() == 0, "the source that was given is as it was"


def test_a_texture_of_another_size_is_painted_alike() -> None:
    finer = (np.kron(each, np.ones((4, 4), np.float32)) for each in (SUIT.texture, SUIT.visibility))
    worn = clothe_back(replace(SUIT, **dict(zip(("texture", "visibility"), finer, strict=True))))
    shirt = BEHIND & (HEIGHT > 0.0) & (HEIGHT < 0.2)
    painted = worn.texture[:, 1::4, 1::4][:, shirt]
    assert np.abs(painted - np.array(JACKET)[:, None]).max() < 0.02


def test_a_neckline_is_closed_and_the_rest_of_the_back_left_alone() -> None:
    worn = clothe_back(wear((FRONT, JACKET), ((AWAY < 25) & (HEIGHT > COLLAR), SKIN)))
    assert worn.visibility[0, BEHIND & (HEIGHT > COLLAR + 0.02) & (HEIGHT < 0.27)].all()
    assert not worn.visibility[0, BEHIND & (HEIGHT < COLLAR - 0.06)].any()


PRINT = (AWAY < 15) & (np.abs(HEIGHT) < 0.03)  # too small to be an opening
STRIPES = FRONT & (AWAY % 12 < 6)
SIDE = np.zeros((SIZE, SIZE), bool)
SIDE.reshape(-1)[TORSO.texels[TORSO.turns < 0.5]] = True


@pytest.mark.parametrize(
    "source",
    [
        wear((FRONT, JACKET)),
        wear((FRONT, JACKET), (PRINT, SHIRT)),
        wear((FRONT, JACKET), (STRIPES, SHIRT)),
        wear((FRONT, JACKET), (FRONT & SIDE, SHIRT), (AWAY < 15, SKIN)),
        replace(SUIT, visibility=np.ones_like(SUIT.visibility)),
        replace(SUIT, texture=SUIT.texture * 0, visibility=SUIT.visibility * 0),
    ],
    ids=["plain", "a small print", "stripes", "flanks that differ", "seen behind", "unseen"],
)
def test_others_pass_as_they_are(source: Source) -> None:
    assert clothe_back(source) is source


def test_light_from_the_side_is_no_other_cloth() -> None:
    """The middle is brighter than flanks that turn away, and one of these darker than the other."""
    lit = wear((FRONT, (0.0, -0.2, -0.2)))
    shade = np.where(SIDE, 0.75, 1.0) * np.where(AWAY < 40, 1.25, 1.0)
    lit.texture[:] = ((lit.texture + 1) / 2 * shade * 2 - 1) * lit.visibility
    assert clothe_back(lit) is lit
