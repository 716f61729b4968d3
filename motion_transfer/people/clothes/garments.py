"""Dressing a body: from an outfit's numbers to pieces of geometry."""

from __future__ import annotations

import numpy as np

from motion_transfer.people.clothes import cuts
from motion_transfer.people.clothes.accessories import (
    collar_piece,
    scarf_piece,
    shoe_keep,
    shoe_pieces,
)
from motion_transfer.people.clothes.fabrics import Colour
from motion_transfer.people.clothes.fit import Fall, Fitting
from motion_transfer.people.clothes.panels import bottom_panel, skirt_panel, top_panel
from motion_transfer.people.clothes.patterns import Pattern, bottom_pattern, top_pattern
from motion_transfer.people.clothes.skirts import (
    COLUMNS,
    EVERYWHERE,
    ROWS,
    SkirtShape,
    settler,
    shape_skirt,
    tube_grid,
)
from motion_transfer.people.clothes.surface import BodySurface
from motion_transfer.people.clothes.tailoring import Panel
from motion_transfer.people.clothes.wardrobe import Outfit, Shoes, Skirt, Top, Trousers
from motion_transfer.people.figure.body import Body, Points
from motion_transfer.people.figure.mesh import Material, Piece

# Metres, all of them chosen by eye: no gap may show in any pose, and nothing poke through.
_OVERLAP = 0.08  # how far trousers and skirts go on under a hem: it rises when arms do
_MARGIN = 0.007  # skin reaches this far into a close garment
_SKIRT_MARGIN = 0.03  # and into a skirt, whose band may lie a little lower than on the template
_LEAST_EASE = 0.005  # of trousers at the waist, where they are held
_FOLDS = 0.003  # height of the slow waves of fully crumpled cloth


class DressedBody:
    """An outfit's garments, made one after another to the measure of a body at rest.

    Attributes:
        pieces: The garments, inner ones first; at rest, ready to be posed.
        keep: V; the skin is seen where it is >= 0.
    """

    def __init__(self, outfit: Outfit, body: Body, surface: BodySurface) -> None:
        self.outfit, self.fitting = outfit, Fitting(surface, body)
        self.surface, self.levels = surface, surface.levels
        self.keep = np.ones(len(body.points), np.float32)
        self.top_ease = np.zeros(1, np.float32)
        self.pieces: list[Piece] = []
        if outfit.trousers:
            self.pieces.append(self.trousers(outfit.trousers))
        if outfit.top:
            self.pieces.append(self.top(outfit.top, "top", below=None))
        if outfit.over:
            self.pieces.append(self.top(outfit.over, "over", below=outfit.top))
        if outfit.skirt:
            self.pieces.append(self.skirt(outfit.skirt, outfit.top))
        for tails, top in ((outfit.top_skirt, outfit.top), (outfit.over_skirt, outfit.over)):
            if tails and top:
                self.pieces.append(self.tails(tails, top))
        self.pieces += self.around_neck()
        self.pieces += self.shoes(outfit.shoes)

    def cover(self, pattern: Pattern, depth: np.ndarray) -> None:
        """Hide the skin that lies deeper than a margin inside a garment."""
        self.keep[pattern.index] = np.minimum(self.keep[pattern.index], _MARGIN - depth)

    def trousers(self, trousers: Trousers) -> Piece:
        pattern = bottom_pattern(self.surface)
        at = pattern.vertices
        keep = cuts.trousers_depth(trousers, at, self.levels)
        loose = cuts.ramp(at.z, self.levels.waist, self.levels.crotch)
        ease = _LEAST_EASE + (trousers.ease - _LEAST_EASE) * loose
        legs = Fall(trousers.ease, trousers.radii, trousers.drop)
        points = self.fitting.close(
            pattern, ease, None, legs, folds=_FOLDS * trousers.folds, seed=trousers.seed
        )
        self.cover(pattern, keep)
        if _tucked_into_shafts(self.outfit):
            shaft = at.leg - np.float32(self.levels.leg - self.outfit.shoes.shaft)
            keep = np.minimum(keep, 0.02 - shaft)  # they go on for 2 cm inside
        top = self.outfit.top
        if top and not self.outfit.tucked:
            keep = np.minimum(keep, _OVERLAP - cuts.top_depth(top, at, self.levels))
        material = bottom_panel(trousers, pattern, self.levels, keep)
        return self.piece("trousers", pattern, points, keep, material)

    def top(self, top: Top, name: str, below: Top | None) -> Piece:
        pattern = top_pattern(self.surface)
        at = pattern.vertices
        keep, hang = cuts.top_depth(top, at, self.levels), 1.0
        ease = np.full(len(at.x), top.ease, np.float32)
        trousers, skirt = self.outfit.trousers, self.outfit.skirt
        lower = trousers.ease if trousers else skirt.ease if skirt else 0.0
        if below:  # clear of the inner top, and of it and the waistband where both lie below
            over_waist = self.at_waist(at, 0.05) * np.float32(lower + 0.014)
            ease = np.maximum(ease + self.top_ease, over_waist)
        elif self.outfit.tucked:
            rise = trousers.rise if trousers else skirt.top if skirt else 0.0
            keep = np.minimum(keep, at.z - np.float32(self.levels.waist + rise - 0.03))
            held = self.at_waist(at, rise)  # inside the waistband cloth lies on the skin
            ease, hang = ease + held * (np.float32(0.0005) - ease), 1 - held
        elif trousers or skirt:
            ease = np.maximum(ease, self.at_waist(at, 0.05) * np.float32(lower + 0.010))
        self.top_ease = ease
        drop, radii = top.drop, np.array(top.sleeve_radii)
        if below:  # hangs no closer than what it hides, and its sleeves are 1 cm wider
            drop = min(drop, below.drop)
            ours, its = (np.linspace(0, 1, len(r)) for r in (radii, below.sleeve_radii))
            radii = np.maximum(radii, np.interp(ours, its, below.sleeve_radii) + 0.01)
        trunk = Fall(float(ease.min()), (0.0,), drop)
        sleeves = Fall(float(ease.min()), tuple(radii), 0.5, under=True)
        points = self.fitting.close(
            pattern, ease, trunk, sleeves, folds=_FOLDS * top.folds, seed=top.seed, hang=hang
        )
        self.cover(pattern, keep)
        outer = self.outfit.over
        if outer and name == "top":
            keep = np.minimum(keep, 0.03 - cuts.top_depth(outer, at, self.levels))
        material = top_panel(top, pattern, self.levels, keep)
        return self.piece(name, pattern, points, keep, material)

    def at_waist(self, at: cuts.Places, rise: float) -> np.ndarray:
        """Tell where a waistband or more lies below a top: 1 there, 0 from 7 cm above it."""
        edge = self.levels.waist + rise
        return cuts.ramp(at.z, edge + 0.07, edge + 0.01)

    def skirt(self, skirt: Skirt, top: Top | None) -> Piece:
        # held close under other hems, so that it does not come through them
        hems = [garment.hem for garment in (top, self.outfit.over) if garment]
        low = self.levels.crotch + (0 if self.outfit.over_skirt else min(hems, default=1.0))
        if self.outfit.tucked and not self.outfit.over:
            low = EVERYWHERE
        shape = shape_skirt(skirt, self.fitting, 0.0, low)
        body = cuts.skirt_depth(skirt, self.surface.places, self.levels)
        self.keep = np.minimum(self.keep, _SKIRT_MARGIN - body)
        keep = np.ones(ROWS * COLUMNS, np.float32)
        if top and not self.outfit.tucked and top.kind != "bodice":
            over = self.levels.waist + skirt.top - (self.levels.crotch + top.hem) - _OVERLAP
            keep = np.repeat(shape.down - np.float32(over), COLUMNS)
        return self.tube("skirt", skirt, shape, keep)

    def tails(self, skirt: Skirt, top: Top) -> Piece:
        # they hang over everything that is worn below
        inner = self.outfit.top.ease if self.outfit.top and top is self.outfit.over else 0.0
        ease = top.ease + inner + (0.01 if self.outfit.trousers else 0.0)
        shape = shape_skirt(skirt, self.fitting, ease)
        keep = np.ones((ROWS, COLUMNS), np.float32)
        if skirt.gap > 0:
            front = shape.outward.reshape(ROWS, COLUMNS, 3)[..., 1] < 0
            x = np.abs(shape.points.reshape(ROWS, COLUMNS, 3)[..., 0])
            wider = 1 + 0.8 * shape.down[:, None]  # an open front swings apart further down
            keep = np.where(front, x - np.float32(skirt.gap) * wider, 1)
        return self.tube("tails", skirt, shape, keep.ravel())

    def tube(self, name: str, skirt: Skirt, shape: SkirtShape, keep: np.ndarray) -> Piece:
        faces, corner_uv = tube_grid(ROWS, COLUMNS)
        return Piece(
            name=name,
            points=shape.points,
            faces=faces,
            weights=shape.weights,
            corner_uv=corner_uv,
            material=skirt_panel(skirt, shape),
            keep=keep.astype(np.float32),
            two_sided=True,
            settle=settler(shape, self.surface),
        )

    def around_neck(self) -> list[Piece]:
        """Make collars, hoods and scarves."""
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
        """Make what rises from the shoes along the legs: socks, and shafts of boots."""
        pattern = bottom_pattern(self.surface)
        at = pattern.vertices
        keep = at.leg - np.float32(self.levels.leg - high)
        points = self.fitting.close(pattern, np.full(len(at.x), ease, np.float32))
        self.cover(pattern, keep)
        trousers = self.outfit.trousers
        if trousers and not _tucked_into_shafts(self.outfit):
            keep = np.minimum(keep, 0.02 - cuts.trousers_depth(trousers, at, self.levels))
        panel = Panel(np.full((2, 2, 3), colour, np.float32))
        material = Material(panel.texture(), pattern.charts.size, gloss=gloss)
        return self.piece(name, pattern, points, keep, material)

    def piece(
        self, name: str, pattern: Pattern, points: Points, keep: np.ndarray, material: Material
    ) -> Piece:
        seen = (keep[pattern.faces] >= 0).any(1)
        return Piece(
            name=name,
            points=points,
            faces=pattern.faces[seen],
            weights=pattern.weights,
            corner_uv=pattern.charts.corner_uv[seen] / np.asarray(material.size_metres, np.float32),
            material=material,
            keep=keep.astype(np.float32),
            two_sided=True,
        )


def _tucked_into_shafts(outfit: Outfit) -> bool:
    """Tell whether trousers are narrow enough to go inside high boots; wide ones go over them."""
    trousers = outfit.trousers
    return bool(trousers and outfit.shoes.shaft > 0.1 and max(trousers.radii) < 0.05)
