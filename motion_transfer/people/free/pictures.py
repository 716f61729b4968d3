"""Pictures of items, made ready once: logos painted over, light that is baked in evened.

Where logos are, and how much is evened, was found by eye.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.people.figure.picture import Picture, mean_brightness
from motion_transfer.people.free.assets import Assets, Item, load_mesh
from motion_transfer.people.free.binding import load_parts

LARGEST = 1024  # px a side; a body's skin then has a texel for each 2 mm


class Logo(NamedTuple):
    """Where MakeHuman's figure is printed on a shirt, in texture coordinates.

    Attributes:
        u, v: Its middle.
        wide, high: Half its width and height.
        aside, down: How far away plain cloth of its size lies.
    """

    u: float
    v: float
    wide: float
    high: float
    aside: float
    down: float


LOGOS: dict[str, tuple[Logo, ...]] = {
    "female_casualsuit01": (Logo(0.79, 0.232, 0.076, 0.074, -0.155, 0.0),),
    "female_casualsuit02": (Logo(0.79, 0.232, 0.076, 0.074, -0.155, 0.0),),
    "male_casualsuit02": (Logo(0.56, 0.17, 0.060, 0.060, 0.0, 0.13),),
    "male_casualsuit04": (Logo(0.56, 0.168, 0.060, 0.060, 0.0, 0.12),),
    "male_casualsuit06": (
        Logo(0.53, 0.158, 0.100, 0.045, 0.0, -0.10),
        Logo(0.262, 0.138, 0.078, 0.034, 0.0, -0.09),
        Logo(0.73, 0.145, 0.038, 0.034, 0.0, -0.09),
    ),
}
"""Item -> what is painted over."""

DARKEST_FOLD = 0.5
"""Occlusion below that is no fold, but the shirt that lies over trousers until somebody sits."""

SKIN_GREY = 0.12
"""Skins are photographs under warm light; so much grey makes them neutral."""

SKIN_EVENED = 0.5
"""Of the slow changes of brightness over a skin, which are light and not skin, this share goes."""

SKIN_BLUR = 0.06
"""How slow a change of brightness is that counts as light, a share of the picture's side."""


@lru_cache(maxsize=96)
def load_picture(item: Item, role: str, assets: Assets) -> Picture:
    """Read a picture of an item that shows colours, once. Raises: InputError for what is none."""
    rgb, alpha = _read(item, role)
    if item.kind == "skin":
        seen = _skin_coverage(assets, rgb.shape[0])
        return Picture.of(np.dstack([_evened(rgb, seen), seen]))
    for logo in LOGOS.get(item.name, ()):
        rgb = _painted_over(rgb, logo)
    if "ao" in item.pictures:
        folds = cv2.resize(_read(item, "ao")[0], rgb.shape[1::-1]).astype(np.float32) / 255
        rgb = np.rint(rgb * np.maximum(folds, DARKEST_FOLD)).astype(np.uint8)
    if not item.alpha:
        alpha = np.full(rgb.shape[:2], 255, np.uint8)
    return Picture.of(np.dstack([rgb, alpha]))


@lru_cache(maxsize=64)
def load_normals(item: Item) -> Picture | None:
    """Read an item's normal map, once; None where it has none. Raises: InputError."""
    if "normal" not in item.pictures:
        return None
    rgb, _ = _read(item, "normal")
    return Picture.of(np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)]))


@lru_cache(maxsize=256)
def brightness(item: Item, part: str, assets: Assets) -> float:
    """Measure the mean brightness of a part of an item."""
    seen = load_parts(item, assets)[part].corner_uv
    return mean_brightness(load_picture(item, "diffuse", assets), seen)


def _read(item: Item, role: str) -> tuple[UInt8[np.ndarray, "H W 3"], UInt8[np.ndarray, "H W"]]:
    photo = read_photo(item.pictures[role], "asset")
    rgb, alpha = photo.rgb, photo.alpha
    if alpha is None:
        alpha = np.full(rgb.shape[:2], 255, np.uint8)
    if max(rgb.shape) > LARGEST:
        scale = LARGEST / max(rgb.shape)
        size = (round(rgb.shape[1] * scale), round(rgb.shape[0] * scale))
        rgb, alpha = (cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (rgb, alpha))
    return rgb, alpha


def _painted_over(rgb: UInt8[np.ndarray, "H W 3"], logo: Logo) -> UInt8[np.ndarray, "H W 3"]:
    """Lay plain cloth over a logo, as light as what is around it, with a soft edge."""
    height, width = rgb.shape[:2]
    columns, rows = (np.arange(width) + 0.5) / width, (np.arange(height)[:, None] + 0.5) / height
    across, along = (columns - logo.u) / logo.wide, (rows - logo.v) / logo.high
    near = np.maximum(across**2, along**2)  # 1 at the logo's edges
    share = np.clip(4 * (1.25 - near), 0, 1).astype(np.float32)[..., None]
    shift = np.array([[1, 0, -logo.aside * width], [0, 1, -logo.down * height]], np.float32)
    cloth = cv2.warpAffine(rgb, shift, (width, height), borderMode=cv2.BORDER_REPLICATE)
    around = (near > 1) & (near < 1.6)
    light = rgb[around].mean(0) / np.maximum(cloth[around].mean(0), 1)
    covered = rgb * (1 - share) + cloth * light.astype(np.float32) * share
    return np.rint(covered).clip(0, 255).astype(np.uint8)


@lru_cache(maxsize=4)
def _skin_coverage(assets: Assets, side: int) -> UInt8[np.ndarray, "side side"]:
    """Draw where on a skin's picture the body lies: 255 there, 0 beside it."""
    seen = np.zeros((side, side), np.uint8)
    corners = np.rint(load_mesh(assets).corner_uv * side * 16).astype(np.int32)  # 1/16 px
    for triangle in corners:
        cv2.fillConvexPoly(seen, triangle, 255, shift=4)
    return cv2.dilate(seen, np.ones((3, 3), np.uint8))


def _evened(
    rgb: UInt8[np.ndarray, "H W 3"], seen: UInt8[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W 3"]:
    """Take most of the baked light and some of the red out of a skin."""
    skin = rgb.astype(np.float32)
    grey = skin.mean(2)
    weight = (seen > 0).astype(np.float32)
    sigma = SKIN_BLUR * rgb.shape[0]
    around = cv2.GaussianBlur(grey * weight, (0, 0), sigma)
    around = around / np.maximum(cv2.GaussianBlur(weight, (0, 0), sigma), 1e-3)
    middle = float(np.median(grey[seen > 0]))
    gain = np.clip(middle / np.maximum(around, 1), 0.75, 1.35) ** SKIN_EVENED
    mixed = skin * (1 - SKIN_GREY) + SKIN_GREY * grey[..., None]
    return np.rint(mixed * gain[..., None]).clip(0, 255).astype(np.uint8)
