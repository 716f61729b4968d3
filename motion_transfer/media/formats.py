"""What can be written: containers, codecs and their settings."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import av
import cv2

from motion_transfer.errors import OutputError

CPU_AVX_512F = 13  # OpenCV's number, cv::CpuFeatures
X264_INSTRUCTIONS = ":asm=AVX2" if cv2.checkHardwareSupport(CPU_AVX_512F) else ""
"""Measured: with AVX-512, x264's look-ahead (mbtree) gives other bytes from run to run at many
widths, such as 192 or 302; with AVX2 it does not."""


@dataclass(frozen=True)
class Codec:
    """How one video codec is driven.

    Attributes:
        encoder: FFmpeg's name of the encoder.
        pixel_format: of the encoded video.
        crf: constant rate factor that looks transparent; None for a lossless codec.
        options: encoder settings; every one single-threaded, every group of pictures closed.
        highest_crf: the largest that the encoder takes.
        tag: the four characters that players expect in MP4, if not the default.
    """

    encoder: str
    pixel_format: str
    crf: int | None
    options: dict[str, str] = field(default_factory=dict)
    highest_crf: int = 63
    tag: str | None = None

    @property
    def needs_even_size(self) -> bool:
        return "420" in self.pixel_format


CODECS = {
    "h264": Codec(
        "libx264",
        "yuv420p",
        18,
        {"preset": "veryfast", "x264-params": "open-gop=0" + X264_INSTRUCTIONS},
        highest_crf=51,
    ),
    "h265": Codec(
        "libx265",
        "yuv420p",
        20,
        {"preset": "fast", "x265-params": "open-gop=0:pools=none:frame-threads=1:log-level=none"},
        highest_crf=51,
        tag="hvc1",
    ),
    "vp9": Codec("libvpx-vp9", "yuv420p", 24, {"b": "0", "cpu-used": "4", "deadline": "good"}),
    "av1": Codec("libsvtav1", "yuv420p", 26, {"preset": "9", "svtav1-params": "lp=1"}),
    "ffv1": Codec("ffv1", "bgr0", None, {"level": "3", "slices": "4", "slicecrc": "1"}),
}

CONTAINERS: dict[str, tuple[str, ...]] = {
    ".mp4": ("h264", "h265", "av1", "vp9"),
    ".mov": ("h264", "h265"),
    ".mkv": ("h264", "h265", "vp9", "av1", "ffv1"),
    ".webm": ("vp9", "av1"),
}
"""Codecs that each container takes; the first is its default."""


@dataclass(frozen=True)
class OutputFormat:
    """What one run writes: `video`, `gif`, `frames` (a folder of PNG) or `image` (one PNG)."""

    kind: str
    codec: Codec
    codec_name: str
    crf: int | None


def choose_format(output: Path, *, codec: str | None, crf: int | None) -> OutputFormat:
    """The format that an output path and the options mean.

    Raises: OutputError for an unknown ending or codec, one that the container or the installed
        FFmpeg lacks, or a crf where none applies.
    """
    suffix = output.suffix.lower()
    kind = {"": "frames", ".gif": "gif", ".png": "image"}.get(suffix, "video")
    if kind == "video" and suffix not in CONTAINERS:
        raise OutputError(
            f"cannot write {output}: unknown ending {output.suffix}; supported are"
            f" {', '.join(CONTAINERS)}, .gif, .png (one frame), and none for a folder of PNG"
        )
    if kind != "video":
        for name, value in (("codec", codec), ("crf", crf)):
            if value is not None:
                raise OutputError(f"--{name} is for video, and {output} is not one; leave it out")
        return OutputFormat(kind, CODECS["ffv1"], "ffv1", None)
    name = codec or CONTAINERS[suffix][0]
    if name not in CODECS:
        raise OutputError(f"unknown codec {name!r}; supported are {', '.join(CODECS)}")
    if name not in CONTAINERS[suffix]:
        raise OutputError(f"{suffix} cannot hold {name}; it takes {', '.join(CONTAINERS[suffix])}")
    chosen = CODECS[name]
    if chosen.encoder not in av.codecs_available:
        raise OutputError(f"the installed FFmpeg has no {chosen.encoder}; choose another --codec")
    if crf is not None and (chosen.crf is None or not 0 <= crf <= chosen.highest_crf):
        takes = "is lossless and takes no crf" if chosen.crf is None else "takes a crf of 0 to"
        highest = "" if chosen.crf is None else f" {chosen.highest_crf}"
        raise OutputError(f"--crf {crf}: {name} {takes}{highest}")
    return OutputFormat("video", chosen, name, chosen.crf if crf is None else crf)
