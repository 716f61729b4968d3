"""What `Scene` and `develop` run for each sample and pixel.

`warp` compiles it; types are warp's, not Python's. Distances were chosen by eye.
"""

import numpy as np
import warp as wp

from motion_transfer.people.figure.body import start_warp
from motion_transfer.people.figure.picture import LEVELS
from motion_transfer.people.figure.raster_kernels import perspective_weights

start_warp()

SHADOW_BIAS_METRES = 0.012
"""A point looks for the lamp from so far off its surface: the shadow map's cells are as coarse."""

SCATTER_METRES = 0.1
"""How far light would get through wholly translucent flesh."""

WRAP_TINT = wp.constant(wp.vec3(1.0, 0.55, 0.4))
"""Light that wraps around skin has passed through it, and comes out red."""

LAST_SIZE = LEVELS - 1
"""Of a picture's sizes, the smallest."""

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
SHADOW_DISC = wp.constant(
    wp.types.matrix((8, 2), wp.float32)(
        *(
            float(np.sqrt((k + 0.5) / 8) * turn(GOLDEN_ANGLE * k))
            for k in range(8)
            for turn in (np.cos, np.sin)
        )
    )
)
"""Eight places spread evenly over a disc of radius 1."""

SPINS = wp.constant(
    wp.types.matrix((16, 2), wp.float32)(
        *(float(turn(np.pi * k / 8)) for k in range(16) for turn in (np.cos, np.sin))
    )
)
"""Sixteen turns of that disc."""


@wp.struct
class LightInput:
    """A `Light` and the camera, as kernels read them."""

    toward: wp.mat33  # rows: unit vectors toward the lamps
    colour: wp.mat33  # rows
    lamps: wp.int32
    sky: wp.vec3
    ground: wp.vec3
    camera: wp.vec3
    shadow_x: wp.vec4  # rows of the map from the world to shadow-map pixels and depth
    shadow_y: wp.vec4
    shadow_z: wp.vec4
    softness_px: wp.float32
    lit: wp.int32


@wp.struct
class PictureInput:
    """A `Picture`; without texels where there is none."""

    texels: wp.array(dtype=wp.vec4ub)
    height: wp.int32
    width: wp.int32


@wp.struct
class MaterialInput:
    """A `Material`, whose texels begin at `first_texel` of all textures."""

    first_texel: wp.int32
    height: wp.int32
    width: wp.int32
    relief: wp.int32
    size: wp.vec2
    gloss: wp.float32
    sharpness: wp.float32
    translucency: wp.float32
    sheen_along_v: wp.int32
    overlaid: wp.int32  # the rest is an `Overlay`'s, and looked at only where this is 1
    picture: PictureInput
    normals: PictureInput
    gain: wp.vec3
    tint: wp.vec4  # its share last
    mean: wp.float32
    contrast: wp.float32


@wp.kernel(enable_backward=False)
def add_normals(
    points: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    normals: wp.array(dtype=wp.vec3),
):
    """Add each triangle's normal, as long as twice its area, to its corners'."""
    corners = faces[wp.tid()]
    a = points[corners[0]]
    n = wp.cross(points[corners[1]] - a, points[corners[2]] - a)
    wp.atomic_add(normals, corners[0], n)
    wp.atomic_add(normals, corners[1], n)
    wp.atomic_add(normals, corners[2], n)


@wp.func
def _texel(texture: wp.array(dtype=wp.vec4), material: MaterialInput, u: float, v: float):
    """Look up a texture, bilinear; it repeats along u and is clamped along v."""
    height, width = material.height, material.width
    x = (u - wp.floor(u)) * float(width) - 0.5
    y = wp.clamp(v * float(height) - 0.5, 0.0, float(height - 1))
    x0, y0 = int(wp.floor(x)), int(wp.floor(y))
    fx, fy = x - float(x0), y - float(y0)
    upper = material.first_texel + y0 * width
    lower = material.first_texel + wp.min(y0 + 1, height - 1) * width
    x1 = x0 + 1
    if x0 < 0:
        x0 = width - 1
    if x1 >= width:
        x1 = 0
    top = texture[upper + x0] * (1.0 - fx) + texture[upper + x1] * fx
    bottom = texture[lower + x0] * (1.0 - fx) + texture[lower + x1] * fx
    return top * (1.0 - fy) + bottom * fy


@wp.func
def _picture_size(picture: PictureInput, a: wp.vec2, b: wp.vec2, c: wp.vec2, area_px: float):
    """Choose which of a picture's sizes has about one texel for each pixel of a triangle."""
    across = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    texels = wp.abs(across) * float(picture.height * picture.width)
    ratio = texels / wp.max(wp.abs(area_px), 1.0e-6)
    size = wp.int32(0)
    while size < LAST_SIZE and ratio >= 4.0:
        ratio = ratio / 4.0
        size += 1
    return size


@wp.func
def _picture_at(picture: PictureInput, size: int, u: float, v: float):
    """Look up one of a picture's sizes, bilinear, in [0, 1]; edges go on beyond it."""
    first = wp.int32(0)
    for larger in range(size):
        first += (picture.height >> larger) * (picture.width >> larger)
    height, width = picture.height >> size, picture.width >> size
    x = wp.clamp(u * float(width) - 0.5, 0.0, float(width - 1))
    y = wp.clamp(v * float(height) - 0.5, 0.0, float(height - 1))
    x0, y0 = int(x), int(y)
    fx, fy = x - float(x0), y - float(y0)
    x1, y1 = wp.min(x0 + 1, width - 1), wp.min(y0 + 1, height - 1)
    upper, lower = first + y0 * width, first + y1 * width
    top = _unit(picture.texels[upper + x0]) * (1.0 - fx) + _unit(picture.texels[upper + x1]) * fx
    bottom = _unit(picture.texels[lower + x0]) * (1.0 - fx) + _unit(picture.texels[lower + x1]) * fx
    return top * (1.0 - fy) + bottom * fy


@wp.func
def _unit(texel: wp.vec4ub):
    scale = 1.0 / 255.0
    return wp.vec4(
        float(texel[0]) * scale,
        float(texel[1]) * scale,
        float(texel[2]) * scale,
        float(texel[3]) * scale,
    )


@wp.func
def _overlay_albedo(material: MaterialInput, seen: wp.vec4):
    """Find the linear colour of a picture's texel, tinted as the overlay says."""
    grey = (seen[0] + seen[1] + seen[2]) / 3.0
    relative = wp.clamp(1.0 + (grey / material.mean - 1.0) * material.contrast, 0.0, 2.5)
    share = material.tint[3]
    out = wp.vec3(0.0, 0.0, 0.0)
    for k in range(3):
        mixed = seen[k] * (1.0 - share) + material.tint[k] * relative * share
        # no cloth is whiter than 0.95, and sRGB's curve is near enough to this power
        out[k] = wp.pow(wp.clamp(mixed * material.gain[k], 0.0, 0.95), 2.2)
    return out


@wp.func
def _threshold(row: int, column: int, face: int):
    """Find the alpha from which on a sample sees a cut-out surface, in (0, 1).

    The four samples of a pixel have thresholds a quarter apart, the two on a diagonal one half, so
    that a pixel shows its share of a fine strand; where in its quarter each lies, and which sample
    has which, differs by pixel and triangle, so that layers of strands do not hide each other.
    """
    spot = (row // 2) * 7919 + (column // 2) * 104729 + face * 15485863
    mixed = (spot ^ (spot >> 13)) * 1274126177
    mixed = mixed ^ (mixed >> 16)
    order = (row % 2) * 2 + (column % 2)  # the diagonal: 0 and 3
    quarter = (wp.where(order == 3, 2, wp.where(order == 2, 3, order)) + (mixed & 3)) % 4
    return (float(quarter) + (float((mixed >> 2) & 255) + 0.5) / 256.0) / 4.0


@wp.kernel(enable_backward=False)
def fill_cut_outs(
    chosen: wp.array(dtype=wp.int32),
    screen: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    corner_uv: wp.array2d(dtype=wp.vec2),
    piece: wp.array(dtype=wp.uint8),
    materials: wp.array(dtype=MaterialInput),
    width: wp.int32,
    height: wp.int32,
    nearest: wp.array(dtype=wp.uint64),
):
    """Enter chosen triangles, seen from both sides, where their picture's alpha lets them be seen.

    The result is that of `rasterise`, which leaves these triangles out.
    """
    f = chosen[wp.tid()]
    corners = faces[f]
    a, b, c = screen[corners[0]], screen[corners[1]], screen[corners[2]]
    x0 = wp.max(int(wp.ceil(wp.min(a[0], wp.min(b[0], c[0])) - 0.5)), 0)
    x1 = wp.min(int(wp.floor(wp.max(a[0], wp.max(b[0], c[0])) - 0.5)), width - 1)
    y0 = wp.max(int(wp.ceil(wp.min(a[1], wp.min(b[1], c[1])) - 0.5)), 0)
    y1 = wp.min(int(wp.floor(wp.max(a[1], wp.max(b[1], c[1])) - 0.5)), height - 1)
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    if x0 > x1 or y0 > y1 or area == 0.0 or wp.min(a[2], wp.min(b[2], c[2])) <= 0.0:
        return
    picture = materials[int(piece[f])].picture
    ta, tb, tc = corner_uv[f, 0], corner_uv[f, 1], corner_uv[f, 2]
    size = _picture_size(picture, ta, tb, tc, area)
    for y in range(y0, y1 + 1):
        py = float(y) + 0.5
        for x in range(x0, x1 + 1):
            px = float(x) + 0.5
            wb = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / area
            wc = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / area
            if wb < 0.0 or wc < 0.0 or wb + wc > 1.0:
                continue
            w = perspective_weights(a, b, c, px, py)
            uv = ta * w[0] + tb * w[1] + tc * w[2]
            if _picture_at(picture, size, uv[0], uv[1])[3] < _threshold(y, x, f):
                continue
            z = 1.0 / ((1.0 - wb - wc) / a[2] + wb / b[2] + wc / c[2])
            bits = wp.uint64(wp.cast(z, wp.uint32))
            wp.atomic_min(nearest, y * width + x, (bits << wp.uint64(32)) | wp.uint64(f))


@wp.func
def _key_share(light: LightInput, shadow: wp.array2d(dtype=wp.float32), point: wp.vec3, spin: int):
    """Find how much of the key lamp a point sees, at 8 places of a disc in the shadow map."""
    p = wp.vec4(point[0], point[1], point[2], 1.0)
    x, y, z = wp.dot(light.shadow_x, p), wp.dot(light.shadow_y, p), wp.dot(light.shadow_z, p)
    cosine, sine = light.softness_px * SPINS[spin, 0], light.softness_px * SPINS[spin, 1]
    open_taps = 0.0
    for k in range(8):
        dx, dy = SHADOW_DISC[k, 0], SHADOW_DISC[k, 1]
        i = wp.clamp(int(y + dx * sine + dy * cosine), 0, shadow.shape[0] - 1)
        j = wp.clamp(int(x + dx * cosine - dy * sine), 0, shadow.shape[1] - 1)
        if shadow[i, j] > z:
            open_taps += 0.125
    return open_taps


@wp.func
def _lit(
    albedo: wp.vec3,
    normal: wp.vec3,
    view: wp.vec3,
    along_v: wp.vec3,
    key: float,
    open_share: float,
    material: MaterialInput,
    light: LightInput,
):
    """Find what a surface sends on: `key` of the first lamp, `open_share` of all other light."""
    # a hemisphere of sky above one of ground, mixed by how far up the surface looks
    upward = 0.5 + 0.5 * normal[2]
    incoming = (light.ground * (1.0 - upward) + light.sky * upward) * open_share
    highlight = wp.vec3(0.0, 0.0, 0.0)
    wrap = WRAP_TINT * material.translucency
    less = wp.vec3(1.0 / (1.0 + wrap[0]), 1.0 / (1.0 + wrap[1]), 1.0 / (1.0 + wrap[2]))
    for k in range(light.lamps):
        toward = light.toward[k]
        seen = open_share
        if k == 0:
            seen = key
        cosine = wp.dot(normal, toward)
        if material.translucency > 0.0:
            bent = wp.cw_mul(wp.vec3(cosine, cosine, cosine) + wrap, less)
            bent = wp.max(bent, wp.vec3(0.0, 0.0, 0.0))
            incoming += wp.cw_mul(light.colour[k], bent) * seen
        elif cosine > 0.0:
            incoming += light.colour[k] * (cosine * seen)
        if material.gloss > 0.0 and cosine > -0.2:
            half = wp.normalize(toward + view)
            shine = wp.max(wp.dot(normal, half), 0.0)
            if material.sheen_along_v != 0:  # strands shine all around themselves
                across = wp.dot(along_v, half)
                shine = wp.sqrt(wp.max(1.0 - across * across, 0.0))
            # fades where the lamp sets, so that the highlight has no edge
            strength = material.gloss * seen * wp.clamp(cosine * 3.0 + 0.6, 0.0, 1.0)
            highlight += light.colour[k] * (strength * wp.pow(shine, material.sharpness))
    return wp.cw_mul(albedo, incoming) + highlight


@wp.kernel(enable_backward=False)
def shade_samples(
    sample: wp.array(dtype=wp.int32),
    share: wp.array(dtype=wp.float32),
    seen_face: wp.array(dtype=wp.int32),
    screen: wp.array(dtype=wp.vec3),
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    corner_uv: wp.array2d(dtype=wp.vec2),
    piece: wp.array(dtype=wp.uint8),
    materials: wp.array(dtype=MaterialInput),
    texture: wp.array(dtype=wp.vec4),
    light: LightInput,
    shadow: wp.array2d(dtype=wp.float32),
    openness: wp.array2d(dtype=wp.float32),
    samples: wp.int32,
    colour: wp.array2d(dtype=wp.vec4),
):
    """Shade one sample and add it, weighted by its share, to its pixel."""
    i = wp.tid()
    face = seen_face[i]
    width = colour.shape[1] * samples
    row, column = sample[i] // width, sample[i] % width
    corners = faces[face]
    sa, sb, sc = screen[corners[0]], screen[corners[1]], screen[corners[2]]
    w = perspective_weights(sa, sb, sc, float(column) + 0.5, float(row) + 0.5)
    wa, wb, wc = w[0], w[1], w[2]
    ta, tb, tc = corner_uv[face, 0], corner_uv[face, 1], corner_uv[face, 2]
    uv = ta * wa + tb * wb + tc * wc
    material = materials[int(piece[face])]
    texel = _texel(texture, material, uv[0], uv[1])
    albedo = wp.vec3(texel[0], texel[1], texel[2])
    area_px = (sb[0] - sa[0]) * (sc[1] - sa[1]) - (sc[0] - sa[0]) * (sb[1] - sa[1])
    if material.overlaid != 0:
        size = _picture_size(material.picture, ta, tb, tc, area_px)
        albedo = _overlay_albedo(material, _picture_at(material.picture, size, uv[0], uv[1]))
    result = albedo
    if light.lit != 0:
        pa, pb, pc = points[corners[0]], points[corners[1]], points[corners[2]]
        point = pa * wa + pb * wb + pc * wc
        normal = wp.normalize(
            normals[corners[0]] * wa + normals[corners[1]] * wb + normals[corners[2]] * wc
        )
        view = wp.normalize(light.camera - point)
        if area_px > 0.0:
            normal = -normal  # the inside of cloth or hair

        # directions in which u and v grow on the surface, for relief and strands
        e1, e2 = pb - pa, pc - pa
        d1, d2 = wp.cw_mul(tb - ta, material.size), wp.cw_mul(tc - ta, material.size)
        det = d1[0] * d2[1] - d2[0] * d1[1]
        along_v = wp.vec3(0.0, 0.0, 1.0)
        if wp.abs(det) > 1.0e-9:
            along_u = wp.normalize((e1 * d2[1] - e2 * d1[1]) / det)
            along_v = wp.normalize((e2 * d1[0] - e1 * d2[0]) / det)
            if material.relief != 0:
                du, dv = 1.0 / float(material.width), 1.0 / float(material.height)
                right = _texel(texture, material, uv[0] + du, uv[1])
                below = _texel(texture, material, uv[0], uv[1] + dv)
                slope_u = (right[3] - texel[3]) / (du * material.size[0])
                slope_v = (below[3] - texel[3]) / (dv * material.size[1])
                normal = wp.normalize(normal - along_u * slope_u - along_v * slope_v)
            if material.overlaid != 0 and material.normals.height > 0:
                size = _picture_size(material.normals, ta, tb, tc, area_px)
                bent = _picture_at(material.normals, size, uv[0], uv[1])
                normal = wp.normalize(
                    # no steeper than light could come to it
                    normal * wp.max(bent[2] * 2.0 - 1.0, 0.2)
                    + along_u * (bent[0] * 2.0 - 1.0)
                    - along_v * (bent[1] * 2.0 - 1.0)
                )

        # turned by a different angle at neighbouring samples, so that 8 taps make no bands
        spin = (column * 7 + row * 11) % 16
        # light that scatters in flesh gets around its own edge
        inside = light.toward[0] * (material.translucency * SCATTER_METRES)
        outside = point + normal * SHADOW_BIAS_METRES + inside
        key = _key_share(light, shadow, outside, spin)
        open_share = openness[row // samples, column // samples]
        result = _lit(albedo, normal, view, along_v, key, open_share, material, light)
    part = share[i]
    value = wp.vec4(result[0] * part, result[1] * part, result[2] * part, part)
    wp.atomic_add(colour, row // samples, column // samples, value)


@wp.kernel(enable_backward=False)
def develop_pixels(
    person: wp.array2d(dtype=wp.vec4),
    behind: wp.array2d(dtype=wp.vec3),
    noise: wp.array2d(dtype=wp.float32),
    tone: wp.array(dtype=wp.float32),
    tone_range: wp.float32,
    rgb: wp.array3d(dtype=wp.uint8),
):
    """Composite linear light and encode it; noise is 1 x 1 where there is none."""
    i, j = wp.tid()
    seen, back = person[i, j], behind[i, j]
    grain = 0.0
    if noise.shape[0] > 1:
        grain = noise[i, j]
    last = tone.shape[0] - 1
    for k in range(3):
        light = seen[k] + back[k] * (1.0 - seen[3])
        index = wp.clamp(int(light * float(last) / tone_range), 0, last)
        rgb[i, j, k] = wp.uint8(wp.clamp(tone[index] + grain, 0.0, 255.0) + 0.5)
