"""A driver as a run sees it: opened once whatever it is, and looked through once."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.person import People, find_people, take_as_one
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Listener, Notice, Stage
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.folders import list_gaps
from motion_transfer.media.iuv.blends import look_for_blends
from motion_transfer.media.iuv.formats import ChannelOrder, Missing, names_file
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.unchanged import Inputs
from motion_transfer.option import frame_range
from motion_transfer.people import is_motion
from motion_transfer.render.crew import Crew, result_of
from motion_transfer.render.inputs import motion_files
from motion_transfer.render.options import InputOptions
from motion_transfer.render.plan import (
    CHUNK_FRAMES,
    SeenFrame,
    look_through,
    scan_people,
)
from motion_transfer.render.workers import WARM

if TYPE_CHECKING:
    from motion_transfer.render.picture_driver import PictureDriver

log = logging.getLogger(__name__)


class DriverIuv(Protocol):
    """A driver's IUV, wherever it is; equal ones are opened once."""

    def open(self) -> IuvReader:
        """Open it. Raises: InputError if it is gone, IuvFileError if it is not IUV."""
        ...


@dataclass(frozen=True)
class DriverFile:
    """A driver's IUV in a file, which any process can open for itself.

    Attributes:
        missing: What a number missing from a folder does.
    """

    path: Path
    missing: Missing
    order: ChannelOrder

    def open(self) -> IuvReader:
        return open_reader(open_stream(self.path, missing=self.missing), self.order)


@dataclass(frozen=True)
class Driver:
    """A driver that was opened.

    Attributes:
        path: What the options name.
        reader: Of its IUV.
        frame_rate: Its own, if it has one.
        inputs: What it is read from.
        pictures: What was made of it, if it is raw pictures.
    """

    path: Path
    file: DriverIuv
    reader: IuvReader
    frame_rate: Fraction | None
    inputs: Inputs
    pictures: PictureDriver | None = None

    @property
    def frame_count(self) -> int:
        return self.reader.stream.frame_count

    def people_in(self, iuv: UInt8[np.ndarray, "H W 3"]) -> People:
        """Find everybody in a frame; of raw pictures one person is left, in however many pieces."""
        return take_as_one(iuv) if self.pictures else find_people(iuv)

    def where(self, index: int) -> str:
        """Name a frame, for messages."""
        if self.pictures:  # not the video that is kept of it
            return f"frame {index} of {self.path}"
        return self.reader.stream.where(index)

    def scan_of(self, chosen: range, seen: list[SeenFrame]) -> DriverScan:
        """Sum up what was seen in the chosen frames, one entry for each."""
        found = next((i for i, frame in enumerate(seen) if frame.people.persons), 0)
        return DriverScan(
            path=self.path,
            file=self.file,
            height=self.reader.height,
            width=self.reader.width,
            frame_rate=self.frame_rate,
            start_seconds=(self.pictures or self.reader.stream).start_seconds,
            chosen=chosen,
            seen=seen,
            where_first=self.where(chosen.start),
            where_found=self.where(chosen.start + found),
            inputs=self.inputs,
            pictures=self.pictures,
        )


@dataclass(frozen=True)
class DriverScan:
    """What one look through a driver tells, which any number of runs may share.

    Attributes:
        path: What the options name.
        chosen: The frames that were looked at, `seen` one for each.
        frame_rate: The driver's own, if it has one.
        start_seconds: When its first frame is shown, on the clock of its sound.
        where_first, where_found: The first of the frames, and the first of them with somebody (if
            there is one), for messages.
        inputs: What the driver is read from.
        pictures: What was made of the driver, if it is raw pictures.
    """

    path: Path
    file: DriverIuv
    height: int
    width: int
    frame_rate: Fraction | None
    start_seconds: Fraction
    chosen: range
    seen: list[SeenFrame]
    where_first: str
    where_found: str
    inputs: Inputs
    pictures: PictureDriver | None = None


def open_driver(options: InputOptions, folder: Path, listener: Listener) -> Driver:
    """Open a driver; if it is raw pictures, find their IUV first, which takes a while.

    Args:
        folder: Where the IUV of pictures is kept.
    Raises: InputError if there is no such driver, it cannot be told what it is, or an option does
        not go with it.
    """
    inputs = Inputs(motion_files(options))
    if are_pictures(options):
        # what estimates takes long to load, and a driver that is IUV needs none of it
        from motion_transfer.render.picture_driver import ORDER, estimate_driver

        pictures = estimate_driver(options, folder, listener, inputs)
        file = DriverFile(pictures.iuv, "fail", ORDER)
        return Driver(options.driver, file, file.open(), pictures.frame_rate, inputs, pictures)
    if options.azimuth is not None:
        advice = (
            f"write {options.driver},azimuth={options.azimuth:g}"
            if is_motion(options.driver)
            else "give the video or pictures that it was made from"
        )
        raise InputError(
            f"--azimuth fits a body to pictures, and {options.driver} is none; {advice}, or leave"
            " out --azimuth"
        )
    if options.fit_body:
        raise InputError(
            f"--fit-body compares landmarks, and IUV as in the driver {options.driver} has none;"
            " give the video or pictures that it was made from, or leave out --fit-body"
        )
    if is_motion(options.driver):
        from motion_transfer.people import FIRST_USE, is_cached

        if not is_cached():
            listener(Notice(FIRST_USE))  # now: what follows takes minutes
    missing = options.missing or "fail"
    stream = open_stream(options.driver, missing=missing)
    if stream.gaps:
        filled = "shows nobody" if missing == "background" else "repeats the frame before it"
        listener(Notice(f"{list_gaps(stream.gaps)}; each {filled}"))
    for note in stream.notes:
        listener(Notice(note))
    reader = open_reader(stream, options.iuv_order)
    file = DriverFile(options.driver, missing, reader.order)
    return Driver(options.driver, file, reader, stream.frame_rate, inputs)


def scan_driver(
    options: InputOptions,
    folder: Path,
    listener: Listener,
    *,
    workers: int,
    crew: Crew | None = None,
) -> DriverScan:
    """Open a driver and decode its chosen frames once.

    Args:
        folder: Where the IUV of pictures is kept.
        workers: Threads that decode.
        crew: Processes that take it off them as they begin.
    Raises: InputError, also for a driver that changes meanwhile; IuvFileError naming the frame that
        is broken.
    """
    began = time.perf_counter()
    driver = open_driver(options, folder, listener)
    log.debug("opened driver %s in %.2f s", options.driver, time.perf_counter() - began)
    chosen = frame_range(options.frames, driver.frame_count, str(options.driver))
    if not driver.pictures and names_file(options.driver):  # what is drawn here is not blended
        blends = look_for_blends(driver.reader, chosen)
        if warning := blends.warn(f"driver {options.driver}"):
            listener(Notice(warning))
    listener(Stage("scan", len(chosen)))
    crew = crew or Crew()
    crew.begin(min(workers, -(-len(chosen) // CHUNK_FRAMES)), len(chosen))

    def elsewhere(block: range) -> list[SeenFrame] | None:
        looking = crew.offer(_look, driver.file, block, driver.pictures is not None)
        return looking and result_of(looking)

    seen = scan_people(
        driver.reader,
        chosen,
        workers,
        lambda count: listener(FramesDone(count)),
        find=driver.people_in,
        elsewhere=elsewhere,
    )
    driver.inputs.check()
    log.debug("looked through %d frames, %.2f s in all", len(chosen), time.perf_counter() - began)
    return driver.scan_of(chosen, seen)


def _look(file: DriverIuv, frames: range, as_one: bool) -> list[SeenFrame]:
    """Look through a stretch of a driver in another process, see `Driver.people_in`."""
    reader = WARM.get(f"reader {file}", file.open)
    return look_through(reader, frames, take_as_one if as_one else find_people)


def are_pictures(options: InputOptions) -> bool:
    """Tell whether a driver is raw pictures. Raises: InputError if that cannot be told."""
    if not names_file(options.driver):
        return False
    if not options.driver.exists():
        raise InputError(f"driver {options.driver} does not exist")
    return (options.driver_kind or tell_kind(options.driver)) == "pictures"
