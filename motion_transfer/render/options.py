"""What one run is: a source, a driver, an output, and how to get from one to the other."""

from __future__ import annotations

import os
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import get_args

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_image import CHANNEL_ORDERS, ChannelOrder
from motion_transfer.media.iuv_stream import Missing
from nhrr_core.iuv import PART_GROUPS, PART_NAMES

RENDERERS = ("texture", "nhrr")
SIZES = ("driver", "crop", "even")
DEFAULT_RATE = Fraction(30)
LONGEST_RATE_TERM = 2**31 - 1  # what FFmpeg's fractions hold
RATE_DENOMINATOR = 100_000


@dataclass(frozen=True, kw_only=True)
class Garment:
    """Parts to take from another photo. `iuv` None means: look beside the photo."""

    photo: Path
    parts: tuple[int, ...]
    iuv: Path | None = None


@dataclass(frozen=True, kw_only=True)
class RenderOptions:
    """The options of `mt run`, with its defaults.

    Attributes:
        source, source_iuv: the photo and its IUV; None means: look beside the photo.
        driver: a folder of IUV images, one IUV image, a lossless IUV video, `.npy`, `.npz`, or a
            motion, `people:walk` (see `people.stream`).
        output: `.mp4`, `.mov`, `.mkv`, `.webm`, `.gif`, `.png` (one frame), or a folder.
        renderer: `texture` (no weights) or `nhrr` (the network); None: `nhrr` if weights are given.
        weights: a safetensors checkpoint, for `nhrr`.
        person, driver_person: `largest`, an index from the left (0 first), or `x0,y0,x1,y1` in px.
        iuv_order, source_iuv_order: force the channel order, `iuv` or `vui`.
        missing: what becomes of driver frames in which nobody is found, and of numbers missing
            from a folder: `fail`, `hold` (the frame before is repeated) or `background`. None:
            missing numbers fail, frames without anybody are background.
        frames: half-open range of the driver's frames, either end open.
        frame_rate: frames per second; None: the driver's own, or 30.
        codec, crf: of the video; None: the container's default.
        background: `white`, `#rrggbb`, or `photo` (the source's, without the person).
        size: `driver` (the result pasted into the driver's frame), `crop` (the square around the
            person), `even` (as `driver`, grown by a pixel where odd).
        garments: parts taken from other photos.
        compare: source, IUV and result side by side.
        sheet: write a contact sheet there.
        force: replace an existing output.
        workers: threads that render chunks; None: one for each core. Never changes the output.
        compile: let `nhrr` compile the network; None: when the driver is long enough to pay for it.
    """

    source: Path
    driver: Path
    output: Path
    source_iuv: Path | None = None
    renderer: str | None = None
    weights: Path | None = None
    person: str = "largest"
    driver_person: str = "largest"
    iuv_order: ChannelOrder | None = None
    source_iuv_order: ChannelOrder | None = None
    missing: Missing | None = None
    frames: tuple[int | None, int | None] = (None, None)
    frame_rate: Fraction | None = None
    codec: str | None = None
    crf: int | None = None
    background: str = "white"
    size: str = "driver"
    garments: tuple[Garment, ...] = ()
    compare: bool = False
    sheet: Path | None = None
    force: bool = False
    workers: int | None = None
    compile: bool | None = None

    def __post_init__(self) -> None:
        for name, allowed in (
            ("renderer", (None, *RENDERERS)),
            ("iuv_order", (None, *CHANNEL_ORDERS)),
            ("source_iuv_order", (None, *CHANNEL_ORDERS)),
            ("missing", (None, *get_args(Missing))),
            ("size", SIZES),
        ):
            if getattr(self, name) not in allowed:
                listed = ", ".join(word for word in allowed if word)
                raise InputError(f"{name} is {getattr(self, name)!r}; supported are {listed}")
        if self.renderer == "nhrr" and self.weights is None:
            raise InputError("the nhrr renderer needs --weights FILE; none ship yet")
        if self.renderer == "texture" and self.weights is not None:
            raise InputError("the texture renderer uses no weights; leave out --weights")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")
        parse_colour(self.background)

    @property
    def renderer_name(self) -> str:
        """The renderer that runs: the given one, else what the weights call for."""
        return self.renderer or ("texture" if self.weights is None else "nhrr")

    @property
    def worker_count(self) -> int:
        return self.workers or len(os.sched_getaffinity(0))


def parse_colour(background: str) -> tuple[int, int, int] | None:
    """RGB of `white`, `black` or `#rrggbb`; None for `photo`. Raises: InputError."""
    named = {"white": "#ffffff", "black": "#000000"}
    text = named.get(background, background)
    if text == "photo":
        return None
    try:
        if len(text) != 7 or text[0] != "#":
            raise ValueError
        red, green, blue = bytes.fromhex(text[1:])
    except ValueError:
        raise InputError(
            f"background {background!r}; supported are white, black, photo and #rrggbb"
        ) from None
    return red, green, blue


def parse_frames(text: str) -> tuple[int | None, int | None]:
    """`10:50`, `10:`, `:50` or `12` as a half-open range. Raises: InputError."""
    try:
        if ":" not in text:
            return int(text), int(text) + 1
        start, stop = text.split(":")
        ends = int(start) if start else None, int(stop) if stop else None
    except ValueError:
        raise InputError(f"frames {text!r}; write START:STOP, such as 10:50, 10: or :50") from None
    if any(end is not None and end < 0 for end in ends):
        raise InputError(f"frames {text!r}; frames count from 0 and never from the end")
    return ends


def parse_rate(text: str) -> Fraction:
    """`25`, `29.97` or `30000/1001`. Raises: InputError."""
    try:
        rate = Fraction(text)
    except (ValueError, ZeroDivisionError):
        raise InputError(
            f"fps {text!r}; write a number or a fraction, such as 30000/1001"
        ) from None
    if not 0 < rate <= 1000:
        raise InputError(f"fps {text!r}; it must lie between 0 and 1000")
    if max(rate.numerator, rate.denominator) > LONGEST_RATE_TERM:
        rate = rate.limit_denominator(RATE_DENOMINATOR)  # 29.97002997002997 is 30000/1001
    if not rate:
        raise InputError(f"fps {text!r}; it is too slow for a video")
    return rate


def parse_parts(text: str) -> tuple[int, ...]:
    """Part numbers of a comma-separated list of part or group names. Raises: InputError."""
    names = {name: (index,) for index, name in enumerate(PART_NAMES) if index}
    names |= PART_GROUPS
    parts: set[int] = set()
    for word in filter(None, (word.strip() for word in text.split(","))):
        if word not in names:
            raise InputError(
                f"unknown part {word!r}; groups are {', '.join(PART_GROUPS)}, and `mt info parts`"
                " lists the single parts"
            )
        parts.update(names[word])
    if not parts:
        raise InputError("no parts named; write some, such as torso,upper-legs")
    return tuple(sorted(parts))
