"""From pieces under a light to a photo's bytes: relief, highlights, shadows, occlusion, tone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import warp as wp
from jaxtyping import Bool, Float32, UInt8, UInt64

from motion_transfer.people.figure.body import Points
from motion_transfer.people.figure.camera import Camera
from motion_transfer.people.figure.mesh import Piece
from motion_transfer.people.figure.picture import Picture
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
    PictureInput,
    add_normals,
    develop_pixels,
    fill_cut_outs,
    shade_samples,
)

SAMPLES = 2
"""Samples along each side of a pixel."""

SHADOW_SIZE = 192
"""Pixels along each side of the shadow map."""

LAMP_DISTANCE_METRES = 1000.0
"""The rasteriser interpolates as a perspective does; from this far it is as good as parallel."""

OCCLUSION_RADII_METRES = (0.03, 0.12)
"""Folds of cloth, and gaps between limbs."""

OCCLUSION_THRESHOLD = 0.12
"""A round surface is a little behind its own neighbourhood; that is no occlusion."""

TONE_RANGE = 2.0
KNEE = 0.8
"""Linear light above this is compressed: it comes close to white at TONE_RANGE."""


@dataclass(frozen=True)
class Shading:
    """Pieces seen by a camera.

    Attributes:
        rgba: Linear RGB multiplied by the coverage, and the coverage.
    """

    rgba: Float32[np.ndarray, "H W 4"]

    @property
    def coverage(self) -> Float32[np.ndarray, "H W"]:
        """Tell the share of each pixel that the person covers, in steps of 1 / SAMPLES^2."""
        return self.rgba[..., 3]


class Scene:
    """Pieces joined, once for any number of pictures of them.

    Attributes:
        triangles: All pieces' triangles, vertices and faces numbered through.
    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        faces = [len(piece.faces) for piece in pieces]
        first = np.cumsum([0, *(len(piece.points) for piece in pieces)], dtype=np.int32)
        cut = [bool(p.material.overlay and p.material.overlay.cut_out) for p in pieces]
        self.triangles = Triangles(
            np.concatenate([piece.faces + n for piece, n in zip(pieces, first, strict=False)]),
            np.concatenate(
                # what an alpha cuts out is left to a kernel of its own
                [
                    np.full_like(p.keep, -1) if own else p.keep
                    for p, own in zip(pieces, cut, strict=True)
                ]
            ).astype(np.float32),
            np.repeat(np.array([not piece.two_sided for piece in pieces], np.uint8), faces),
        )
        self._cut_out = np.repeat(np.array(cut), faces)
        self._cut_outs = np.flatnonzero(self._cut_out).astype(np.int32)
        # kernels take no lists: texels of all textures lie one after the other
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
            points: All pieces' points in their order, posed.
        """
        fine = camera.scaled(SAMPLES)
        screen = fine.project(points)
        nearest = self._nearest(screen, fine.width, fine.height)
        shadow_map, lamp = self._light_input(light, camera, points)
        seen = np.not_equal(nearest, EMPTY).reshape(fine.height, fine.width)
        # only samples at which something is seen are shaded
        share = sample_shares(seen, self._strands(nearest).reshape(seen.shape))
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

    def _nearest(self, screen: Points, width: int, height: int) -> UInt64[np.ndarray, " H*W"]:
        """Find what each place sees first, cut-outs included; see `rasterise`."""
        nearest = rasterise(screen, self.triangles, width, height)
        if len(self._cut_outs):
            corner_uv, piece, materials, _ = self._arrays
            inputs = [
                share_array(self._cut_outs, wp.int32),
                share_array(screen, wp.vec3),
                self.triangles.arrays[0],
                corner_uv,
                piece,
                materials,
                width,
                height,
            ]
            outputs = [share_array(nearest, wp.uint64)]
            wp.launch(
                fill_cut_outs, len(self._cut_outs), inputs=inputs, outputs=outputs, device="cpu"
            )
        return nearest

    def _strands(self, nearest: UInt64[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
        """Tell where a cut-out is seen."""
        if not len(self._cut_outs):
            return np.zeros(len(nearest), bool)
        ids = triangle_ids(nearest)
        return (ids >= 0) & self._cut_out[ids]

    def _light_input(
        self, light: Light | None, camera: Camera, points: Points
    ) -> tuple[Float32[np.ndarray, "S S"], Any]:
        """Make the shadow map (depth from the key lamp) and all that shading needs of the light."""
        made = LightInput()
        made.camera = wp.vec3(*camera.position)
        made.lit = int(light is not None)
        if light is None:
            return np.zeros((1, 1), np.float32), made
        black = (0.0, 0.0, 0.0)  # kernels take three lamps, whether they are lit or not
        lamps = [*light.lamps, *[None] * 3][:3]
        made.toward = wp.mat33(*[x for lamp in lamps for x in (lamp.toward if lamp else black)])
        made.colour = wp.mat33(*[x for lamp in lamps for x in (lamp.colour if lamp else black)])
        made.lamps = len(light.lamps)
        made.sky, made.ground = wp.vec3(*light.sky), wp.vec3(*light.ground)

        rows = shadow_rows(light, points)
        made.shadow_x, made.shadow_y, made.shadow_z = (wp.vec4(*row) for row in rows)
        made.softness_px = light.softness_metres * float(np.linalg.norm(rows[0, :3]))
        placed = points @ rows[:, :3].T + rows[:, 3]
        seen = self._nearest(placed, SHADOW_SIZE, SHADOW_SIZE)
        shadow = np.where(seen == EMPTY, np.float32(1e9), depths(seen))  # nothing is in the way
        return shadow.reshape(SHADOW_SIZE, SHADOW_SIZE), made


def sample_shares(
    seen: Bool[np.ndarray, "SH SW"], strands: Bool[np.ndarray, "SH SW"]
) -> Float32[np.ndarray, " SH*SW"]:
    """Weigh how much each sample counts for its pixel.

    Samples of a pixel count alike, so that the outline is as fine as they are; but inside a person
    those on the diagonal do for all, which halves the work, unless a pixel has strands in it.
    """
    height, width = (side // SAMPLES for side in seen.shape)
    cells = seen.reshape(height, SAMPLES, width, SAMPLES)
    share = cells * np.float32(1 / SAMPLES**2)
    inside = np.all(cells, axis=(1, 3), keepdims=True)
    if strands.any():
        inside &= ~np.any(strands.reshape(cells.shape), axis=(1, 3), keepdims=True)
    diagonal = np.eye(SAMPLES, dtype=np.float32)[None, :, None, :] / SAMPLES
    return np.where(inside, diagonal, share).ravel()


def vertex_normals(points: Points, triangles: Triangles) -> Float32[np.ndarray, "V 3"]:
    """Add up the normals of the triangles around each vertex, weighted by area; not unit."""
    normals = wp.zeros(len(points), dtype=wp.vec3, device="cpu")
    inputs = [share_array(points, wp.vec3), triangles.arrays[0]]
    wp.launch(add_normals, len(triangles.faces), inputs=inputs, outputs=[normals], device="cpu")
    return normals.numpy()


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
    if (overlay := material.overlay) is not None:
        made.overlaid = 1
        made.picture, made.normals = _picture(overlay.picture), _picture(overlay.normals)
        made.gain, made.tint = wp.vec3(*overlay.gain), wp.vec4(*overlay.tint, overlay.tint_share)
        made.mean, made.contrast = overlay.mean, overlay.contrast
    return made


def _picture(picture: Picture | None) -> Any:
    """Share a picture's bytes with kernels; whoever holds the `Picture` keeps them alive."""
    made = PictureInput()
    if picture is not None:
        made.texels = share_array(picture.texels, wp.vec4ub)
        made.height, made.width = picture.height, picture.width
    return made


def shadow_rows(light: Light, points: Points) -> Float32[np.ndarray, "3 4"]:
    """Find rows that take (x, y, z, 1) to shadow-map column, row and depth from the key lamp."""
    into = -np.array(light.lamps[0].toward)
    right = np.cross([0.0, 0.0, 1.0], into)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(into, right), into])
    # one vertex in eight of a person is enough to find the borders, with 6 % to spare
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
    """Tell how freely light reaches each pixel, 0..1: less where the neighbourhood is nearer.

    Source: T. Luft, C. Colditz, O. Deussen, "Image enhancement by unsharp masking the depth
    buffer", SIGGRAPH 2006; here at two scales.
    """
    size = (fine.height // SAMPLES, fine.width // SAMPLES)
    if light is None:
        return np.ones(size, np.float32)
    one_a_pixel = slice(SAMPLES // 2, None, SAMPLES)
    grid = nearest.reshape(fine.height, fine.width)[one_a_pixel, one_a_pixel]
    seen = (grid != EMPTY).astype(np.float32)
    depth = np.where(grid != EMPTY, depths(grid), np.float32(0))
    openness = np.ones(size, np.float32)
    # shares by eye: gaps should be seen, and no outline around a limb before the body
    metre_px = fine.focal_px / SAMPLES / fine.distance
    for radius in OCCLUSION_RADII_METRES:
        around = _blur(depth, radius * metre_px) / np.maximum(_blur(seen, radius * metre_px), 1e-3)
        behind = np.clip((depth - around) / (1.5 * radius) - OCCLUSION_THRESHOLD, 0, 1)
        openness *= 1 - 0.7 * light.occlusion * behind
    return openness


def _blur(image: Float32[np.ndarray, "H W"], sigma: float) -> Float32[np.ndarray, "H W"]:
    """Blur by a Gaussian, on a coarser grid where it is wide."""
    step = max(1, int(sigma / 1.3))  # a narrower blur would not hide the coarser grid
    if step == 1:
        return cv2.GaussianBlur(image, (0, 0), max(sigma, 0.6))
    height, width = image.shape
    coarse = cv2.resize(image, (width // step, height // step), interpolation=cv2.INTER_AREA)
    coarse = cv2.GaussianBlur(coarse, (0, 0), sigma / step)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)


def develop(
    seen: Shading, behind: Float32[np.ndarray, "H W 3"], grain: float, rng: np.random.Generator
) -> UInt8[np.ndarray, "H W 3"]:
    """Put the person in front of a background, as 8-bit sRGB.

    Args:
        behind: Linear RGB.
        grain: Sensor noise, standard deviation as a share of white.
    """
    height, width = behind.shape[:2]
    noise = np.zeros((1, 1), np.float32)
    if grain > 0:
        noise = rng.standard_normal((height, width), np.float32) * np.float32(255 * grain)
    rgb = np.empty((height, width, 3), np.uint8)
    inputs = [
        share_array(seen.rgba, wp.vec4),
        share_array(behind, wp.vec3),
        share_array(noise, wp.float32),
        share_array(_TONE, wp.float32),
        TONE_RANGE,
    ]
    outputs = [share_array(rgb, wp.uint8)]
    wp.launch(develop_pixels, (height, width), inputs=inputs, outputs=outputs, device="cpu")
    return rgb


def _tone_curve() -> Float32[np.ndarray, " N"]:
    """Tabulate the sRGB value (0..255) of linear light from 0 to TONE_RANGE."""
    light = np.linspace(0, TONE_RANGE, 8192)  # fine enough for 8 bits where sRGB is steepest
    bent = np.where(light < KNEE, light, 1 - (1 - KNEE) * np.exp(-(light - KNEE) / (1 - KNEE)))
    encoded = np.where(bent <= 0.0031308, 12.92 * bent, 1.055 * bent ** (1 / 2.4) - 0.055)
    return (255 * encoded).astype(np.float32)


_TONE = _tone_curve()
