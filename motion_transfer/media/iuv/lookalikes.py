"""Pictures that are taken for IUV and are not: what they are, and what to do instead.

- DensePose's drawings of parts ("dp_segm", what MagicAnimate and its kin are driven by): part
  indices run through a colour map, mostly Viridis or Parula, often at 70 % opacity. U and V are not
  in them.
- UV scaled by its own minimum and maximum: the background, 0 before, then has a colour, and every
  frame has another scale.
- Part indices spread over 0..255.
- Grey images: Caffe2's `_INDS.png` (which person), or part indices alone.
"""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
from jaxtyping import UInt8

from nhrr_core.parts import PART_COUNT

COLOUR_MAPS = {
    "Viridis": cv2.COLORMAP_VIRIDIS,
    "Parula": cv2.COLORMAP_PARULA,
    "Jet": cv2.COLORMAP_JET,
    "Turbo": cv2.COLORMAP_TURBO,
}
OPACITIES = (1.0, 0.7)  # how parts are drawn over the photo; 0.7 is detectron2's default
# the rest is chosen so that such drawings are known behind H.264, and photos are not taken for them
NEAR = 14  # grey levels that a video codec may add to a flat colour
EXPLAINED_SHARE = 0.9  # least share of the pixels; the others are mixtures along outlines
FEWEST_COLOURS = 4  # parts that must be seen, each on SMALLEST_SHARE of the pixels
SMALLEST_SHARE = 0.001
SAMPLED_PIXELS = 20_000  # enough to tell; each is compared with 25 colours, many times
DRAWN_STEP = 10.0  # grey levels a part, as some drawings have it instead of 255 / 24
EXPORT_REMEDY = (
    "export the numbers instead: apply_net.py dump, or labels and round(255 uv) as a PNG"
)

Rgb = UInt8[np.ndarray, "H W 3"]


def explain_picture(rgb: Rgb) -> str | None:
    """Tell what a picture without a part channel is, if it is one of those known here."""
    name = _find_colour_map(rgb)
    if name:
        return (
            f"it is DensePose's drawing of parts (dp_segm) in {name} colours, which has no U and V;"
            f" {EXPORT_REMEDY}"
        )
    for channel in (0, 2):
        values = np.unique(rgb[..., channel])
        if _is_spread(values):
            return (
                "its part indices look spread over 0..255; divide that channel by"
                f" {_step(values):.4g}, round, and save it again"
            )
    return None


def explain_scaled_uv(iuv: UInt8[np.ndarray, "H W 3"]) -> str | None:
    """Tell whether (I, U, V) show the marks of UV scaled by its minimum and maximum."""
    background = iuv[iuv[..., 0] == 0]
    if not len(background) or len(background) == iuv[..., 0].size:
        return None
    value = int(background[0, 1])
    if value == 0 or not (background[:, 1:] == value).all():
        return None
    return (
        f"its U and V were scaled by their minimum and maximum (the background has {value}, not 0),"
        f" with another scale in every frame, which cannot be undone; {EXPORT_REMEDY}"
    )


def explain_grey(grey: UInt8[np.ndarray, "H W"], name: str) -> str:
    """Tell what a picture with one channel is, going by its values and its file's name."""
    if name.lower().endswith("_inds"):
        return (
            "is Caffe2 DensePose's index of persons, without parts, U and V; give the _IUV.png of"
            " the same name"
        )
    if int(grey.max(initial=0)) <= PART_COUNT:
        return "is grey: part indices at most, without U and V; export all three channels"
    return "is grey; an IUV image has three channels, I, U and V"


def _find_colour_map(rgb: Rgb) -> str | None:
    pixels = rgb.reshape(-1, 3)
    pixels = pixels[:: max(1, len(pixels) // SAMPLED_PIXELS)].astype(np.int16)
    for (name, kind), opacity in product(COLOUR_MAPS.items(), OPACITIES):
        shades = np.arange(PART_COUNT + 1) * 255 // PART_COUNT
        # OpenCV's colours are BGR
        colours = cv2.applyColorMap(shades.astype(np.uint8)[:, None], kind)[:, 0, ::-1]
        # drawn on the map's lowest colour, on black or on white
        for ground in (colours[0].astype(float), np.zeros(3), np.full(3, 255.0)):
            palette = np.vstack([colours[1:] * opacity + ground * (1 - opacity), ground])
            distance = np.abs(pixels[:, None] - palette.astype(np.int16)).max(-1)
            near, which = distance.min(1) <= NEAR, distance.argmin(1)
            shares = np.bincount(which[near], minlength=len(palette))[:-1] / len(pixels)
            if near.mean() > EXPLAINED_SHARE and (shares > SMALLEST_SHARE).sum() >= FEWEST_COLOURS:
                return name
    return None


def _is_spread(values: np.ndarray) -> bool:
    """Tell whether the values are those of parts times one step, and reach beyond the parts."""
    if not FEWEST_COLOURS < len(values) <= PART_COUNT + 1 or values[0] or values[-1] <= PART_COUNT:
        return False
    parts = values / _step(values)
    # exporters round or cut: a level off is still the same part
    return bool(np.abs(parts - parts.round()).max() * _step(values) <= 1)


def _step(values: np.ndarray) -> float:
    """Find how many grey levels apart neighbouring parts are."""
    return 255 / PART_COUNT if (values % DRAWN_STEP).any() else DRAWN_STEP
