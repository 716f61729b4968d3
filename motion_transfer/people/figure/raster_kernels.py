"""What `rasterise` runs for each triangle, and `render_iuv` for each pixel, compiled by `warp`.

Types are warp's, not Python's.
"""

import warp as wp

from motion_transfer.people.figure.body import start_warp

start_warp()


@wp.kernel(enable_backward=False)
def fill(
    screen: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    keep: wp.array(dtype=wp.float32),
    cull: wp.array(dtype=wp.uint8),
    width: wp.int32,
    height: wp.int32,
    nearest: wp.array(dtype=wp.uint64),
):
    """Enter a triangle at every pixel centre where it is the nearest so far."""
    f = wp.tid()
    corners = faces[f]
    a, b, c = screen[corners[0]], screen[corners[1]], screen[corners[2]]
    # most triangles are so small that they lie between pixel centres: see that first
    x0 = wp.max(int(wp.ceil(wp.min(a[0], wp.min(b[0], c[0])) - 0.5)), 0)
    x1 = wp.min(int(wp.floor(wp.max(a[0], wp.max(b[0], c[0])) - 0.5)), width - 1)
    if x0 > x1:
        return
    y0 = wp.max(int(wp.ceil(wp.min(a[1], wp.min(b[1], c[1])) - 0.5)), 0)
    y1 = wp.min(int(wp.floor(wp.max(a[1], wp.max(b[1], c[1])) - 0.5)), height - 1)
    if y0 > y1 or wp.min(a[2], wp.min(b[2], c[2])) <= 0.0:
        return
    # twice the signed area; y points down, so outward (counter-clockwise) faces are negative
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    if area == 0.0 or (area > 0.0 and cull[f] != wp.uint8(0)):
        return
    ka, kb, kc = keep[corners[0]], keep[corners[1]], keep[corners[2]]
    if ka < 0.0 and kb < 0.0 and kc < 0.0:
        return
    whole = ka >= 0.0 and kb >= 0.0 and kc >= 0.0
    scale = 1.0 / area
    ia, ib, ic = 1.0 / a[2], 1.0 / b[2], 1.0 / c[2]
    for y in range(y0, y1 + 1):
        py = float(y) + 0.5
        for x in range(x0, x1 + 1):
            px = float(x) + 0.5
            wb = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) * scale
            wc = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) * scale
            wa = 1.0 - wb - wc
            if wa < 0.0 or wb < 0.0 or wc < 0.0:
                continue
            if not whole and wa * ka + wb * kb + wc * kc < 0.0:
                continue
            z = 1.0 / (wa * ia + wb * ib + wc * ic)
            # positive floats sort as their bits do: depth above, triangle below
            bits = wp.uint64(wp.cast(z, wp.uint32))
            wp.atomic_min(nearest, y * width + x, (bits << wp.uint64(32)) | wp.uint64(f))


@wp.func
def perspective_weights(a: wp.vec3, b: wp.vec3, c: wp.vec3, px: float, py: float):
    """Turn a place on the picture into barycentric weights on the triangle in space."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
    wb = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / area
    wc = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / area
    weights = wp.vec3((1.0 - wb - wc) / a[2], wb / b[2], wc / c[2])
    return weights / (weights[0] + weights[1] + weights[2])


@wp.kernel(enable_backward=False)
def draw_charts(
    nearest: wp.array(dtype=wp.uint64),
    screen: wp.array(dtype=wp.vec3),
    faces: wp.array(dtype=wp.vec3i),
    part: wp.array(dtype=wp.uint8),
    uv: wp.array2d(dtype=wp.vec2),
    width: wp.int32,
    iuv: wp.array2d(dtype=wp.uint8),
):
    """Write down the part and the chart coordinates of what each pixel centre sees."""
    i = wp.tid()
    face = int(wp.uint32(nearest[i] & wp.uint64(0xFFFFFFFF)))
    if face < 0:  # all ones: nothing is seen here
        return
    corners = faces[face]
    a, b, c = screen[corners[0]], screen[corners[1]], screen[corners[2]]
    w = perspective_weights(a, b, c, float(i % width) + 0.5, float(i // width) + 0.5)
    chart = uv[face, 0] * w[0] + uv[face, 1] * w[1] + uv[face, 2] * w[2]
    iuv[i, 0] = part[face]
    iuv[i, 1] = wp.uint8(wp.rint(wp.clamp(chart[0], 0.0, 1.0) * 255.0))
    iuv[i, 2] = wp.uint8(wp.rint(wp.clamp(chart[1], 0.0, 1.0) * 255.0))
