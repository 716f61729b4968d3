"""The pictures that show a source's person: photos, folders of photos, and videos.

Every photo that is named counts. Of a folder or a video, which may be long, the pictures are chosen
that add most, in one pass; all but the best one are kept as far as the person reaches in them.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.kept_source import load_picture
from motion_transfer.drawing.moments import Moments
from motion_transfer.drawing.person import (
    COVERS,
    Follower,
    Person,
    bounding_box,
    find_people,
    isolate,
)
from motion_transfer.drawing.source import SourcePicture, read_person
from motion_transfer.drawing.views import rate_texels
from motion_transfer.errors import InputError
from motion_transfer.estimate.interface import PersonEstimate
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.events import FramesDone, Listener, Stage
from motion_transfer.media.iuv.formats import find_iuv_of, list_iuv_names
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import Photo, read_photo
from motion_transfer.media.pictures.stream import PictureStream
from motion_transfer.render.inputs import find_source_iuv, is_clip, list_source_photos
from motion_transfer.render.options import EstimatorOptions, SourceOptions, is_kept
from nhrr_core.parts import ALL_PARTS

ROOM_SHARE = 0.3
"""Of the person's longer side: around them, pictures are looked at no farther than that."""


@dataclass(frozen=True)
class FoundPicture:
    """A picture of a source's person.

    Attributes:
        iuv_path: The file its IUV was read from; None where it was estimated, or is one of a clip.
    """

    picture: SourcePicture
    iuv_path: Path | None = None


def read_pictures(
    options: SourceOptions, listener: Listener, parts: tuple[int, ...] = ALL_PARTS
) -> list[FoundPicture]:
    """Read what shows the person, the picture that leads first.

    Args:
        parts: What is taken of the person.
    Raises: InputError if a file is missing or unfit, sizes differ, or nobody is found.
    """
    found: list[FoundPicture] = []
    for path, iuv in options.sources:
        if is_kept(path):  # the one that led when it was saved
            found.append(FoundPicture(replace(load_picture(path), parts=parts)))
        elif is_clip(path):
            pictures = _read_clip(path, iuv, options, listener)
            found += [FoundPicture(replace(picture, parts=parts)) for picture in pictures]
        else:
            photo = read_photo(path)
            found.append(find_person(photo, iuv, options.person, options, "source", parts))
    return found


def first_picture(source: Path) -> UInt8[np.ndarray, "H W 3"]:
    """Show a photo, or the first picture of a folder, video or kept source. Raises: InputError."""
    if is_kept(source):
        return load_picture(source).photo.on_white()
    if source.is_dir():
        return read_photo(list_source_photos(source)[0]).on_white()
    if not is_clip(source):
        return read_photo(source).on_white()
    picture = next(open_pictures(source).read(), None)
    if picture is None:
        raise InputError(f"{source} holds no pictures")
    return picture


def find_person(
    photo: Photo,
    iuv_path: Path | None,
    choice: str,
    options: SourceOptions,
    what: str,
    parts: tuple[int, ...],
) -> FoundPicture:
    """Find the chosen person of a photo: by its IUV, or by looking at it.

    Args:
        iuv_path: As it was named; None: it is looked for beside the photo.
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: The photo's role, for messages.
    Raises: InputError.
    """
    iuv_path = iuv_path or find_iuv_of(photo.path)
    if iuv_path is not None:
        iuv = read_person(photo, iuv_path, choice, options.source_iuv_order, what)
        return FoundPicture(SourcePicture(photo, iuv, parts=parts), iuv_path)
    person = estimate_person(photo, choice, options, what)
    return FoundPicture(show_estimate(photo, person, parts))


def estimate_person(
    photo: Photo, choice: str, options: EstimatorOptions, what: str
) -> PersonEstimate:
    """Find one person in a photo that comes without IUV.

    Args:
        choice: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        what: The photo's role, for messages.
    Raises: InputError if nobody is found, or what it takes to look is missing.
    """
    lacking = f"{photo.path} comes without IUV"
    if photo.path.exists():
        names = " nor ".join(path.name for path in list_iuv_names(photo.path))
        lacking = f"no IUV found for {photo.path} (neither {names} is beside it)"
    try:
        estimator = open_estimator(options.estimator, options.estimator_model, for_photos=True)
    except InputError as error:
        raise InputError(f"{lacking}, and to estimate it: {error}") from error
    people = estimator.estimate(photo.on_white())
    chosen = Follower[PersonEstimate](choice).pick(people, f"{what} {photo.path}")
    if not chosen:
        raise InputError(
            f"{lacking}, and nobody was found in it; give a photo that shows a person, or make its"
            " IUV with DensePose and name it"
        )
    return chosen[0]


def show_estimate(
    photo: Photo, person: PersonEstimate, parts: tuple[int, ...] = ALL_PARTS
) -> SourcePicture:
    """Take a photo with what an estimator found in it."""
    iuv, alpha = person.on_frame(*photo.rgb.shape[:2])
    if photo.alpha is not None:
        alpha = np.minimum(alpha, photo.alpha)
    return SourcePicture(photo, iuv * (alpha >= COVERS)[..., None], alpha, parts)


def _read_clip(
    path: Path, iuv: Path | None, options: SourceOptions, listener: Listener
) -> list[SourcePicture]:
    """Choose the pictures of a folder or a video that show most. Raises: InputError."""
    if not path.exists():
        raise InputError(f"source {path} does not exist")
    iuv = iuv or find_source_iuv(path)
    if path.is_dir() and iuv is None:
        seen = _each_photo(path, options, listener)
    else:
        pictures = open_pictures(path)
        listener(Stage("look", pictures.frame_count))
        seen = _watch(pictures, options) if iuv is None else _read_along(pictures, iuv, options)
    moments = Moments[tuple[int, SourcePicture]]()
    leader, most = (-1, None), 0.0
    with closing(seen):
        for index, picture in enumerate(seen):
            listener(FramesDone(1))
            if picture is None:
                continue
            rating = rate_texels(picture.photo.rgb, picture.iuv)
            if (total := float(rating.sum())) > most:
                leader, most = (index, picture), total
            moments.offer(rating, (index, _cut(picture)))
    if leader[1] is None:
        raise InputError(
            f"nobody was found in source {path}; it should show a person, upright and larger than"
            " about 60 pixels"
        )
    return [leader[1], *(picture for index, picture in moments.chosen() if index != leader[0])]


def _each_photo(
    folder: Path, options: SourceOptions, listener: Listener
) -> Generator[SourcePicture | None, None, None]:
    """The photos of a folder, each with its own IUV, or looked at by itself."""
    photos = list_source_photos(folder)
    listener(Stage("look", len(photos)))
    for photo in photos:
        yield find_person(
            read_photo(photo), None, options.person, options, "source", ALL_PARTS
        ).picture


def _watch(
    pictures: PictureStream, options: SourceOptions
) -> Generator[SourcePicture | None, None, None]:
    """The frames of a video, in which the person is looked for."""
    from motion_transfer.estimate.clip import follow_people

    estimator = open_estimator(
        options.estimator, options.estimator_model, frame_rate=pictures.frame_rate
    )
    chosen = range(pictures.frame_count)
    with closing(follow_people(pictures, estimator, options.person, chosen)) as frames:
        for seen in frames:
            photo = Photo(pictures.path, seen.picture, None, turned=False, notes=pictures.notes)
            yield show_estimate(photo, seen.people[0]) if seen.people else None


def _read_along(
    pictures: PictureStream, iuv: Path, options: SourceOptions
) -> Generator[SourcePicture | None, None, None]:
    """The frames of a clip with their IUV. Raises: InputError if the two do not fit."""
    reader = open_reader(open_stream(iuv), options.source_iuv_order)
    count, size = reader.stream.frame_count, (reader.height, reader.width)
    if (count, *size) != (pictures.frame_count, pictures.height, pictures.width):
        raise InputError(
            f"source IUV {iuv} has {count} frames of {size[1]} x {size[0]}, but {pictures.path} has"
            f" {pictures.frame_count} of {pictures.width} x {pictures.height}; make it from this"
            " very clip"
        )
    follower = Follower[Person](options.person)
    for index, (rgb, body) in enumerate(zip(pictures.read(), reader.read(0, count), strict=True)):
        people = find_people(body)
        chosen = follower.pick(people.persons, pictures.where(index))
        photo = Photo(pictures.path, rgb, None, turned=False, notes=pictures.notes)
        if chosen and not people.shows_only(chosen[0]):
            body = isolate(body, chosen[0])
        yield SourcePicture(photo, body) if chosen else None


def _cut(picture: SourcePicture) -> SourcePicture:
    """Keep of a picture what lies around its person: a video's frames may be large."""
    box = bounding_box(picture.iuv)
    near = box.grown(round(max(box.width, box.height) * ROOM_SHARE)).slices

    def part(image: UInt8[np.ndarray, "H W *C"]) -> UInt8[np.ndarray, "h w *C"]:
        return image[near].copy()

    photo, alpha = picture.photo, picture.alpha
    return replace(
        picture,
        photo=replace(
            photo, rgb=part(photo.rgb), alpha=None if photo.alpha is None else part(photo.alpha)
        ),
        iuv=part(picture.iuv),
        alpha=None if alpha is None else part(alpha),
    )
