"""What a renderer knows of a source: photos and IUV, unfolded into one partial texture."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from motion_transfer.drawing.outline import clearance_of, shrink_image
from motion_transfer.drawing.person import (
    COVERS,
    bounding_box,
    choose_person,
    find_people,
    isolate,
)
from motion_transfer.drawing.textures import enlarge, merge_textures, pick_nearest
from motion_transfer.drawing.trimming import trim
from motion_transfer.drawing.unfolding import extract_texture, keep_parts, pixels_per_texel
from motion_transfer.drawing.views import View, merge_views, rate_texels
from motion_transfer.drawing.window import BEYOND_THE_PHOTO, cut_picture, plan_window
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.blends import BlendMeter
from motion_transfer.media.iuv.formats import ChannelOrder
from motion_transfer.media.iuv.opening import read_single_iuv
from motion_transfer.media.nearest import nearest_points
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import ALL_PARTS, PART_GROUPS, PART_NAMES, load_uv_tables
from nhrr_core.config import CLEARANCE_SIZE
from nhrr_core.uv_tables import SAMPLES_PER_TEXEL

SURROUNDINGS_SHARE = 0.15  # of the person's height: enough background around to know its colours
LEAST_RATING = 0.01  # of a view, in the units of `View.rating`
OVERLAP_METRES = 0.05
OVERLAPS = {"lower-legs": "feet", "lower-arms": "hands", "torso": "upper-legs"}
"""Clothes hang over what they are not worn on: hems over shoes, cuffs over hands, shirts over
trousers. Whose clothes of the former are taken away shows so much less of the latter."""

MOST_PIXELS_PER_TEXEL = 2.0  # along a side; more are averaged anyway
LEAST_HEIGHT = 1500  # px; smaller bodies cost little, and lose texels at their outline
MEASURED_HEIGHT = 500  # px; of a taller body not every pixel is counted

DENSE_TEXELS = 512  # a side; finer textures may miss texels, which are then as coarse as the map


@dataclass(frozen=True)
class SourcePicture:
    """One person in one photo, and what is taken from there.

    Attributes:
        photo: The picture, upright.
        iuv: (I, U, V) of this person only; 0 elsewhere.
        alpha: How much of each pixel is this person, 0..255, where somebody could tell; None: the
            photo's own alpha says it, or else its colours.
        parts: What is taken; the person of a run gives what no garment covers.
    """

    photo: Photo
    iuv: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"] | None = None
    parts: tuple[int, ...] = ALL_PARTS


@dataclass(frozen=True)
class Source:
    """What a renderer needs to know of a source.

    Attributes:
        photo: The picture, upright.
        iuv: H x W x 3 uint8, of the chosen person only.
        iuv_path: None where it was estimated.
        texture: 3 x T x T in [-1, 1], 0 where nothing is seen.
        visibility: 1 x T x T, 1 where the texture is seen.
        alpha: How much of each pixel is the person, 0..255, where the IUV was estimated.
        clearance: Of clothes and hair, see `nhrr_core.unfold_clearance`; 0 where it is not known.
        notes: What the user should know of how the photos are read, in sentences.
        kept: The file that it was read from, see `kept_source`, which holds feature maps of it.
        pictures: What the texture was unfolded from, garments last; none where that is not known.
    """

    photo: Photo
    iuv: UInt8[np.ndarray, "H W 3"]
    iuv_path: Path | None
    texture: Float32[np.ndarray, "3 T T"]
    visibility: Float32[np.ndarray, "1 T T"]
    alpha: UInt8[np.ndarray, "H W"] | None = None
    clearance: Float32[np.ndarray, "2 128 128"] | None = None
    notes: tuple[str, ...] = ()
    kept: Path | None = None
    pictures: tuple[SourcePicture, ...] = ()


def unfold_source(
    pictures: Sequence[SourcePicture],
    texture_size: int,
    iuv_path: Path | None = None,
) -> Source:
    """Unfold what photos show of a person into one source.

    Args:
        pictures: The person, one photo or several; the first one leads, see `merge_views`.
        texture_size: Side of the partial texture in texels.
        iuv_path: Where the first photo's IUV was read; None where it was estimated.
    """
    merged = merge_views(unfold_views(pictures, texture_size))
    person = pictures[0]
    notes = [note for picture in pictures for note in _list_notes(picture)]
    notes += tell_strangers(pictures, merged.strangers)
    return Source(
        person.photo,
        person.iuv,
        iuv_path,
        merged.texture,
        merged.visibility,
        person.alpha,
        _mean_clearance(pictures),
        tuple(dict.fromkeys(notes)),  # those of a video are the same for each of its frames
        pictures=tuple(pictures),
    )


def paint(
    source: Source, colours: Float32[np.ndarray, "3 t t"], where: Bool[np.ndarray, "t t"]
) -> Source:
    """Show colours, in [-1, 1], where a source's texture is hidden, as if a photo had."""
    size = source.texture.shape[-1]
    painted = pick_nearest(where, size) & (source.visibility[0] == 0)
    return replace(
        source,
        texture=np.where(painted, pick_nearest(colours, size), source.texture),
        visibility=np.maximum(source.visibility, painted),
    )


def undress(source: Source, parts: Collection[int]) -> Source:
    """Take parts of the body out of a source, so that another photo can give them.

    Which texels are theirs is told by the layout; a texel at a part's border may have been seen in
    a pixel of its neighbour. A photo that is at hand is better not unfolded there to begin with.
    """
    if not parts:
        return source
    kept = untouched_texels(frozenset(parts))

    def left(values: Float32[np.ndarray, "C t t"]) -> Float32[np.ndarray, "C t t"]:
        return values * pick_nearest(kept, values.shape[-1])

    return replace(
        source,
        texture=left(source.texture),
        visibility=left(source.visibility),
        clearance=None if source.clearance is None else left(source.clearance),
        kept=None,
        pictures=tuple(
            replace(each, parts=tuple(part for part in each.parts if part not in parts))
            for each in source.pictures
        ),
    )


@cache
def untouched_texels(taken: frozenset[int]) -> Bool[np.ndarray, "256 256"]:
    """Mark the texels of other parts than those that are taken, out of reach of their clothes."""
    tables = load_uv_tables()
    kept = ~np.isin(tables.part, sorted(taken))
    for above, below in OVERLAPS.items():
        if not taken.issuperset(PART_GROUPS[above]):
            continue
        covering = np.isin(tables.part, PART_GROUPS[above])
        covered = np.isin(tables.part, PART_GROUPS[below]) & kept
        near, _ = nearest_points(tables.position[covering], tables.position[covered])
        kept[covered] = near[:, 0] > OVERLAP_METRES
    return kept


def dress(source: Source, garments: Sequence[SourcePicture]) -> Source:
    """Lay garments over a source; later ones win where two give the same part.

    Raises: InputError for a garment photo that shows none of its parts.
    """
    if not garments:
        return source
    layers = [(source.texture, source.visibility)]
    layers += [unfold_picture(garment, source.texture.shape[-1]) for garment in garments]
    for garment, (_, shown) in zip(garments, layers[1:], strict=True):
        if garment.parts and not shown.any():
            found = ", ".join(PART_NAMES[p] for p in np.unique(garment.iuv[..., 0]) if p)
            raise InputError(
                f"garment {garment.photo.path} shows none of"
                f" {', '.join(PART_NAMES[p] for p in garment.parts)}; it shows {found}"
            )
    texture, visibility = merge_textures(layers)
    clearances = [_clearance(garment) for garment in garments]
    if source.clearance is not None:
        clearances.insert(0, source.clearance)
    clearance = np.concatenate(merge_textures([(c[:1], c[1:]) for c in clearances]))
    notes = [*source.notes, *(note for garment in garments for note in _list_notes(garment))]
    return replace(
        source,
        texture=texture,
        visibility=visibility,
        clearance=clearance,
        notes=tuple(dict.fromkeys(notes)),
        kept=None,
        pictures=(*source.pictures, *garments),
    )


def unfold_views(
    pictures: Sequence[SourcePicture], texture_size: int, *, rated: bool = False
) -> list[View]:
    """Unfold each photo of a person, and rate how well it sees each texel.

    Args:
        rated: Whether one photo alone is rated as well, which a merge does not need.
    """
    views = []
    for picture in pictures:
        texture, visibility = unfold_picture(picture, texture_size)
        if len(pictures) == 1 and not rated:  # nothing to compare with
            return [View(str(picture.photo.path), texture, visibility, visibility)]
        rating = rate_texels(picture.photo.rgb, picture.iuv)
        # seen at all is more than not seen, also where few pixels fall
        rating = np.maximum(enlarge(rating, texture_size), LEAST_RATING) * visibility
        views.append(View(str(picture.photo.path), texture, visibility, rating))
    return views


def tell_strangers(pictures: Sequence[SourcePicture], strangers: Sequence[int]) -> list[str]:
    """Say which photos do not seem to show the person of the first."""
    return [
        f"{pictures[index].photo.path} seems to show somebody else than {pictures[0].photo.path},"
        " or other clothes; leave it out if it does"
        for index in strangers
    ]


def _clearance(picture: SourcePicture) -> Float32[np.ndarray, "2 128 128"]:
    return clearance_of(picture.photo, picture.iuv, picture.parts, alpha=picture.alpha)


def _mean_clearance(pictures: Sequence[SourcePicture]) -> Float32[np.ndarray, "2 128 128"]:
    """The mean of what each photo measures along its own outline."""
    lengths, known = np.stack([_clearance(picture) for picture in pictures], axis=1)
    count = known.sum(0)
    return np.stack([(lengths * known).sum(0) / np.maximum(count, 1), np.minimum(count, 1)])


def _list_notes(picture: SourcePicture) -> list[str]:
    blends = BlendMeter()
    blends.add(picture.iuv)
    warning = blends.warn(f"the IUV of {picture.photo.path}")
    return [*picture.photo.notes, *([warning] if warning else [])]


def cut_source(picture: SourcePicture, size: int) -> UInt8[np.ndarray, "6 S S"]:
    """Cut a photo out around its person, and the (I, U, V) of what is taken from there.

    Networks read that which look at the photo itself.
    """
    window = plan_window([bounding_box(picture.iuv)])
    rgb = cut_picture(window, picture.photo.rgb, size, BEYOND_THE_PHOTO)
    iuv = window.cut(keep_parts(picture.iuv, picture.parts), size)
    return np.concatenate([rgb, iuv], axis=-1).transpose(2, 0, 1)


def unfold_picture(
    picture: SourcePicture, texture_size: int
) -> tuple[Float32[np.ndarray, "3 T T"], Float32[np.ndarray, "1 T T"]]:
    """Unfold a photo into a partial texture in [-1, 1] and visibility.

    At its full resolution, or in the one that the texture holds: a large photo takes seconds less.
    """
    if not picture.iuv[..., 0].any():
        blank = np.zeros((4, texture_size, texture_size), np.float32)
        return blank[:3], blank[3:]
    rgb, iuv, alpha = _cut_to_unfold(picture, texture_size)
    trimmed = trim(rgb, iuv, alpha)
    colours = rgb / np.float32(127.5) - 1
    return extract_texture(
        colours,
        keep_parts(trimmed, picture.parts),
        texture_size,
        samples_per_texel=SAMPLES_PER_TEXEL if texture_size <= DENSE_TEXELS else 1,
    )


def _cut_to_unfold(
    picture: SourcePicture, texture_size: int
) -> tuple[UInt8[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"] | None]:
    """Cut the surroundings of a person out of photo, IUV and alpha, no finer than can be held."""
    photo, iuv = picture.photo, picture.iuv
    alpha = photo.cutout if picture.alpha is None else picture.alpha
    box = bounding_box(iuv)
    # nothing farther away is looked at: of a large photo that saves most of the work
    body = box.grown(round((box.height - 1) * SURROUNDINGS_SHARE)).slices
    rgb, iuv, alpha = photo.rgb[body], iuv[body], None if alpha is None else alpha[body]
    every = max(1, box.height // MEASURED_HEIGHT)
    density = pixels_per_texel(iuv[::every, ::every]) * every * CLEARANCE_SIZE / texture_size
    scale = min(1.0, max(MOST_PIXELS_PER_TEXEL / density, LEAST_HEIGHT / box.height))
    return (
        shrink_image(rgb, scale, cv2.INTER_AREA),
        shrink_image(iuv, scale, cv2.INTER_NEAREST_EXACT),
        None if alpha is None else shrink_image(alpha, scale, cv2.INTER_AREA),
    )


def read_person(
    photo: Photo, path: Path, choice: str, order: ChannelOrder | None, what: str
) -> UInt8[np.ndarray, "H W 3"]:
    """Read the IUV of one person in a photo, without pixels that the photo's alpha leaves out.

    Args:
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: The photo's role, for messages.
    Raises: InputError if the IUV cannot be read, is of another size, or shows nobody.
    """
    where = f"{what} IUV {path}"
    iuv = read_single_iuv(path, order, f"{what} IUV")
    if iuv is None:
        raise InputError(f"{where}: no person in it, every pixel is background")
    return take_person(photo, iuv, choice, where)


def take_person(
    photo: Photo, iuv: UInt8[np.ndarray, "H W 3"], choice: str, where: str
) -> UInt8[np.ndarray, "H W 3"]:
    """Leave one person in a photo's IUV, see `read_person`.

    Args:
        where: The IUV, for messages.
    Raises: InputError if it is of another size, or shows nobody whom the choice means.
    """
    if iuv.shape[:2] != photo.rgb.shape[:2]:
        height, width = photo.rgb.shape[:2]
        hint = "make the IUV from this very photo"
        if photo.turned and iuv.shape[1::-1] == (height, width):
            hint = "the photo was turned upright as its EXIF says, make the IUV from it like that"
        raise InputError(
            f"{where} is {iuv.shape[1]} x {iuv.shape[0]}, but {photo.path} is {width} x {height};"
            f" {hint}"
        )
    people = find_people(iuv)
    person = choose_person(people, choice, where)
    if not people.shows_only(person):
        iuv = isolate(iuv, person)
    if photo.alpha is not None:
        iuv = iuv * (photo.alpha >= COVERS)[..., None]
    return iuv
