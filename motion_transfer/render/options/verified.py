"""What a verification takes: an output, and the files that it is said to be made of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from motion_transfer.devices import check_device
from motion_transfer.drawing.engines import ENGINES, PRECISIONS
from motion_transfer.errors import InputError
from motion_transfer.option import option
from motion_transfer.render.options.part import Part

SAYS_SO = " Only where the record says that there was one."


@dataclass(frozen=True, kw_only=True)
class VerifyOptions(Part):
    """Files to compare with a record; all other options of the run are in the record."""

    SECTIONS: ClassVar = ("Inputs", "Rendering")

    source: tuple[Path, ...] = option(
        "--source", "Inputs", "As of the run.", kind="paths", default=(), metavar="PATH"
    )
    source_iuv: tuple[Path, ...] = option(
        "--source-iuv",
        "Inputs",
        "As of the run; else it is looked for beside the source, or estimated.",
        kind="paths",
        default=(),
        metavar="PATH",
    )
    driver: Path | None = option("--driver", "Inputs", "As of the run.", kind="path")
    garments: tuple[str, ...] = option(
        "--garment",
        "Inputs",
        "Each garment's photo, in their order." + SAYS_SO,
        kind="words",
        default=(),
        metavar="PHOTO[,IUV]",
    )
    partners: tuple[str, ...] = option(
        "--partner",
        "Inputs",
        "Each partner's photo, in their order." + SAYS_SO,
        kind="words",
        default=(),
        metavar="PHOTO[,IUV]",
    )
    background: Path | None = option(
        "--background", "Inputs", "The picture or video behind." + SAYS_SO, kind="path"
    )
    audio: Path | None = option("--audio", "Inputs", "The sound." + SAYS_SO, kind="path")
    weights: Path | None = option(
        "--weights", "Inputs", "The checkpoint, unless it ships with the program.", kind="path"
    )
    estimator_model: Path | None = option(
        "--estimator-model", "Inputs", "DensePose's file." + SAYS_SO, kind="path"
    )
    segments: int = option(
        "--segments",
        "Rendering",
        "How many segments, chosen at random, are rendered again (default: 3); 0: none.",
        kind="integer",
        default=3,
        metavar="N",
    )
    seed: int | None = option(
        "--seed", "Rendering", "Choose the same segments again.", kind="integer", metavar="S"
    )
    engine: str | None = option(
        "--engine", "Rendering", "As of mt run.", choices=tuple(ENGINES), metavar="NAME"
    )
    precision: str | None = option(
        "--precision", "Rendering", "As of mt run.", choices=PRECISIONS, metavar="NAME"
    )
    device: str | None = option("--device", "Rendering", "As of mt run.", metavar="NAME")
    workers: int | None = option(
        "--workers", "Rendering", "Threads; default: one for each core.", kind="integer"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.segments < 0:
            raise InputError(f"segments is {self.segments}; it must be at least 0")
        if self.device is not None:
            check_device(self.device)
