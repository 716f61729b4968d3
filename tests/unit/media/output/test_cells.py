"""Every container x codec x alpha x pixel format, written in two segments and read back.

What is drawn is a disc of smooth colours with a soft edge, which moves; under alpha 0 lies noise,
which nobody may ever see. What comes back is held against it over white, black and green.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS, holds_alpha
from motion_transfer.media.output import pixels
from motion_transfer.media.output.audio import AudioCut
from motion_transfer.media.output.formats import (
    CONTAINERS,
    OUTPUT_KINDS,
    OutputFormat,
    choose_format,
)
from motion_transfer.media.output.segments import join_segments, open_segment, segment_path
from motion_transfer.media.pictures.formats import open_pictures

COUNT = 8
RATE = Fraction(30000, 1001)
EVEN, ODD = (196, 122), (195, 121)
RADIUS, EDGE_PX = 40, 8
BACKDROPS = [(255, 255, 255), (0, 0, 0), (0, 255, 0)]
DOCS = Path(__file__).parents[4] / "docs" / "outputs.md"


@dataclass(frozen=True)
class Cell:
    """One cell of the table in the docs."""

    suffix: str
    codec: str | None
    alpha: str | None
    pixels: str | None

    @property
    def row(self) -> str:
        words = (self.suffix or "folder", self.codec, self.pixels, self.alpha or "none")
        return "| " + " | ".join(word or "" for word in words) + " |"

    def choose(self, output: Path) -> OutputFormat:
        return choose_format(
            output,
            codec=self.codec,
            crf=None,
            transparent=self.alpha is not None,
            alpha=self.alpha or "straight",
            pix_fmt=self.pixels,
        )


VIDEO_CELLS = [
    Cell(suffix, codec, alpha, form)
    for suffix, container in CONTAINERS.items()
    for codec in container.codecs
    for form in CODECS[codec].pixel_formats
    for alpha in (("straight", "premultiplied") if holds_alpha(form) else (None,))
    if alpha is None or codec in container.alpha
]
PICTURE_CELLS = [
    Cell(suffix, None, alpha, None)
    for row in OUTPUT_KINDS.values()
    for suffix in row.suffixes
    if suffix not in CONTAINERS
    for alpha in (None, *row.alpha)
]
CELLS = VIDEO_CELLS + PICTURE_CELLS
CLEAR = [cell for cell in CELLS if cell.alpha]

# Levels of 256 at the edge, or everywhere where nothing is transparent: the mean, the 99th
# percentile and the most. What is multiplied is rounded twice, when it is and when it is undone.
LOSSLESS, ROUNDED = (0, 0, 0), (0.5, 1, 1)
LOSSY = (1.6, 9, 45)  # the disc has an edge, and 4:2:0 half the colours of it
BOUNDS = {
    (".gif", None): (0.5, 4, 8),
    (".webp", None): (0.6, 5, 18),
    (".webp", "straight"): (0.6, 3, 5),
    ("ffv1", "premultiplied"): ROUNDED,
    ("prores", None): (0.2, 2, 10),
    ("prores", "straight"): (0.004, 0.1, 1),
    ("prores", "premultiplied"): (0.5, 2, 3),
    ("vp9", "straight"): (0.65, 3, 6),
    # 4:2:0 takes the darkness of the edge for its colour: no crf mends it
    ("vp9", "premultiplied"): (1.7, 7, 18),
}


def draw(index: int, size: tuple[int, int], under: int | None = None) -> np.ndarray:
    """Draw a frame, RGBA; `under` is the level of all colours under alpha 0, else noise."""
    width, height = size
    y, x = np.mgrid[:height, :width]
    distance = np.hypot(x - width / 2 - index, y - height / 2)
    alpha = np.rint(255 * np.clip((RADIUS - distance) / EDGE_PX, 0, 1)).astype(np.uint8)
    colours = np.stack([200 + 0 * x, 40 + x // 4, 60 + y // 4], -1).astype(np.uint8)
    hidden = np.random.default_rng(index).integers(0, 256, colours.shape, np.uint8)
    if under is not None:
        hidden[:] = under
    return np.dstack([np.where(alpha[..., None] > 0, colours, hidden), alpha])


def lay_over(rgba: np.ndarray, backdrop: tuple[int, int, int]) -> np.ndarray:
    weight = rgba[..., 3:] / 255
    return rgba[..., :3] * weight + np.array(backdrop) * (1 - weight)


def frames(cell: Cell, size: tuple[int, int], under: int | None = None) -> list[np.ndarray]:
    """What is written: RGBA, or the same over grey."""
    drawn = [draw(index, size, under) for index in range(COUNT)]
    if cell.alpha:
        return drawn
    return [np.rint(lay_over(frame, (90, 90, 90))).astype(np.uint8) for frame in drawn]


def size_of(output_format: OutputFormat) -> tuple[int, int]:
    return EVEN if output_format.codec.needs_even_size else ODD


def write(
    cell: Cell,
    folder: Path,
    *,
    order: tuple[int, ...] = (0, 1),
    sound: AudioCut | None = None,
    under: int | None = None,
) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / f"out{cell.suffix}"
    output_format = cell.choose(path)
    size = size_of(output_format)
    wanted = frames(cell, size, under)
    single = not output_format.row.several
    parts = [(0, 1)] if single else [(0, COUNT // 2), (COUNT // 2, COUNT)]
    segments = [segment_path(folder, number, output_format) for number in range(len(parts))]
    for number in order[: len(parts)] if not single else (0,):
        first, stop = parts[number]
        with open_segment(
            segments[number], output_format, size=size, rate=RATE, first=first
        ) as write_frame:
            for frame in wanted[first:stop]:
                write_frame(frame)
    counts = [stop - first for first, stop in parts]
    join_segments(list(zip(segments, counts, strict=True)), path, output_format, RATE, sound)
    return path


def measure(cell: Cell, path: Path, under: int | None = None) -> tuple[float, float, float]:
    """Tell how far off what is read back is: the mean, the 99th percentile, the most."""
    clip = open_pictures(path)
    assert clip.frame_count == (1 if path.suffix == ".png" else COUNT)
    assert clip.has_alpha or not cell.alpha
    wanted = frames(cell, (clip.width, clip.height), under)[: clip.frame_count]
    errors = []
    for got, frame in zip(clip.read_rgba() if cell.alpha else clip.read(), wanted, strict=True):
        if not cell.alpha:
            errors.append(np.abs(got.astype(float) - frame).reshape(-1, 3))
            continue
        edge = (frame[..., 3] > 0) & (frame[..., 3] < 255)
        for backdrop in BACKDROPS:
            errors.append(np.abs(lay_over(got, backdrop) - lay_over(frame, backdrop))[edge])
    off = np.concatenate(errors)
    return float(off.mean()), float(np.percentile(off, 99)), float(off.max())


def limits(cell: Cell) -> tuple[float, float, float]:
    lossy = cell.codec in ("h264", "h265", "av1", "vp9")
    most = LOSSY if lossy else LOSSLESS
    return BOUNDS.get((cell.codec or cell.suffix, cell.alpha), most)


def skip_what_the_encoder_lacks(cell: Cell) -> None:
    if cell.codec and cell.pixels:
        known = av.Codec(CODECS[cell.codec].encoder, "w").video_formats or []
        if cell.pixels not in [form.name for form in known]:
            with pytest.raises(OutputError, match="the installed FFmpeg's"):
                cell.choose(Path(f"out{cell.suffix}"))
            pytest.skip(f"{CODECS[cell.codec].encoder} is built without {cell.pixels}")


def within(got: tuple[float, float, float], most: tuple[float, float, float]) -> bool:
    return all(one <= other for one, other in zip(got, most, strict=True))


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.row)
def test_what_is_written_is_read_back(tmp_path: Path, cell: Cell) -> None:
    skip_what_the_encoder_lacks(cell)
    assert within(measure(cell, write(cell, tmp_path)), limits(cell))


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: cell.row)
def test_the_docs_have_a_row(cell: Cell) -> None:
    assert cell.row in DOCS.read_text()


@pytest.mark.parametrize("cell", CLEAR, ids=lambda cell: cell.row)
def test_segments_in_any_order_make_the_same_bytes(tmp_path: Path, cell: Cell) -> None:
    files = []
    for name, order in (("a", (0, 1)), ("b", (1, 0))):
        path = write(cell, tmp_path / name, order=order)
        parts = sorted(path.iterdir()) if path.is_dir() else [path]
        files.append([part.read_bytes() for part in parts])
    assert files[0] == files[1]


DEEP = [cell for cell in VIDEO_CELLS if "10le" in (cell.pixels or "")]


@pytest.mark.parametrize("cell", DEEP, ids=lambda cell: cell.row)
def test_10_bits_make_the_same_bytes(tmp_path: Path, cell: Cell) -> None:
    skip_what_the_encoder_lacks(cell)
    assert len({write(cell, tmp_path / name).read_bytes() for name in "abcd"}) == 1


@pytest.mark.parametrize("cell", CLEAR, ids=lambda cell: cell.row)
def test_what_lies_under_alpha_0_is_never_seen(tmp_path: Path, cell: Cell) -> None:
    """White around the disc would be a fringe over black: nothing is brighter than the disc."""
    path = write(cell, tmp_path, under=255)
    assert within(measure(cell, path, under=255), limits(cell))
    clip = open_pictures(path)
    wanted = frames(cell, (clip.width, clip.height))
    for got, frame in zip(clip.read_rgba(), wanted, strict=False):
        excess = lay_over(got, (0, 0, 0)) - lay_over(frame, (0, 0, 0))
        edge = (frame[..., 3] > 0) & (frame[..., 3] < 128)
        assert np.percentile(excess[edge], 99) <= limits(cell)[1] + 1e-9


MIXING = [cell for cell in CLEAR if cell.alpha == "straight" and cell.codec in ("vp9", "prores")]


@pytest.mark.parametrize("cell", MIXING, ids=lambda cell: cell.row)
def test_colours_have_to_be_extended(tmp_path: Path, monkeypatch, cell: Cell) -> None:
    """The tests above fail where colours are left as they come, or are made black."""
    for name, under, prepare in (
        ("noise", None, lambda colours, _: colours),
        ("white", 255, lambda colours, _: colours),
        ("black", None, pixels.clear_colours),
    ):
        monkeypatch.setattr(pixels, "extend_colours", prepare)
        path = write(cell, tmp_path / name, under=under)
        assert not within(measure(cell, path, under), limits(cell))


WITH_SOUND = [cell for cell in CLEAR if cell.suffix in (".mov", ".webm", ".mkv")]


@pytest.mark.parametrize("cell", WITH_SOUND, ids=lambda cell: cell.row)
def test_sound_lies_beside_alpha(tmp_path: Path, cell: Cell) -> None:
    song = tmp_path / "song.wav"
    with av.open(str(song), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=48_000, layout="mono")
        samples = (9000 * np.sin(np.arange(24_000) / 10)).astype(np.int16)[None]
        frame = av.AudioFrame.from_ndarray(samples, format="s16", layout="mono")
        frame.sample_rate = 48_000
        container.mux(stream.encode(frame))
    length = COUNT / RATE
    path = write(cell, tmp_path / "a", sound=AudioCut(song, Fraction(0), length))
    with av.open(str(path)) as container:
        heard = np.concatenate([f.to_ndarray()[0] for f in container.decode(audio=0)])
    assert np.abs(heard).max() > 0.2
    assert len(heard) / 48_000 == pytest.approx(float(length), abs=0.045)
    assert within(measure(cell, path), limits(cell))


@pytest.mark.parametrize("cell", [c for c in CLEAR if c.codec], ids=lambda cell: cell.row)
def test_the_file_says_whether_colours_are_multiplied(tmp_path: Path, cell: Cell) -> None:
    path = write(cell, tmp_path)
    with av.open(str(path)) as container:
        said = {key.lower(): value for key, value in container.metadata.items()}
        assert said["alpha_mode"] == cell.alpha
    assert not open_pictures(path).notes
    if cell.codec == "vp9":
        assert b"\x53\xc0\x81\x01" in path.read_bytes()  # Matroska's AlphaMode is 1


YUV = [cell for cell in VIDEO_CELLS if cell.codec != "ffv1"]


@pytest.mark.parametrize("cell", YUV, ids=lambda cell: cell.row)
def test_colours_are_tagged(tmp_path: Path, cell: Cell) -> None:
    skip_what_the_encoder_lacks(cell)
    path = write(cell, tmp_path)
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))  # what the codec says wins over the container
        context = container.streams.video[0].codec_context
        assert (context.color_primaries, context.color_trc, context.colorspace) == (1, 1, 1)
        assert (frame.color_primaries, frame.color_trc, frame.colorspace) == (1, 1, 1)
        assert context.color_range == 1
        tag = CODECS[cell.codec].tags.get(cell.pixels)
        assert not (tag and cell.suffix in (".mp4", ".mov")) or context.codec_tag == tag
    assert (frame.width, frame.height) == size_of(cell.choose(path))
    depth = 10 if "10" in cell.pixels else 8
    assert frame.format.components[0].bits == (12 if cell.alpha and depth == 10 else depth)


def ramp() -> np.ndarray:
    """Every grey there is, four pixels wide."""
    levels = np.repeat(np.arange(256, dtype=np.uint8), 4)
    return np.dstack([np.tile(levels, (64, 1))] * 3)


@pytest.mark.parametrize("cell", DEEP, ids=lambda cell: cell.row)
def test_10_bits_are_used(tmp_path: Path, cell: Cell) -> None:
    """8 bits of limited range have 220 greys; 10 bits keep all 256, and they stay neutral."""
    skip_what_the_encoder_lacks(cell)
    path = tmp_path / f"out{cell.suffix}"
    output_format = cell.choose(path)
    segment = segment_path(tmp_path, 0, output_format)
    image = ramp()
    if cell.alpha:
        image = np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])
    size = image.shape[1], image.shape[0]
    with open_segment(segment, output_format, size=size, rate=RATE, first=0) as write_frame:
        write_frame(image)
    join_segments([(segment, 1)], path, output_format, RATE)
    with av.open(str(path)) as container:
        frame = next(container.decode(video=0))
    luma, *chroma = (
        np.frombuffer(bytes(plane), "<u2").reshape(plane.height, -1)[:, : plane.width]
        for plane in frame.planes[:3]
    )
    scale = 2 ** (frame.format.components[0].bits - 10)
    columns = luma.reshape(64, 256, 4).mean((0, 2)) / scale
    wanted = 64 + np.arange(256) * 876 / 255
    assert np.abs(columns - wanted).mean() < 1  # 8 bits would be a whole one off on average
    assert len(np.unique(np.rint(columns))) > 240
    assert all(np.abs(plane / scale - 512).max() <= 3 for plane in chroma)
    got = next(open_pictures(path).read()).astype(int)
    assert np.abs(got - image[..., :3]).mean() < 0.5


@pytest.mark.parametrize("frames", [1, 2])
def test_a_segment_shorter_than_an_encoder_delays_is_the_same_each_time(
    tmp_path: Path, frames: int
) -> None:
    """x265 leaves the decoding times of so few frames uninitialised."""
    output_format = Cell(".mov", "h265", None, None).choose(tmp_path / "out.mov")
    written = set()
    for _ in range(20):
        segment = segment_path(tmp_path, 0, output_format)
        with open_segment(segment, output_format, size=(64, 64), rate=RATE, first=0) as write_frame:
            for level in range(frames):
                write_frame(np.full((64, 64, 3), level, np.uint8))
        written.add(segment.read_bytes())
    assert len(written) == 1


def test_the_names_of_cells_are_their_own() -> None:
    rows = [cell.row for cell in CELLS]
    assert len(set(rows)) == len(rows)
    assert all(a != b for a, b in itertools.pairwise(rows))


@pytest.mark.parametrize("name", ["out.webp", "out.apng", "out.mov"])
def test_a_run_writes_the_same_bytes_with_any_number_of_workers(studio, name: str) -> None:
    from motion_transfer import render_video

    files = []
    for workers in (1, 2):
        output = studio.folder / str(workers) / name
        output.parent.mkdir()
        render_video(
            studio.source(),
            studio.array(52),  # two chunks
            output,
            renderer="texture",
            codec="prores" if name == "out.mov" else None,
            workers=workers,
        )
        files.append(output.read_bytes())
        assert open_pictures(output).frame_count == 52
    assert files[0] == files[1]
