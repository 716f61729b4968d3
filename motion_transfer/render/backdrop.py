"""What is behind the people of an output, frame by frame: one picture, a video, or the driver.

A backdrop goes to whatever process draws, and is opened there; memory does not grow with its
length.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import islice, repeat
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.backgrounds import (
    Frame,
    blur_picture,
    fill_from_around,
    fit_picture,
    person_area,
)
from motion_transfer.drawing.light import Light, measure_light
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Listener, Notice, Stage
from motion_transfer.media.files import check_readable
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import read_photo, write_png
from motion_transfer.media.pictures.playing import Player
from motion_transfer.media.pictures.stream import PictureStream
from motion_transfer.media.publish import publish
from motion_transfer.media.unchanged import status_key
from motion_transfer.media.work import key_of
from motion_transfer.option import SCENES
from motion_transfer.render.driver import DriverIuv, DriverScan
from motion_transfer.render.options.scene import SceneOptions
from motion_transfer.render.plan import DriverPlan

KEPT_CLIPS = 4  # that are open
LIGHT_FRAMES = 8  # of a video, evenly spread: its light is theirs
PLATE_FRAMES = 200  # of a shot, evenly spread: who moves has been elsewhere in most of them
MOVING_CAMERA = 14.0
"""Levels; the median over the frame of each pixel's deviation. Noise and light leave it below 5."""

FEATHER = 0.004  # of the frame's height: over so much a filled place goes over into its picture


class OpenBackdrop(Protocol):
    """A backdrop that can be read, by several threads."""

    def read(self, start: int, stop: int) -> Iterator[Frame | None]:
        """Give what is behind output frames start..stop-1, not to be written to.

        Returns: RGB of the canvas' height and width; None where nothing is behind.
        Raises: InputError naming the frame that cannot be read.
        """
        ...


class Backdrop(Protocol):
    """What is behind the people of an output; it can be pickled."""

    def open(self) -> OpenBackdrop: ...


@dataclass(frozen=True, eq=False)
class Still:
    """The same picture behind every frame, or nothing."""

    picture: Frame | None

    def open(self) -> Still:
        return self

    def read(self, start: int, stop: int) -> Iterator[Frame | None]:
        yield from repeat(self.picture, stop - start)


@dataclass(frozen=True)
class Clip:
    """A video behind, or several pictures of one file or folder.

    Attributes:
        size: (height, width) of the canvas, px.
        rate: Of the output, frames per second.
        fit, end, blur: As options have them.
    """

    path: Path
    size: tuple[int, int]
    rate: Fraction
    fit: str
    end: str
    blur: float

    def open(self) -> OpenBackdrop:
        return _PlayedClip(self)


class _PlayedClip:
    def __init__(self, clip: Clip) -> None:
        self._clip = clip
        pictures = open_background(clip.path)
        self._count, self._rate = pictures.frame_count, pictures.frame_rate or clip.rate
        self._player = Player(pictures)

    def read(self, start: int, stop: int) -> Iterator[Frame]:
        numbers = [self._number(index) for index in range(start, stop)]
        shown, frame = None, None
        for picture in self._player.read(numbers):
            if picture is not shown or frame is None:  # a slower video repeats its pictures
                shown, frame = picture, self._fit(picture)
            yield frame

    def _number(self, index: int) -> int:
        """Tell which picture is on the screen in the middle of an output frame's time."""
        number = int((index + Fraction(1, 2)) / self._clip.rate * self._rate)
        return number % self._count if self._clip.end == "loop" else min(number, self._count - 1)

    def _fit(self, picture: Frame) -> Frame:
        return blur_picture(fit_picture(picture, self._clip.size, self._clip.fit), self._clip.blur)


@dataclass(frozen=True)
class DriverPictures:
    """The driver's own pictures, without the people who are replaced.

    Attributes:
        people: The IUV of each of them, frame by frame.
        first: The driver's frame behind output frame 0.
        plates: For each shot its first output frame, and a file with what its frames together show
            where somebody stands in one of them; None: too little is known, and the place is
            filled from around.
    """

    path: Path
    people: tuple[DriverIuv, ...]
    first: int
    plates: tuple[tuple[int, Path | None], ...]
    size: tuple[int, int]
    fit: str
    blur: float

    def open(self) -> OpenBackdrop:
        return _OpenDriver(self)


class _OpenDriver:
    def __init__(self, backdrop: DriverPictures) -> None:
        self._backdrop = backdrop
        self._player = Player(open_pictures(backdrop.path))
        self._people = [file.open() for file in backdrop.people]

    def read(self, start: int, stop: int) -> Iterator[Frame]:
        backdrop = self._backdrop
        frames = range(backdrop.first + start, backdrop.first + stop)
        plates = self._plates(start, stop)
        for (picture, area), plate in zip(self.look(frames), plates, strict=True):
            emptied = _take_out(picture, area, plate)
            yield blur_picture(fit_picture(emptied, backdrop.size, backdrop.fit), backdrop.blur)

    def look(self, frames: range) -> Iterator[tuple[Frame, UInt8[np.ndarray, "H W"]]]:
        """Give the driver's pictures, each with the area of the people in it."""
        masks = zip(
            *(reader.read(frames.start, frames.stop) for reader in self._people), strict=True
        )
        for picture, people in zip(self._player.read(frames), masks, strict=True):
            yield picture, np.maximum.reduce([person_area(iuv) for iuv in people])

    def _plates(self, start: int, stop: int) -> Iterator[Frame | None]:
        """Give the plate of each frame; one is read for a stretch of them."""
        ends = [begin for begin, _ in self._backdrop.plates[1:]] + [stop]
        for (begin, path), end in zip(self._backdrop.plates, ends, strict=True):
            if (count := min(end, stop) - max(begin, start)) > 0:
                yield from repeat(None if path is None else read_photo(path).rgb, count)


def open_still(options: SceneOptions, size: tuple[int, int]) -> Frame | None:
    """Read the picture behind, if it is a single one. Raises: InputError."""
    path = options.background_file
    if path is None:
        return None
    pictures = open_background(path)
    if pictures.frame_count > 1:
        return None
    picture = next(pictures.read())
    return blur_picture(fit_picture(picture, size, options.background_fit), options.background_blur)


def open_background(path: Path) -> PictureStream:
    """Open the picture or video behind.

    Raises: InputError if it is none, or not there: then the name may be a word that was misspelt.
    """
    if not path.exists():
        raise InputError(
            f"background {path} does not exist; name a picture or a video, or write white, black,"
            f" #rrggbb, {', '.join(SCENES)}"
        )
    check_readable(path, "background", folder=True)
    return _open_as_it_is(path, status_key(path))


@lru_cache(KEPT_CLIPS)
def _open_as_it_is(path: Path, _status: str) -> PictureStream:
    """Open pictures once for all who ask: to count a video's frames is to go through all of it."""
    try:
        return open_pictures(path)
    except InputError as error:  # which begins with the path
        raise InputError(f"background {error}") from error


def count_until_end(options: SceneOptions, rate: Fraction) -> int | None:
    """Tell after how many output frames a video behind cuts the output; None: it never does.

    Raises: InputError if it cannot be read.
    """
    path = options.background_file
    if path is None or options.background_end != "cut":
        return None
    pictures = open_background(path)
    if pictures.frame_count == 1:
        return None
    return max(1, int(pictures.frame_count / (pictures.frame_rate or rate) * rate))


def empty_driver(
    options: SceneOptions,
    scans: Sequence[DriverScan],
    plan: DriverPlan,
    size: tuple[int, int],
    folder: Path,
    listener: Listener,
) -> DriverPictures:
    """Make the driver's pictures without its people; what they hide is found in other frames.

    Args:
        scans: Of each person.
        folder: Where the plates are kept.
    Raises: InputError if the driver has no pictures, or they cannot be read.
    """
    driver = scans[0]
    if driver.pictures is None:
        raise InputError(no_pictures(driver.path))
    people = tuple(scan.file for scan in scans)
    backdrop = DriverPictures(
        driver.path, people, plan.first, (), size, options.background_fit, options.background_blur
    )
    listener(Stage("background", len(plan.frames)))
    key = key_of({"people": [scan.pictures and scan.pictures.key for scan in scans]})
    opened, plates = _OpenDriver(backdrop), []
    for shot in plan.shots:
        frames = range(plan.first + shot.start, plan.first + shot.stop)
        path: Path | None = folder / f"plate-{key[:16]}-{frames.start}-{frames.stop}.png"
        if not path.exists():  # or an earlier run has made it
            path = _write_plate(path, _make_plate(opened, frames))
        plates.append((shot.start, path))
        listener(FramesDone(len(frames)))
    if moving := sum(path is None for _, path in plates):
        where = "the driver" if len(plates) == 1 else f"{moving} of {len(plates)} shots"
        listener(
            Notice(
                f"--background driver: the camera moves in {where}; what a person hides is filled"
                " from around it, smoothly"
            )
        )
    return replace(backdrop, plates=tuple(plates))


def no_pictures(driver: Path) -> str:
    """Say that a driver has nothing to show behind."""
    return (
        f"--background driver shows the driver's pictures, and {driver} is IUV, which has none;"
        " name the video by --background"
    )


def light_of(backdrop: Backdrop, frame_count: int) -> Light:
    """Measure the light of what is behind, see `measure_light`. Raises: InputError."""
    frames = range(frame_count)
    if isinstance(backdrop, Still):
        frames = range(1)
    opened = backdrop.open()
    chosen = np.linspace(0, len(frames) - 1, min(LIGHT_FRAMES, len(frames))).round().astype(int)
    lights = []
    for index in sorted(set(chosen.tolist())):
        for picture in opened.read(index, index + 1):
            assert picture is not None  # options refuse to match with nothing
            lights.append(measure_light(picture))
    mean, deviation = (
        tuple(np.mean([getattr(light, name) for light in lights], axis=0).tolist())
        for name in ("mean", "deviation")
    )
    return Light(mean, deviation)


def _write_plate(path: Path, plate: Frame | None) -> Path | None:
    if plate is None:
        return None
    # a name that a killed run may leave behind: a work folder sweeps it away
    written = path.with_name(f"{path.stem}.part-{uuid.uuid4().hex[:8]}.png")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(written, plate)
    publish(written, path)
    return path


def _make_plate(driver: _OpenDriver, frames: range) -> Frame | None:
    """Average what the frames of a shot show where nobody is; None if the camera moves."""
    total = squares = count = None
    step = -(-len(frames) // PLATE_FRAMES)
    for picture, area in islice(driver.look(frames), 0, None, step):
        free = (area == 0).astype(np.float32)[..., None]
        if total is None:
            total = np.zeros(picture.shape, np.float32)
            squares, count = np.zeros(free.shape, np.float32), np.zeros(free.shape, np.float32)
        light = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)[..., None].astype(np.float32)
        total += picture * free
        squares += light * light * free
        count += free
    assert total is not None and squares is not None and count is not None
    seen = count[..., 0] > 0
    if not seen.any():
        return None
    mean = total / np.maximum(count, 1)
    light = mean @ np.array([0.299, 0.587, 0.114], np.float32)  # as OpenCV's grey
    variance = (squares / np.maximum(count, 1))[..., 0] - light**2
    if len(frames) > 1 and np.median(np.sqrt(np.maximum(variance[seen], 0))) > MOVING_CAMERA:
        return None
    return fill_from_around(mean.round().astype(np.uint8), (~seen).astype(np.uint8))


def _take_out(picture: Frame, area: UInt8[np.ndarray, "H W"], plate: Frame | None) -> Frame:
    """Replace an area of a picture by what is known of it, or by what is around."""
    if not area.any():
        return picture
    if plate is None:
        return fill_from_around(picture, area)
    width = max(0.5, picture.shape[0] * FEATHER)
    x, y, columns, rows = cv2.boundingRect(area)
    room = int(4 * width) + 1
    around = np.s_[max(0, y - room) : y + rows + room, max(0, x - room) : x + columns + room]
    weight = cv2.GaussianBlur(area[around].astype(np.float32), (0, 0), width)[..., None]
    emptied = picture.copy()
    before = picture[around]
    emptied[around] = (before + (plate[around].astype(np.float32) - before) * weight).round()
    return emptied
