"""What raw pictures hold, as plain facts: their size and length, and who is in them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import Box, find_people, isolate
from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.media.iuv.formats import find_iuv_of
from motion_transfer.media.iuv.opening import read_single_iuv
from motion_transfer.media.iuv.stream import IuvStream
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, open_pictures
from motion_transfer.media.pictures.photo import Photo, read_photo
from motion_transfer.media.pictures.stream import PictureStream
from motion_transfer.render.options import EstimatorOptions
from nhrr_core.parts import PART_COUNT, PART_GROUPS

LOOKED_AT = 48
"""How many frames of a clip are looked at until one shows somebody: clips fade in."""

LEAST_SHARE = 0.003
"""Of a person's pixels: less of a part, such as the tip of a foot, is not told as seen."""

Facts = dict[str, Any]
Found = Sequence[tuple[Box, UInt8[np.ndarray, "H W 3"]]]
"""People: the box that holds each of them, and an image with nobody else's IUV."""


def describe_photo(path: Path) -> Facts:
    """Tell what a photo holds, or an animation. Raises: InputError if it cannot be read."""
    photo = read_photo(path, "picture")
    height, width = photo.rgb.shape[:2]
    facts: Facts = {
        "what": "picture" + (", turned upright as its EXIF says" if photo.turned else ""),
        "size": f"{width} x {height}",
        "alpha": _describe_alpha(photo),
    }
    if photo.profile:
        facts["colours"] = f"converted from {photo.profile} to sRGB"
    if photo.notes:
        facts["note"] = "; ".join(photo.notes)
    if path.suffix.lower() in PHOTO_SUFFIXES and (clip := open_pictures(path)).frame_count > 1:
        facts |= describe_length(clip)
    return facts | _describe_people(photo)


def _describe_alpha(photo: Photo) -> str:
    if photo.alpha is None:
        return "no"
    return "yes" if photo.cutout is not None else "opaque, which tells nothing of the person"


def describe_clip(path: Path) -> Facts:
    """Tell what a video or a folder of pictures holds. Raises: InputError if it cannot be read."""
    pictures = open_pictures(path)
    facts: Facts = {
        "what": "folder of pictures" if path.is_dir() else "video of pictures",
        "size": f"{pictures.width} x {pictures.height}",
        **describe_length(pictures),
    }
    try:
        estimator = _open_estimator(for_photos=False)
    except InputError as error:
        return facts | {"people": f"not looked for: {error}"}
    for index, frame in enumerate(islice(pictures.read(), LOOKED_AT)):
        if found := _look(estimator, frame):
            return facts | {f"people in frame {index}, from the left": _tell(found)}
    count = min(LOOKED_AT, pictures.frame_count)
    return facts | {"people": f"nobody found in the first {count} frames"}


def describe_length(stream: IuvStream | PictureStream) -> Facts:
    """Tell how many frames there are, and how long they take."""
    facts: Facts = {"frames": stream.frame_count}
    if stream.frame_rate:
        seconds = float(stream.frame_count / stream.frame_rate)
        facts["frame rate"] = f"{stream.frame_rate} ({seconds:.2f} s)"
    if stream.notes:
        facts["note"] = "; ".join(stream.notes)
    return facts


def _describe_people(photo: Photo) -> Facts:
    """Tell who is in a photo: by the IUV beside it, or by looking."""
    if (path := find_iuv_of(photo.path)) is not None:
        iuv = read_single_iuv(path, None, "IUV")
        found: Found = []
        if iuv is not None:
            found = [(each.box, isolate(iuv, each)) for each in find_people(iuv).persons]
        return {f"people by {path.name}, from the left": _tell(found)}
    try:
        estimator = _open_estimator(for_photos=True)
    except InputError as error:
        return {"people": f"not looked for: {error}"}
    return {"people, from the left": _tell(_look(estimator, photo.on_white()))}


def _open_estimator(*, for_photos: bool) -> Estimator:
    default = EstimatorOptions()
    return open_estimator(default.estimator, default.estimator_model, for_photos=for_photos)


def _look(estimator: Estimator, frame: UInt8[np.ndarray, "H W 3"]) -> Found:
    return [(person.box, person.iuv) for person in estimator.estimate(frame) if person.pixels]


def _tell(people: Found) -> Facts | str:
    """Tell where people are and what is seen of them, numbered as `--person` counts."""
    told = {}
    for number, (box, iuv) in enumerate(sorted(people, key=lambda one: one[0].left + one[0].right)):
        pixels = np.bincount(iuv[..., 0].ravel(), minlength=PART_COUNT + 1)
        least = LEAST_SHARE * pixels[1:].sum()
        shown = {name: pixels[list(parts)].sum() >= least for name, parts in PART_GROUPS.items()}
        hidden = ", ".join(name for name in shown if not shown[name])
        told[str(number)] = (
            f"{box.height} px high, at {box.left},{box.top},{box.right},{box.bottom};"
            f" {f'no {hidden}' if hidden else 'all parts'} in sight"
        )
    return told or "nobody found"
