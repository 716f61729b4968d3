"""What one run is: a source, a driver, an output, and how to get from one to the other."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.errors import InputError
from motion_transfer.render.option import REQUIRED, Option, list_options, option
from motion_transfer.weights.shipped import DEFAULT_WEIGHTS, find_weights

if TYPE_CHECKING:  # help has to be instant, and these need the libraries that do the work
    from motion_transfer.media.driver_kind import DriverKind
    from motion_transfer.media.iuv_image import ChannelOrder
    from motion_transfer.media.iuv_stream import Missing

CHANNEL_ORDERS = ("iuv", "vui")
MISSING = ("hold", "background", "fail")
RENDERERS = ("nhrr", "texture")
ESTIMATORS = ("blazepose", "densepose")
DRIVER_KINDS = ("iuv", "pictures")
NO_AUDIO = "none"
SIZES = ("driver", "crop", "even")
SMALLEST_WINDOW, LARGEST_WINDOW = 16, 16384
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
    """The options of a run: what `mt run` takes, what a manifest's jobs may set, and its defaults.

    Paths of drivers may name a motion, `people:walk` (see `people.stream`). The IUV of photos and
    drivers that come without one is estimated; `driver_kind` None finds out which do. `frames` is a
    half-open range of the driver's frames, either end open. `weights` may name a checkpoint that
    ships, and None is the default one; a `frame_rate` of None is the driver's own, or 30; `audio`
    None is its own if it has one; `missing` None fails for numbers missing from a folder, and shows
    background where nobody is found. Nothing here but the content of the inputs and what is drawn
    decides the output's bytes: `workers` never does.
    """

    source: Path = option(
        "--source", "Source", "Photo of the person.", kind="path", default=REQUIRED
    )
    source_iuv: Path | None = option(
        "--source-iuv",
        "Source",
        "Its IUV; else STEM_IUV.png or STEM_iuv.png beside it; else it is estimated.",
        kind="path",
    )
    person: str = option(
        "--person",
        "Source",
        "largest (default), an index from the left (0 first), or a box x0,y0,x1,y1 in pixels.",
        default="largest",
        metavar="WHO",
    )
    source_iuv_order: ChannelOrder | None = option(
        "--source-iuv-order",
        "Source",
        "As --iuv-order, for source and garments.",
        choices=CHANNEL_ORDERS,
        metavar="ORDER",
    )
    driver: Path = option(
        "--driver",
        "Driver",
        "A video or pictures of a person; or IUV: a folder of images, one image, lossless video,"
        " .npy, .npz, detectron2's results.pkl; or people:MOTION (such as people:walk,frames=60;"
        " see `mt people drive -h`).",
        kind="path",
        default=REQUIRED,
    )
    driver_kind: DriverKind | None = option(
        "--driver-kind",
        "Driver",
        "iuv, or pictures of a person whose IUV is estimated; else found out.",
        choices=DRIVER_KINDS,
    )
    driver_person: str = option(
        "--driver-person",
        "Driver",
        "Whom to follow; as --person.",
        default="largest",
        metavar="WHO",
    )
    iuv_order: ChannelOrder | None = option(
        "--iuv-order",
        "Driver",
        "Channels of the file's RGB: iuv, or vui as Caffe2's DensePose has it; else found out.",
        choices=CHANNEL_ORDERS,
        metavar="ORDER",
    )
    missing: Missing | None = option(
        "--missing",
        "Driver",
        "Frames that show nobody, and numbers missing in a folder: hold (repeat the frame before),"
        " background, or fail. Default: background for the former, fail for the latter.",
        choices=MISSING,
    )
    window: str = option(
        "--window",
        "Driver",
        "auto (default: around the person, in every frame), or the square X,Y,SIDE of the driver's"
        " frame, px, that is drawn.",
        default="auto",
        metavar="X,Y,SIDE",
    )
    frames: tuple[int | None, int | None] = option(
        "--frames",
        "Driver",
        "Only these frames, counted from 0, B excluded.",
        kind="frames",
        default=(None, None),
        metavar="A:B",
    )
    estimator: str = option(
        "--estimator",
        "Raw pictures",
        "blazepose (default; needs `mt models fetch`, once), or densepose, with its model.",
        default="blazepose",
        choices=ESTIMATORS,
    )
    estimator_model: Path | None = option(
        "--estimator-model",
        "Raw pictures",
        "DensePose, TorchScript or .onnx. A TorchScript file is a program: it is run.",
        kind="path",
        metavar="FILE",
    )
    fit_body: bool = option(
        "--fit-body",
        "Raw pictures",
        "Give the driver's body the proportions of the source's; needs blazepose.",
        kind="flag",
        default=False,
    )
    garments: tuple[Garment, ...] = option(
        "--garment --garment-parts",
        "Garment transfer",
        "Take parts from this photo; may be repeated, each with its --garment-parts.",
        kind="garments",
        default=(),
    )
    renderer: str = option(
        "--renderer",
        "Rendering",
        "nhrr (the network; default) or texture (a draft without it, faster).",
        default="nhrr",
        choices=RENDERERS,
        metavar="NAME",
    )
    weights: Path | None = option(
        "--weights",
        "Rendering",
        "Checkpoint for nhrr, safetensors; default: lite, which ships.",
        kind="path",
    )
    background: str = option(
        "--background",
        "Rendering",
        "white (default), black, #rrggbb, or photo (the source's, painted over behind the person).",
        default="white",
        metavar="COLOUR",
    )
    workers: int | None = option(
        "--workers",
        "Rendering",
        "Threads; default: one for each core.",
        kind="integer",
        in_manifest=False,
    )
    compile: bool | None = option(
        "--compile/--no-compile",
        "Rendering",
        "Compile the network first; default: for drivers of 300 frames and more.",
        kind="switch",
    )
    output: Path = option(
        "-o --output",
        "Output",
        ".mp4 .mov .mkv .webm .gif, .png for one frame, or a folder of PNG.",
        kind="path",
        default=REQUIRED,
    )
    frame_rate: Fraction | None = option(
        "--fps",
        "Output",
        "Such as 25 or 30000/1001; default: the driver's, or 30.",
        kind="rate",
        metavar="RATE",
    )
    codec: str | None = option(
        "--codec", "Output", "h264, h265, vp9, av1, ffv1; default by container.", metavar="NAME"
    )
    crf: int | None = option(
        "--crf",
        "Output",
        "Quality, lower is better; default by codec, 18 for h264.",
        kind="integer",
    )
    audio: Path | None = option(
        "--audio",
        "Output",
        "Sound from this file, or none; default: the driver video's own.",
        kind="path",
        metavar="FILE|none",
    )
    size: str = option(
        "--size",
        "Output",
        "The driver's frame (default), the square around the person, or the frame made even.",
        default="driver",
        choices=SIZES,
    )
    compare: bool = option(
        "--compare", "Output", "Source, IUV and result side by side.", kind="flag", default=False
    )
    sheet: Path | None = option(
        "--sheet", "Output", "Write a contact sheet (PNG) there as well.", kind="path"
    )
    force: bool = option(
        "--force", "Output", "Replace an existing output.", kind="flag", default=False
    )
    restart: bool = option(
        "--restart",
        "Output",
        "Begin anew, whatever an interrupted run of the same output has finished.",
        kind="flag",
        default=False,
        in_manifest=False,
    )

    def __post_init__(self) -> None:
        for entry in list_options(RenderOptions):
            value = getattr(self, entry.name)
            if entry.choices and value != entry.default and value not in entry.choices:
                listed = ", ".join(entry.choices)
                raise InputError(f"{entry.name} is {value!r}; supported are {listed}")
        if self.renderer == "texture" and self.weights is not None:
            raise InputError("the texture renderer uses no weights; leave out --weights")
        if self.estimator == "densepose" and self.estimator_model is None:
            raise InputError("the densepose estimator needs --estimator-model FILE; none ships")
        if self.estimator != "densepose" and self.estimator_model is not None:
            raise InputError(
                "--estimator-model is for the densepose estimator; add --estimator densepose"
            )
        if self.fit_body and self.estimator != "blazepose":
            raise InputError(
                f"--fit-body compares landmarks, and the {self.estimator} estimator gives none;"
                " choose the blazepose estimator, or leave out --fit-body"
            )
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")
        parse_colour(self.background)
        parse_window(self.window)

    @property
    def weights_file(self) -> Path | None:
        """The checkpoint that draws; None for a renderer without one. Raises: WeightsError."""
        if self.renderer == "texture":
            return None
        return find_weights(self.weights or DEFAULT_WEIGHTS)

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


def parse_window(text: str) -> tuple[int, int, int] | None:
    """x, y and side, px, of `X,Y,SIDE`; None for `auto`. Raises: InputError."""
    if text == "auto":
        return None
    try:
        x, y, side = (int(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"window {text!r}; write X,Y,SIDE in pixels, or auto") from None
    if not SMALLEST_WINDOW <= side <= LARGEST_WINDOW:
        raise InputError(
            f"window {text!r}; its side lies between {SMALLEST_WINDOW} and {LARGEST_WINDOW} pixels"
        )
    return x, y, side


def parse_frames(text: str) -> tuple[int | None, int | None]:
    """`10:50`, `10:`, `:50` or `12` as a half-open range. Raises: InputError."""
    return parse_range(text, "frames")


def parse_range(text: str, what: str) -> tuple[int | None, int | None]:
    """A half-open range of what is counted from 0, either end open. Raises: InputError."""
    try:
        if ":" not in text:
            return int(text), int(text) + 1
        start, stop = text.split(":")
        ends = int(start) if start else None, int(stop) if stop else None
    except ValueError:
        raise InputError(f"{what} {text!r}; write START:STOP, such as 10:50, 10: or :50") from None
    if any(end is not None and end < 0 for end in ends):
        raise InputError(f"{what} {text!r}; {what} count from 0 and never from the end")
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
    from nhrr_core.iuv import PART_GROUPS, PART_NAMES

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


def parse_word(entry: Option, value: Any) -> Any:
    """A value as the command line or a manifest writes it, as the field of `RenderOptions`.

    Garments are mappings with `photo`, `parts` and, if wanted, `iuv`. Raises: InputError.
    """
    if value is None:
        return entry.default
    if entry.kind == "path":
        return Path(value)
    if entry.kind == "rate":
        return parse_rate(str(value))
    if entry.kind == "frames":
        return parse_frames(str(value))
    if entry.kind == "garments":
        return tuple(
            Garment(
                photo=Path(garment["photo"]),
                iuv=Path(garment["iuv"]) if garment.get("iuv") else None,
                parts=parse_parts(garment["parts"]),
            )
            for garment in value
        )
    if entry.name == "background":
        parse_colour(value)
    return value


def options_from_words(words: Mapping[str, Any]) -> RenderOptions:
    """Options from what was written, by field name. Raises: InputError for a value that is none."""
    entries = {entry.name: entry for entry in list_options(RenderOptions)}
    return RenderOptions(
        **{name: parse_word(entries[name], value) for name, value in words.items()}
    )
