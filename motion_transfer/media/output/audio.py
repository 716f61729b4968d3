"""Sound for a video: cut to the sample, encoded once, laid between the pictures' packets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
from av.audio.fifo import AudioFifo
from av.audio.resampler import AudioResampler
from av.container import OutputContainer
from av.error import FFmpegError

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.iuv.formats import find_iuv_format
from motion_transfer.media.output.formats import OutputFormat

BIT_RATE = 192_000  # bits per second; chosen so high that a second encoding is not heard
RATES = (48_000, 44_100)  # Hz; what every encoder here takes. Other rates become the first
FRAME_SAMPLES = 960  # for encoders that take any number; Opus' 20 ms


@dataclass(frozen=True)
class AudioCut:
    """A piece of a file's sound."""

    path: Path
    start_seconds: Fraction
    duration_seconds: Fraction


def choose_audio(
    wish: Path | None,
    output: Path,
    output_format: OutputFormat,
    *,
    driver: Path,
    start_seconds: Fraction,
    duration_seconds: Fraction,
) -> AudioCut | None:
    """Choose an output's sound: the named file's from its beginning, else the driver's.

    Args:
        wish: A file, `none`, or None for the driver's own sound where it has one.
        start_seconds: Where the output begins in the driver.
    Raises: InputError for a file that has no sound; OutputError where the output can hold none.
    """
    if str(wish) == "none":
        return None
    if not output_format.row.has_sound:
        if wish is not None:
            raise OutputError(f"{output} cannot hold sound; leave out --audio, or write a video")
        return None
    if wish is None:
        may_sound = driver.is_file() and find_iuv_format(driver).has_sound
        sounds = may_sound and _has_audio(driver)
        return AudioCut(driver, start_seconds, duration_seconds) if sounds else None
    if not wish.is_file():
        raise InputError(f"audio {wish} does not exist")
    if not _has_audio(wish):
        raise InputError(f"audio {wish} has no sound in it; name another file, or none")
    return AudioCut(wish, Fraction(0), duration_seconds)


def _has_audio(path: Path) -> bool:
    try:
        with av.open(str(path)) as container:
            return bool(container.streams.audio)
    except FFmpegError:
        return False


class AudioTrack:
    """The sound of one output; add it before the first packet, then `write_until` as time goes."""

    def __init__(self, cut: AudioCut, output: OutputContainer, encoder: str) -> None:
        """Raises: InputError for a file whose sound cannot be read."""
        self._output = output
        try:
            with av.open(str(cut.path)) as container:
                source = container.streams.audio[0]
                rate = source.rate if source.rate in RATES else RATES[0]
                layout = "mono" if source.channels == 1 else "stereo"
        except (FFmpegError, IndexError) as error:
            raise InputError(f"audio {cut.path} cannot be read: {error}") from error
        stream = output.add_stream(encoder, rate=rate)
        self._stream = cast(av.AudioStream, stream)
        self._stream.bit_rate = BIT_RATE
        self._stream.layout = layout
        self._stream.codec_context.thread_count = 1  # for the same bytes everywhere
        self._stream.codec_context.open()  # settles how many samples a frame has
        self._packets = self._encode(cut)
        self._next: av.Packet | None = None

    def write_until(self, seconds: Fraction | None) -> None:
        """Mux every packet that begins before that time; None: all that are left."""
        while True:
            packet = self._next or next(self._packets, None)
            self._next = packet
            if packet is None:
                return
            begins = (packet.pts or 0) * packet.time_base
            if seconds is not None and begins >= seconds:
                return
            packet.stream = self._stream
            self._output.mux(packet)
            self._next = None

    def _encode(self, cut: AudioCut) -> Iterator[av.Packet]:
        context = self._stream.codec_context
        rate = context.sample_rate
        fifo = AudioFifo()
        taken = 0
        try:
            for frame in self._cut_frames(cut):
                fifo.write(frame)
                size = context.frame_size or FRAME_SAMPLES
                while (block := fifo.read(size)) is not None:
                    taken += self._stamp(block, taken, rate)
                    yield from self._stream.encode(block)
        except FFmpegError as error:
            raise InputError(f"audio {cut.path} is damaged ({error.strerror})") from error
        # the encoder takes a short block only as its last
        if (rest := fifo.read(0, partial=True)) is not None and rest.samples:
            self._stamp(rest, taken, rate)
            yield from self._stream.encode(rest)
        yield from self._stream.encode(None)

    @staticmethod
    def _stamp(block: av.AudioFrame, first: int, rate: int) -> int:
        block.pts, block.time_base = first, Fraction(1, rate)
        return block.samples

    def _cut_frames(self, cut: AudioCut) -> Iterator[av.AudioFrame]:
        """Decode the cut, resampled for the encoder, exact to the sample."""
        context = self._stream.codec_context
        rate = context.sample_rate
        first = round(cut.start_seconds * rate)
        stop = first + round(cut.duration_seconds * rate)
        resampler = AudioResampler(format=context.format, layout=context.layout, rate=rate)
        position: int | None = None
        with av.open(str(cut.path)) as container:
            for decoded in container.decode(audio=0):
                if position is None:  # sound may begin later than the pictures
                    position = round((decoded.pts or 0) * (decoded.time_base or 0) * rate)
                for frame in resampler.resample(decoded):
                    begin, end = max(first - position, 0), min(stop - position, frame.samples)
                    position += frame.samples
                    if begin < end:
                        yield _slice(frame, begin, end)
                if position >= stop:
                    return


def _slice(frame: av.AudioFrame, begin: int, end: int) -> av.AudioFrame:
    channels = 1 if frame.format.is_planar else frame.layout.nb_channels
    samples = frame.to_ndarray()[:, begin * channels : end * channels].copy()
    piece = av.AudioFrame.from_ndarray(samples, format=frame.format.name, layout=frame.layout.name)
    piece.sample_rate = frame.sample_rate
    return piece
