"""A motion as a driver: `people:walk` wherever a driver's path is expected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_image import Raw
from motion_transfer.media.stream import IuvStream
from motion_transfer.people.motion_name import SCHEME

if TYPE_CHECKING:  # every run asks whether its driver is a motion, and few are
    from motion_transfer.people.driver import MotionDriver, MotionOptions


class MotionStream(IuvStream):
    """IUV frames of a synthetic body, in the order I, U, V, drawn when they are read."""

    def __init__(self, name: Path, driver: MotionDriver) -> None:
        super().__init__(name, f"motion ({driver.options.motion})", driver.frame_count)
        self.frame_rate = driver.frame_rate
        self._driver = driver

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        return (self._driver.iuv(index) for index in range(start, stop))

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path}"


def open_motion(path: Path) -> MotionStream:
    """Open `people:MOTION` or `people:FILE.bvh`, settings after commas.

    Example: `people:walk,frames=60,fps=25,size=384x512,gender=1,azimuth=30`.
    Raises: InputError for an unknown motion or setting.
    """
    from motion_transfer.people.driver import MotionDriver, MotionOptions
    from motion_transfer.people.extra import require_people

    require_people()
    motion, *settings = str(path).removeprefix(SCHEME).split(",")
    options = MotionOptions(motion=motion)
    for setting in settings:
        options = _with_setting(options, setting, str(path))
    return MotionStream(path, MotionDriver(options))


def parse_size(text: str) -> tuple[int, int]:
    """`384x512` as (width, height). Raises: InputError."""
    try:
        width, height = (int(side) for side in text.lower().split("x"))
    except ValueError:
        raise InputError(f"size {text!r}; write WIDTHxHEIGHT, such as 384x512") from None
    return width, height


def _with_setting(options: MotionOptions, setting: str, where: str) -> MotionOptions:
    name, _, value = setting.partition("=")
    numbers = ("azimuth", "elevation", "distance")
    shape = [entry.name for entry in fields(options.shape)]
    try:
        if name == "frames":
            return replace(options, frame_count=int(value))
        if name == "fps":
            return replace(options, frame_rate=Fraction(value))
        if name == "size":
            return replace(options, size=parse_size(value))
        if name == "framing":
            return replace(options, framing=value)  # type: ignore[arg-type]
        if name in numbers:
            return replace(options, **{name: float(value)})
        if name in shape:
            return replace(options, shape=replace(options.shape, **{name: float(value)}))
    except (ValueError, ZeroDivisionError):
        raise InputError(f"{where}: {setting!r} has no number that can be used") from None
    known = ["frames", "fps", "size", "framing", *numbers, *shape]
    raise InputError(f"{where}: unknown setting {name!r}; supported are {', '.join(known)}")
