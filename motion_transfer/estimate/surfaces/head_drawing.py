"""Heads laid over the IUV that a coarser network painted."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.surfaces.hand_drawing import (
    box_of,
    clear,
    draw,
    within,
)
from motion_transfer.estimate.surfaces.head_surface import load_head

RIGHT = 23  # the head's first part
TRUNK = 2  # the last part of the trunk; 0 is nobody

AROUND = 0.6  # of the drawn head's size: so far around it, what was painted of it is its own
NECK_METRES = 0.085  # below the head's middle; what was painted there is the neck's, and stays


def lay_head(iuv: UInt8[np.ndarray, "h w 3"], box: Box, seen: Float32[np.ndarray, "468 3"]) -> None:
    """Draw a head in place of what was painted of it, in `iuv` itself; hair is not the head's.

    Args:
        box: Of the frame; where `iuv` lies.
        seen: The face's points; frame pixels, depth included.
    """
    surface = load_head()
    scale, turn, middle = surface.fit(seen)
    points = (scale * surface.points @ turn.T + middle).astype(np.float32)
    place = within(box_of(points, AROUND), box)
    if place is None:
        return
    drawn = draw(surface, points, place)
    here = iuv[
        place.top - box.top : place.bottom - box.top, place.left - box.left : place.right - box.left
    ]
    part = here[..., 0]
    # arms and hands before the face stay
    shown = (drawn[..., 0] > 0) & ((part <= TRUNK) | (part >= RIGHT))
    clear(here, (part >= RIGHT) & ~_below(place, middle, turn, scale))
    np.copyto(here, drawn, where=shown[..., None])


def _below(
    place: Box, middle: np.ndarray, turn: np.ndarray, scale: float
) -> Bool[np.ndarray, "h w"]:
    """Tell which pixels lie on the neck's side of where the head ends."""
    down = turn[:2, 1]
    x = np.arange(place.left, place.right) + 0.5 - middle[0]
    y = np.arange(place.top, place.bottom) + 0.5 - middle[1]
    return x * down[0] + y[:, None] * down[1] > scale * NECK_METRES * (down @ down)
