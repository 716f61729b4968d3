"""Digests of what a video holds, by which an edited one is told from what was written.

They are of what is decoded, not of its packing: containers divide the packets of H.264 and H.265 in
two ways, and keep parameter sets in the header or not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from av import Packet, VideoStream
from av.container import InputContainer

DIGEST_BYTES = 16
"""Of a SHA-256: enough to tell, and a record of an hour of video stays below 100 KB."""

START_CODE = b"\0\0\1"
HEVC_PARAMETER_SETS = range(32, 35)  # types of units: VPS, SPS, PPS
AV1_DELIMITER = b"\x12\0"  # begins a packet, but not in Matroska and MP4
BESIDE_PACKET = "matroska_block_additional"  # where the alpha of VP9 is

Units = Callable[[bytes], Iterator[bytes]]


def shorten(digest: bytes) -> str:
    """Write a SHA-256 as records have it: its first half, hexadecimal."""
    return digest[:DIGEST_BYTES].hex()


def digest_packets(container: InputContainer, counts: Sequence[int]) -> list[str]:
    """Make a digest of each run of so many packets of a video, in decoding order.

    Returns: One more, if there are more packets.
    """
    stream = container.streams.video[0]
    units = _choose_units(stream)
    packets = (packet for packet in container.demux(stream) if packet.size)
    digests = [_digest(islice(packets, count), units) for count in counts]
    rest = list(islice(packets, 1))
    return digests + [_digest(iter(rest), units)] * len(rest)


def _digest(packets: Iterator[Packet], units: Units) -> str:
    digest = hashlib.sha256()
    for packet in packets:
        beside = [bytes(data) for data in packet.iter_sidedata() if data.data_type == BESIDE_PACKET]
        for unit in [*units(bytes(packet)), *beside]:
            digest.update(len(unit).to_bytes(4, "big") + unit)
    return shorten(digest.digest())


def _choose_units(stream: VideoStream) -> Units:
    """Choose what divides packets into what counts of them.

    Source: H.264 and H.265, annex B; ISO/IEC 14496-15 for lengths in the place of start codes.
    """
    context = stream.codec_context
    name = context.codec.canonical_name
    if name == "av1":
        return lambda data: iter([data.removeprefix(AV1_DELIMITER)])
    if name not in ("h264", "hevc"):
        return lambda data: iter([data])
    header = context.extradata or b""
    has_lengths = header[:1] == b"\1"
    size = 1 + (header[4 if name == "h264" else 21] & 3) if has_lengths else 0
    is_hevc = name == "hevc"

    def divide(data: bytes) -> Iterator[bytes]:
        for unit in _by_length(data, size) if has_lengths else _by_start_code(data):
            if not (is_hevc and unit and unit[0] >> 1 & 0x3F in HEVC_PARAMETER_SETS):
                yield unit

    return divide


def _by_start_code(data: bytes) -> Iterator[bytes]:
    # zeros before a start code are its, and no unit ends in one
    return (unit.rstrip(b"\0") for unit in data.split(START_CODE)[1:])


def _by_length(data: bytes, size: int) -> Iterator[bytes]:
    start = 0
    while start < len(data):
        end = start + size + int.from_bytes(data[start : start + size], "big")
        yield data[start + size : end]
        start = end
