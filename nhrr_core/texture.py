"""UV space from screen space: the partial texture of what a photo shows, and guesses at the rest.

The numbers are this project's, chosen by eye. Programs that must not wait for torch have twins of
some of these functions, for one picture: `motion_transfer.drawing.unfolding` and `.textures`, which
tests hold equal to these.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor

from nhrr_core.config import FILL_FROM, FILL_METRES, FILL_TO, PLACE_METRES
from nhrr_core.errors import ShapeError
from nhrr_core.iuv import check_iuv
from nhrr_core.uv_layout import chart_index, smooth_coordinates, texture_coordinates
from nhrr_core.uv_tables import (
    CHART_SIZE,
    MAX_CHART_STEP,
    MAX_ENTRY_STEP,
    MAX_STRETCH,
    SAMPLES_PER_TEXEL,
)


def extract_texture(
    image: Float[Tensor, "B C H W"],
    iuv: UInt8[Tensor, "B 3 H W"],
    charts: Float[Tensor, "24 256 256 2"],
    size: int,
) -> tuple[Float[Tensor, "B C T T"], Float[Tensor, "B 1 T T"]]:
    """Unfold the visible pixels of a photo into a partial UV texture and its visibility.

    A texel is the mean of all pixels that land in it. Where the photo is coarser than the texture,
    the texels between the centres of four neighbouring pixels of one part are interpolated
    bilinearly from those; nothing is filled outside such a quad.

    Convention: image and IUV have the same size, whatever it is; values pass unscaled. A pixel lies
    where `smooth_coordinates` says.

    Args:
        size: T, side of the texture in texels.
    Returns: The texture, 0 where unseen and differentiable with respect to the image; and the
        visibility, 1 where seen and 0 elsewhere.
    Raises: ShapeError if image and IUV differ in batch or size; IuvError.
    Source: the paper, Sec. 3.1. Departs from it: the filling between pixels is this project's.
    """
    check_iuv(iuv)
    if image.shape[0] != iuv.shape[0] or image.shape[2:] != iuv.shape[2:]:
        raise ShapeError(f"photo {list(image.shape)} and IUV {list(iuv.shape)} do not match")
    if size < 1:
        raise ShapeError(f"texture size is {size}; it must be at least 1")
    place = smooth_coordinates(iuv, charts)
    moved = place - texture_coordinates(iuv, charts)
    colours = image.permute(0, 2, 3, 1)
    batch = torch.arange(image.shape[0], device=image.device)[:, None, None]
    texels = image.shape[0] * size * size

    seen = iuv[:, 0] > 0
    x, y = place.unbind(-1)
    total, count = _scatter(colours[seen], _texel(x, y, batch, size)[seen], texels)
    hit = count > 0  # what is interpolated only fills where no pixel landed
    precise = torch.promote_types(image.dtype, torch.float32)  # float16 is too coarse for places
    axes = charts.view(-1, 2).T.to(precise).contiguous()
    fill_total, fill_count = torch.zeros_like(total), torch.zeros_like(count)
    for steps, quads in _quads_by_steps(iuv, place, size):
        points, texel = _fill_points(colours, iuv, moved, axes, quads, steps, hit, size)
        more_total, more_count = _scatter(points, texel, texels)
        fill_total, fill_count = fill_total + more_total, fill_count + more_count

    total = torch.where(hit[:, None], total, fill_total)
    count = torch.where(hit, count, fill_count)
    texture = total / count.clamp_min(1)[:, None]
    shape = (image.shape[0], size, size)
    return (
        texture.view(*shape, -1).permute(0, 3, 1, 2),
        (count > 0).to(image.dtype).view(shape)[:, None],
    )


def shrink_texture(
    texture: Float[Tensor, "*B C T T"], visibility: Float[Tensor, "*B 1 T T"], factor: int
) -> tuple[Float[Tensor, "*B C t t"], Float[Tensor, "*B 1 t t"]]:
    """Make a partial texture coarser: a texel is the mean of those seen in its place, if any is.

    Args:
        texture: 0 where it is not seen.
        factor: How many times; t = T / factor.
    """
    if factor == 1:
        return texture, visibility
    share = F.avg_pool2d(visibility, factor)
    mean = F.avg_pool2d(texture, factor) / share.clamp_min(1 / factor**2)
    return mean, (share > 0).to(visibility.dtype)


def merge_textures(
    layers: list[tuple[Float[Tensor, "B C T T"], Float[Tensor, "B 1 T T"]]],
) -> tuple[Float[Tensor, "B C T T"], Float[Tensor, "B 1 T T"]]:
    """Unite partial textures, each with its visibility; where two claim a texel, the later wins.

    Source: the paper, Sec. 4.5 (garment transfer).
    """
    texture, visibility = layers[0]
    for more_texture, more_visibility in layers[1:]:
        texture = texture * (1 - more_visibility) + more_texture * more_visibility
        visibility = torch.maximum(visibility, more_visibility)
    return texture, visibility


def _texel(
    x: Float[Tensor, "*shape"], y: Float[Tensor, "*shape"], batch: Tensor, size: int
) -> Int64[Tensor, "*shape"]:
    """Index of the texel that a place falls in, counted through the batch."""
    column, row = ((axis * size).long().clamp_(0, size - 1) for axis in (x, y))
    return (batch * size + row) * size + column


def mirror_texture(
    texture: Float[Tensor, "B C T T"],
    visibility: Float[Tensor, "B 1 T T"],
    side_twin: Int64[Tensor, "256 256"],
    depth_twin: Int64[Tensor, "256 256"],
) -> tuple[Float[Tensor, "B C T T"], Float[Tensor, "B 1 T T"]]:
    """Give hidden texels the colours of their mirror image on the body.

    First those of the other side, then those of the other face of the same limb, then those of the
    other side's other face.

    Args:
        side_twin, depth_twin: Those of `UVLayout`.
    Returns: The texture, 0 where neither a texel nor a mirror image of it is visible; and 1 where
        one of them is.
    Source: this project's.
    """
    size = texture.shape[-1]
    side, depth = (resize_twins(twin, size) for twin in (side_twin, depth_twin))
    colours, shown = texture.flatten(2), visibility.flatten(2) > 0
    # side again: by then the side twin has got the colours of its own other face
    for twin in (side, depth, side):
        gain = ~shown & shown[..., twin]
        colours = torch.where(gain, colours[..., twin], colours)
        shown = shown | gain
    return colours.view_as(texture), shown.to(visibility.dtype).view_as(visibility)


def fill_texture(
    texture: Float[Tensor, "B C T T"],
    shown: Float[Tensor, "B 1 T T"],
    position: Float[Tensor, "256 256 3"],
    surroundings: Float[Tensor, "N M"],
) -> Float[Tensor, "B C T T"]:
    """Give texels that show nothing a mean of the colours around them on the body.

    There is one for each of FILL_TO x FILL_TO places, made of the means of what is shown in
    FILL_FROM x FILL_FROM places: it tells colours, not patterns.

    Args:
        shown: 1 where the texture shows something; such texels stay as they are.
        position: That of `UVLayout`.
        surroundings: What `measure_surroundings` makes of it.
    Returns: The texture; still 0 everywhere where nothing at all is shown.
    Source: this project's; inverse distance weighting is Shepard's (1968).
    """
    counted = shown * _lie_at_their_place(position, texture.shape[-1])
    known = torch.cat([texture * counted, counted], dim=1)
    places = F.adaptive_avg_pool2d(known, FILL_FROM).flatten(2)
    spread = (places @ surroundings.to(places.dtype)).unflatten(2, (FILL_TO, FILL_TO))
    colours = spread[:, :-1] / spread[:, -1:].clamp_min(torch.finfo(spread.dtype).tiny)
    # not between places: neighbours in the texture may lie far apart on the body
    filled = F.interpolate(colours, texture.shape[2:], mode="nearest")
    return torch.where(shown > 0, texture, filled)


def measure_surroundings(position: Float[Tensor, "256 256 3"]) -> Float[Tensor, "N M"]:
    """Weigh how much each of FILL_FROM**2 places of the texture counts for each of FILL_TO**2.

    With their distance d on the body the weight is (m^2 / (d^2 + m^2))^3, m being FILL_METRES: it
    falls with the sixth power, so that the nearest decide.

    Args:
        position: That of `UVLayout`, in metres.
    """
    given, wanted = (_places(position, count).reshape(-1, 3) for count in (FILL_FROM, FILL_TO))
    # by differences: products of matrices lose the small distances
    exact = "donot_use_mm_for_euclid_dist"
    squared = torch.cdist(given, wanted, compute_mode=exact).square()
    return (FILL_METRES**2 / (squared + FILL_METRES**2)) ** 3


def _places(position: Float[Tensor, "256 256 3"], count: int) -> Float[Tensor, "P P 3"]:
    """Where the middles of count x count equal shares of the texture lie on the body."""
    step = position.shape[0] // count
    return position[step // 2 :: step, step // 2 :: step]


def _lie_at_their_place(position: Float[Tensor, "256 256 3"], size: int) -> Bool[Tensor, "T T"]:
    """Whether a texel belongs to the place whose share of the texture it lies in.

    Places at the border of a chart hold texels of another part of the body, too.
    """
    step = position.shape[0] // FILL_FROM
    own = _places(position, FILL_FROM).repeat_interleave(step, 0).repeat_interleave(step, 1)
    near = (position - own).norm(dim=-1) < PLACE_METRES
    return F.interpolate(near[None, None].float(), (size, size), mode="nearest")[0, 0] > 0


def resize_twins(twin: Int64[Tensor, "S S"], size: int) -> Int64[Tensor, " L"]:
    """A table of twins for a texture of another size, flat; the nearest texels'."""
    own = twin.shape[-1]
    if size == own:
        return twin.flatten()
    centres = ((torch.arange(size, device=twin.device) + 0.5) * own / size).long()
    chosen = twin[centres][:, centres]
    rows, columns = chosen // own, chosen % own
    return (rows * size // own * size + columns * size // own).flatten()


def _scatter(
    values: Float[Tensor, "N C"], index: Int64[Tensor, " N"], length: int
) -> tuple[Float[Tensor, "L C"], Float[Tensor, " L"]]:
    """Sums and counts of the values per index."""
    total = values.new_zeros(length, values.shape[1]).index_add(0, index, values)
    count = values.new_zeros(length).index_add(0, index, torch.ones_like(values[:, 0]))
    return total, count


def _corners(x: Tensor) -> Tensor:
    """The four corners of each 2 x 2 quad of a B x H x W (x C) tensor, stacked in front."""
    return torch.stack([x[:, :-1, :-1], x[:, :-1, 1:], x[:, 1:, :-1], x[:, 1:, 1:]])


def _quads_by_steps(
    iuv: UInt8[Tensor, "B 3 H W"], place: Float[Tensor, "B H W 2"], size: int
) -> list[tuple[int, Int64[Tensor, "Q 3"]]]:
    """Quads to fill, as (image, row, column) of their first corner, by points along a side.

    Those of one number of points are filled at once; it is a power of two, so that groups are few.
    """
    part, u, v = (_corners(channel) for channel in iuv.int().unbind(1))
    step = torch.maximum(u.amax(0) - u.amin(0), v.amax(0) - v.amin(0))
    corners = _corners(place)
    stretch = (corners.amax(0) - corners.amin(0)).amax(-1)
    joined = (part[0] > 0) & (part == part[0]).all(0)
    joined &= (step <= MAX_CHART_STEP * 255) & (stretch <= MAX_STRETCH)
    wanted = stretch * size * SAMPLES_PER_TEXEL
    groups, low, steps = [], SAMPLES_PER_TEXEL, 4  # under one texel apart: none lies between
    while low < MAX_STRETCH * size * SAMPLES_PER_TEXEL:
        quads = (joined & (wanted > low) & (wanted <= steps)).nonzero()
        if len(quads):
            groups.append((steps, quads))
        low, steps = steps, steps * 2
    return groups


def _fill_points(
    colours: Float[Tensor, "B H W C"],
    iuv: UInt8[Tensor, "B 3 H W"],
    moved: Float[Tensor, "B H W 2"],
    axes: Float[Tensor, "2 L"],
    quads: Int64[Tensor, "Q 3"],
    steps: int,
    hit: Bool[Tensor, " M"],
    size: int,
) -> tuple[Float[Tensor, "N C"], Int64[Tensor, " N"]]:
    """Colours and texels of steps x steps points spread evenly inside each quad.

    Those in texels that are hit, about half of them, are left out.

    Args:
        moved: How far from its entry in the table each pixel lies.
    """
    line = (torch.arange(steps, device=iuv.device, dtype=axes.dtype) + 0.5) / steps
    down, right = (axis.reshape(-1) for axis in torch.meshgrid(line, line, indexing="ij"))

    batch, top, left = quads.unbind(1)
    corners = [(batch, top + y, left + x) for y in (0, 1) for x in (0, 1)]
    corner_iuv = [iuv[image, :, row, column] for image, row, column in corners]
    # no product of matrices, which may be of a few bits only: each place in the table counts
    u, v = (
        _bilinear([corner[:, channel, None].to(axes.dtype) for corner in corner_iuv], down, right)
        for channel in (1, 2)
    )
    places = _place_between_entries(axes, corner_iuv[0][:, :1].long(), u, v)
    moves = [moved[corner].to(axes.dtype) for corner in corners]
    x, y = (
        place + _bilinear([move[:, axis, None] for move in moves], down, right)
        for axis, place in enumerate(places)
    )
    texel = _texel(x, y, batch[:, None], size).flatten()
    open_texels = (~hit.index_select(0, texel)).nonzero()[:, 0]
    shares = [(1 - down, down), (1 - right, right)]
    weights = torch.stack([a * b for a in shares[0] for b in shares[1]], dim=1)
    corner_colours = torch.stack([colours[corner] for corner in corners], dim=1)
    values = (weights.to(colours.dtype) @ corner_colours).flatten(0, 1)
    return values.index_select(0, open_texels), texel.index_select(0, open_texels)


def _bilinear(corners: Sequence[Tensor], down: Tensor, right: Tensor) -> Tensor:
    """Between a quad's corners (row by row), at places inside it, each axis in [0, 1]."""
    a, b, c, d = corners
    return torch.lerp(torch.lerp(a, b, right), torch.lerp(c, d, right), down)


def _place_between_entries(
    axes: Float[Tensor, "2 L"],
    part: Int64[Tensor, "Q 1"],
    u: Float[Tensor, "Q P"],
    v: Float[Tensor, "Q P"],
) -> list[Float[Tensor, "Q P"]]:
    """Texture coordinates x and y of fractional U and V.

    They are bilinear in the table, and the nearest entry's across a seam.

    Args:
        axes: The table's x, and its y: in a column of numbers many are looked up fastest.
    """
    left, top = (axis.floor().clamp_(0, CHART_SIZE - 2) for axis in (u, v))  # 255 is the last entry
    chart = chart_index(part, *torch.zeros_like(part).expand(2, -1, -1))
    first = (chart + (top * CHART_SIZE + left).long()).flatten()
    places, smooth = [], torch.ones_like(first, dtype=torch.bool)
    for axis in axes:
        # entries further on are looked up from a later beginning: that needs no sum for each point
        corners = [
            axis[y * CHART_SIZE + x :].index_select(0, first) for y in (0, 1) for x in (0, 1)
        ]
        highest, lowest = (reduce(extreme, corners) for extreme in (torch.maximum, torch.minimum))
        smooth &= highest - lowest <= MAX_ENTRY_STEP
        corners = [corner.view_as(u) for corner in corners]
        places.append(_bilinear(corners, v - top, u - left).flatten())
    seam = (~smooth).nonzero()[:, 0]
    nearest = (chart + (v.round() * CHART_SIZE + u.round()).long()).flatten()[seam]
    return [
        place.index_copy(0, seam, axis[nearest]).view_as(u)
        for axis, place in zip(axes, places, strict=True)
    ]
