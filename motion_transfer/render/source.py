"""The source, once per run: photo and IUV become a partial texture, garments included."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.errors import InputError
from motion_transfer.media.image import Photo, read_photo
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_stream import read_single_iuv
from motion_transfer.media.nearest import take_nearest
from motion_transfer.render.beside import find_iuv_beside
from motion_transfer.render.options import Garment, RenderOptions
from motion_transfer.render.outline import clearance_of, grab_cut
from motion_transfer.render.person import choose_person, disc, find_people, isolate, occupancy
from motion_transfer.render.photo_person import COVERS, SourcePerson, estimate_person
from nhrr_core import extract_texture, keep_parts, load_uv_layout, merge_textures
from nhrr_core.iuv import ALL_PARTS, PART_NAMES

SMALLEST_VISIBLE_SHARE = 0.01  # of the texels; a frontal half-length portrait shows about 0.2
BAND_SHARE = 0.025  # of the person's height: IUV outlines stray over the background by up to that
CLEAR_SHARE = 0.05  # likewise: hair and loose clothes leave the outline by up to that
TRIM_SHARE = 0.004  # likewise: the width over which a photo mixes person and background
SURROUNDINGS_SHARE = 0.15  # likewise: enough background around the person to know its colours
SOLID_ALPHA = 192  # of 255; less is mixed with the background
GRABCUT_HEIGHT = 320  # px; the cut is made at that size, or it would take seconds


@dataclass(frozen=True)
class Source:
    """What a renderer needs to know of a source.

    Attributes:
        photo: the picture, upright.
        iuv: H x W x 3 uint8, of the chosen person only.
        iuv_path: None where it was estimated.
        texture: 1 x 3 x T x T in [-1, 1], 0 where nothing is seen.
        visibility: 1 x 1 x T x T, 1 where the texture is seen.
        alpha: how much of each pixel is the person, 0..255, where the IUV was estimated.
        clearance: of clothes and hair, see `nhrr_core.unfold_clearance`; 0 where it is not known.
    """

    photo: Photo
    iuv: UInt8[np.ndarray, "H W 3"]
    iuv_path: Path | None
    texture: Float[Tensor, "1 3 T T"]
    visibility: Float[Tensor, "1 1 T T"]
    alpha: UInt8[np.ndarray, "H W"] | None = None
    clearance: Float[Tensor, "1 2 128 128"] | None = None


def prepare_source(options: RenderOptions, texture_size: int) -> Source:
    """Read the source (and garments) and unfold what they show.

    Raises: InputError if a file is missing or unfit, sizes differ, nobody or too little is seen,
        or a garment photo shows none of its parts.
    """
    photo = read_photo(options.source)
    iuv_path = options.source_iuv or find_iuv_beside(options.source)
    person = _find_person(photo, iuv_path, options.person, options, "source")
    taken = {part for garment in options.garments for part in garment.parts}
    kept = tuple(part for part in ALL_PARTS if part not in taken)
    layers = [unfold(photo, person.iuv, kept, texture_size, alpha=person.alpha)]
    clearances = [clearance_of(photo, person.iuv, kept, alpha=person.alpha)]
    for number, garment in enumerate(options.garments):
        later = {part for other in options.garments[number + 1 :] for part in other.parts}
        layer, clearance = _unfold_garment(garment, later, options, texture_size)
        layers.append(layer)
        clearances.append(clearance)
    texture, visibility = merge_textures(layers)
    merged = torch.cat(merge_textures([(c[:, :1], c[:, 1:]) for c in clearances]), dim=1)
    share = float(visibility.mean())
    if share < SMALLEST_VISIBLE_SHARE:
        raise InputError(
            f"source {options.source} shows too little of the body ({share:.1%} of the texture);"
            " use a larger photo, or choose another --person"
        )
    return Source(photo, person.iuv, iuv_path, texture, visibility, person.alpha, merged)


def _find_person(
    photo: Photo, iuv_path: Path | None, choice: str, options: RenderOptions, what: str
) -> SourcePerson:
    if iuv_path is None:
        return estimate_person(photo, choice, options, what)
    return SourcePerson(read_person(photo, iuv_path, choice, options.source_iuv_order, what))


def unfold(
    photo: Photo,
    iuv: UInt8[np.ndarray, "H W 3"],
    parts: tuple[int, ...],
    texture_size: int,
    *,
    alpha: UInt8[np.ndarray, "H W"] | None = None,
) -> tuple[Float[Tensor, "1 3 T T"], Float[Tensor, "1 1 T T"]]:
    """Partial texture in [-1, 1] and visibility of some parts of a photo at its full resolution.

    Args:
        alpha: says where the person ends; None: the photo's own alpha, or else its colours.
    """
    alpha = photo.alpha if alpha is None else alpha
    rows, columns = (np.flatnonzero(iuv[..., 0].any(axis)) for axis in (1, 0))
    if not len(rows):
        blank = torch.zeros(1, 1, texture_size, texture_size)
        return blank.expand(-1, 3, -1, -1), blank
    margin = round((rows[-1] - rows[0]) * SURROUNDINGS_SHARE)
    body = np.s_[
        max(0, rows[0] - margin) : rows[-1] + 1 + margin,
        max(0, columns[0] - margin) : columns[-1] + 1 + margin,
    ]
    rgb, own = np.ascontiguousarray(photo.rgb[body]), np.ascontiguousarray(iuv[body])
    trimmed = trim_outline(rgb, own) if alpha is None else trim_to_alpha(own, alpha[body])
    tensors = [torch.from_numpy(image).permute(2, 0, 1)[None] for image in (rgb, trimmed)]
    colours, body_iuv = tensors[0].float() / 127.5 - 1, keep_parts(tensors[1], parts)
    return extract_texture(colours, body_iuv, load_uv_layout().charts, texture_size)


def trim_to_alpha(
    iuv: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"]
) -> UInt8[np.ndarray, "H W 3"]:
    """The IUV where alpha is solid, without the outermost pixels, where photo and outline mix."""
    rows = np.flatnonzero(iuv[..., 0].any(1))
    if not len(rows):
        return iuv
    solid = (alpha >= SOLID_ALPHA).astype(np.uint8)
    height = int(rows[-1] - rows[0] + 1)
    return iuv * cv2.erode(solid, disc(height * TRIM_SHARE), borderValue=1)[..., None]


def trim_outline(
    rgb: UInt8[np.ndarray, "H W 3"], iuv: UInt8[np.ndarray, "H W 3"]
) -> UInt8[np.ndarray, "H W 3"]:
    """The IUV without the background that strays into its outline.

    Only a band along the outline is doubted. In it, GrabCut (Rother et al., SIGGRAPH 2004) decides
    by colour, and the outermost pixels, where photo and outline mix, always go. What lies just
    outside may be hair: the background's colours are those farther away.
    """
    mask = occupancy(iuv)
    rows = np.flatnonzero(mask.any(1))
    if not len(rows):
        return iuv
    height = int(rows[-1] - rows[0] + 1)
    scale = min(1, GRABCUT_HEIGHT / height)
    small = max(1, round(mask.shape[1] * scale)), max(1, round(mask.shape[0] * scale))
    labels = _cut_out(
        cv2.resize(rgb, small, interpolation=cv2.INTER_AREA),
        cv2.resize(mask, small, interpolation=cv2.INTER_NEAREST),
        height * scale,
    )
    person = mask & cv2.resize(labels, mask.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return iuv * cv2.erode(person, disc(height * TRIM_SHARE))[..., None]


def _cut_out(
    rgb: UInt8[np.ndarray, "H W 3"], mask: UInt8[np.ndarray, "H W"], height: float
) -> UInt8[np.ndarray, "H W"]:
    """1 where a person of that height in px is, by colour along the outline of a rough mask."""
    band = height * BAND_SHARE
    depth = cv2.distanceTransform(mask, cv2.DIST_L2, 3)
    thickness = cv2.dilate(depth, disc(band))
    inner = depth >= np.minimum(band, thickness / 2)  # a limb thinner than the band keeps its core
    near = cv2.dilate(mask, disc(height * CLEAR_SHARE)) > 0
    if near.all():
        return mask
    labels = np.where(mask, cv2.GC_PR_FGD, cv2.GC_BGD).astype(np.uint8)
    labels[inner & (mask > 0)] = cv2.GC_FGD
    surroundings = np.where(mask[..., None], rgb, take_nearest(rgb, near))
    return grab_cut(surroundings, labels)


def _unfold_garment(
    garment: Garment, later: set[int], options: RenderOptions, texture_size: int
) -> tuple[tuple[Float[Tensor, "1 3 T T"], Float[Tensor, "1 1 T T"]], Float[Tensor, "1 2 128 128"]]:
    photo = read_photo(garment.photo, "garment")
    path = garment.iuv or find_iuv_beside(garment.photo)
    person = _find_person(photo, path, "largest", options, "garment")
    parts = tuple(part for part in garment.parts if part not in later)
    texture, visibility = unfold(photo, person.iuv, parts, texture_size, alpha=person.alpha)
    if parts and not visibility.any():
        shown = ", ".join(PART_NAMES[part] for part in np.unique(person.iuv[..., 0]) if part)
        raise InputError(
            f"garment {garment.photo} shows none of {', '.join(PART_NAMES[p] for p in parts)};"
            f" it shows {shown}"
        )
    return (texture, visibility), clearance_of(photo, person.iuv, parts, alpha=person.alpha)


def read_person(
    photo: Photo, path: Path, choice: str, order: ChannelOrder | None, what: str
) -> UInt8[np.ndarray, "H W 3"]:
    """The IUV of one person in a photo, without pixels that the photo's alpha leaves out.

    Args:
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: the photo's role, for messages.
    Raises: InputError if the IUV cannot be read, is of another size, or shows nobody.
    """
    where = f"{what} IUV {path}"
    iuv = read_single_iuv(path, order, f"{what} IUV")
    if iuv is None:
        raise InputError(f"{where}: no person in it, every pixel is background")
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
    if len(person.regions) != people.region_count:
        iuv = isolate(iuv, person)
    if photo.alpha is not None:
        iuv = iuv * (photo.alpha >= COVERS)[..., None]
    return iuv
