"""Dressing a body: from an outfit's numbers to pieces of geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from motion_transfer.people.clothes import cuts
from motion_transfer.people.clothes.collars import collar_piece, scarf_piece
from motion_transfer.people.clothes.fabrics import Colour
from motion_transfer.people.clothes.fit import Fall, Fitting
from motion_transfer.people.clothes.panels import bottom_panel, skirt_panel, top_panel
from motion_transfer.people.clothes.patterns import Pattern, bottom_pattern, top_pattern
from motion_transfer.people.clothes.shoes import shoe_keep, shoe_pieces
from motion_transfer.people.clothes.skirts import (
    COLUMNS,
    ROWS,
    SkirtShape,
    grid_faces,
    grid_uv,
    settler,
    shape_skirt,
)
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.clothes.tailoring import linear
from motion_transfer.people.clothes.wardrobe import Outfit, Shoes, Skirt, Top, Trousers
from motion_transfer.people.figure.body import Body, BodyModel, Points
from motion_transfer.people.figure.mesh import Material, Piece

_OVERLAP = 0.08
"""How far trousers and skirts go on under a hem, metres: it rises when arms do."""

_MARGIN = 0.007  # skin reaches this far into a close garment, metres
_SKIRT_MARGIN = 0.03  # and into a skirt, whose band may lie a little lower than on the template


@dataclass(frozen=True)
class Dressed:
    """A dressed body.

    Attributes:
        pieces: the garments, inner ones first.
        body_keep: V; the skin is seen where it is >= 0.
    """

    pieces: list[Piece]
    body_keep: Float32[np.ndarray, " V"]


def dress_body(outfit: Outfit, body: Body, model: BodyModel, surface: BodySurface) -> Dressed:
    """Make an outfit's garments to a body's measure.

    Args:
        body: at rest.
        model: whose skin the surface describes.
        surface: fields over it.

    Returns: pieces at rest, ready to be posed.
    """
    dresser = _Dresser(outfit, Fitting(surface, body), model)
    return dresser.dressed()


class _Dresser:
    def __init__(self, outfit: Outfit, fitting: Fitting, model: BodyModel) -> None:
        self.outfit, self.fitting, self.model = outfit, fitting, model
        self.surface = fitting.surface
        self.levels = self.surface.levels
        self.skin = self.surface.places
        self.keep = np.ones(len(fitting.body.points), np.float32)
        self.top_ease = np.zeros(1, np.float32)

    def dressed(self) -> Dressed:
        pieces = []
        outfit = self.outfit
        if outfit.trousers:
            pieces.append(self.trousers(outfit.trousers))
        if outfit.top:
            pieces.append(self.top(outfit.top, "top", below=None))
        if outfit.over:
            pieces.append(self.top(outfit.over, "over", below=outfit.top))
        if outfit.skirt:
            pieces.append(self.skirt(outfit.skirt, "skirt", outfit.top))
        for tails, top in ((outfit.top_skirt, outfit.top), (outfit.over_skirt, outfit.over)):
            if tails and top:
                pieces.append(self.tails(tails, top))
        pieces += self.around_neck()
        pieces += self.shoes(outfit.shoes)
        return Dressed(pieces, self.keep)

    def cover(self, pattern: Pattern, depth: np.ndarray, margin: float) -> None:
        """Hide the skin that lies deeper than a margin inside a garment."""
        self.keep[pattern.index] = np.minimum(self.keep[pattern.index], margin - depth)

    def trousers(self, trousers: Trousers) -> Piece:
        pattern = bottom_pattern(self.surface)
        at = pattern.vertices
        depth = cuts.trousers_depth(trousers, at, self.levels)
        ease = 0.005 + (trousers.ease - 0.005) * cuts.ramp(
            at.z, self.levels.waist, self.levels.crotch
        )
        legs = Fall(trousers.ease, trousers.radii, trousers.drop)
        points = self.fitting.close(
            pattern, ease, None, legs, folds=0.003 * trousers.folds, seed=trousers.seed
        )
        self.cover(pattern, depth, _MARGIN)
        keep = depth
        if tucked_into_shafts(self.outfit):
            shaft = at.leg - np.float32(self.levels.leg - self.outfit.shoes.shaft)
            keep = np.minimum(keep, 0.02 - shaft)
        top = self.outfit.top
        if top and not self.outfit.tucked:
            keep = np.minimum(keep, _OVERLAP - cuts.top_depth(top, at, self.levels))
        texture, size = bottom_panel(trousers, pattern, self.levels, keep)
        return self.piece("trousers", pattern, points, keep, texture, size, trousers.gloss)

    def top(self, top: Top, name: str, below: Top | None) -> Piece:
        pattern = top_pattern(self.surface)
        at = pattern.vertices
        depth = cuts.top_depth(top, at, self.levels)
        ease = np.full(len(at.x), top.ease, np.float32)
        trousers, skirt = self.outfit.trousers, self.outfit.skirt
        keep = depth
        hang = 1.0
        lower = trousers.ease if trousers else skirt.ease if skirt else 0.0
        if below:
            over_waist = self.at_waist(at, 0.05) * np.float32(lower + 0.014)
            ease = np.maximum(ease + self.top_ease, over_waist)
        elif self.outfit.tucked:
            rise = trousers.rise if trousers else skirt.top if skirt else 0.0
            keep = np.minimum(depth, at.z - np.float32(self.levels.waist + rise - 0.03))
            held = self.at_waist(at, rise)
            ease, hang = ease + held * (np.float32(0.0005) - ease), 1 - held
        elif trousers or skirt:
            ease = np.maximum(ease, self.at_waist(at, 0.05) * np.float32(lower + 0.010))
        self.top_ease = ease
        over = below is not None
        trunk = Fall(float(ease.min()), (0.0,), min(top.drop, below.drop) if over else top.drop)
        radii = np.array(top.sleeve_radii)
        if over:
            inner = np.interp(np.linspace(0, 1, len(radii)), *_evenly(below.sleeve_radii))
            radii = np.maximum(radii, inner + 0.01)
        sleeves = Fall(float(ease.min()), tuple(radii), 0.5, under=True)
        points = self.fitting.close(
            pattern, ease, trunk, sleeves, folds=0.003 * top.folds, seed=top.seed, hang=hang
        )
        self.cover(pattern, keep, _MARGIN)
        outer = self.outfit.over
        if outer and name == "top":
            keep = np.minimum(keep, 0.03 - cuts.top_depth(outer, at, self.levels))
        texture, size = top_panel(top, pattern, self.levels, keep)
        return self.piece(name, pattern, points, keep, texture, size, top.gloss)

    def at_waist(self, at: cuts.Places, rise: float) -> np.ndarray:
        """1 where a waistband or more lies below a top, 0 from 8 cm above it."""
        edge = self.levels.waist + rise
        return cuts.ramp(at.z, edge + 0.07, edge + 0.01)

    def skirt(self, skirt: Skirt, name: str, top: Top | None) -> Piece:
        covers = [garment.hem for garment in (top, self.outfit.over) if garment]
        low = self.levels.crotch + min(covers, default=1.0)  # held close under other hems
        if self.outfit.over_skirt:
            low = self.levels.crotch
        if self.outfit.tucked and not self.outfit.over:
            low = 9.0
        shape = shape_skirt(skirt, self.fitting, 0.0, low)
        body = cuts.skirt_depth(skirt, self.skin, self.levels)
        self.keep = np.minimum(self.keep, _SKIRT_MARGIN - body)
        keep = np.ones(ROWS * COLUMNS, np.float32)
        if top and not self.outfit.tucked and not self.outfit.is_dress:
            over = self.levels.waist + skirt.top - (self.levels.crotch + top.hem) - _OVERLAP
            keep = np.repeat(shape.down - np.float32(over), COLUMNS)
        return self.tube(name, skirt, shape, keep)

    def tails(self, skirt: Skirt, top: Top) -> Piece:
        shape = shape_skirt(skirt, self.fitting, self.below_tails(top))
        keep = np.ones((ROWS, COLUMNS), np.float32)
        if skirt.gap > 0:
            front = shape.outward.reshape(ROWS, COLUMNS, 3)[..., 1] < 0
            x = np.abs(shape.points.reshape(ROWS, COLUMNS, 3)[..., 0])
            wider = 1 + 0.8 * shape.down[:, None]
            keep = np.where(front, x - np.float32(skirt.gap) * wider, 1)
        return self.tube("tails", skirt, shape, keep.ravel())

    def below_tails(self, top: Top) -> float:
        """How thick everything under a long top's tails is, metres."""
        trousers = self.outfit.trousers
        inner = self.outfit.top.ease if self.outfit.top and top is self.outfit.over else 0.0
        return top.ease + inner + (0.01 if trousers else 0.0)

    def tube(self, name: str, skirt: Skirt, shape: SkirtShape, keep: np.ndarray) -> Piece:
        texture, size = skirt_panel(skirt, shape)
        return Piece(
            name=name,
            points=shape.points,
            faces=grid_faces(ROWS, COLUMNS),
            weights=shape.weights,
            corner_uv=grid_uv(ROWS, COLUMNS),
            material=Material(texture, size, gloss=skirt.gloss),
            keep=keep.astype(np.float32),
            two_sided=True,
            settle=settler(shape, self.surface),
        )

    def around_neck(self) -> list[Piece]:
        """Collars, hoods and scarves."""
        outfit, ease, pieces = self.outfit, 0.0, []
        for top in (outfit.top, outfit.over):
            if top is not None:
                ease += top.ease
                pieces.append(collar_piece(top, self.fitting, ease))
        if outfit.scarf:
            pieces.append(scarf_piece(outfit.scarf, self.fitting, ease))
        return [piece for piece in pieces if piece is not None]

    def shoes(self, shoes: Shoes) -> list[Piece]:
        pieces = shoe_pieces(shoes, self.surface, self.fitting.body)
        self.keep = np.minimum(self.keep, shoe_keep(shoes, self.surface))
        if shoes.shaft > 0:
            pieces.append(self.stocking("shafts", shoes.colour, shoes.shaft, 0.008, shoes.gloss))
        elif shoes.socks and shoes.sock > 0:
            pieces.append(self.stocking("socks", shoes.socks, shoes.sock, 0.002, 0.0))
        return [piece for piece in pieces if (piece.keep >= 0).any()]

    def stocking(self, name: str, colour: Colour, high: float, ease: float, gloss: float) -> Piece:
        """What rises from the shoes along the legs: socks, and shafts of boots."""
        pattern = bottom_pattern(self.surface)
        at = pattern.vertices
        depth = at.leg - np.float32(self.levels.leg - high)
        points = self.fitting.close(pattern, np.full(len(at.x), ease, np.float32))
        self.cover(pattern, depth, _MARGIN)
        keep = depth
        trousers = self.outfit.trousers
        if trousers and not tucked_into_shafts(self.outfit):
            keep = np.minimum(keep, 0.02 - cuts.trousers_depth(trousers, at, self.levels))
        texture = np.zeros((2, 2, 4), np.float32)
        texture[..., :3] = linear(np.full((1, 1, 3), colour, np.float32))
        return self.piece(name, pattern, points, keep, texture, pattern.charts.size, gloss)

    def piece(
        self,
        name: str,
        pattern: Pattern,
        points: Points,
        keep: np.ndarray,
        texture: np.ndarray,
        size: tuple[float, float],
        gloss: float,
    ) -> Piece:
        seen = (keep[pattern.faces] >= 0).any(1)
        return Piece(
            name=name,
            points=points,
            faces=pattern.faces[seen],
            weights=pattern.weights,
            corner_uv=pattern.charts.corner_uv[seen] / np.asarray(size, np.float32),
            material=Material(texture, size, gloss=gloss),
            keep=keep.astype(np.float32),
            two_sided=True,
        )


def tucked_into_shafts(outfit: Outfit) -> bool:
    """Narrow trousers go inside high boots, wide ones over them."""
    trousers = outfit.trousers
    return bool(trousers and outfit.shoes.shaft > 0.1 and max(trousers.radii) < 0.05)


def _evenly(values: Sequence[float]) -> tuple[np.ndarray, Sequence[float]]:
    return np.linspace(0, 1, len(values)), values
