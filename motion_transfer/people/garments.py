"""Dressing a body: from an outfit's numbers to pieces of geometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from motion_transfer.people import cuts
from motion_transfer.people.body import Body, BodyModel, Points
from motion_transfer.people.fit import Fall, Fitting
from motion_transfer.people.mesh import Material, Piece
from motion_transfer.people.outfits import Outfit, Top, Trousers
from motion_transfer.people.panels import bottom_panel, top_panel
from motion_transfer.people.patterns import Pattern, bottom_pattern, top_pattern
from motion_transfer.people.surface import BodySurface

_MARGIN = 0.012  # skin reaches this far into a close garment


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
        self.keep = np.ones(len(fitting.body.points), np.float32)

    def dressed(self) -> Dressed:
        pieces = []
        outfit = self.outfit
        if outfit.trousers:
            pieces.append(self.trousers(outfit.trousers))
        if outfit.top:
            pieces.append(self.top(outfit.top, "top", below=None))
        if outfit.over:
            pieces.append(self.top(outfit.over, "over", below=outfit.top))
        return Dressed(pieces, self.keep)

    def cover(self, pattern: Pattern, depth: np.ndarray, margin: float) -> None:
        """Hide the skin that lies deeper than a margin inside a garment."""
        self.keep[pattern.index] = np.minimum(self.keep[pattern.index], margin - depth)

    def trousers(self, trousers: Trousers) -> Piece:
        pattern = bottom_pattern(self.surface)
        at = pattern.vertices
        depth = cuts.trousers_depth(trousers, at, self.levels)
        ease = 0.003 + (trousers.ease - 0.003) * cuts.ramp(at.z, self.levels.waist, self.levels.crotch)
        legs = Fall(trousers.ease, trousers.radii, trousers.drop)
        points = self.fitting.close(
            pattern, ease, None, legs, folds=0.004 * trousers.folds, seed=trousers.seed
        )
        self.cover(pattern, depth, _MARGIN)
        keep = depth
        top = self.outfit.top
        if top and not self.outfit.tucked:
            keep = np.minimum(keep, 0.04 - cuts.top_depth(top, at, self.levels))
        texture, size = bottom_panel(trousers, pattern, self.levels, keep)
        return self.piece("trousers", pattern, points, keep, texture, size, trousers.gloss)

    def top(self, top: Top, name: str, below: Top | None) -> Piece:
        pattern = top_pattern(self.surface)
        at = pattern.vertices
        depth = cuts.top_depth(top, at, self.levels)
        ease = np.full(len(at.x), top.ease + (below.ease if below else 0), np.float32)
        trousers = self.outfit.trousers
        keep = depth
        if trousers and name == "top":
            low = cuts.ramp(at.z, self.levels.waist + 0.08, self.levels.waist)
            if self.outfit.tucked:
                edge = self.levels.waist + trousers.rise - 0.03
                keep = np.minimum(depth, at.z - np.float32(edge))
                ease = ease + low * (np.float32(0.002) - ease)
            else:
                ease = np.maximum(ease, low * np.float32(trousers.ease + 0.007))
        trunk = Fall(top.ease, (0.0,), top.drop)
        sleeves = Fall(top.ease, top.sleeve_radii, 0.5)
        points = self.fitting.close(
            pattern, ease, trunk, sleeves, folds=0.004 * top.folds, seed=top.seed
        )
        self.cover(pattern, keep, _MARGIN)
        over = self.outfit.over
        if over and name == "top":
            keep = np.minimum(keep, 0.03 - cuts.top_depth(over, at, self.levels))
        texture, size = top_panel(top, pattern, self.levels, keep)
        return self.piece(name, pattern, points, keep, texture, size, top.gloss)

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
            corner_uv=pattern.charts.corner_uv[seen] / np.float32(size),
            material=Material(texture, size, gloss=gloss),
            keep=keep.astype(np.float32),
            two_sided=True,
        )
