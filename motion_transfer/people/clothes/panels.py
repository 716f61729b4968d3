"""What the panels of garments look like: cloth, then everything sewn onto it."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from motion_transfer.people.clothes import cuts
from motion_transfer.people.clothes.cuts import Levels, Places
from motion_transfer.people.clothes.fabric_colours import mix
from motion_transfer.people.clothes.fabrics import Fabric, paint_fabric
from motion_transfer.people.clothes.patterns import TEXELS_PER_METRE, Pattern
from motion_transfer.people.clothes.prints import paint_print
from motion_transfer.people.clothes.skirts import SkirtShape
from motion_transfer.people.clothes.tailoring import Panel, band, box, creases, disc, front_of, line
from motion_transfer.people.clothes.wardrobe import Belt, Skirt, Top, Trousers

Texture = tuple[np.ndarray, tuple[float, float]]
"""A material's texture, and the width and height that it shows in metres."""

_MOST_COLUMNS = 480  # of a skirt's texture; wide skirts are painted more coarsely
_CREASE = 0.0028  # metres, deviation of the relief of fully crumpled cloth


def _used(pattern: Pattern, keep: np.ndarray) -> tuple[int, int]:
    """Rows and columns of texels that a garment cut from the pattern needs."""
    seen = (keep[pattern.faces] >= 0).any(1)
    uv = pattern.charts.corner_uv[seen].reshape(-1, 2)
    height, width = pattern.seam.shape
    if len(uv) == 0:
        return 8, 8
    right, low = np.ceil((uv.max(0) + 0.006) * TEXELS_PER_METRE).astype(int)
    return min(int(low), height), min(int(right), width)


def _part(places: Places, rows: slice, columns: slice) -> Places:
    return Places(*(getattr(places, f.name)[rows, columns] for f in fields(places)))


def _start(pattern: Pattern, keep: np.ndarray, fabric: Fabric, folds: float, seed: int) -> Panel:
    height, width = _used(pattern, keep)
    size = width / TEXELS_PER_METRE, height / TEXELS_PER_METRE
    colours = paint_fabric(fabric, *size, TEXELS_PER_METRE)
    relief = creases((height, width), np.random.default_rng(seed), _CREASE * folds)
    sewn = line(pattern.seam[:height, :width], 0.004, 0.005)
    return Panel(colours, 1 - np.float32(0.1) * sewn, relief - np.float32(0.0008) * sewn)


def _finish(panel: Panel) -> Texture:
    height, width = panel.shape
    return panel.texture(), (width / TEXELS_PER_METRE, height / TEXELS_PER_METRE)


def top_panel(top: Top, pattern: Pattern, levels: Levels, keep: np.ndarray) -> Texture:
    """The texture of a top and its size in metres (width, height)."""
    panel = _start(pattern, keep, top.fabric, top.folds, top.seed)
    height, width = panel.shape
    trunk = slice(0, min(pattern.trunk_columns, width))
    at = _part(pattern.texels, slice(0, height), trunk)
    _trunk(panel.part(slice(None), trunk), top, at, levels)
    if width > pattern.trunk_columns and top.sleeve > 0:
        arms = slice(pattern.trunk_columns, width)
        at = _part(pattern.texels, slice(0, height), arms)
        _cuffs(panel.part(slice(None), arms), top, np.float32(top.sleeve * levels.arm) - at.arm)
    return _finish(panel)


def _cuffs(panel: Panel, top: Top, to_end: np.ndarray) -> None:
    if top.cuffs == "ribbed":
        cuff = band(to_end, -0.1, 0.025 if top.sleeve < 0.6 else 0.055)
        panel.tint(cuff, top.trim)
        panel.ribs(cuff)
        panel.raise_by(cuff, -0.002)
    elif top.cuffs == "buttoned":
        panel.stitch(to_end, 0.055 if top.sleeve > 0.6 else 0.03, 0.25)
    else:
        panel.stitch(to_end, 0.02)


def _trunk(panel: Panel, top: Top, at: Places, levels: Levels) -> None:
    from_neck = cuts.neckline(top, at, levels)
    from_hem = at.z - np.float32(levels.crotch + top.hem)
    knitted = top.cuffs == "ribbed" and top.collar != "polo"
    if knitted:
        rib = band(from_hem, -0.1, 0.05)
        panel.tint(rib, top.trim)
        panel.ribs(rib)
    else:
        panel.stitch(from_hem, 0.022)
    if top.collar == "none" and top.neck in ("crew", "v", "scoop", "boat"):
        edge = band(from_neck, -0.1, 0.018)
        panel.tint(edge, top.trim if knitted or top.kind == "t_shirt" else top.fabric.colours[0])
        panel.stitch(from_neck, 0.019, 0.18)
    elif top.neck == "turtle":
        panel.ribs(band(from_neck, -0.1, top.neck_depth + 0.01), 0.1)
        panel.stitch(from_neck, top.neck_depth + 0.012, 0.12)
    if top.collar == "lapels":
        _lapels(panel, top, at, from_neck, levels)
    if top.opening == "buttons" or top.collar == "polo":
        _placket(panel, top, at, from_neck, levels)
    elif top.gap > 0:
        panel.stitch(cuts.opening(top, at, levels), 0.02, 0.2)
    _pockets(panel, top, at, levels)
    _printed(panel, top, at, levels)


def _placket(
    panel: Panel,
    top: Top,
    at: Places,
    from_neck: np.ndarray,
    levels: Levels,
) -> None:
    front = front_of(at)
    if top.collar == "polo":
        front = front * (from_neck < 0.13)
    panel.dim(line(np.abs(at.x), 0.016) * front, 0.25)
    strip = band(np.abs(at.x), -1, 0.016) * front
    panel.raise_by(strip, 0.001)
    start = levels.armpit + 0.06 - max(top.neck_depth - 0.05, 0)
    step = 0.045 if top.collar == "polo" else 0.085
    last = start - 0.09 if top.collar == "polo" else levels.crotch + top.hem + 0.03
    for z in np.arange(start, last, -step):
        button = disc(at, 0.0, float(z), 0.0055)
        panel.tint(button, top.trim)


def _lapels(panel: Panel, top: Top, at: Places, from_neck: np.ndarray, levels: Levels) -> None:
    """A turned-back edge that widens towards the shoulders."""
    edge = np.minimum(from_neck, cuts.opening(top, at, levels))
    up = cuts.ramp(at.z, levels.armpit - 0.14, levels.armpit + 0.06)
    wide = np.float32(0.075) * up - np.float32(0.02)
    lapel = band(wide - edge, 0.0, 1.0, 0.004) * (at.on_arm < 0.5)
    notch = line(at.z, levels.armpit + 0.075, 0.006) * lapel * front_of(at)
    panel.dim(band(np.abs(wide - edge), -1, 0.003), 0.4)
    panel.dim(notch, 0.4)
    panel.raise_by(lapel, 0.003)


def _printed(panel: Panel, top: Top, at: Places, levels: Levels) -> None:
    """The motif, with its upper edge a little below the collarbones."""
    if top.print is None or top.print_width <= 0:
        return
    texels = max(2, round(top.print_width * TEXELS_PER_METRE))
    aspect = min(max(top.print.aspect, 0.15), 1.3)
    image = paint_print(top.print, texels, max(2, round(texels * aspect)))
    upper = levels.armpit + 0.035 - max(0.0, top.neck_depth - 0.04)
    wrong = (at.on_arm > 0.5) | ((at.y > 0) != top.print_on_back)
    sign = -1 if top.print_on_back else 1
    across = np.float32(sign / top.print_width) * at.x + np.float32(0.5)
    down = (np.float32(upper) - at.z) * np.float32(1 / (top.print_width * aspect))
    panel.decal(image, across + wrong * np.float32(9), down)


def _pockets(panel: Panel, top: Top, at: Places, levels: Levels) -> None:
    front = front_of(at)
    if top.pocket == "chest":
        inside = box(at, (0.045, 0.145), (levels.armpit - 0.14, levels.armpit - 0.03))
        panel.dim(line(inside, 0.0) * front, 0.22)
    elif top.pocket == "kangaroo":
        z = levels.crotch + top.hem
        inside = box(at, (-0.14, 0.14), (z + 0.055, z + 0.21))
        slant = np.float32(0.26) - np.abs(at.x) - np.maximum(at.z - np.float32(z + 0.10), 0)
        inside = np.minimum(inside, slant * 0.7)
        panel.dim(line(inside, 0.0, 0.005) * front, 0.3)
        panel.raise_by(band(inside, 0.0, 1.0) * front, 0.003)
    elif top.pocket == "patch":
        for side in (-1, 1):
            x = sorted((side * 0.07, side * 0.165))
            z = levels.waist - 0.09
            inside = box(at, (x[0], x[1]), (z, z + 0.05))
            panel.dim(line(inside, 0.0, 0.005) * front, 0.3)
            panel.raise_by(band(inside, 0.0, 1.0) * front, 0.002)


def bottom_panel(trousers: Trousers, pattern: Pattern, levels: Levels, keep: np.ndarray) -> Texture:
    """The texture of trousers and its size in metres (width, height)."""
    panel = _start(pattern, keep, trousers.fabric, trousers.folds, trousers.seed)
    height, width = panel.shape
    at = _part(pattern.texels, slice(0, height), slice(0, width))
    below = cuts.waistline(trousers, at, levels)
    to_end = np.float32(trousers.length * levels.leg) - at.leg
    if trousers.kind == "jeans":
        _denim_wash(panel, at)
    if trousers.kind in ("jeans", "chinos", "suit", "shorts"):
        upper = slice(0, min(height, round(0.5 * TEXELS_PER_METRE)))
        _pocketed(
            panel.part(upper, slice(None)), trousers, _part(at, upper, slice(None)), below[upper]
        )
    else:
        panel.stitch(below, 0.045, 0.12)
    if trousers.stripe:
        outside = (np.abs(at.x) > 0.14) & (at.leg > 0.02)
        panel.tint(band(np.abs(at.y + 0.02), -1, 0.014) * outside, trousers.trim)
    if trousers.cuffs == "ribbed":
        cuff = band(to_end, -0.1, 0.055)
        panel.ribs(cuff, 0.2)
        panel.stitch(to_end, 0.056, 0.25)
    elif trousers.cuffs == "turned_up":
        cuff = band(to_end, -0.1, 0.04)
        ground = trousers.fabric.colours[0]
        panel.tint(cuff * 0.5, mix(ground, (0.9, 0.9, 0.9), 0.4))
        panel.stitch(to_end, 0.042, 0.3)
    else:
        panel.stitch(to_end, 0.02, 0.15)
    _belt(panel, trousers.belt, below, at)
    return _finish(panel)


def _denim_wash(panel: Panel, at: Places) -> None:
    """Thighs and seat are paler."""
    height = (at.leg - np.float32(0.28)) * np.float32(1 / 0.2)
    side = (np.abs(at.x) - np.float32(0.11)) * np.float32(1 / 0.06)
    panel.shade *= 1 + np.float32(0.35) / (1 + 2 * height * height + 2 * side * side)


def _pocketed(panel: Panel, trousers: Trousers, at: Places, below: np.ndarray) -> None:
    panel.stitch(below, 0.038, 0.25)
    front = (at.y < 0).astype(np.float32)
    fly = line(np.abs(at.x - np.float32(0.012)), 0.022) * front * (below < 0.19) * (below > 0.038)
    panel.dim(fly, 0.2)
    away = np.sqrt((np.abs(at.x) - np.float32(0.20)) ** 2 + (below - np.float32(0.03)) ** 2)
    opening = line(away, 0.115, 0.006) * front * (below > 0.038)
    panel.dim(opening, 0.3)
    panel.raise_by(opening, -0.0015)
    if trousers.kind in ("jeans", "shorts", "chinos"):
        across = np.minimum(np.abs(at.x) - np.float32(0.045), np.float32(0.165) - np.abs(at.x))
        inside = np.minimum(across, np.minimum(below - np.float32(0.09), np.float32(0.22) - below))
        outline = line(inside, 0.0, 0.005) * (1 - front)
        panel.dim(outline, 0.25)
        if trousers.kind == "jeans":
            panel.tint(outline * 0.35, trousers.trim)


def _belt(panel: Panel, belt: Belt | None, below: np.ndarray, at: Places | None) -> None:
    if belt is None:
        return
    strap = band(below, 0.002, belt.width)
    panel.tint(strap, belt.colour)
    panel.raise_by(strap, 0.003)
    if at is not None:
        away = np.maximum(np.abs(at.x) - np.float32(0.02), np.abs(below - belt.width / 2) - 0.018)
        panel.tint(band(away, -0.014, 0.004) * (at.y < 0), belt.buckle)


def skirt_panel(skirt: Skirt, shape: SkirtShape) -> Texture:
    """The texture of a skirt and its size in metres (width, height)."""
    size = shape.around, float(shape.down[-1])
    texels = min(TEXELS_PER_METRE, _MOST_COLUMNS / size[0])
    panel = Panel(paint_fabric(skirt.fabric, *size, texels))
    height, width = panel.shape
    rng = np.random.default_rng(skirt.seed)
    soft = min(skirt.folds, 0.4) if skirt.pleats or skirt.flare < 0.1 else skirt.folds
    panel.relief += creases((height, width), rng, _CREASE * soft)
    down = ((np.arange(height, dtype=np.float32) + 0.5) / np.float32(texels))[:, None]
    down = np.broadcast_to(down, (height, width))
    if skirt.pleats:
        turn = np.mod(np.arange(width) * (2.0 * skirt.waves / width), 1)
        below = cuts.ramp(down, skirt.waistband, skirt.waistband + 0.05)
        panel.relief += np.float32(0.006) * turn.astype(np.float32) * below
        panel.dim((turn < 0.1).astype(np.float32) * below, 0.25)
    if skirt.kind == "tiered":
        for share in (0.36, 0.68):
            panel.stitch(down, share * size[1], 0.3)
    if skirt.waistband > 0:
        panel.stitch(down, skirt.waistband, 0.25)
    panel.stitch(down, size[1] - 0.02, 0.15)
    if skirt.kind in ("mini", "pencil") and skirt.fabric.kind == "denim":
        u = np.abs((np.arange(width) + 0.5) / width * shape.around)
        fly = np.broadcast_to(np.minimum(u, shape.around - u), (height, width))
        panel.dim(line(fly, 0.018) * (down < 0.18), 0.25)
    _belt(panel, skirt.belt, down, None)
    return panel.texture(), size
