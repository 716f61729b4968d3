"""Drivers that are raw pictures: their IUV is found once, and kept as a lossless video.

The engine then reads that video as any other driver: in chunks, in parallel, again after a crash.
With `--fit-body` the driver's body gets the source's proportions on the way; with `--azimuth` a
body that is fitted to the clip is drawn instead, as another camera sees it.
"""

from __future__ import annotations

import json
import logging
import shutil
import uuid
from collections.abc import Generator
from contextlib import closing
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.kept_source import load_picture
from motion_transfer.drawing.person import Follower, bounding_box
from motion_transfer.drawing.source import read_person
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.retarget import (
    BodyFit,
    compare_proportions,
    measure_proportions,
)
from motion_transfer.estimate.clip import ClipSummary, estimate_clip, follow_landmarks
from motion_transfer.estimate.interface import Landmarks, PersonEstimate
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.events import FramesDone, Listener, Notice, Stage
from motion_transfer.media.iuv.formats import ChannelOrder, find_iuv_of
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.media.pictures.stream import PictureStream
from motion_transfer.media.publish import publish
from motion_transfer.media.unchanged import Inputs
from motion_transfer.media.work import digest_of
from motion_transfer.option import frame_range
from motion_transfer.render.content import driver_key
from motion_transfer.render.inputs import is_clip
from motion_transfer.render.options import InputOptions, SourceOptions, is_kept
from motion_transfer.render.plan import list_stretches

if TYPE_CHECKING:
    from motion_transfer.tracking import Track

ORDER: ChannelOrder = "iuv"
"""Of the channels of the video that is kept."""

log = logging.getLogger(__name__)


MEASURED_FRAMES = 60
"""Of the driver: the first ones that show its person. Two seconds hold several poses; a single
picture says a bone's length to no better than a tenth."""


@dataclass(frozen=True)
class PictureDriver:
    """The IUV of one person in a clip, fitted to a source's proportions if that was asked for.

    Attributes:
        iuv: The lossless video; as long as the clip, or as its used beginning.
        digest: SHA-256 of that file, hexadecimal.
        key: Of the content that it was made from.
        frame_rate: The clip's own, if it has one.
        start_seconds: Where the first frame stands on the clock of the clip's sound.
        cuts: The frames with which shots begin.
        notes: What the user should know of how the clip was read.
    """

    iuv: Path
    digest: str
    key: str
    frame_rate: Fraction | None
    start_seconds: Fraction
    cuts: tuple[int, ...]
    notes: tuple[str, ...]


def estimate_driver(
    options: InputOptions, folder: Path, listener: Listener, inputs: Inputs
) -> PictureDriver:
    """Find the IUV of a driver's person, or take that of an earlier run of the same content.

    Args:
        folder: Where the result is kept.
        inputs: What it is found in; noted, and not yet read.
    Raises: InputError if nobody is found, what it takes to look is missing, or the inputs change
        meanwhile: what is kept is made from what its key says.
    """
    key = driver_key(options)
    iuv, facts = _names(folder, key)
    driver = _read(iuv, facts, key)
    if driver is None:
        driver = _make(options, iuv, key, listener, inputs)
        _write(driver, facts)
    else:
        log.debug("IUV of %s is there from an earlier run: %s", options.driver, iuv)
    for note in driver.notes:
        listener(Notice(note))
    return driver


def take_over(options: InputOptions, kept: Path, folder: Path) -> PictureDriver | None:
    """Copy what was found in a driver's pictures before, and is kept elsewhere.

    Returns: The copy; None if nothing is kept of this content.
    Raises: InputError if there is no such driver.
    """
    key = driver_key(options)
    iuv, facts = _names(kept, key)
    driver = _read(iuv, facts, key)
    if driver is None:
        return None
    for file in (iuv, facts):  # half a copy is known by its digest, and made again
        shutil.copyfile(file, folder / file.name)
    return replace(driver, iuv=folder / iuv.name)


def _names(folder: Path, key: str) -> tuple[Path, Path]:
    """Name the video that is kept, and the file with what else is known."""
    iuv = folder / f"driver-{key[:16]}.mkv"
    return iuv, iuv.with_suffix(".json")


def _make(
    options: InputOptions, iuv: Path, key: str, listener: Listener, inputs: Inputs
) -> PictureDriver:
    pictures = open_pictures(options.driver)
    chosen = frame_range(options.frames, pictures.frame_count, str(options.driver))
    look = _estimate if options.azimuth is None else _fit_moving_body
    frames, found = look(options, pictures, chosen, listener)
    written = _temporary(iuv)
    iuv.parent.mkdir(parents=True, exist_ok=True)
    settings = IuvOutput(
        frame_count=chosen.stop, height=pictures.height, width=pictures.width, order=ORDER
    )
    with closing(frames):
        guarded = inputs.guard(frames)
        write_iuv(guarded, written, settings, lambda count: listener(FramesDone(count)))
    digest = digest_of(written)
    publish(written, iuv)
    return PictureDriver(
        iuv,
        digest,
        key,
        pictures.frame_rate,
        pictures.start_seconds,
        tuple(found.cuts),
        (*pictures.notes, *found.notes),
    )


@dataclass
class _Found:
    """What is known of a clip when its frames are drawn: cuts, and what the user should know."""

    cuts: list[int] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


Frames = Generator[UInt8[np.ndarray, "H W 3"], None, None]


def _estimate(
    options: InputOptions, pictures: PictureStream, chosen: range, listener: Listener
) -> tuple[Frames, _Found]:
    """Find the person's IUV frame by frame."""
    fit = _match_body(options, pictures, chosen, listener) if options.fit_body else None
    estimator = open_estimator(
        options.estimator, options.estimator_model, frame_rate=pictures.frame_rate, fit=fit
    )
    listener(Stage("estimate", chosen.stop))
    summary = ClipSummary()
    frames = estimate_clip(
        pictures, estimator, person=options.driver_person, chosen=chosen, summary=summary
    )
    return frames, _Found(summary.shots)


def _fit_moving_body(
    options: InputOptions, pictures: PictureStream, chosen: range, listener: Listener
) -> tuple[Frames, _Found]:
    """Fit a body to the person's motion, and draw it from elsewhere; nobody before what is chosen.

    Raises: InputError without the extra, if nobody is found, or in a frame where `--missing fail`
        wants somebody.
    """
    assert options.azimuth is not None
    from motion_transfer.people import FIRST_USE, is_cached
    from motion_transfer.tracking import track_clip  # with the extra alone

    if not is_cached():
        listener(Notice(FIRST_USE))  # now: what follows takes minutes
    estimator = open_estimator(options.estimator, None, frame_rate=pictures.frame_rate)
    listener(Stage("track", chosen.stop))
    track = track_clip(
        pictures,
        estimator,
        person=options.driver_person,
        chosen=chosen,
        done=lambda count: listener(FramesDone(count)),
    )
    unseen = [(start + chosen.start, stop + chosen.start) for start, stop in track.unseen]
    notes = []
    if unseen:
        where = list_stretches(unseen, 0, track.frame_rate)
        if options.missing == "fail":
            raise InputError(
                f"{options.driver}: nobody found in {where}; cut the clip there, or choose another"
                " --missing"
            )
        notes = [f"nobody found in {where}; filled in between what is before and after"]
    listener(Stage("draw", chosen.stop))
    cuts = [shot.frames.start + chosen.start for shot in track.shots]
    return _after_nobody(track, options.azimuth, chosen.start), _Found(cuts, notes)


def _after_nobody(track: Track, azimuth: float, empty: int) -> Frames:
    first = track.shots[0].camera
    for _ in range(empty):
        yield np.zeros((first.height, first.width, 3), np.uint8)
    yield from track.seen_from(azimuth)


def _match_body(
    options: InputOptions, pictures: PictureStream, chosen: range, listener: Listener
) -> BodyFit:
    """Find what brings the driver's person to the source's proportions, once for the whole clip.

    It is measured before the clip is estimated: the first frames are fitted as the last are.
    Raises: InputError if either shows nobody, or they show too little in common.
    """
    source = measure_proportions([_source_landmarks(options)])
    estimator = open_estimator(
        options.estimator, options.estimator_model, frame_rate=pictures.frame_rate
    )
    listener(Stage("compare", min(MEASURED_FRAMES, len(chosen))))
    seen = follow_landmarks(
        pictures,
        estimator,
        person=options.driver_person,
        chosen=chosen,
        count=MEASURED_FRAMES,
        done=lambda count: listener(FramesDone(count)),
    )
    return compare_proportions(source, measure_proportions(seen))


def _source_landmarks(options: SourceOptions) -> Landmarks:
    """Find the landmarks of the first source's person, also where its IUV says who that is."""
    path, iuv_path = options.sources[0]
    if is_clip(path):
        raise InputError(
            f"--fit-body measures a photo, and the source {path} is a folder or a video; name a"
            " photo first, or leave out --fit-body"
        )
    choice = options.person
    if is_kept(path):
        kept = load_picture(path)
        photo, iuv = kept.photo, kept.iuv
    else:
        photo = read_photo(path)
        iuv_path = iuv_path or find_iuv_of(path)
        order = options.source_iuv_order
        iuv = read_person(photo, iuv_path, choice, order, "source") if iuv_path else None
    if iuv is not None:
        box = bounding_box(iuv)
        if box.area:
            choice = f"{box.left},{box.top},{box.right},{box.bottom}"
    estimator = open_estimator(options.estimator, options.estimator_model)
    people = estimator.estimate(photo.on_white())
    chosen = Follower[PersonEstimate](choice).pick(people, f"source {path}")
    if not chosen or chosen[0].landmarks is None:
        raise InputError(
            f"--fit-body: no landmarks of a person were found in the source {path}; give"
            " a photo that shows one, or leave out --fit-body"
        )
    return chosen[0].landmarks


def _read(iuv: Path, facts: Path, key: str) -> PictureDriver | None:
    """Read what an earlier run made of the same content, if it is there and whole."""
    try:
        told: dict[str, Any] = json.loads(facts.read_text(encoding="utf-8"))
        if told["key"] != key or digest_of(iuv) != told["digest"]:
            return None
        rate = told["frame_rate"]
        return PictureDriver(
            iuv,
            told["digest"],
            key,
            rate and Fraction(rate),
            Fraction(told["start_seconds"]),
            tuple(told["cuts"]),
            tuple(told["notes"]),
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(driver: PictureDriver, facts: Path) -> None:
    told = {name: value for name, value in asdict(driver).items() if name != "iuv"}
    for name in ("frame_rate", "start_seconds"):
        told[name] = None if told[name] is None else str(told[name])
    written = _temporary(facts)
    written.write_text(json.dumps(told), encoding="utf-8")
    publish(written, facts)


def _temporary(path: Path) -> Path:
    """Make a name that a killed run may leave behind: a work folder sweeps it away."""
    return path.with_name(f"{path.stem}.part-{uuid.uuid4().hex[:8]}{path.suffix}")
