"""The options of an evaluation, each described once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from motion_transfer.cores import core_count
from motion_transfer.drawing.engines import PRECISIONS
from motion_transfer.drawing.renderers import DRAFT, RENDERERS
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import CHANNEL_ORDERS, ChannelOrder
from motion_transfer.option import REQUIRED, check_choices, option, parse_size

if TYPE_CHECKING:
    from motion_transfer.evaluation.framing import Framing

PEOPLE, FREE_PEOPLE, DEEPFASHION = "people", "free-people", "deepfashion"
PAIRS = "Pairs (one of --pairs, --clips and --protocol)"
METHODS = "Methods to compare (any number, of any kind)"
PROTOCOL = "Protocol (numbers are comparable only where it is the same)"
OUTPUT = "Output"


@dataclass(frozen=True, kw_only=True)
class EvaluationOptions:
    """What is compared, on which pairs, how, and where the results are written.

    `workers` never changes a number.
    """

    pairs: Path | None = option(
        "--pairs",
        PAIRS,
        "CSV with columns from,to (or source,target): file names of photos of one person.",
        kind="path",
    )
    images: Path | None = option(
        "--images",
        PAIRS,
        "Folder that the names are relative to, else the CSV's; for deepfashion, In-shop's.",
        kind="path",
    )
    clips: Path | None = option(
        "--clips",
        PAIRS,
        "Folder of videos, NAME.mp4 with NAME_iuv/ or NAME_IUV.mkv: frames of a clip are paired.",
        kind="path",
    )
    protocol: str | None = option(
        "--protocol",
        PAIRS,
        "A named set: people (synthetic and painted, nothing is ever trained on them) or"
        " free-people (in photographed clothes), 500 pairs; deepfashion, the paper's Table 1 on"
        " the In-shop photos in --images, 176 pairs or those of --pairs. Fewer with --limit.",
        choices=(PEOPLE, FREE_PEOPLE, DEEPFASHION),
        metavar="NAME",
    )
    assets: Path | None = option(
        "--assets",
        PAIRS,
        "Folder of MakeHuman's assets, for free-people; else MT_ASSETS.",
        kind="path",
        metavar="DIR",
    )
    moments: int = option(
        "--moments",
        PAIRS,
        "Target moments a clip, two frames each; default 8.",
        kind="integer",
        default=8,
    )
    limit: int | None = option(
        "--limit", PAIRS, "Only the first so many pairs (or clips).", kind="integer"
    )
    iuv_order: ChannelOrder | None = option(
        "--iuv-order",
        PAIRS,
        "Channels of the IUV files: iuv or vui; else found out.",
        choices=CHANNEL_ORDERS,
        metavar="ORDER",
    )
    skip_broken: bool = option(
        "--skip-broken",
        PAIRS,
        "Leave out pairs with missing or broken files.",
        kind="flag",
        default=False,
    )
    weights: tuple[Path, ...] = option(
        "--weights",
        METHODS,
        "Checkpoints of the network.",
        kind="paths",
        default=(),
        metavar="FILE...",
    )
    renderer: str | None = option(
        "--renderer", METHODS, "The renderer without a network as well.", metavar=DRAFT
    )
    precision: str | None = option(
        "--precision",
        METHODS,
        "Numbers that networks are computed in: int8, bf16 or f32; default: as mt run does.",
        choices=PRECISIONS,
        metavar="NAME",
    )
    device: str | None = option(
        "--device",
        METHODS,
        "cpu, cuda, cuda:1 or mps (Apple's GPUs); default: cuda where it is.",
        metavar="NAME",
    )
    results: tuple[Path, ...] = option(
        "--results",
        METHODS,
        "Pictures that another method made, named SOURCE__TARGET.png or from.jpg___to.jpg, or as"
        " published code names them.",
        kind="paths",
        default=(),
        metavar="FOLDER...",
    )
    size: tuple[int, int] = option(
        "--size",
        PROTOCOL,
        "Compare at that size; default 256x256.",
        default=(256, 256),
        metavar="WxH",
        parse=parse_size,
    )
    background: str = option(
        "--background",
        PROTOCOL,
        "Behind the person: white (default), black, #rrggbb, or photo (the source's).",
        default="white",
        metavar="COLOUR",
    )
    metrics: tuple[str, ...] = option(
        "--metrics",
        PROTOCOL,
        "ssim psnr l1 efficientnet-lite0 hidden head checkerboard (these by default), faces and"
        " identity (after `mt models fetch --faces`), lpips, fid, flicker (with --clips).",
        kind="words",
        default=(),
        metavar="NAME...",
        parse=lambda written: tuple(n for words in written for n in words.split(",") if n),
    )
    lpips_weights: Path | None = option(
        "--lpips-weights",
        PROTOCOL,
        "AlexNet's or VGG-16's of torchvision; adds lpips.",
        kind="path",
    )
    fid_weights: Path | None = option(
        "--fid-weights", PROTOCOL, "inception-2015-12-05.pt; adds fid.", kind="path"
    )
    output: Path = option(
        "-o --output",
        OUTPUT,
        "Folder for results.json, scores.csv, sheet.png.",
        kind="path",
        default=REQUIRED,
    )
    save_images: bool = option(
        "--save-images", OUTPUT, "Write every result there as well.", kind="flag", default=False
    )
    workers: int | None = option(
        "--workers", OUTPUT, "Threads; default: one for each core.", kind="integer"
    )
    force: bool = option(
        "--force", OUTPUT, "Replace an earlier evaluation.", kind="flag", default=False
    )

    def __post_init__(self) -> None:
        check_choices(self)
        # deepfashion alone has a use for a list: of its own pairs
        pairs = self.pairs if self.protocol != DEEPFASHION else None
        if sum(given is not None for given in (pairs, self.clips, self.protocol)) != 1:
            raise InputError("give one of --pairs, --clips and --protocol")
        if self.protocol == DEEPFASHION and self.images is None:
            raise InputError(
                f"protocol {DEEPFASHION} needs the photos; name the benchmark's folder with"
                " --images DIR"
            )
        if self.renderer is not None and (
            self.renderer not in RENDERERS or RENDERERS[self.renderer].default_weights is not None
        ):
            raise InputError(
                f"renderer {self.renderer!r}; only {DRAFT} needs naming, the network comes with"
                " --weights"
            )
        if not (self.weights or self.renderer or self.results):
            raise InputError(
                "nothing to evaluate; give --weights FILE, --renderer texture or --results FOLDER"
            )
        for name in ("limit", "moments", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"{name} is {value}; it must be at least 1")
        _ = self.framing, self.protocol_assets

    @property
    def protocol_assets(self) -> Path | None:
        """The assets that the protocol's people wear; None: they wear none. Raises: InputError."""
        if self.protocol != FREE_PEOPLE:
            return None
        from motion_transfer.people import find_assets, load_assets  # help has to be instant

        assets = find_assets(self.assets)
        if assets is None:
            raise InputError(
                f"protocol {FREE_PEOPLE} needs assets; name their folder with --assets DIR or"
                " MT_ASSETS"
            )
        load_assets(assets)
        return assets

    @property
    def framing(self) -> Framing:
        """The size and background that everything is compared at. Raises: InputError."""
        from motion_transfer.evaluation.framing import Framing  # help has to be instant

        return Framing(*self.size, self.background)

    @property
    def worker_count(self) -> int:
        """How many threads to use: as many as asked for, or one for each core that may be used."""
        return self.workers or core_count()
