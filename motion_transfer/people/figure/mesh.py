"""Pieces of geometry and what they are made of: skin, garments and hair are all such pieces.

Convention: texture coordinates (u, v) are in [0, 1]; u runs along a texture's columns and v down
its rows, pixel centres at +0.5. Coordinates belong to the corners of triangles, so that a
wrap-around needs no doubled vertices. Colours of materials are linear RGB in [0, 1].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32

from motion_transfer.people.figure.body import Body, Faces, Points, SkinWeights, Transforms
from motion_transfer.people.figure.picture import Overlay


@dataclass(frozen=True)
class Material:
    """What a surface looks like.

    Attributes:
        texture: H x W x 4: linear RGB, and relief in metres (bumps that only bend the light).
        size_metres: Width and height of the cloth that the texture shows; scales the relief.
        gloss: Strength of the highlight, 0 (cloth) .. 1 (patent leather).
        sharpness: Exponent of the highlight; about 8 satin and skin, 60 leather.
        translucency: How far light wraps around, 0 (cloth) .. 1; skin about 0.3.
        sheen_along_v: Highlights stretch across v, as on strands of hair that run along v.
        overlay: A photographed surface in place of the texture.
    """

    texture: Float32[np.ndarray, "H W 4"]
    size_metres: tuple[float, float]
    gloss: float = 0.0
    sharpness: float = 20.0
    translucency: float = 0.0
    sheen_along_v: bool = False
    overlay: Overlay | None = None


@dataclass(frozen=True)
class PosedBody:
    """A body in a pose, for what has to keep clear of it."""

    body: Body
    transforms: Transforms
    points: Points
    joints: np.ndarray


Settle = Callable[[Points, PosedBody], Points]
"""Moves a piece's posed points to where gravity and the body leave them."""


@dataclass(frozen=True)
class Piece:
    """A surface that follows the bones.

    Attributes:
        name: For descriptions: `skin`, `top`, `skirt`, `hair`, ...
        points: At rest, on the person's own body; metres.
        faces: Triangles of them.
        weights: How the bones move the points.
        corner_uv: F x 3 x 2 texture coordinates.
        material: Of the whole piece.
        keep: V; the surface is there where its interpolation over a triangle is >= 0, so that hems
            and hairlines are smooth whatever the triangles are.
        two_sided: Both sides are seen (cloth, hair); closed surfaces leave this off.
        settle: Applied after skinning.
    """

    name: str
    points: Points
    faces: Faces
    weights: SkinWeights
    corner_uv: Float32[np.ndarray, "F 3 2"]
    material: Material
    keep: Float32[np.ndarray, " V"]
    two_sided: bool = False
    settle: Settle | None = field(default=None, compare=False)

    def posed(self, body: PosedBody) -> Points:
        """Bring the points into a pose."""
        points = self.weights.pose(self.points, body.transforms)
        return self.settle(points, body) if self.settle else points
