"""The source of a run: what its pictures show, merged and unfolded, and garments laid over it."""

from __future__ import annotations

from collections.abc import Sequence

from motion_transfer.drawing.kept_source import load_source
from motion_transfer.drawing.source import Source, SourcePicture, dress, undress, unfold_source
from motion_transfer.errors import InputError
from motion_transfer.events import Listener, ignore
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.render.options import Garment, SourceOptions
from motion_transfer.render.source_pictures import find_person, read_pictures
from nhrr_core.parts import ALL_PARTS

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
    taken = {part for garment in options.garments for part in garment.parts}
    if options.kept is not None:
        people = [undress(load_source(options.kept, size), taken) for size in texture_sizes]
    else:
        kept = tuple(part for part in ALL_PARTS if part not in taken)
        found = read_pictures(options, listener, kept)
        pictures = [entry.picture for entry in found]
        people = [unfold_source(pictures, size, found[0].iuv_path) for size in texture_sizes]
    garments = [
        _read_garment(garment, options.garments[number + 1 :], options)
        for number, garment in enumerate(options.garments)
    ]
    sources = [dress(person, garments) for person in people]
    check_visible(sources[0], options.source_words)
    return sources


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
