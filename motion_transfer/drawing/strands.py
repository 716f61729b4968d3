"""Long hair that hangs before bare arms: it would be a sleeve of hair on arms that rise."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.textures import differ_in_any_light
from motion_transfer.drawing.unfolding import find_positions
from nhrr_core import PART_GROUPS

FEWEST_PIXELS = 60  # of upper arms, forearms, and the top of a head; fewer tell nothing
CROWN, CHIN, BROW = 0.5, 0.38, 0.47  # metres: hair grows higher up; a face, see `UVTables.position`
CHEEKS_METRES = 0.08  # forward: what is farther in front is face, not hair beside it
SHOULDER, ELBOW = 0.157, 0.417  # metres to the side, between which upper arms lie
STRETCHES, BARE_SHARE, FEWEST_OF_STRETCH = 13, 0.2, 8  # of an arm; of a bare one's pixels; pixels
SKIN_LIGHT, ANY_LIGHT = (0.6, 1.5), (0.4, 2.5)  # of that on the colours compared with
SKIN, STRANGE = 0.07, 0.1  # of 1: how far skin is from skin, and what is none
MORE_LIKE_HAIR = 0.7  # times as far from hair as from skin, at most
SPREAD_SHARE = 0.02  # of the root of the arms' area: edges of hair are mixed with skin

Places = Float32[np.ndarray, "N 3"]
Shades = Float32[np.ndarray, "3 K"]


def trim_strands(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take hair that hangs before bare upper arms out of their IUV.

    Arms are bare where all along them some of the one or of the other has the forearms' colours,
    and forearms that of the face. Hair before sleeves stays: nothing tells it from these.
    """
    arms, forearms, head = (
        np.isin(iuv[..., 0], PART_GROUPS[name]) for name in ("upper-arms", "lower-arms", "head")
    )
    colours = rgb[head]
    place = find_positions(iuv[head])
    crown = place[:, 1] > CROWN
    face = (place[:, 1] > CHIN) & (place[:, 1] < BROW) & (place[:, 2] > CHEEKS_METRES)
    if min(map(np.count_nonzero, (arms, forearms, crown))) < FEWEST_PIXELS:
        return iuv
    skin = _shades(rgb[forearms])
    if face.any():
        of_face = _shades(colours[face])
        if _apart(skin[:, 1:2], of_face[:, 1:2], ANY_LIGHT)[0] > STRANGE:
            return iuv  # it wears sleeves
        skin = np.concatenate([skin, of_face], 1)
    levels = rgb[arms].T / np.float32(255)
    from_skin = _apart(levels, skin, SKIN_LIGHT)
    if not _are_bare(find_positions(iuv[arms]), from_skin < SKIN):
        return iuv
    from_hair = _apart(levels, _shades(colours[crown]), ANY_LIGHT)
    hair = np.zeros(arms.shape, np.uint8)
    hair[arms] = (from_skin > STRANGE) & (from_hair < MORE_LIKE_HAIR * from_skin)
    reach = round(SPREAD_SHARE * np.count_nonzero(arms) ** 0.5)
    hair = cv2.dilate(hair, np.ones((2 * reach + 1,) * 2, np.uint8))
    return iuv * ~(arms & (hair > 0))[..., None]


def _shades(rgb: UInt8[np.ndarray, "N 3"]) -> Shades:
    """Give the dark, the medium and the bright colour of pixels: the medians of their thirds."""
    ordered = rgb[np.argsort(rgb.sum(1, dtype=int))]
    medians = [np.median(third, 0) for third in np.array_split(ordered, 3)]
    return np.stack(medians, 1).astype(np.float32) / 255


def _apart(
    levels: Float32[np.ndarray, "3 N"], shades: Shades, light: tuple[float, float]
) -> Float32[np.ndarray, " N"]:
    """Tell how far colours are from the nearest of some, in that light."""
    each = [differ_in_any_light(levels, shade[:, None], light) for shade in shades.T]
    return np.minimum.reduce(each)


def _are_bare(places: Places, is_skin: Bool[np.ndarray, " N"]) -> bool:
    """Tell whether all along upper arms, both taken as one, some of what is seen is skin."""
    along = (np.abs(places[:, 0]) - SHOULDER) / (ELBOW - SHOULDER) * STRETCHES
    stretch = along.astype(int).clip(0, STRETCHES - 1)
    seen, skin = (np.bincount(each, minlength=STRETCHES) for each in (stretch, stretch[is_skin]))
    return bool(np.all((skin >= BARE_SHARE * seen) | (seen < FEWEST_OF_STRETCH)))
