"""Drivers that are raw pictures: their IUV is found once, and kept as a lossless video.

The engine then reads that video as any other driver: in chunks, in parallel, again after a crash.
"""

from __future__ import annotations

import json
import uuid
from contextlib import closing
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from motion_transfer.estimate.clip import ClipSummary, estimate_clip
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_writing import IuvFormat, write_iuv
from motion_transfer.media.picture_stream import open_pictures
from motion_transfer.media.publish import publish
from motion_transfer.media.work import digest_of
from motion_transfer.render.body_match import match_body
from motion_transfer.render.content import driver_key
from motion_transfer.render.events import FramesDone, Listener, Notice, Stage
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.plan import frame_range

ORDER: ChannelOrder = "iuv"


@dataclass(frozen=True)
class PictureDriver:
    """The IUV of one person in a clip, fitted to a source's proportions if that was asked for.

    Attributes:
        iuv: the lossless video; as long as the clip, or as its used beginning.
        digest: of that file; hexadecimal.
        key: of the content it was made from.
        frame_rate: the clip's own, if it has one.
        start_seconds: where the first frame stands on the clock of the clip's sound.
        cuts: the frames with which shots begin.
        notes: what the user should know of how the clip was read.
    """

    iuv: Path
    digest: str
    key: str
    frame_rate: Fraction | None
    start_seconds: Fraction
    cuts: tuple[int, ...]
    notes: tuple[str, ...]


def estimate_driver(options: RenderOptions, folder: Path, listener: Listener) -> PictureDriver:
    """The IUV of a driver's person, from an earlier run if its content is the same.

    Args:
        folder: where the result is kept.
    Raises: InputError if nobody is found, or what it takes to look is missing.
    """
    key = driver_key(options)
    iuv = folder / f"driver-{key[:16]}.mkv"
    facts = iuv.with_suffix(".json")
    driver = _read(iuv, facts, key)
    if driver is None:
        driver = _make(options, iuv, key, listener)
        _write(driver, facts)
    for note in driver.notes:
        listener(Notice(note))
    return driver


def _make(options: RenderOptions, iuv: Path, key: str, listener: Listener) -> PictureDriver:
    pictures = open_pictures(options.driver)
    chosen = frame_range(options.frames, pictures.frame_count, str(options.driver))
    fit = match_body(options, pictures, chosen, listener) if options.fit_body else None
    estimator = open_estimator(
        options.estimator, options.estimator_model, frame_rate=pictures.frame_rate, fit=fit
    )
    listener(Stage("estimate", chosen.stop))
    summary = ClipSummary()
    frames = estimate_clip(
        pictures, estimator, person=options.driver_person, chosen=chosen, summary=summary
    )
    written = _temporary(iuv)
    iuv.parent.mkdir(parents=True, exist_ok=True)
    settings = IuvFormat(
        frame_count=chosen.stop, height=pictures.height, width=pictures.width, order=ORDER
    )
    with closing(frames):
        write_iuv(frames, written, settings, lambda count: listener(FramesDone(count)))
    digest = digest_of(written)
    publish(written, iuv)
    return PictureDriver(
        iuv,
        digest,
        key,
        pictures.frame_rate,
        pictures.start_seconds,
        tuple(summary.shots),
        pictures.notes,
    )


def _read(iuv: Path, facts: Path, key: str) -> PictureDriver | None:
    """What an earlier run made of the same content, if it is there and whole."""
    try:
        told: dict[str, Any] = json.loads(facts.read_text())
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
    written.write_text(json.dumps(told))
    publish(written, facts)


def _temporary(path: Path) -> Path:
    """A name that a killed run may leave behind: a work folder sweeps it away."""
    return path.with_name(f"{path.stem}.part-{uuid.uuid4().hex[:8]}{path.suffix}")
