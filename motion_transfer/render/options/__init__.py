"""What one run is: a source, a driver, an output, and how to get from one to the other.

Every option is described once, here. A function that reads some of them takes the part that it
reads: `RenderOptions` is each of its parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar

from motion_transfer.cores import core_count
from motion_transfer.errors import InputError
from motion_transfer.option import option
from motion_transfer.render.options.drawn import RendererOptions
from motion_transfer.render.options.inputs import (
    KEPT_SUFFIX,
    LEGS,
    AdaptOptions,
    DriverOptions,
    EstimatorOptions,
    Garment,
    InputOptions,
    KeepOptions,
    Legs,
    SourceOptions,
    is_kept,
    parse_parts,
    parse_window,
    read_garment,
)
from motion_transfer.render.options.outputs import NO_AUDIO, SIZES, OutputOptions
from motion_transfer.render.options.scene import Partner, SceneOptions

__all__ = [
    "DEFAULT_RATE",
    "KEPT_SUFFIX",
    "LEGS",
    "NO_AUDIO",
    "SIZES",
    "AdaptOptions",
    "DriverOptions",
    "EstimatorOptions",
    "Garment",
    "InputOptions",
    "KeepOptions",
    "Legs",
    "OutputOptions",
    "Partner",
    "RenderOptions",
    "RendererOptions",
    "SceneOptions",
    "SourceOptions",
    "is_kept",
    "parse_parts",
    "parse_window",
    "read_garment",
]

DEFAULT_RATE = Fraction(30)


@dataclass(frozen=True, kw_only=True)
class RenderOptions(OutputOptions, SceneOptions, RendererOptions, InputOptions):
    """The options of a run: what `mt run` takes, what a manifest's jobs may set, and its defaults.

    Nothing here but the content of the inputs and what is drawn decides the output's bytes:
    `workers` never does.
    """

    SECTIONS: ClassVar = (
        "Source",
        "Driver",
        "Raw pictures",
        "Garment transfer",
        "Rendering",
        "Scene",
        "Output",
    )

    workers: int | None = option(
        "--workers",
        "Rendering",
        "Threads; default: one for each core.",
        kind="integer",
        in_manifest=False,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")
        if self.partners and self.adapt:
            raise InputError("--adapt learns one person; leave it out, or the partners")
        if self.azimuth is not None and (self.partners or self.background == "driver"):
            raise InputError(
                "--azimuth sees one person from elsewhere, and nothing around it; leave it out, or"
                " --partner and --background driver"
            )
        if self.size == "crop" and (self.partners or self.place or self.on_the_spot):
            raise InputError(
                "--size crop is the square around one person; leave it out to place somebody, or"
                " for partners"
            )
        if self.size == "background" and self.background_file is None:
            raise InputError(
                f"--size background takes its size from a picture or a video, and the background is"
                f" {self.background}; name a file by --background, or another --size"
            )

    @property
    def cast(self) -> tuple[RenderOptions, ...]:
        """One run for each person of the scene, the one who leads first, as if it were alone."""
        lead = replace(self, partners=()) if self.partners else self
        return (
            lead,
            *(
                replace(
                    lead,
                    source=(partner.photo,),
                    source_iuv=(partner.iuv,) if partner.iuv else (),
                    person="largest",
                    garments=(),
                    driver_person=partner.person,
                )
                for partner in self.partners
            ),
        )

    @property
    def worker_count(self) -> int:
        """How many threads to use: as many as asked for, or one for each core that may be used."""
        return self.workers or core_count()
