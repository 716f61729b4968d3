"""What photos show of a body: how much, which of them, how well, and which photo is wanting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from motion_transfer.drawing.views import EARS_METRES, HEAD, View, merge_views
from nhrr_core import load_uv_tables

WELL = 1.0
"""A texel is seen well by so many pixels along its side, see `View.rating`."""

SIDES = ("front", "back", "left side", "right side")
"""From where a body is looked at; left and right are the person's own."""

WANTING = 0.35
"""Of what a side shows: where so much is seen badly or not at all, a photo from there would help.
The gaps that IUV leaves between parts are less."""

CELL_METRES = 0.025  # what lies in one such cell, farther from the camera than that, is hidden
DEPTH_METRES = 0.04

PX_PER_METRE = 220
PANEL_PX = 420  # the height of a body's picture
THUMBNAIL_PX = 150
UNSEEN, PAPER, INK = (222, 222, 222), (255, 255, 255), (40, 40, 40)
DARKEST = 0.35  # of a photo's colour, where it sees a place badly
PALETTE = (
    (230, 97, 1),
    (44, 123, 182),
    (26, 150, 65),
    (202, 0, 80),
    (123, 50, 148),
    (166, 118, 29),
)


@dataclass(frozen=True)
class Coverage:
    """What the photos of a person show.

    Attributes:
        names: The sources; all frames of a video are one.
        shares: S x 256 x 256, how much of each texel comes from each source.
        quality: 256 x 256, how well the texel is seen by the photo that sees it best: 1 is well,
            less is coarse or blurred; 0 where none sees it.
        area: 256 x 256, of each texel as a share of the body's surface.
        strangers: As those of `MergedViews`.
    """

    names: tuple[str, ...]
    shares: Float[np.ndarray, "S T T"]
    quality: Float[np.ndarray, "T T"]
    area: Float[np.ndarray, "T T"]
    strangers: tuple[int, ...] = ()

    def of(self, where: Bool[np.ndarray, "T T"]) -> tuple[float, float]:
        """Tell which share of a region is seen, and how well what is seen of it, on average."""
        total, seen = self.area[where].sum(), self.area * (self.quality > 0)
        quality = (seen * self.quality.clip(0, 1))[where].sum()
        return float(seen[where].sum() / total), float(quality / max(seen[where].sum(), 1e-9))

    @property
    def seen(self) -> float:
        """The share of the body's surface that is seen."""
        return float(self.area[self.quality > 0].sum())

    def given(self) -> dict[str, float]:
        """Tell which share of the body's surface comes from each source."""
        given = (self.shares * self.area).sum((1, 2))
        return dict(zip(self.names, map(float, given), strict=True))

    def wanting(self) -> tuple[str, float] | None:
        """Tell the side whose photo would help most, and the share of it that lacks one."""
        lacking = self.area * (1 - self.quality.clip(0, 1))
        shares = {}
        for side in SIDES:
            shown = visible_from(side)
            shares[side] = float(lacking[shown].sum() / self.area[shown].sum())
        side = max(shares, key=lambda name: shares[name])
        return (side, shares[side]) if shares[side] >= WANTING else None


def measure_coverage(views: Sequence[View]) -> Coverage:
    """Measure what photos show together.

    Args:
        views: Of 256 x 256 texels, and rated, as those of several photos are.
    """
    merged = merge_views(views)
    names = tuple(dict.fromkeys(view.name for view in views))
    shares = np.stack(
        [
            merged.shares[[i for i, view in enumerate(views) if view.name == name]].sum(0)
            for name in names
        ]
    )
    rating = np.max([view.rating[0] for view in views], axis=0)
    return Coverage(names, shares, rating / WELL, _measure_area(), merged.strangers)


def regions() -> dict[str, Bool[np.ndarray, "T T"]]:
    """Name parts of the body as people do, each with its texels."""
    tables = load_uv_tables()
    part, ahead = tables.part, tables.position[..., 2] > EARS_METRES
    parts = {
        "front of the trunk": (2,),
        "back of the trunk": (1,),
        "front of the arms": (15, 16, 19, 20),
        "back of the arms": (17, 18, 21, 22),
        "front of the legs": (9, 10, 13, 14),
        "back of the legs": (7, 8, 11, 12),
        "hands": (3, 4),
        "feet": (5, 6),
    }
    head = np.isin(part, HEAD)
    return {"face": head & ahead, "back of the head": head & ~ahead} | {
        name: np.isin(part, numbers) for name, numbers in parts.items()
    }


def visible_from(side: str) -> Bool[np.ndarray, "T T"]:
    """Mark the texels that a camera on one of SIDES sees of a body that stretches its arms out."""
    across, up, depth = _project(side)
    row, column = ((axis - axis.min()) // CELL_METRES for axis in (up, across))
    cell = (row * (column.max() + 1) + column).astype(np.int64)
    nearest = np.full(cell.max() + 1, -np.inf, np.float32)
    np.maximum.at(nearest, cell, depth)
    return depth > nearest[cell] - DEPTH_METRES


def _project(side: str) -> list[Float32[np.ndarray, "T T"]]:
    """To the right in the picture, up, and towards the camera; metres."""
    x, y, z = load_uv_tables().position.transpose(2, 0, 1)
    return {
        "front": [x, y, z],
        "back": [-x, y, -z],
        "left side": [-z, y, x],
        "right side": [z, y, -x],
    }[side]


def _measure_area() -> Float[np.ndarray, "T T"]:
    """The surface of each texel, as a share of all."""
    position = load_uv_tables().position
    right, down = (np.diff(position, axis=axis, append=np.nan) for axis in (1, 0))
    cross = np.linalg.norm(np.cross(right, down), axis=-1)
    # across a chart's border neighbours lie far apart; outside all charts they are one place
    far = (np.linalg.norm(right, axis=-1) > CELL_METRES) | (
        np.linalg.norm(down, axis=-1) > CELL_METRES
    )
    area = np.where(far, 0, np.nan_to_num(cross))
    return area / area.sum()


def draw_coverage(
    coverage: Coverage, photos: Sequence[UInt8[np.ndarray, "H W 3"]]
) -> UInt8[np.ndarray, "H W 3"]:
    """Draw the body from four sides, in the colour of the photo that shows each place.

    The better it is seen, the stronger is the colour; what nothing shows is grey. Below stand the
    photos, each with its colour.

    Args:
        photos: One for each source.
    """
    colours = [PALETTE[index % len(PALETTE)] for index in range(len(photos))]
    mixed = np.tensordot(np.array(colours, np.float32), coverage.shares, axes=(0, 0))
    strength = np.maximum(coverage.quality.clip(0, 1), DARKEST)[None]
    shown = (coverage.quality > 0)[None]
    tinted = mixed * strength + np.array(PAPER, np.float32)[:, None, None] * (1 - strength)
    texture = np.where(shown, tinted, np.array(UNSEEN, np.float32)[:, None, None])
    panels = [_draw_side(side, texture.transpose(1, 2, 0).astype(np.uint8)) for side in SIDES]
    body = np.hstack(panels)
    cells = [
        _draw_photo(name, photo, colour, share)
        for (name, share), photo, colour in zip(
            coverage.given().items(), photos, colours, strict=True
        )
    ]
    per_row = body.shape[1] // cells[0].shape[1]
    rows = [np.hstack(cells[at : at + per_row]) for at in range(0, len(cells), per_row)]
    width = body.shape[1]
    strips = [
        cv2.copyMakeBorder(row, 0, 0, 0, width - row.shape[1], cv2.BORDER_CONSTANT, value=PAPER)
        for row in rows
    ]
    return np.vstack([body, *strips])


def _draw_side(side: str, texture: UInt8[np.ndarray, "T T 3"]) -> UInt8[np.ndarray, "H W 3"]:
    across, up, depth = _project(side)
    height, width = PANEL_PX, round(np.ptp(across) * PX_PER_METRE) + 60
    row = (height * 0.36 - up * PX_PER_METRE).astype(np.int64).ravel()
    column = (30 + (across - across.min()) * PX_PER_METRE).astype(np.int64).ravel()
    order = np.argsort(depth.ravel(), kind="stable")  # the nearest come last, and stay
    row, column = row[order], column[order]
    drawn = np.zeros((height, width, 3), np.uint8)
    nearest = np.full((height, width), -np.inf, np.float32)
    drawn[row, column] = texture.reshape(-1, 3)[order]
    nearest[row, column] = depth.ravel()[order]
    # between points, what is drawn beside them: a pixel that shows nothing, or one far behind
    for _ in range(2):
        beside = cv2.dilate(nearest, np.ones((3, 3), np.uint8))
        hole = beside > nearest + CELL_METRES
        own = np.isfinite(nearest)
        inside = cv2.morphologyEx(own.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3))) > 0
        hole &= inside
        for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1)):
            moved = np.roll(nearest, (dy, dx), (0, 1))
            taken = hole & (moved >= beside)
            drawn[taken] = np.roll(drawn, (dy, dx), (0, 1))[taken]
        nearest = np.where(hole, beside, nearest)
    drawn[~np.isfinite(nearest)] = PAPER
    _write(drawn, side, (width // 2 - 4 * len(side), height - 6))
    return drawn


def _draw_photo(
    name: str, photo: UInt8[np.ndarray, "H W 3"], colour: tuple[int, int, int], share: float
) -> UInt8[np.ndarray, "h w 3"]:
    scale = THUMBNAIL_PX / max(photo.shape[:2])
    size = max(1, round(photo.shape[1] * scale)), max(1, round(photo.shape[0] * scale))
    small = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    cell = np.full((THUMBNAIL_PX + 40, THUMBNAIL_PX + 24, 3), 255, np.uint8)
    top, left = 8, (cell.shape[1] - size[0]) // 2
    cell[top : top + size[1], left : left + size[0]] = small
    ends = (left - 3, top - 3), (left + size[0] + 2, top + size[1] + 2)
    cv2.rectangle(cell, *ends, colour, 5)
    name = Path(name).name
    label = f"{share:.0%} {name if len(name) < 17 else name[:7] + '..' + name[-7:]}"
    _write(cell, label, (6, cell.shape[0] - 8))
    return cell


def _write(picture: UInt8[np.ndarray, "H W 3"], text: str, place: tuple[int, int]) -> None:
    ascii_text = text.encode("ascii", "replace").decode()  # the font has no more
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(picture, ascii_text, place, font, 0.42, INK, 1, cv2.LINE_AA)
