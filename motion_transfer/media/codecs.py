"""The codecs of what is written, and how each is driven, for video and for lossless IUV."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2

CPU_AVX_512F = 13  # OpenCV's number, cv::CpuFeatures
X264_INSTRUCTIONS = ":asm=AVX2" if cv2.checkHardwareSupport(CPU_AVX_512F) else ""
"""Measured: with AVX-512, x264's look-ahead (mbtree) gives other bytes from run to run at many
widths, such as 192 or 302; with AVX2 it does not."""


@dataclass(frozen=True)
class Codec:
    """How one video codec is driven.

    Attributes:
        encoder: FFmpeg's name of the encoder.
        pixel_format: The format of the encoded video's pixels.
        crf: The constant rate factor that looks transparent; None for a lossless codec.
        options: Encoder settings; every one single-threaded, every group of pictures closed.
        highest_crf: The largest that the encoder takes.
        tag: The four characters that players expect in MP4, if not the default.
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

    @property
    def keeps_rgb(self) -> bool:
        """Whether pixels stay RGB; others become YUV as BT.709 has it."""
        return "bgr" in self.pixel_format


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
LOSSLESS = "ffv1"
