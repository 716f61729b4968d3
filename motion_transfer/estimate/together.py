"""Several people in one IUV image, and still apart."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.estimate.interface import Box, PersonEstimate

NOBODY = 255
MOST_PEOPLE = NOBODY - 1


def lay_together(
    people: Sequence[PersonEstimate], height: int, width: int
) -> UInt8[np.ndarray, "H W 3"]:
    """The people of a frame in one IUV image.

    A pixel that several claim goes to the one whose alpha is higher there: where somebody is
    covered, its mask ends. An image of (I, U, V) does not say whose a pixel is, and connected
    pixels are taken for one person's; so between people who touch, one pixel of background stays.
    """
    iuv = np.zeros((height, width, 3), np.uint8)
    owner = np.full((height, width), NOBODY, np.uint8)
    claim = np.full((height, width), -1, np.int16)
    people = people[:MOST_PEOPLE]
    for number, person in enumerate(people):
        place = person.box.slices
        wins = (person.iuv[..., 0] > 0) & (person.alpha > claim[place])
        # not by `[wins]`: of a large photo its list of indices takes more memory than the photo
        np.copyto(iuv[place], person.iuv, where=wins[..., None])
        np.copyto(claim[place], person.alpha, where=wins)
        np.copyto(owner[place], number, where=wins)
    if any(_touch(a.box, b.box) for a, b in combinations(people, 2)):
        nearby = cv2.erode(owner, np.ones((3, 3), np.uint8))  # the lowest number around
        iuv *= (nearby == owner)[..., None]
    return iuv


def lay_alpha(
    people: Sequence[PersonEstimate], height: int, width: int
) -> UInt8[np.ndarray, "H W"]:
    """How much of each pixel of a frame is anybody; where several are, the most certain's."""
    alpha = np.zeros((height, width), np.uint8)
    for person in people:
        place = person.box.slices
        np.maximum(alpha[place], person.alpha, out=alpha[place])
    return alpha


def _touch(one: Box, other: Box) -> bool:
    return (
        one.left <= other.right
        and other.left <= one.right
        and one.top <= other.bottom
        and other.top <= one.bottom
    )
