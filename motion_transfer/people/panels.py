"""What the panels of tops and trousers look like: cloth, then everything sewn onto it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from motion_transfer.people import cuts
from motion_transfer.people.cuts import Levels, Places
from motion_transfer.people.fabrics import paint_fabric
from motion_transfer.people.outfits import Top, Trousers
from motion_transfer.people.patterns import TEXELS_PER_METRE, Pattern
from motion_transfer.people.tailoring import Panel, creases, line

_Texture = tuple[np.ndarray, tuple[float, float]]


def _used(pattern: Pattern, keep: np.ndarray) -> tuple[int, int]:
    """Rows and columns of texels that a garment cut from the pattern needs."""
    seen = (keep[pattern.faces] >= 0).any(1)
    uv = pattern.charts.corner_uv[seen].reshape(-1, 2)
    height, width = pattern.seam.shape
    if len(uv) == 0:
        return 8, 8
    right, low = np.ceil((uv.max(0) + 0.006) * TEXELS_PER_METRE).astype(int)
    return min(int(low), height), min(int(right), width)


def _cut(places: Places, shape: tuple[int, int]) -> Places:
    height, width = shape
    return Places(*(getattr(places, f.name)[:height, :width] for f in fields(places)))


def _start(pattern: Pattern, keep: np.ndarray, fabric) -> tuple[Panel, Places, np.ndarray]:
    shape = _used(pattern, keep)
    size = shape[1] / TEXELS_PER_METRE, shape[0] / TEXELS_PER_METRE
    panel = Panel(paint_fabric(fabric, *size, TEXELS_PER_METRE))
    at = _cut(pattern.texels, shape)
    return panel, at, pattern.seam[: shape[0], : shape[1]]


def _finish(panel: Panel) -> _Texture:
    height, width = panel.relief.shape
    return panel.texture(), (width / TEXELS_PER_METRE, height / TEXELS_PER_METRE)


def top_panel(top: Top, pattern: Pattern, levels: Levels, keep: np.ndarray) -> _Texture:
    """The texture of a top and its size in metres (width, height)."""
    panel, at, seam = _start(pattern, keep, top.fabric)
    rng = np.random.default_rng(top.seed)
    panel.relief += creases(seam.shape, rng) * np.float32(0.0035 * top.folds)
    return _finish(panel)


def bottom_panel(
    trousers: Trousers, pattern: Pattern, levels: Levels, keep: np.ndarray
) -> _Texture:
    """The texture of trousers and its size in metres (width, height)."""
    panel, at, seam = _start(pattern, keep, trousers.fabric)
    rng = np.random.default_rng(trousers.seed)
    panel.relief += creases(seam.shape, rng) * np.float32(0.0035 * trousers.folds)
    return _finish(panel)
