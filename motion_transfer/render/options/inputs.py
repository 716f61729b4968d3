"""What goes into a run: who is drawn, in whose clothes, and whose motion it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal, get_args

from motion_transfer.devices import check_device
from motion_transfer.errors import InputError
from motion_transfer.estimate.opening import ESTIMATORS, check_estimator, landmark_estimators
from motion_transfer.media.iuv.formats import (
    CHANNEL_ORDERS,
    DRIVER_KINDS,
    MISSING,
    ChannelOrder,
    DriverKind,
    Missing,
    driver_help,
)
from motion_transfer.option import LONGEST_SHOWN, REQUIRED, option, read_whole, some_path
from motion_transfer.render.options.part import Part

Legs = Literal["jeans", "guess"]
LEGS: tuple[Legs, ...] = get_args(Legs)

KEPT_SUFFIX = ".mtsource"
SMALLEST_WINDOW, LARGEST_WINDOW = 16, 16384
"""Sides, px: a smaller window shows nobody, a larger one takes the memory of a whole machine."""


@dataclass(frozen=True, kw_only=True)
class Garment:
    """Parts to take from another photo. `iuv` None means: look beside the photo."""

    photo: Path
    parts: tuple[int, ...]
    iuv: Path | None = None


@dataclass(frozen=True, kw_only=True)
class EstimatorOptions(Part):
    """Who finds the people of pictures that come without IUV."""

    estimator: str = option(
        "--estimator",
        "Raw pictures",
        "blazepose (default; needs `mt models fetch`, once), blazepose-heavy (nearer, slower;"
        " `mt models fetch --heavy`), or densepose, with its model.",
        default="blazepose",
        choices=tuple(ESTIMATORS),
    )
    estimator_model: Path | None = option(
        "--estimator-model",
        "Raw pictures",
        "DensePose, TorchScript or .onnx. A TorchScript file is a program: it is run.",
        kind="path",
        metavar="FILE",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_estimator(self.estimator, self.estimator_model, model_flag="--estimator-model")


@dataclass(frozen=True, kw_only=True)
class SourceOptions(EstimatorOptions):
    """Who is drawn, and in whose clothes.

    Several sources show one person; `source_iuv` then is empty or has one for each.
    """

    source: tuple[Path, ...] = option(
        "--source",
        "Source",
        "Photo of the person, a folder of photos, or a video; may be repeated, the best photo"
        " first; or what `mt source save` kept.",
        kind="paths",
        default=REQUIRED,
        metavar="PATH",
    )
    source_iuv: tuple[Path, ...] = option(
        "--source-iuv",
        "Source",
        "Its IUV, one for each source; else STEM_IUV.png or STEM_iuv.png beside it (of videos and"
        " folders STEM_IUV.mkv or STEM_iuv/); else it is estimated.",
        kind="paths",
        default=(),
        metavar="PATH",
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
    unseen_legs: Legs = option(
        "--unseen-legs",
        "Source",
        "Where the source shows no legs, as in a half-length photo: jeans (default; with shoes), or"
        " guess (what the network makes of the rest).",
        default="jeans",
        choices=LEGS,
    )
    garments: tuple[Garment, ...] = option(
        "--garment --garment-parts",
        "Garment transfer",
        "Take parts from this photo; may be repeated, each with its --garment-parts.",
        kind="garments",
        default=(),
        parse=lambda written: tuple(map(read_garment, written)),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.source:
            raise InputError("no source; give a photo of the person with --source")
        if self.source_iuv and len(self.source_iuv) != len(self.source):
            raise InputError(
                f"{len(self.source_iuv)} source IUV for {len(self.source)} sources; give one for"
                " each, in their order, or none"
            )
        if (kept := next(filter(is_kept, self.source), None)) is not None:
            refused = {
                "stands alone; to add photos, save it again from all of them": len(self.source) > 1,
                "holds its IUV; leave out --source-iuv": self.source_iuv,
                "holds one person; leave out --person": self.person != "largest",
            }
            if reasons := [reason for reason, refuses in refused.items() if refuses]:
                raise InputError(f"source {kept} is a kept source, which {reasons[0]}")

    @property
    def sources(self) -> list[tuple[Path, Path | None]]:
        """Each source with the IUV that was named for it, if any was."""
        return list(zip(self.source, self.source_iuv or [None] * len(self.source), strict=True))

    @property
    def redressed(self) -> frozenset[int]:
        """The parts that garments give."""
        return frozenset(part for garment in self.garments for part in garment.parts)

    @property
    def source_words(self) -> str:
        """The sources, for messages."""
        return ", ".join(map(str, self.source))

    @property
    def kept(self) -> Path | None:
        """The file that `mt source save` wrote, if that is the source."""
        return self.source[0] if is_kept(self.source[0]) else None


@dataclass(frozen=True, kw_only=True)
class KeepOptions(SourceOptions):
    """Who is kept in a file, and for which weights."""

    SECTIONS: ClassVar = ("Source", "Raw pictures", "Garment transfer", "Output")

    weights: Path | None = option(
        "--weights",
        "Output",
        "Checkpoint whose feature map is kept, too; default: lite, which ships. Others can be used"
        " with the file all the same, and encode the person in each run.",
        kind="path",
    )
    force: bool = option(
        "--force", "Output", "Replace an existing file.", kind="flag", default=False
    )


@dataclass(frozen=True, kw_only=True)
class AdaptOptions(SourceOptions):
    """Whom weights are to learn, and which weights."""

    SECTIONS: ClassVar = ("Source", "Raw pictures", "Learning", "Output")

    # what is learned is the person; clothes of others are laid over whoever that is
    garments: tuple[Garment, ...] = field(default=(), init=False)
    unseen_legs: Legs = field(default="guess", init=False)

    weights: Path | None = option(
        "--weights",
        "Learning",
        "Checkpoint to start from; default: lite, which ships.",
        kind="path",
    )
    steps: int | None = option(
        "--steps",
        "Learning",
        "How long to learn; the default takes some minutes on two cores.",
        kind="integer",
    )
    device: str | None = option(
        "--device",
        "Learning",
        "cpu, cuda, cuda:1 or mps (Apple's GPUs); default: cuda where it is.",
        metavar="NAME",
    )
    force: bool = option(
        "--force", "Output", "Replace an existing file.", kind="flag", default=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.device is not None:
            check_device(self.device)
        if self.steps is not None and self.steps < 1:
            raise InputError(f"steps is {self.steps}; it must be at least 1")


@dataclass(frozen=True, kw_only=True)
class DriverOptions(EstimatorOptions):
    """Whose motion it is.

    The path may name a motion, `people:walk` (see `motion_transfer.people`). `driver_kind` None
    finds out whether it is IUV. `frames` is a half-open range, either end open. `missing` None
    fails for numbers missing from a folder or a dump, and shows background where nobody is found.
    """

    driver: Path = option(
        "--driver",
        "Driver",
        f"A video or pictures of a person; or IUV: {driver_help()} (such as people:walk,frames=60;"
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
        "Frames that show nobody, and numbers missing in a folder or dump: hold (repeat the frame"
        " before), background, or fail. Default: background for the former, fail for the latter.",
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

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_window(self.window)


@dataclass(frozen=True, kw_only=True)
class InputOptions(DriverOptions, SourceOptions):
    """Everything that goes in: a driver of raw pictures may be fitted to the source's body, or seen
    from elsewhere, `azimuth` degrees towards its left hand."""

    fit_body: bool = option(
        "--fit-body",
        "Raw pictures",
        "Give the driver's body the proportions of the source's; needs blazepose.",
        kind="flag",
        default=False,
    )
    azimuth: float | None = option(
        "--azimuth",
        "Raw pictures",
        "See the driver from elsewhere, so many degrees towards its left hand: a body fitted to it"
        " moves in its place (-360..360; extra `people`).",
        kind="number",
        metavar="DEGREES",
    )

    def __post_init__(self) -> None:
        """Raises: InputError for options that do not go together."""
        super().__post_init__()
        check_estimator(
            self.estimator,
            self.estimator_model,
            model_flag="--estimator-model",
            fit=self.fit_body,
        )
        if self.azimuth is None:
            return
        if not -360 <= self.azimuth <= 360:
            raise InputError(f"--azimuth {self.azimuth:g}; it must lie in -360..360 degrees")
        if self.fit_body:
            raise InputError(
                "--azimuth draws a body of its own, which --fit-body does not change; leave one out"
            )
        if self.estimator not in landmark_estimators():
            raise InputError(
                f"--azimuth follows landmarks, and the {self.estimator} estimator gives none;"
                f" choose {' or '.join(landmark_estimators())}"
            )


def is_kept(source: Path) -> bool:
    """Tell whether a source is a file that `mt source save` wrote, by its ending."""
    return source.suffix.lower() == KEPT_SUFFIX


def read_garment(written: Mapping[str, str]) -> Garment:
    """Read a garment from a mapping with `photo`, `parts` and perhaps `iuv`. Raises: InputError."""
    return Garment(
        photo=some_path(written["photo"]),
        iuv=Path(written["iuv"]) if written.get("iuv") else None,
        parts=parse_parts(written["parts"]),
    )


def parse_window(text: str) -> tuple[int, int, int] | None:
    """Read x, y and side, px, of `X,Y,SIDE`; None for `auto`. Raises: InputError."""
    if text == "auto":
        return None
    try:
        x, y, side = (read_whole(word) for word in text.split(","))
    except ValueError:
        raise InputError(
            f"window {text[:LONGEST_SHOWN]!r}; write X,Y,SIDE in pixels, or auto"
        ) from None
    if not SMALLEST_WINDOW <= side <= LARGEST_WINDOW:
        raise InputError(
            f"window {text!r}; its side lies between {SMALLEST_WINDOW} and {LARGEST_WINDOW} pixels"
        )
    return x, y, side


def parse_parts(text: str) -> tuple[int, ...]:
    """Read a comma-separated list of part or group names as part numbers. Raises: InputError."""
    from nhrr_core.parts import PART_GROUPS, PART_NAMES

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
