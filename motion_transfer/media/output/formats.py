"""What can be written: kinds of output by their endings, and what containers take."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import av

from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS, LOSSLESS, Codec, holds_alpha
from motion_transfer.media.output.marks import Mark

AlphaMode = Literal["straight", "premultiplied"]
"""Whether colours are as they are, or multiplied by alpha."""


@dataclass(frozen=True)
class Container:
    """What one video container takes.

    Attributes:
        codecs: Names in `CODECS`; the first is its default.
        alpha: Those of them whose alpha it holds; the first is the default of transparent frames.
        audio: FFmpeg's name of the encoder of its sound.
        is_mp4: Whether it is of the MP4 family: its index is moved to the front, so that it plays
            while it loads, and codecs go by tags.
    """

    codecs: tuple[str, ...]
    alpha: tuple[str, ...] = ()
    audio: str = "aac"
    is_mp4: bool = False


CONTAINERS = {
    ".mp4": Container(("h264", "h265", "av1", "vp9"), is_mp4=True),
    ".mov": Container(("h264", "h265", "prores"), alpha=("prores",), is_mp4=True),
    ".mkv": Container(
        ("h264", "h265", "vp9", "av1", "ffv1", "prores"), alpha=("ffv1", "vp9", "prores")
    ),
    ".webm": Container(("vp9", "av1"), alpha=("vp9",), audio="libopus"),
}


@dataclass(frozen=True)
class OutputKind:
    """One row of the table: what a kind of output can hold, and who makes it.

    Attributes:
        suffixes: Endings of its names, lower case; an empty one is a folder's.
        help: The endings, in the words of messages.
        module: Where its `open_segment`, `join_segments`, `digest_output` and `read_mark` are,
            which do what those of `segments` say; it is imported when it is first needed.
        segment_suffix: The ending of a segment's name, where segments are no videos.
        has_sound: Whether it holds sound.
        several: Whether it holds several frames.
        alpha: How it can hold alpha; of a video, the container's codecs say whether.
    """

    suffixes: tuple[str, ...]
    help: str
    module: str
    segment_suffix: str | None = None
    has_sound: bool = False
    several: bool = True
    alpha: tuple[AlphaMode, ...] = ()


HERE = "motion_transfer.media.output"
STRAIGHT: tuple[AlphaMode, ...] = ("straight",)
OUTPUT_KINDS = {
    "video": OutputKind(
        tuple(CONTAINERS),
        ", ".join(CONTAINERS),
        f"{HERE}.video",
        has_sound=True,
        alpha=get_args(AlphaMode),
    ),
    "gif": OutputKind((".gif",), ".gif", f"{HERE}.gif"),
    "webp": OutputKind((".webp",), ".webp", f"{HERE}.animation", alpha=STRAIGHT),
    "apng": OutputKind((".apng",), ".apng", f"{HERE}.animation", alpha=STRAIGHT),
    "image": OutputKind(
        (".png",), ".png (one frame)", f"{HERE}.frames", "", several=False, alpha=STRAIGHT
    ),
    "frames": OutputKind(
        ("",), "and none for a folder of PNG", f"{HERE}.frames", "", alpha=STRAIGHT
    ),
}
"""A new kind of output is a row here and the module that it names."""

SEGMENT_SUFFIXES = {"nut": ".nut", "matroska": ".mkv"}


@dataclass(frozen=True)
class OutputFormat:
    """What one run writes; decides its bytes together with the output's ending.

    Attributes:
        kind: A name in `OUTPUT_KINDS`.
        codec: What frames are encoded with; lossless where the kind has no codec of its own.
        codec_name: Its name in `CODECS`.
        crf: The constant rate factor; None for a codec without one.
        transparent: Whether frames come as RGBA, not multiplied, and alpha is written.
        premultiplied: Whether colours are written multiplied by alpha.
        mark: What frames say that are pictures of their own.
    """

    kind: str
    codec: Codec
    codec_name: str
    crf: int | None
    transparent: bool = False
    premultiplied: bool = False
    mark: Mark | None = None

    @property
    def row(self) -> OutputKind:
        """What this kind of output can hold, and who makes it."""
        return OUTPUT_KINDS[self.kind]

    @property
    def pixel_format(self) -> str:
        """The format of the encoded frames' pixels, FFmpeg's name."""
        return self.codec.pixel_format

    @property
    def alpha_mode(self) -> AlphaMode | None:
        """How alpha is written; None where there is none."""
        if not self.transparent:
            return None
        return "premultiplied" if self.premultiplied else "straight"

    @property
    def segment_suffix(self) -> str:
        """The ending of a segment's name."""
        suffix = self.row.segment_suffix
        return SEGMENT_SUFFIXES[self.codec.segment_container] if suffix is None else suffix


def kind_of(output: Path) -> str | None:
    """Tell the kind of an output by its name's ending; None for one that is none of them."""
    suffix = output.suffix.lower()
    return next((kind for kind, row in OUTPUT_KINDS.items() if suffix in row.suffixes), None)


def choose_format(
    output: Path,
    *,
    codec: str | None,
    crf: int | None,
    transparent: bool = False,
    alpha: str = "straight",
    pix_fmt: str | None = None,
) -> OutputFormat:
    """Choose the format that an output path and the options mean.

    Args:
        transparent: Whether frames come as H x W x 4 RGBA and keep their alpha.
        alpha: `straight`, or `premultiplied` for colours that are multiplied by alpha.
        pix_fmt: One of the codec's pixel formats; None for its first that fits.
    Raises: OutputError for an unknown ending or codec, one that the container or the installed
        FFmpeg lacks, a crf or a pixel format where none applies, or alpha where none can be.
    """
    suffix = output.suffix.lower()
    kind = kind_of(output)
    if kind is None:
        raise OutputError(
            f"cannot write {output}: unknown ending {output.suffix}; supported are"
            f" {', '.join(row.help for row in OUTPUT_KINDS.values())}"
        )
    _check_alpha(output, OUTPUT_KINDS[kind], transparent=transparent, alpha=alpha)
    premultiplied = alpha == "premultiplied"
    if suffix not in CONTAINERS:
        for name, value in (("codec", codec), ("crf", crf), ("pix-fmt", pix_fmt)):
            if value is not None:
                raise OutputError(f"--{name} is for video, and {output} is not one; leave it out")
        stored = _choose_pixels(LOSSLESS, None, transparent=transparent)
        return OutputFormat(kind, stored, LOSSLESS, None, transparent)
    takes = CONTAINERS[suffix]
    name = codec or (takes.alpha if transparent else takes.codecs)[0]
    if name not in CODECS:
        raise OutputError(f"unknown codec {name!r}; supported are {', '.join(CODECS)}")
    if name not in takes.codecs:
        raise OutputError(f"{suffix} cannot hold {name}; it takes {', '.join(takes.codecs)}")
    if transparent and name not in takes.alpha:
        raise OutputError(
            f"{name} in {suffix} cannot hold transparency; there {' or '.join(takes.alpha)} can"
        )
    chosen = _choose_pixels(name, pix_fmt, transparent=transparent)
    if crf is not None and (chosen.crf is None or not 0 <= crf <= chosen.highest_crf):
        limits = f"takes a crf of 0 to {chosen.highest_crf}"
        lossless = "is lossless and takes no crf" if name == LOSSLESS else "takes no crf"
        raise OutputError(f"--crf {crf}: {name} {lossless if chosen.crf is None else limits}")
    rate = chosen.crf if crf is None else crf
    return OutputFormat(kind, chosen, name, rate, transparent, premultiplied)


def _check_alpha(output: Path, row: OutputKind, *, transparent: bool, alpha: str) -> None:
    """Refuse alpha where there is none, or in a form that an output cannot have."""
    if alpha not in get_args(AlphaMode):
        supported = ", ".join(get_args(AlphaMode))
        raise OutputError(f"unknown way to write alpha {alpha!r}; supported are {supported}")
    if not transparent:
        if alpha != "straight":
            raise OutputError(
                f"{output} is not to be transparent, so that --alpha {alpha} means nothing; leave"
                " it out, or add --background transparent"
            )
        return
    container = CONTAINERS.get(output.suffix.lower())
    if not (row.alpha if container is None else container.alpha):
        raise OutputError(
            f"{output} cannot hold transparency; {', '.join(transparent_suffixes())} and a folder"
            " of PNG can"
        )
    if alpha not in row.alpha:
        raise OutputError(
            f"{output} is {' or '.join(row.alpha)} by its specification, and not {alpha}; write"
            f" {', '.join(suffix for suffix, row in CONTAINERS.items() if row.alpha)} for that"
        )


def transparent_suffixes() -> list[str]:
    """List the endings of files that can hold transparency."""
    kinds = [
        suffix
        for row in OUTPUT_KINDS.values()
        for suffix in row.suffixes
        if suffix and suffix not in CONTAINERS and row.alpha
    ]
    return [*(suffix for suffix, row in CONTAINERS.items() if row.alpha), *kinds]


def _choose_pixels(name: str, pix_fmt: str | None, *, transparent: bool) -> Codec:
    """Choose a codec's pixel format. Raises: OutputError for one that does not fit."""
    codec = CODECS[name]
    if codec.encoder not in av.codecs_available:
        raise OutputError(f"the installed FFmpeg has no {codec.encoder}; choose another --codec")
    fitting = [form for form in codec.pixel_formats if holds_alpha(form) == transparent]
    if pix_fmt is None:
        return codec.with_pixels(fitting[0])
    if pix_fmt not in codec.pixel_formats:
        raise OutputError(f"--pix-fmt {pix_fmt}: {name} takes {', '.join(codec.pixel_formats)}")
    if pix_fmt not in fitting:
        reason = "has no alpha for" if transparent else "has alpha, which is not in"
        raise OutputError(
            f"--pix-fmt {pix_fmt} {reason} this output; {name} takes {', '.join(fitting)} here"
        )
    known = av.Codec(codec.encoder, "w").video_formats  # some encoders do not say
    if known and pix_fmt not in [form.name for form in known]:
        raise OutputError(
            f"--pix-fmt {pix_fmt}: the installed FFmpeg's {codec.encoder} takes none; leave it out"
        )
    return codec.with_pixels(pix_fmt)
