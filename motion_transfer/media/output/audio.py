"""Sound for a video: cut to the sample, encoded once, laid between the pictures' packets.

Sound stands where its time stamps say: where a file has none, because it starts late or packets are
missing, there is silence, and what follows is not moved to the front.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import cast

import av
import numpy as np
from av.audio.fifo import AudioFifo
from av.audio.resampler import AudioResampler
from av.container import InputContainer, OutputContainer
from av.error import FFmpegError
from av.stream import Disposition
from jaxtyping import Float32

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.container import open_input
from motion_transfer.media.iuv.formats import find_iuv_format
from motion_transfer.media.output.formats import OutputFormat

BIT_RATE = 192_000  # bits per second; chosen so high that a second encoding is not heard
RATES = (48_000, 44_100)  # Hz; what every encoder here takes. Other rates become the first
FRAME_SAMPLES = 960  # for encoders that take any number; Opus' 20 ms

JITTER_SECONDS = Fraction(15, 1000)
"""How far a time stamp may be from the end of the sound before it. Containers that count in
milliseconds, and phones, put packets a little beside their place, and to follow them would click;
but a packet that is missing, 20 ms of Opus or 21 ms of AAC, is a hole."""

HIGHEST_RATE = 768_000
"""Hz; twice what any recorder offers. A damaged header may claim thousands of millions."""

REMEDY = "convert it first, give another file by --audio, or none"

SILENCE_SAMPLES = 2**16  # at once; a hole may be hours long

WORKING_FORMAT = "fltp"  # between decoding and encoding: an array of floats for each channel

Samples = Float32[np.ndarray, "C N"]


@dataclass(frozen=True)
class AudioCut:
    """A piece of a file's sound.

    Attributes:
        start_seconds: Where it begins on the file's clock.
        track: Which of the file's tracks it is of; 0 is the first.
        notes: What the user should know of it, in sentences.
    """

    path: Path
    start_seconds: Fraction
    duration_seconds: Fraction
    track: int = 0
    notes: tuple[str, ...] = field(default=(), compare=False, repr=False)


def choose_audio(
    wish: Path | None,
    output: Path,
    output_format: OutputFormat,
    *,
    track: int | None = None,
    driver: Path,
    start_seconds: Fraction,
    duration_seconds: Fraction,
) -> AudioCut | None:
    """Choose an output's sound: the named file's from its beginning, else the driver's.

    It is decoded once, to the end: what is wrong with it is better known before rendering.

    Args:
        wish: A file, `none`, or None for the driver's own sound where it has one.
        track: Which track, 0 first; None for the one that the file marks as its default.
        start_seconds: Where the output begins on the driver's clock.
    Raises: InputError for a file or a track that has no sound, or whose sound cannot be decoded;
        OutputError where the output can hold none.
    """
    if str(wish) == "none":
        if track is not None:
            raise InputError("--audio-track chooses sound, and --audio none wants none; drop one")
        return None
    if not output_format.row.has_sound:
        if wish is None and track is None:
            return None
        flag = "--audio-track" if wish is None else "--audio"
        raise OutputError(f"{output} cannot hold sound; leave out {flag}, or write a video")
    if wish is not None:
        path, what, remedy = wish, f"audio {wish}", "name another file, or none"
    else:
        path, what, remedy = driver, f"driver {driver}", "name a file by --audio, or leave it out"
        if not (driver.is_file() and find_iuv_format(driver).has_sound):
            if track is not None:
                raise InputError(f"--audio-track {track}: {what} has no sound in it; {remedy}")
            return None
    try:
        with open_input(path, "audio") as container:
            begins = Fraction(container.start_time or 0, av.time_base)
            tracks = container.streams.audio
            if not tracks:
                if wish is None and track is None:
                    return None
                raise InputError(f"{what} has no sound in it; {remedy}")
            chosen, notes = _choose_track(container, what, track)
    except FFmpegError as error:
        raise InputError(f"{what} cannot be read: {error.strerror}; {remedy}") from error
    cut = AudioCut(path, begins if wish else start_seconds, duration_seconds, chosen)
    holes: list[_Hole] = []
    if sum(1 for _ in _read_cut(cut, holes.append)):
        if holes:
            missing = float(sum(hole.seconds for hole in holes))
            notes += (
                f"the sound of {path} has holes, {missing:.2f} s in all, the first one"
                f" {float(holes[0].begins_seconds):.2f} s into the output; they are silent",
            )
        return replace(cut, notes=notes)
    if wish is None and track is None:
        return None
    raise InputError(f"{what} has no sound in its track {chosen}; {remedy}")


def _choose_track(
    container: InputContainer, what: str, wish: int | None
) -> tuple[int, tuple[str, ...]]:
    """Choose a track: the one wished for, else the file's default, else the first.

    Returns: The track, and notes, if it was one of several that nobody chose.
    """
    tracks = container.streams.audio
    listed = ", ".join(_describe(number, track) for number, track in enumerate(tracks))
    if wish is not None:
        if not 0 <= wish < len(tracks):
            raise InputError(f"--audio-track {wish}: {what} has the tracks {listed}; choose one")
        return wish, ()
    defaults = (n for n, track in enumerate(tracks) if track.disposition & Disposition.default)
    chosen = next(defaults, 0)
    if len(tracks) == 1:
        return chosen, ()
    note = f"{what} has the sound tracks {listed}; {chosen} is taken, --audio-track takes another"
    return chosen, (note,)


def _describe(number: int, track: av.AudioStream) -> str:
    """Name a track by its number, and its language and title where it has them."""
    words = [word for word in (track.language, track.metadata.get("title")) if word]
    return f"{number} ({', '.join(words)})" if words else str(number)


@dataclass(frozen=True)
class _Block:
    """Some samples, each between -1 and 1, and what they are of."""

    samples: Samples
    rate: int
    layout: str


@dataclass(frozen=True)
class _Hole:
    """Where sound stops, and goes on later."""

    begins_seconds: Fraction
    seconds: Fraction


class AudioTrack:
    """The sound of one output; add it before the first packet, then `write_until` as time goes."""

    def __init__(self, cut: AudioCut, output: OutputContainer, encoder: str) -> None:
        """Raises: InputError for a file whose sound cannot be read."""
        self._output = output
        self._blocks = _read_cut(cut)
        first = next(self._blocks)
        rate = first.rate if first.rate in RATES else RATES[0]
        stream = output.add_stream(encoder, rate=rate)
        self._stream = cast(av.AudioStream, stream)
        self._stream.bit_rate = BIT_RATE
        self._stream.layout = first.layout
        self._stream.codec_context.thread_count = 1  # for the same bytes everywhere
        self._stream.codec_context.open()  # settles how many samples a frame has
        self._packets = self._encode(first, round(cut.duration_seconds * rate))
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

    def _encode(self, first: _Block, wanted: int) -> Iterator[av.Packet]:
        context = self._stream.codec_context
        fifo = AudioFifo()
        taken = 0
        for frame in self._resample(first):
            fifo.write(frame)
            size = context.frame_size or FRAME_SAMPLES
            while taken + size <= wanted and (block := fifo.read(size)) is not None:
                yield from self._stream.encode(self._stamped(block, taken))
                taken += size
        # the encoder takes a short block only as its last
        rest = fifo.read(wanted - taken, partial=True) if wanted > taken else None
        if rest is not None and rest.samples:
            yield from self._stream.encode(self._stamped(rest, taken))
        yield from self._stream.encode(None)

    def _resample(self, first: _Block) -> Iterator[av.AudioFrame]:
        """Bring the sound to the encoder's rate and format, to the last sample."""
        context = self._stream.codec_context
        resampler = AudioResampler(context.format, context.layout, context.sample_rate)
        position = 0
        for block in chain([first], self._blocks):
            frame = av.AudioFrame.from_ndarray(block.samples, WORKING_FORMAT, block.layout)
            frame.sample_rate = block.rate
            frame.pts, frame.time_base = position, Fraction(1, block.rate)
            position += frame.samples
            yield from resampler.resample(frame)
        yield from resampler.resample(None)

    def _stamped(self, block: av.AudioFrame, first: int) -> av.AudioFrame:
        block.pts, block.time_base = first, Fraction(1, self._stream.codec_context.sample_rate)
        return block


def _read_cut(cut: AudioCut, hear_hole: Callable[[_Hole], object] = id) -> Iterator[_Block]:
    """Decode a piece of sound, with silence where there is none, exactly as long as it is to be.

    Where sound lies over other sound, the first to come is kept. A track without any sound gives
    nothing, not even silence.

    Args:
        hear_hole: Hears of every place where sound stops and goes on later.
    Raises: InputError.
    """
    heard: _Block | None = None
    ends: int | None = None  # where the sound so far ends on the file's clock, in samples
    first = written = stop = 0  # on the same clock
    goes_on = False
    for begins_seconds, block in _decode(cut):
        if heard is None:
            first = written = round(cut.start_seconds * block.rate)
            stop = written + max(1, round(cut.duration_seconds * block.rate))
        heard = block
        if begins_seconds is not None:
            begins = round(begins_seconds * block.rate)
            if ends is None or abs(begins - ends) > JITTER_SECONDS * block.rate:
                ends = begins
        begins = ends or 0
        ends = begins + block.samples.shape[1]
        if begins >= stop:
            break
        if goes_on and begins > written:
            hole = Fraction(written - first, block.rate), Fraction(begins - written, block.rate)
            hear_hole(_Hole(*hole))
        yield from _silence(begins - written, block)
        written = max(written, begins)
        samples = block.samples[:, written - begins : stop - begins]
        if samples.size:
            yield replace(block, samples=samples)
            written += samples.shape[1]
            goes_on = True
    if heard is not None:
        yield from _silence(stop - written, heard)


def _silence(count: int, like: _Block) -> Iterator[_Block]:
    while count > 0:
        samples = np.zeros((like.samples.shape[0], min(count, SILENCE_SAMPLES)), np.float32)
        yield replace(like, samples=samples)
        count -= samples.shape[1]


def _decode(cut: AudioCut) -> Iterator[tuple[Fraction | None, _Block]]:
    """Decode a track from its beginning, each block with when it begins, if the file says it.

    Raises: InputError.
    """
    first: tuple[object, ...] = ()
    resampler, layout = AudioResampler(WORKING_FORMAT), ""
    seconds: Fraction | None = None
    try:
        with open_input(cut.path, "audio") as container:
            for frame in container.decode(audio=cut.track):
                seconds = None
                if frame.pts is not None and frame.time_base is not None:
                    seconds = frame.pts * frame.time_base
                kind = (frame.sample_rate, frame.layout.name, frame.format.name)
                if not first:
                    if not 0 < frame.sample_rate <= HIGHEST_RATE:
                        raise InputError(
                            f"sound of {cut.path} claims {frame.sample_rate} samples a second;"
                            f" {REMEDY}"
                        )
                    first = kind
                    layout = "mono" if frame.layout.nb_channels == 1 else "stereo"
                    resampler = AudioResampler(WORKING_FORMAT, layout)
                if kind != first:
                    raise InputError(
                        f"sound of {cut.path} changes{_at(seconds)} from {_listed(first)} to"
                        f" {_listed(kind)}; {REMEDY}"
                    )
                for part in resampler.resample(frame):  # the rate stays, so that it is one
                    yield seconds, _Block(part.to_ndarray(), frame.sample_rate, layout)
    except (FFmpegError, ValueError) as error:
        reason = error.strerror if isinstance(error, FFmpegError) else error
        raise InputError(
            f"sound of {cut.path} is damaged{_at(seconds)} ({reason}); {REMEDY}"
        ) from error


def _at(seconds: Fraction | None) -> str:
    return "" if seconds is None else f" after {float(seconds):.2f} s"


def _listed(kind: tuple[object, ...]) -> str:
    rate, layout, name = kind
    return f"{rate} Hz, {layout}, {name}"
