"""What comes out of a run."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.option import REQUIRED, option
from motion_transfer.render.options.part import Part

NO_AUDIO = "none"
SIZES = ("driver", "crop", "even", "background")
ALPHAS = ("straight", "premultiplied")
PROVENANCE = ("full", "mark")


@dataclass(frozen=True, kw_only=True)
class OutputOptions(Part):
    """What comes out. A `frame_rate` of None is the driver's, or 30; `audio` None is its own."""

    output: Path = option(
        "-o --output",
        "Output",
        ".mp4 .mov .mkv .webm .gif .webp .apng, .png for one frame, or a folder of PNG.",
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
        "--codec",
        "Output",
        "h264, h265, vp9, av1, prores, ffv1; default by container.",
        metavar="NAME",
    )
    pix_fmt: str | None = option(
        "--pix-fmt",
        "Output",
        "Pixels of the video by FFmpeg's name, such as yuv420p10le for 10 bits; default by codec.",
        metavar="NAME",
    )
    alpha: str = option(
        "--alpha",
        "Output",
        "How transparent colours are written: straight (default), or premultiplied.",
        default="straight",
        choices=ALPHAS,
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
    audio_track: int | None = option(
        "--audio-track",
        "Output",
        "Which of the sound's tracks, 0 first; default: the one marked as default.",
        kind="integer",
        metavar="N",
    )
    size: str = option(
        "--size",
        "Output",
        "The frame of the driver (default), the square around the person, the frame made even, or"
        " that of a picture or video behind.",
        default="driver",
        choices=SIZES,
    )
    compare: bool = option(
        "--compare", "Output", "Source, IUV and result side by side.", kind="flag", default=False
    )
    sheet: Path | None = option(
        "--sheet", "Output", "Write a contact sheet (PNG) there as well.", kind="path"
    )
    provenance: str = option(
        "--provenance",
        "Output",
        "What the output says of itself: full (default), what it was made of and by, for `mt"
        " verify`; or mark, only that it is synthetic.",
        default="full",
        choices=PROVENANCE,
    )
    credentials_cert: Path | None = option(
        "--credentials-cert",
        "Output",
        "Sign the output with this certificate (PEM, those of its issuers below it), as Content"
        " Credentials (C2PA).",
        kind="path",
        metavar="FILE",
    )
    credentials_key: Path | None = option(
        "--credentials-key",
        "Output",
        "The certificate's private key (PEM).",
        kind="path",
        metavar="FILE",
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
        super().__post_init__()
        if (self.credentials_cert is None) != (self.credentials_key is None):
            raise InputError("--credentials-cert and --credentials-key sign together; give both")
