"""What the panels of garments look like: cloth, then everything sewn onto it.

Where seams, pockets and buttons sit is metres from a garment's edges or from the body's levels,
drawn by eye after real ones; the last number of `dim` and `stitch` is how dark they are.
"""

from __future__ import annotations

import numpy as np

from motion_transfer.people.clothes import cuts
from motion_transfer.people.clothes.cuts import Levels, Places
from motion_transfer.people.clothes.fabrics import paint_fabric
from motion_transfer.people.clothes.fabrics.colours import mix
from motion_transfer.people.clothes.flattening import GAP_METRES
from motion_transfer.people.clothes.patterns import TEXELS_PER_METRE, Pattern
from motion_transfer.people.clothes.prints import paint_print
from motion_transfer.people.clothes.skirts import SkirtShape
from motion_transfer.people.clothes.tailoring import Panel, band, box, creases, disc, front_of, line
from motion_transfer.people.clothes.wardrobe import Belt, Skirt, Top, Trousers
from motion_transfer.people.figure.mesh import Material

_MOST_COLUMNS = 480  # of a skirt's texture; wide skirts are painted more coarsely
_CREASE = 0.0028  # metres, deviation of the relief of fully crumpled cloth
_POCKET_ROWS = round(0.5 * TEXELS_PER_METRE)  # the upper ones of trousers: with pockets and fly


def _start(
    pattern: Pattern, keep: np.ndarray, garment: Top | Trousers
) -> tuple[Panel, tuple[float, float]]:
    """Cut the cloth as large as a garment needs it, crease it, and sew its seams.

    Returns: The panel, and its width and height in metres.
    """
    uv = pattern.charts.corner_uv[(keep[pattern.faces] >= 0).any(1)].reshape(-1, 2)
    height = width = 8  # where nothing is seen; a texture is needed all the same
    if len(uv):
        ends = np.ceil((uv.max(0) + GAP_METRES / 2) * TEXELS_PER_METRE).astype(int)
        height, width = np.minimum(ends[::-1], pattern.seam.shape).tolist()
    size = width / TEXELS_PER_METRE, height / TEXELS_PER_METRE
    colours = paint_fabric(garment.fabric, *size, TEXELS_PER_METRE)
    relief = creases((height, width), np.random.default_rng(garment.seed), _CREASE * garment.folds)
    panel = Panel(colours, relief=relief)
    panel.stitch(pattern.seam[:height, :width], 0.004, 0.1)
    return panel, size


def top_panel(top: Top, pattern: Pattern, levels: Levels, keep: np.ndarray) -> Material:
    """Paint what a top is made of; `keep` is its vertices'."""
    panel, size = _start(pattern, keep, top)
    height, width = panel.shape
    trunk = slice(0, min(pattern.trunk_columns, width))
    _trunk(panel[:, trunk], top, pattern.texels.part((slice(height), trunk)), levels)
    if width > pattern.trunk_columns and top.sleeve > 0:
        arms = slice(pattern.trunk_columns, width)
        along = pattern.texels.arm[:height, arms]
        _cuffs(panel[:, arms], top, np.float32(top.sleeve * levels.arm) - along)
    return Material(panel.texture(), size, gloss=top.gloss)


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


def _placket(panel: Panel, top: Top, at: Places, from_neck: np.ndarray, levels: Levels) -> None:
    """Sew on the strip of the buttons: down to the hem, or a short one with two or three (polo)."""
    start, step = levels.armpit + 0.06 - max(top.neck_depth - 0.05, 0), 0.085
    front, last = front_of(at), levels.crotch + top.hem + 0.03
    if top.collar == "polo":
        front, last, step = front * (from_neck < 0.13), start - 0.09, 0.045
    panel.dim(line(np.abs(at.x), 0.016) * front, 0.25)
    panel.raise_by(band(np.abs(at.x), -1, 0.016) * front, 0.001)
    for z in np.arange(start, last, -step):
        panel.tint(disc(at, 0.0, float(z), 0.0055), top.trim)


def _lapels(panel: Panel, top: Top, at: Places, from_neck: np.ndarray, levels: Levels) -> None:
    """Turn the edge back, the wider the nearer to the shoulders."""
    edge = np.minimum(from_neck, cuts.opening(top, at, levels))
    up = cuts.ramp(at.z, levels.armpit - 0.14, levels.armpit + 0.06)
    wide = np.float32(0.075) * up - np.float32(0.02)
    lapel = band(wide - edge, 0.0, 1.0, 0.004) * (at.on_arm < 0.5)
    notch = line(at.z, levels.armpit + 0.075, 0.006) * lapel * front_of(at)
    panel.dim(band(np.abs(wide - edge), -1, 0.003), 0.4)
    panel.dim(notch, 0.4)
    panel.raise_by(lapel, 0.003)


def _printed(panel: Panel, top: Top, at: Places, levels: Levels) -> None:
    """Print the motif, with its upper edge a little below the collarbones."""
    if top.print is None or top.print_width <= 0:
        return
    texels = max(2, round(top.print_width * TEXELS_PER_METRE))
    aspect = min(max(top.print.aspect, 0.15), 1.3)
    image = paint_print(top.print, texels, max(2, round(texels * aspect)))
    upper = levels.armpit + 0.035 - max(0.0, top.neck_depth - 0.04)
    wrong = (at.on_arm > 0.5) | ((at.y > 0) != top.print_on_back)
    sign = -1 if top.print_on_back else 1  # seen from behind, x runs to the left
    across = np.float32(sign / top.print_width) * at.x + np.float32(0.5)
    down = (np.float32(upper) - at.z) * np.float32(1 / (top.print_width * aspect))
    panel.decal(image, across + wrong * np.float32(9), down)  # far off where it must not be


def _pockets(panel: Panel, top: Top, at: Places, levels: Levels) -> None:
    """Sew on pockets: one on the left breast, one like a pouch, or two patches at the hips."""
    if top.pocket == "chest":
        inside = box(at, (0.045, 0.145), (levels.armpit - 0.14, levels.armpit - 0.03))
        panel.dim(line(inside, 0.0) * front_of(at), 0.22)
    elif top.pocket == "kangaroo":
        z = levels.crotch + top.hem
        inside = box(at, (-0.14, 0.14), (z + 0.055, z + 0.21))
        slant = np.float32(0.26) - np.abs(at.x) - np.maximum(at.z - np.float32(z + 0.10), 0)
        _thick_pocket(panel, np.minimum(inside, slant * 0.7), at, 0.003)
    elif top.pocket == "patch":
        z = levels.waist - 0.09
        for x in ((-0.165, -0.07), (0.07, 0.165)):
            _thick_pocket(panel, box(at, x, (z, z + 0.05)), at, 0.002)


def _thick_pocket(panel: Panel, inside: np.ndarray, at: Places, metres: float) -> None:
    front = front_of(at)
    panel.dim(line(inside, 0.0, 0.005) * front, 0.3)
    panel.raise_by(band(inside, 0.0, 1.0) * front, metres)


def bottom_panel(
    trousers: Trousers, pattern: Pattern, levels: Levels, keep: np.ndarray
) -> Material:
    """Paint what trousers are made of; `keep` is their vertices'."""
    panel, size = _start(pattern, keep, trousers)
    at = pattern.texels.part(tuple(map(slice, panel.shape)))
    below = cuts.waistline(trousers, at, levels)
    to_end = np.float32(trousers.length * levels.leg) - at.leg
    if trousers.kind == "jeans":  # washed: paler on thighs and seat, where they wear
        height = (at.leg - np.float32(0.28)) * np.float32(1 / 0.2)
        side = (np.abs(at.x) - np.float32(0.11)) * np.float32(1 / 0.06)
        panel.shade *= 1 + np.float32(0.35) / (1 + 2 * height * height + 2 * side * side)
    if trousers.kind in ("jeans", "chinos", "suit", "shorts"):
        upper = slice(_POCKET_ROWS)
        _pocketed(panel[upper, :], trousers, at.part(upper), below[upper])
    else:
        panel.stitch(below, 0.045, 0.12)
    if trousers.stripe:
        outside = (np.abs(at.x) > 0.14) & (at.leg > 0.02)
        panel.tint(band(np.abs(at.y + 0.02), -1, 0.014) * outside, trousers.trim)
    if trousers.cuffs == "ribbed":
        panel.ribs(band(to_end, -0.1, 0.055), 0.2)
        panel.stitch(to_end, 0.056, 0.25)
    elif trousers.cuffs == "turned_up":
        pale = mix(trousers.fabric.colours[0], (0.9, 0.9, 0.9), 0.4)  # the cloth's wrong side
        panel.tint(band(to_end, -0.1, 0.04) * 0.5, pale)
        panel.stitch(to_end, 0.042, 0.3)
    else:
        panel.stitch(to_end, 0.02, 0.15)
    _belt(panel, trousers.belt, below, at)
    return Material(panel.texture(), size, gloss=trousers.gloss)


def _pocketed(panel: Panel, trousers: Trousers, at: Places, below: np.ndarray) -> None:
    """Sew the waistband, the fly, curved pockets in front and patch pockets behind."""
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


def skirt_panel(skirt: Skirt, shape: SkirtShape) -> Material:
    """Paint what a skirt is made of, as wide as it is around."""
    size = shape.around, float(shape.down[-1])
    texels = min(TEXELS_PER_METRE, _MOST_COLUMNS / size[0])
    panel = Panel(paint_fabric(skirt.fabric, *size, texels))
    height, width = panel.shape
    rng = np.random.default_rng(skirt.seed)
    # pleated and tight skirts crease little
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
        u = (np.arange(width) + 0.5) / width * shape.around
        fly = np.broadcast_to(np.minimum(u, shape.around - u), (height, width))
        panel.dim(line(fly, 0.018) * (down < 0.18), 0.25)
    _belt(panel, skirt.belt, down, None)
    return Material(panel.texture(), size, gloss=skirt.gloss)
