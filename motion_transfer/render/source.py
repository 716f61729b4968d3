"""The source of a run: what its pictures show, merged and unfolded, and garments laid over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from motion_transfer.drawing.kept_source import load_source
from motion_transfer.drawing.source import (
    Source,
    SourcePicture,
    dress,
    read_person,
    undress,
    unfold_source,
)
from motion_transfer.drawing.textures import pick_nearest
from motion_transfer.errors import InputError
from motion_transfer.events import Listener, ignore
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.render.options import Garment, Legs, SourceOptions
from motion_transfer.render.source_pictures import find_person, read_pictures
from nhrr_core import load_uv_tables
from nhrr_core.parts import ALL_PARTS, PART_GROUPS

JEANS = Path(str(files("motion_transfer.render"))) / "jeans"

LEG_PARTS = (*PART_GROUPS["upper-legs"], *PART_GROUPS["lower-legs"])
SMALLEST_LEG_SHARE = 0.015
"""Of the legs' texels: from less, which is a hand's breadth of trousers, the network does not tell
that they are trousers. Cut at mid-thigh, a photo shows 0.05, a whole person 0.1 to 0.2."""

SMALLEST_VISIBLE_SHARE = 0.01  # of the texels; a frontal half-length portrait shows about 0.2


def check_photos(options: SourceOptions) -> None:
    """Raise InputError if a photo is missing."""
    photos = [("source", source) for source in options.source]
    photos += [("garment", garment.photo) for garment in options.garments]
    for what, photo in photos:
        if not photo.exists():
            raise InputError(f"{what} {photo} does not exist")


def read_source(options: SourceOptions, texture_size: int, listener: Listener = ignore) -> Source:
    """Read the source, and garments, and unfold what they show, unless it was kept unfolded.

    Args:
        texture_size: Side of the partial texture, which the renderer decides, in texels.
        listener: Told how far it is, where a source has many pictures.
    Raises: InputError if a file is missing or unfit, sizes differ, nobody or too little is seen,
        or a garment photo shows none of its parts.
    """
    return read_sources(options, [texture_size], listener)[0]


def read_sources(
    options: SourceOptions, texture_sizes: Sequence[int], listener: Listener = ignore
) -> list[Source]:
    """Read one source for several sizes of texture, see `read_source`; pictures are read once."""
    taken = options.redressed
    if options.kept is not None:
        people = [load_source(options.kept, size) for size in texture_sizes]
    else:
        kept = tuple(part for part in ALL_PARTS if part not in taken)
        found = read_pictures(options, listener, kept)
        pictures = [entry.picture for entry in found]
        people = [unfold_source(pictures, size, found[0].iuv_path) for size in texture_sizes]
    people = [undress(person, taken) for person in people]
    garments = [
        _read_garment(garment, options.garments[number + 1 :], options)
        for number, garment in enumerate(options.garments)
    ]
    sources = [dress(person, garments) for person in people]
    check_visible(sources[0], options.source_words)
    return clothe_legs(sources, options.unseen_legs)


def clothe_legs(sources: Sequence[Source], legs: Legs) -> list[Source]:
    """Lay jeans and shoes over legs that a person does not show, if that is asked for.

    FeatureNet's own guess is the mean of all that could be there, which nobody wears.

    Args:
        sources: One person, for several sizes of texture; the first says what they show.
    """
    if legs == "guess":
        return list(sources)
    first = sources[0]
    on_legs = np.isin(load_uv_tables().part, LEG_PARTS)
    seen = first.visibility[0][pick_nearest(on_legs, first.visibility.shape[-1])]
    if seen.mean() >= SMALLEST_LEG_SHARE:
        return list(sources)
    jeans = _read_jeans()
    note = (
        f"{first.photo.path} shows no legs: they wear jeans; --garment takes clothes from another"
        " photo, --unseen-legs guess leaves them to the network"
    )
    dressed = [dress(undress(source, jeans[0].parts), jeans) for source in sources]
    return [replace(source, notes=(*source.notes, note)) for source in dressed]


@cache
def _read_jeans() -> list[SourcePicture]:
    """Legs of a synthetic person, front and back; `tools/build_jeans.py` made them."""
    found = []
    for name in ("back", "front"):  # the front wins where both show a flank
        photo = read_photo(JEANS / f"{name}.png")
        iuv = read_person(photo, JEANS / f"{name}_IUV.png", "largest", None, "jeans")
        found.append(SourcePicture(photo, iuv, parts=(*LEG_PARTS, *PART_GROUPS["feet"])))
    return found


def check_visible(source: Source, name: str) -> None:
    """Raise InputError, naming the source, if it shows hardly anything of the body."""
    share = float(source.visibility.mean())
    if share < SMALLEST_VISIBLE_SHARE:
        raise InputError(
            f"source {name} shows too little of the body ({share:.1%} of the texture); use a larger"
            " photo, or choose another --person"
        )


def _read_garment(
    garment: Garment, later: tuple[Garment, ...], options: SourceOptions
) -> SourcePicture:
    photo = read_photo(garment.photo, "garment")
    covered = {part for other in later for part in other.parts}
    parts = tuple(part for part in garment.parts if part not in covered)
    return find_person(photo, garment.iuv, "largest", options, "garment", parts).picture
