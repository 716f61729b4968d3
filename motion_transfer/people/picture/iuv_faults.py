"""Parts that DensePose loses or takes for another.

All functions take and return (I, U, V), uint8, H x W x 3; the input is left alone.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from motion_transfer.people.picture.smooth_noise import smooth_noise

Iuv = UInt8[np.ndarray, "H W 3"]

ARMS = ((3, 4), (19, 20), (21, 22), (15, 16), (17, 18))
LEGS = ((5, 6), (11, 12), (13, 14), (7, 8), (9, 10))
HEAD = ((23, 24),)
"""Parts and their twins on the other side of the body; the outer ones come first."""
LOWER_LIMB_PAIRS = 3

FACES = ((1, 2), (7, 9), (8, 10), (11, 13), (12, 14), (15, 17), (16, 18), (19, 21), (20, 22))
"""The two faces of the torso and of each limb."""
HANDS = ((3, (20, 22)), (4, (19, 21)))
"""Each hand, and its forearm."""
FEET = (5, 6)

# Where the twin's chart runs the other way; measured on the charts through `nhrr_core.UVLayout`.
U_TURNS_ACROSS_SIDES = (3, 4, 5, 6, 23, 24)
U_TURNS_ACROSS_FACES = (7, 8, 9, 10, 11, 12, 13, 14)
V_TURNS_ACROSS_FACES = (7, 8, 9, 10)

PATCH_SHARE = 0.3  # of the box: a confusion of faces covers a patch about so large


def lose_parts(iuv: Iuv, hand: float, forearm: float, foot: float, rng: np.random.Generator) -> Iuv:
    """Turn hands, forearms and feet into background, each with its probability.

    Args:
        forearm: where the hand of that arm is lost.
    """
    draws = rng.random(6)
    lost = [f for f, draw in zip(FEET, draws[:2], strict=True) if draw < foot]
    for (part, arm), draw, arm_draw in zip(HANDS, draws[2:4], draws[4:], strict=True):
        if draw < hand:
            lost += [part, *arm] if arm_draw < forearm else [part]
    if not lost:
        return iuv
    keep = np.ones(256, np.uint8)
    keep[lost] = 0
    return iuv * keep[iuv[..., :1]]


def swap_sides(iuv: Iuv, probability: float, rng: np.random.Generator) -> Iuv:
    """Take left for right: on the arms, the legs and the head, each with that probability.

    A confused pair trades places, or both are taken for the same side; on limbs, the whole of them
    or what lies beyond elbow and knee.
    """
    becomes = np.arange(256, dtype=np.uint8)
    for pairs in (ARMS, LEGS, HEAD):
        chosen, lower, way = rng.random() < probability, rng.random() < 0.5, rng.integers(3)
        if not chosen:
            continue
        for first, second in pairs[:LOWER_LIMB_PAIRS] if lower else pairs:
            if way != 1:
                becomes[first] = second
            if way != 2:
                becomes[second] = first
    if (becomes == np.arange(256)).all():
        return iuv
    part = becomes[iuv[..., 0]]
    return _renamed(iuv, part, U_TURNS_ACROSS_SIDES, ())


def swap_faces(iuv: Iuv, probability: float, rng: np.random.Generator) -> Iuv:
    """Take front for back, in a patch of the torso or of a limb, each with that probability."""
    draws = rng.random(len(FACES))
    becomes = np.arange(256, dtype=np.uint8)
    for (first, second), draw in zip(FACES, draws, strict=True):
        if draw < probability:
            becomes[[first, second]] = second, first
    if not (draws < probability).any():
        return iuv
    patch = smooth_noise(iuv.shape, PATCH_SHARE * max(iuv.shape), rng) > rng.uniform(-0.5, 1)
    part = np.where(patch, becomes[iuv[..., 0]], iuv[..., 0])
    return _renamed(iuv, part, U_TURNS_ACROSS_FACES, V_TURNS_ACROSS_FACES)


def _renamed(iuv: Iuv, part: np.ndarray, u_turns: tuple[int, ...], v_turns: tuple[int, ...]) -> Iuv:
    """The IUV with other parts; where one changes, U and V run back in the charts named."""
    out = iuv.copy()
    out[..., 0] = part
    places = np.flatnonzero(part != iuv[..., 0])
    before, after = iuv.reshape(-1, 3)[places], out.reshape(-1, 3)
    for channel, turning in ((1, u_turns), (2, v_turns)):
        turned = np.isin(before[:, 0], turning)
        after[places[turned], channel] = 255 - before[turned, channel]
    return out
