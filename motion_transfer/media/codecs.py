"""The codecs of what is written, and how each is driven, for video and for lossless IUV."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import cv2
from av.video.format import VideoFormat

CPU_AVX_512F = 13  # OpenCV's number, cv::CpuFeatures
X264_INSTRUCTIONS = ":asm=AVX2" if cv2.checkHardwareSupport(CPU_AVX_512F) else ""
"""Measured: with AVX-512, x264's look-ahead (mbtree) gives other bytes from run to run at many
widths, such as 192 or 302; with AVX2 it does not."""


@dataclass(frozen=True)
class Codec:
    """How one video codec is driven.

    Attributes:
        encoder: FFmpeg's name of the encoder.
        pixel_formats: The formats that the encoded video's pixels may have, FFmpeg's names. The
            first is taken; where there is alpha, the first that has it.
        crf: The constant rate factor that looks transparent; None for a codec without one.
        options: Encoder settings; every one single-threaded, every group of pictures closed.
        highest_crf: The largest that the encoder takes.
        tags: The four characters that players expect in MP4 and QuickTime, by pixel format, where
            they are not the default.
        fits_nut: Whether NUT takes it.
    """

    encoder: str
    pixel_formats: tuple[str, ...]
    crf: int | None
    options: dict[str, str] = field(default_factory=dict)
    highest_crf: int = 63
    tags: dict[str, str] = field(default_factory=dict)
    fits_nut: bool = True

    @property
    def pixel_format(self) -> str:
        """The format of the encoded video's pixels."""
        return self.pixel_formats[0]

    @property
    def tag(self) -> str | None:
        """The four characters for this pixel format, if not the default."""
        return self.tags.get(self.pixel_format)

    @property
    def needs_even_size(self) -> bool:
        return "420" in self.pixel_format

    @property
    def keeps_rgb(self) -> bool:
        """Whether pixels stay RGB; others become YUV as BT.709 has it."""
        return "bgr" in self.pixel_format

    @property
    def has_alpha(self) -> bool:
        return holds_alpha(self.pixel_format)

    @property
    def segment_container(self) -> str:
        """FFmpeg's name of the container of segments.

        NUT takes any frame rate without rounding, but loses what lies beside a packet, and that is
        where VP9's alpha is.
        """
        return "nut" if self.fits_nut and not self.has_alpha else "matroska"

    def with_pixels(self, pixel_format: str) -> Self:
        """Have one of its pixel formats as the one that is taken."""
        others = (name for name in self.pixel_formats if name != pixel_format)
        return replace(self, pixel_formats=(pixel_format, *others))


def holds_alpha(pixel_format: str) -> bool:
    """Tell whether one of FFmpeg's pixel formats has alpha."""
    return any(component.is_alpha for component in VideoFormat(pixel_format).components)


CODECS = {
    "h264": Codec(
        "libx264",
        ("yuv420p", "yuv444p", "yuv420p10le"),
        18,
        {"preset": "veryfast", "x264-params": "open-gop=0" + X264_INSTRUCTIONS},
        highest_crf=51,
    ),
    "h265": Codec(
        "libx265",
        ("yuv420p", "yuv420p10le"),
        20,
        {"preset": "fast", "x265-params": "open-gop=0:pools=none:frame-threads=1:log-level=none"},
        highest_crf=51,
        tags={"yuv420p": "hvc1", "yuv420p10le": "hvc1"},
    ),
    "vp9": Codec(
        "libvpx-vp9",
        ("yuv420p", "yuv420p10le", "yuva420p"),
        24,
        {"b": "0", "cpu-used": "4", "deadline": "good"},
    ),
    "av1": Codec(
        "libsvtav1", ("yuv420p", "yuv420p10le"), 26, {"preset": "9", "svtav1-params": "lp=1"}
    ),
    "prores": Codec(
        "prores_ks",  # the profile follows from the pixels: 422 HQ or 4444
        ("yuv422p10le", "yuva444p10le"),
        None,
        {"vendor": "apl0"},  # some editors take no other maker's
        tags={"yuv422p10le": "apch", "yuva444p10le": "ap4h"},
        fits_nut=False,
    ),
    "ffv1": Codec("ffv1", ("bgr0", "bgra"), None, {"level": "3", "slices": "4", "slicecrc": "1"}),
}
LOSSLESS = "ffv1"
