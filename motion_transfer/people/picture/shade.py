"""What a surface looks like under a light: albedo, relief, highlights, shadows, occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import warp as wp
from jaxtyping import Bool, Float32, UInt64

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.mesh import Piece
from motion_transfer.people.figure.rasterise import (
    EMPTY,
    Triangles,
    depths,
    rasterise,
    share_array,
    triangle_ids,
)
from motion_transfer.people.picture.light import Light
from motion_transfer.people.picture.shade_kernels import (
    LightInput,
    MaterialInput,
    add_normals,
    shade_samples,
)

SAMPLES = 2
"""Samples along each side of a pixel."""

SHADOW_SIZE = 192
LAMP_DISTANCE_METRES = 1000.0
"""The rasteriser interpolates as a perspective does; from this far it is as good as parallel."""

OCCLUSION_RADII_METRES = (0.03, 0.12)
OCCLUSION_THRESHOLD = 0.12
"""A round surface is a little behind its own neighbourhood; that is no occlusion."""


@dataclass(frozen=True)
class Shading:
    """Pieces seen by a camera.

    Attributes:
        rgba: H x W x 4: linear RGB multiplied by the coverage, and the coverage.
    """

    rgba: Float32[np.ndarray, "H W 4"]

    @property
    def colour(self) -> Float32[np.ndarray, "H W 3"]:
        """Linear RGB, multiplied by the coverage."""
        return self.rgba[..., :3]

    @property
    def coverage(self) -> Float32[np.ndarray, "H W"]:
        """Share of each pixel that the person covers, in steps of 1 / SAMPLES^2."""
        return self.rgba[..., 3]


class Scene:
    """Pieces joined, once for any number of pictures of them.

    Attributes:
        triangles: of all pieces, vertices and faces numbered through.
    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        counts = [len(piece.points) for piece in pieces]
        first = np.cumsum([0, *counts], dtype=np.int32)
        self.triangles = Triangles(
            np.concatenate([piece.faces + n for piece, n in zip(pieces, first, strict=False)]),
            np.concatenate([piece.keep for piece in pieces]).astype(np.float32),
            np.repeat([not piece.two_sided for piece in pieces], faces := _faces(pieces)).astype(
                np.uint8
            ),
        )
        textures = [piece.material.texture.reshape(-1, 4) for piece in pieces]
        texels = np.cumsum([0, *(len(texture) for texture in textures)])
        materials = [_material(p, int(n)) for p, n in zip(pieces, texels, strict=False)]
        self._arrays = (
            share_array(np.concatenate([piece.corner_uv for piece in pieces]), wp.vec2),
            share_array(np.repeat(np.arange(len(pieces), dtype=np.uint8), faces), wp.uint8),
            wp.array(materials, dtype=MaterialInput, device="cpu"),
            share_array(np.concatenate(textures), wp.vec4),
        )

    def shade(self, points: Points, camera: Camera, light: Light | None) -> Shading:
        """Draw the pieces; without a light, each shows its bare colour.

        Args:
            points: of all pieces in their order, posed.
        """
        fine = camera.scaled(SAMPLES)
        screen = fine.project(points)
        nearest = rasterise(screen, self.triangles, fine.width, fine.height)
        shadow_map, lamp = _light_input(light, camera, self.triangles, points)
        seen = np.not_equal(nearest, EMPTY)
        share = sample_shares(seen.reshape(fine.height, fine.width))
        sample = np.flatnonzero(share).astype(np.int32)
        out = wp.zeros((camera.height, camera.width), dtype=wp.vec4, device="cpu")
        inputs = [
            share_array(sample, wp.int32),
            share_array(share[sample], wp.float32),
            share_array(triangle_ids(nearest[sample]), wp.int32),
            share_array(screen, wp.vec3),
            share_array(points, wp.vec3),
            share_array(vertex_normals(points, self.triangles), wp.vec3),
            self.triangles.arrays[0],
            *self._arrays,
            lamp,
            share_array(shadow_map, wp.float32),
            share_array(_openness(nearest, fine, light), wp.float32),
            SAMPLES,
        ]
        wp.launch(shade_samples, len(sample), inputs=inputs, outputs=[out], device="cpu")
        return Shading(out.numpy())


def sample_shares(seen: Bool[np.ndarray, "SH SW"]) -> Float32[np.ndarray, " SH*SW"]:
    """How much each sample counts for its pixel.

    Samples of a pixel count alike, so that the outline is as fine as they are; but inside a person
    those on the diagonal do for all, which halves the work.
    """
    height, width = (side // SAMPLES for side in seen.shape)
    cells = seen.reshape(height, SAMPLES, width, SAMPLES)
    share = cells * np.float32(1 / SAMPLES**2)
    inside = np.all(cells, axis=(1, 3), keepdims=True)
    diagonal = np.eye(SAMPLES, dtype=np.float32)[None, :, None, :] / SAMPLES
    return np.where(inside, diagonal, share).ravel()


def vertex_normals(points: Points, triangles: Triangles) -> Float32[np.ndarray, "V 3"]:
    """Sums of the normals of the triangles around each vertex, weighted by area; not unit."""
    normals = wp.zeros(len(points), dtype=wp.vec3, device="cpu")
    inputs = [share_array(points, wp.vec3), triangles.arrays[0]]
    wp.launch(add_normals, len(triangles.faces), inputs=inputs, outputs=[normals], device="cpu")
    return normals.numpy()


def _faces(pieces: Sequence[Piece]) -> list[int]:
    return [len(piece.faces) for piece in pieces]


def _material(piece: Piece, first_texel: int) -> Any:
    material, made = piece.material, MaterialInput()
    made.first_texel = first_texel
    made.height, made.width = material.texture.shape[:2]
    made.relief = int(material.texture[..., 3].any())
    made.size = wp.vec2(*material.size_metres)
    made.gloss = material.gloss
    made.sharpness = material.sharpness
    made.translucency = material.translucency
    made.sheen_along_v = int(material.sheen_along_v)
    return made


def _light_input(
    light: Light | None, camera: Camera, triangles: Triangles, points: Points
) -> tuple[Float32[np.ndarray, "S S"], Any]:
    """The shadow map (depth from the key lamp) and everything that shading needs of the light."""
    made = LightInput()
    made.camera = wp.vec3(*camera.position)
    made.lit = int(light is not None)
    if light is None:
        return np.zeros((1, 1), np.float32), made
    black = (0.0, 0.0, 0.0)
    lamps = [*light.lamps, *[None] * 3][:3]
    made.toward = wp.mat33(*[x for lamp in lamps for x in (lamp.toward if lamp else black)])
    made.colour = wp.mat33(*[x for lamp in lamps for x in (lamp.colour if lamp else black)])
    made.lamps = len(light.lamps)
    made.sky, made.ground = wp.vec3(*light.sky), wp.vec3(*light.ground)

    rows = shadow_rows(light, points)
    made.shadow_x, made.shadow_y, made.shadow_z = (wp.vec4(*row) for row in rows)
    made.softness_px = light.softness_metres * float(np.linalg.norm(rows[0, :3]))
    placed = points @ rows[:, :3].T + rows[:, 3]
    seen = rasterise(placed, triangles, SHADOW_SIZE, SHADOW_SIZE)
    shadow = np.where(seen == EMPTY, np.float32(1e9), depths(seen))
    return shadow.reshape(SHADOW_SIZE, SHADOW_SIZE), made


def shadow_rows(light: Light, points: Points) -> Float32[np.ndarray, "3 4"]:
    """Rows that take (x, y, z, 1) to shadow-map column, row and depth from the key lamp."""
    into = -np.array(light.lamps[0].toward)
    right = np.cross([0.0, 0.0, 1.0], into)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(into, right), into])
    placed = points[:: 8 if len(points) > 1000 else 1] @ axes.T
    low, high = placed.min(0), placed.max(0)
    scale = 0.94 * SHADOW_SIZE / max(float((high - low)[:2].max()), 1e-3)
    middle = (low + high) / 2
    rows = np.empty((3, 4))
    rows[:2, :3] = scale * axes[:2]
    rows[:2, 3] = SHADOW_SIZE / 2 - scale * middle[:2]
    rows[2, :3], rows[2, 3] = into, LAMP_DISTANCE_METRES - low[2]
    return rows.astype(np.float32)


def _openness(
    nearest: UInt64[np.ndarray, " N"], fine: Camera, light: Light | None
) -> Float32[np.ndarray, "H W"]:
    """How freely light reaches each pixel, 0..1: less where the neighbourhood is nearer.

    Source: T. Luft, C. Colditz, O. Deussen, "Image enhancement by unsharp masking the depth
    buffer", SIGGRAPH 2006; here at two scales.
    """
    size = (fine.height // SAMPLES, fine.width // SAMPLES)
    if light is None:
        return np.ones(size, np.float32)
    grid = nearest.reshape(fine.height, fine.width)[
        SAMPLES // 2 :: SAMPLES, SAMPLES // 2 :: SAMPLES
    ]
    seen = (grid != EMPTY).astype(np.float32)
    depth = np.where(grid != EMPTY, depths(grid), np.float32(0))
    openness = np.ones(size, np.float32)
    metre_px = fine.focal_px / SAMPLES / fine.distance
    for radius in OCCLUSION_RADII_METRES:
        around = _blur(depth, radius * metre_px) / np.maximum(_blur(seen, radius * metre_px), 1e-3)
        behind = np.clip((depth - around) / (1.5 * radius) - OCCLUSION_THRESHOLD, 0, 1)
        openness *= 1 - 0.7 * light.occlusion * behind
    return openness


def _blur(image: Float32[np.ndarray, "H W"], sigma: float) -> Float32[np.ndarray, "H W"]:
    """A Gaussian blur, on a coarser grid where it is wide."""
    step = max(1, int(sigma / 1.3))
    if step == 1:
        return cv2.GaussianBlur(image, (0, 0), max(sigma, 0.6))
    height, width = image.shape
    coarse = cv2.resize(image, (width // step, height // step), interpolation=cv2.INTER_AREA)
    coarse = cv2.GaussianBlur(coarse, (0, 0), sigma / step)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
