"""A video for browsers that tells nothing but its pictures: packets copied into a bare MP4.

Sound, titles, dates and the name of the encoder stay behind; nothing is encoded again.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from av.bitstream import BitStreamFilterContext
from av.error import FFmpegError

from motion_transfer.errors import InputError
from motion_transfer.media.container import find_pictures, open_input, open_output

PLAYED = ("h264", "vp9", "av1")
"""What every browser of today plays in MP4."""

PLAYED_PIXELS = ("yuv420p", "yuvj420p")
"""What every browser plays of them; of 10 bits or 4:4:4, some show nothing."""

TIMED = {"mp4", "matroska"}
"""Of containers that say when a frame is shown; AVI only tells the order of decoding."""

REMEDY = "`ffmpeg -i FILE -pix_fmt yuv420p FILE.mp4`"
WITHOUT_REMARKS = "filter_units=remove_types=6"  # H.264's SEI, where x264 writes its settings
OPTIONS = {"fflags": "+bitexact", "movflags": "+faststart"}  # bitexact: no name of the program


@dataclass(frozen=True)
class BareVideo:
    """What was written: size in px, and how long it plays."""

    size: tuple[int, int]
    duration_seconds: Fraction


def copy_for_browsers(path: Path, destination: Path) -> BareVideo:
    """Copy the pictures of a video into an MP4 that begins at 0.

    Raises: InputError for a video that not all browsers play, or that is damaged; OSError.
    """
    try:
        with open_input(path) as source:
            stream = find_pictures(source, f"video {path}")
            name = stream.codec_context.codec.canonical_name
            pixels = stream.codec_context.pix_fmt
            if name not in PLAYED or pixels not in PLAYED_PIXELS:
                raise InputError(
                    f"video {path} is {name} in {pixels}, which not all browsers play; encode it"
                    f" as H.264 in yuv420p, such as by {REMEDY}"
                )
            packets = [packet for packet in source.demux(stream) if packet.size]
            if not packets:
                raise InputError(f"video {path} holds no frames; export it again")
            times = [packet.pts for packet in packets if packet.pts is not None]
            if len(times) < len(packets) or not TIMED & set(source.format.name.split(",")):
                raise InputError(
                    f"video {path} does not say when each frame is shown; save it as MP4, such as"
                    f" by {REMEDY}"
                )
            shown = sorted(times)
            # decoding begins as much earlier as a frame ever needs; Matroska does not tell when
            delay = max(early - time for early, time in zip(shown, times, strict=True))
            length = packets[-1].duration or (shown[-1] - shown[0]) // max(1, len(shown) - 1)
            duration = (shown[-1] - shown[0] + length) * (stream.time_base or Fraction(1))
            clean = BitStreamFilterContext(WITHOUT_REMARKS, stream) if name == "h264" else None
            with open_output(destination, format_name="mp4", options=OPTIONS) as output:
                copied = output.add_stream_from_template(stream, opaque=True)
                copied.metadata.clear()
                for packet, time, early in zip(packets, times, shown, strict=True):
                    packet.pts, packet.dts = time - shown[0], early - shown[0] - delay
                    for kept in clean.filter(packet) if clean else [packet]:
                        kept.stream = copied
                        output.mux(kept)
            size = stream.codec_context.width, stream.codec_context.height
    except FFmpegError as error:
        raise InputError(
            f"video {path} cannot be copied ({error.strerror}); export it again"
        ) from error
    return BareVideo(size, duration)
