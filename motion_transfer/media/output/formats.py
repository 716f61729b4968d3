"""What can be written: kinds of output by their endings, and what containers take."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import av

from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS, LOSSLESS, Codec


@dataclass(frozen=True)
class Container:
    """What one video container takes.

    Attributes:
        codecs: Names in `CODECS`; the first is its default.
        audio: FFmpeg's name of the encoder of its sound.
        is_mp4: Whether it is of the MP4 family: its index is moved to the front, so that it plays
            while it loads, and codecs go by tags.
    """

    codecs: tuple[str, ...]
    audio: str = "aac"
    is_mp4: bool = False


CONTAINERS = {
    ".mp4": Container(("h264", "h265", "av1", "vp9"), is_mp4=True),
    ".mov": Container(("h264", "h265"), is_mp4=True),
    ".mkv": Container(("h264", "h265", "vp9", "av1", "ffv1")),
    ".webm": Container(("vp9", "av1"), audio="libopus"),
}


@dataclass(frozen=True)
class OutputKind:
    """One row of the table: what a kind of output can hold, and who makes it.

    Attributes:
        suffixes: Endings of its names, lower case; an empty one is a folder's.
        help: The endings, in the words of messages.
        module: Where its `open_segment` and `join_segments` are, which do what those of `segments`
            say; it is imported when the first output of this kind is made.
        segment_suffix: The ending of a segment's name.
        has_sound: Whether it holds sound.
        several: Whether it holds several frames.
    """

    suffixes: tuple[str, ...]
    help: str
    module: str
    segment_suffix: str = ""
    has_sound: bool = False
    several: bool = True


HERE = "motion_transfer.media.output"
OUTPUT_KINDS = {
    "video": OutputKind(
        tuple(CONTAINERS), ", ".join(CONTAINERS), f"{HERE}.video", ".nut", has_sound=True
    ),
    "gif": OutputKind((".gif",), ".gif", f"{HERE}.gif", ".nut"),
    "image": OutputKind((".png",), ".png (one frame)", f"{HERE}.frames", several=False),
    "frames": OutputKind(("",), "and none for a folder of PNG", f"{HERE}.frames"),
}
"""A new kind of output is a row here and the module that it names."""


@dataclass(frozen=True)
class OutputFormat:
    """What one run writes; decides its bytes together with the output's ending.

    Attributes:
        kind: A name in `OUTPUT_KINDS`.
        codec: What frames are encoded with; lossless where the kind has no codec of its own.
        codec_name: Its name in `CODECS`.
        crf: The constant rate factor; None for a lossless codec.
    """

    kind: str
    codec: Codec
    codec_name: str
    crf: int | None

    @property
    def row(self) -> OutputKind:
        """What this kind of output can hold, and who makes it."""
        return OUTPUT_KINDS[self.kind]


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

    Raises: OutputError for an unknown ending or codec, one that the container or the installed
        FFmpeg lacks, or a crf where none applies.
    """
    suffix = output.suffix.lower()
    kind = next((kind for kind, row in OUTPUT_KINDS.items() if suffix in row.suffixes), None)
    if kind is None:
        raise OutputError(
            f"cannot write {output}: unknown ending {output.suffix}; supported are"
            f" {', '.join(row.help for row in OUTPUT_KINDS.values())}"
        )
    if suffix not in CONTAINERS:
        for name, value in (("codec", codec), ("crf", crf)):
            if value is not None:
                raise OutputError(f"--{name} is for video, and {output} is not one; leave it out")
        return OutputFormat(kind, CODECS[LOSSLESS], LOSSLESS, None)
    takes = CONTAINERS[suffix].codecs
    name = codec or takes[0]
    if name not in CODECS:
        raise OutputError(f"unknown codec {name!r}; supported are {', '.join(CODECS)}")
    if name not in takes:
        raise OutputError(f"{suffix} cannot hold {name}; it takes {', '.join(takes)}")
    chosen = CODECS[name]
    if chosen.encoder not in av.codecs_available:
        raise OutputError(f"the installed FFmpeg has no {chosen.encoder}; choose another --codec")
    if crf is not None and (chosen.crf is None or not 0 <= crf <= chosen.highest_crf):
        limits = f"takes a crf of 0 to {chosen.highest_crf}"
        lossless = "is lossless and takes no crf"
        raise OutputError(f"--crf {crf}: {name} {lossless if chosen.crf is None else limits}")
    return OutputFormat(kind, chosen, name, chosen.crf if crf is None else crf)
