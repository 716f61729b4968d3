"""What circulates as IUV: arrays and global UV are read, look-alikes refused with the remedy."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from global_uv import iuv_to_global

from motion_transfer.errors import InputError, IuvFileError, OutputError
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.iuv.convert import ConvertOptions, convert_iuv
from motion_transfer.media.iuv.formats import (
    IUV_FORMATS,
    IuvFormat,
    find_iuv_format,
    iuv_suffixes,
    names_file,
    register_iuv_format,
)
from motion_transfer.media.iuv.global_uv import global_to_iuv
from motion_transfer.media.iuv.opening import open_reader, open_stream, read_single_iuv
from motion_transfer.media.iuv.stream import IuvStream
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv


def read(path: Path, **options) -> np.ndarray:
    reader = open_reader(open_stream(path, **options))
    return np.stack(list(reader.read(0, reader.stream.frame_count)))


@pytest.fixture(scope="module")
def surface() -> np.ndarray:
    """24 bands, one for each part, of chart coordinates that lie on its surface."""
    frame = np.zeros((24 * 4, 80, 3), np.uint8)
    frame[..., 0] = np.repeat(np.arange(1, 25), 4)[:, None]
    frame[..., 1] = np.linspace(105, 150, 80).round()
    frame[..., 2] = np.tile(np.linspace(110, 150, 4).round(), 24)[:, None]
    frame[:, :5] = 0
    return frame


# --- arrays


def test_one_quantised_result_is_a_driver_of_one_frame(studio) -> None:
    frame = studio.iuv()
    np.save(studio.folder / "pose.npy", frame.transpose(2, 0, 1))
    np.testing.assert_array_equal(read(studio.folder / "pose.npy"), frame[None])


def test_a_folder_of_quantised_results(studio) -> None:
    frames = studio.walk(11)
    (studio.folder / "poses").mkdir()
    for index, frame in enumerate(frames):
        np.save(studio.folder / f"poses/p{index}.npy", frame.transpose(2, 0, 1))
    np.testing.assert_array_equal(read(studio.folder / "poses"), frames)


def test_gaps_in_a_folder_of_arrays(studio) -> None:
    frames = studio.walk(4)
    (studio.folder / "poses").mkdir()
    for index, frame in zip((1, 2, 4, 5), frames, strict=True):
        np.save(studio.folder / f"poses/p{index}.npy", frame)
    with pytest.raises(InputError, match=r"1 missing frame \(3\)"):
        open_stream(studio.folder / "poses")
    held = read(studio.folder / "poses", missing="hold")
    np.testing.assert_array_equal(held[2], frames[1])
    blank = read(studio.folder / "poses", missing="background")
    assert [bool(frame.any()) for frame in blank] == [True, True, False, True, True]


def test_gaps_in_a_folder_of_images_as_background(studio) -> None:
    path = studio.driver(5)
    (path / "frame_2_IUV.png").unlink()
    assert [bool(f.any()) for f in read(path, missing="background")] == [True, True, False] + [
        True
    ] * 2


def test_a_folder_of_mixed_arrays_is_refused(studio) -> None:
    (studio.folder / "poses").mkdir()
    np.save(studio.folder / "poses/p0.npy", studio.iuv())
    np.save(studio.folder / "poses/p1.npy", iuv_to_global(studio.iuv()))
    with pytest.raises(IuvFileError, match=r"frame 1, .*p1.npy holds float32"):
        read(studio.folder / "poses")


def test_floats_with_three_channels_say_how_to_quantise(studio) -> None:
    np.save(studio.folder / "iuv.npy", studio.iuv().astype(np.float32))
    with pytest.raises(IuvFileError, match=r"round\(255 U\)"):
        open_stream(studio.folder / "iuv.npy")


# --- global UV


def test_global_uv_comes_back_as_it_was(surface: np.ndarray) -> None:
    back, distance = global_to_iuv(iuv_to_global(surface), "here")
    np.testing.assert_array_equal(back, surface)
    assert distance < 0.01


def test_global_uv_points_as_cbi_has_it(surface: np.ndarray) -> None:
    """x right, y down, -1..1: part 1's band lies where the layout's table puts it."""
    from nhrr_core import load_uv_layout

    places = iuv_to_global(surface)
    _, u, v = surface[0, 40]
    x, y = load_uv_layout().charts[0, v, u].tolist()
    np.testing.assert_allclose(places[0, 40], (2 * x - 1, 2 * y - 1), atol=1e-6)
    assert np.isnan(places[:, :5]).all()


def test_moved_global_uv_keeps_parts_and_nearly_u_and_v(surface: np.ndarray) -> None:
    places = iuv_to_global(surface) + np.float32(0.25 / 256)  # an eighth of a texel
    back, distance = global_to_iuv(places, "here")
    assert (back[..., 0] == surface[..., 0]).mean() > 0.98
    error = np.abs(back.astype(int) - surface)[surface[..., 0] > 0][:, 1:]
    assert np.median(error) <= 1
    assert distance < 1


@pytest.mark.parametrize("stacked", [False, True])
def test_global_uv_is_a_driver(studio, surface: np.ndarray, stacked: bool) -> None:
    places = iuv_to_global(surface).astype(np.float64)
    np.save(studio.folder / "cbi.npy", places[None].repeat(2, 0) if stacked else places)
    stream = open_stream(studio.folder / "cbi.npy")
    assert stream.order == "iuv"
    assert "nearest entry" in stream.notes[0]
    np.testing.assert_array_equal(read(studio.folder / "cbi.npy")[-1], surface)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda p: (p + 1) / 2, "within 0..1, whose direction cannot be told"),
        (lambda p: np.nan_to_num(p), "no pixel of it is NaN"),
        (lambda p: p * 128, "global UV up to .*lie in -1..1"),
    ],
)
def test_global_uv_on_another_scale_is_refused(
    studio, surface: np.ndarray, spoil: Callable, reason: str
) -> None:
    np.save(studio.folder / "cbi.npy", spoil(iuv_to_global(surface)))
    with pytest.raises(IuvFileError, match=reason):
        read(studio.folder / "cbi.npy")


# --- look-alikes


def drawing(frame: np.ndarray, colour_map: int, opacity: float, ground: str) -> np.ndarray:
    """dp_segm as detectron2 draws it: part * 255 / 24 through a colour map, over a ground."""
    shade = (frame[..., 0].astype(np.float32) * 255 / 24).astype(np.uint8)
    colours = cv2.applyColorMap(shade, colour_map)[..., ::-1]
    back = np.zeros_like(colours)
    if ground == "lowest":
        back[:] = cv2.applyColorMap(np.zeros((1, 1), np.uint8), colour_map)[0, 0, ::-1]
    over = (colours * opacity + back * (1 - opacity)).astype(np.uint8)
    return np.where(frame[..., :1] > 0, over, back)


DRAWINGS = [
    (cv2.COLORMAP_VIRIDIS, 0.7, "lowest", "Viridis"),
    (cv2.COLORMAP_VIRIDIS, 1.0, "lowest", "Viridis"),
    (cv2.COLORMAP_PARULA, 0.7, "black", "Parula"),
    (cv2.COLORMAP_PARULA, 1.0, "black", "Parula"),
]


@pytest.mark.parametrize(("colour_map", "opacity", "ground", "name"), DRAWINGS)
@pytest.mark.parametrize("kind", ["png", "h264"])
def test_drawings_of_parts_are_recognised(
    studio, kind: str, colour_map: int, opacity: float, ground: str, name: str
) -> None:
    big = studio.iuv(scale=4, size=(384, 256))
    picture = drawing(big, colour_map, opacity, ground)
    if kind == "png":
        path = studio.image("segm.png", picture)
    else:
        frames = np.stack([picture] * 2)
        path = studio.video(frames, name="segm.mp4", codec="libx264", pixels="yuv420p")
    with pytest.raises(IuvFileError, match=rf"\(dp_segm\) in {name} .*apply_net.py dump"):
        read(path)


def test_photos_are_not_taken_for_drawings(studio) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    for picture in (noise, studio.dress(studio.iuv())):
        with pytest.raises(IuvFileError) as refused:
            read(studio.image("photo.png", picture))
        assert "dp_segm" not in str(refused.value)


@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_scaled_uv_is_recognised(studio, order: str) -> None:
    """Some exporters bring (U, V), background included, to 0..255 by minimum and maximum."""
    frame = studio.iuv()
    uv = np.where(frame[..., :1] > 0, frame[..., 1:] / 255 * 1.3 - 0.1, 0)
    frame[..., 1:] = (uv - uv.min()) / (uv.max() - uv.min()) * 255
    with pytest.raises(IuvFileError, match=r"scaled by their minimum .*background has 19, not 0"):
        read(studio.image("pose.png", frame, order))
    forced = open_reader(open_stream(studio.folder / "pose.png"), order)
    np.testing.assert_array_equal(next(iter(forced.read(0, 1))), frame)


@pytest.mark.parametrize("step", [10, 255 / 24])
def test_spread_part_indices_are_recognised(studio, step: float) -> None:
    frame = studio.iuv()
    frame[..., 0] = (frame[..., 0] * step).astype(np.uint8)
    with pytest.raises(IuvFileError, match=f"spread over 0..255; divide .* by {step:.4g}"):
        read(studio.image("pose.png", frame))


def test_caffe2_indices_are_left_aside_or_explained(studio) -> None:
    path = studio.driver(3, order="vui")
    persons = (studio.iuv()[..., 0] > 0).astype(np.uint8)
    for index in range(3):
        cv2.imwrite(str(path / f"frame_{index}_INDS.png"), persons)
    np.testing.assert_array_equal(read(path), studio.walk(3))
    for file in path.glob("*_IUV.png"):
        file.unlink()
    for place in (path, path / "frame_0_INDS.png"):
        with pytest.raises(IuvFileError, match=r"index of persons.*give the _IUV.png"):
            open_reader(open_stream(place))


def test_part_indices_alone_are_explained(studio) -> None:
    cv2.imwrite(str(studio.folder / "parts.png"), studio.iuv()[..., 0])
    with pytest.raises(IuvFileError, match="grey: part indices at most"):
        read(studio.folder / "parts.png")


# --- conversion

OUTPUTS = ["out", "out.mkv", "out.npy"]


@pytest.mark.parametrize("first", OUTPUTS)
@pytest.mark.parametrize("second", OUTPUTS)
@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_conversion_there_and_back_changes_nothing(
    studio, first: str, second: str, order: str
) -> None:
    frames = studio.walk(5)
    frames[..., 1:] ^= np.random.default_rng(0).integers(0, 256, frames[..., 1:].shape, np.uint8)
    source, middle, end = studio.driver(frames), studio.folder / first, studio.folder / f"2{second}"
    convert_iuv(ConvertOptions(source=source, output=middle, output_order=order))
    convert_iuv(ConvertOptions(source=middle, output=end))
    for path in (middle, end):
        np.testing.assert_array_equal(read(path), frames)
    assert open_reader(open_stream(middle)).order == ("iuv" if first.endswith("npy") else order)


def test_the_rate_of_a_video_is_passed_on(studio) -> None:
    source, output = studio.video(3, rate=Fraction(24000, 1001)), studio.folder / "out.mkv"
    convert_iuv(ConvertOptions(source=source, output=output))
    assert open_stream(output).frame_rate == Fraction(24000, 1001)


@pytest.mark.parametrize(
    ("name", "changes", "reason"),
    [
        ("out.mp4", {}, "IUV is written as a folder of PNG"),
        ("out.png", {}, "one picture, but there are 3 frames"),
        ("out", {"output_order": "bgr"}, "'bgr'; supported are iuv, vui"),
    ],
)
def test_what_cannot_be_written_is_said_first(
    studio, name: str, changes: dict, reason: str
) -> None:
    output = studio.folder / name
    with pytest.raises(InputError, match=reason):
        convert_iuv(ConvertOptions(source=studio.driver(3), output=output, **changes))
    assert not output.exists()


def test_an_output_is_only_replaced_when_asked(studio) -> None:
    source, output = studio.driver(2), studio.folder / "out"
    convert_iuv(ConvertOptions(source=source, output=output))
    with pytest.raises(OutputError, match="exists already"):
        convert_iuv(ConvertOptions(source=source, output=output))
    convert_iuv(ConvertOptions(source=source, output=output, force=True))


@pytest.mark.parametrize("count", [2, 4])
def test_too_few_or_too_many_frames_are_a_defect(studio, count: int) -> None:
    settings = IuvOutput(frame_count=3, height=96, width=64)
    with pytest.raises(ValueError, match="was promised"):
        write_iuv(iter(studio.walk(count)), studio.folder / "out.npy", settings)
    assert not (studio.folder / "out.npy").exists()


def test_the_source_may_be_an_array(studio) -> None:
    frame = studio.iuv()
    np.save(studio.folder / "me.npy", frame.transpose(2, 0, 1))
    np.testing.assert_array_equal(read_single_iuv(studio.folder / "me.npy", None, "IUV"), frame)
    studio.array(3, name="many.npy")
    with pytest.raises(IuvFileError, match="holds 3 frames, and one is wanted"):
        read_single_iuv(studio.folder / "many.npy", None, "source IUV")


# --- a format of somebody else's


class ToyStream(IuvStream):
    """Frames of 96 x 64 px, one after the other, without a header."""

    def __init__(self, path: Path, files=None) -> None:
        data = b"".join(file.read_bytes() for file in files or [path])
        self._frames = np.frombuffer(data, np.uint8).reshape(-1, 96, 64, 3)
        super().__init__(path, "folder of toys" if files else "toy", len(self._frames))

    def read_raw(self, start: int, stop: int) -> Iterator[np.ndarray]:
        yield from self._frames[start:stop]

    def closing_notes(self) -> tuple[str, ...]:
        return ("that was a toy",)


OPENER = f"{__name__}:ToyStream"
TOY = IuvFormat("toy", OPENER, OPENER, (".toy",), always_iuv=True, help=".toy")


@pytest.fixture
def toy(studio) -> Iterator[Callable[..., Path]]:
    """Writes frames of the toy format, which is known while the test runs."""

    def write(frames: np.ndarray, name: str = "driver.toy") -> Path:
        path = studio.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(frames.tobytes())
        return path

    register_iuv_format(TOY)
    yield write
    IUV_FORMATS.remove(TOY)


def test_a_registered_format_is_a_driver(studio, toy) -> None:
    frames = studio.walk(5)
    path = toy(frames)
    np.testing.assert_array_equal(read(path), frames)
    assert tell_kind(path) == "iuv"
    assert ".toy" in iuv_suffixes(several=True)


def test_a_registered_format_holds_a_single_iuv(studio, toy) -> None:
    frame = studio.iuv()
    np.testing.assert_array_equal(read_single_iuv(toy(frame), None, "IUV"), frame)
    with pytest.raises(IuvFileError, match="holds 2 frames, and one is wanted"):
        read_single_iuv(toy(studio.walk(2)), None, "IUV")


def test_a_folder_of_a_registered_format_may_have_gaps(studio, toy) -> None:
    frames = studio.walk(4)
    for number, frame in zip((1, 2, 4, 5), frames, strict=True):
        folder = toy(frame, f"poses/p{number}.toy").parent
    assert tell_kind(folder) == "iuv"
    with pytest.raises(InputError, match=r"1 missing frame \(3\)"):
        open_stream(folder)
    np.testing.assert_array_equal(read(folder, missing="hold"), frames[[0, 1, 1, 2, 3]])
    blank = read(folder, missing="background")
    assert [bool(frame.any()) for frame in blank] == [True, True, False, True, True]


def test_commands_take_a_registered_format(studio, toy, mt, draft) -> None:
    path = toy(studio.walk(3))
    told = json.loads(mt("inspect", path, "--json").out)
    assert (told["what"], told["frames"], told["size"]) == ("toy", 3, "64 x 96")
    result = draft("--source", studio.source(), "--driver", path, "-o", studio.folder / "out")
    assert (result.code, len(list((studio.folder / "out").iterdir()))) == (0, 3)
    _, notes = convert_iuv(ConvertOptions(source=path, output=studio.folder / "out.npy"))
    assert notes == ["that was a toy"]


def test_a_format_is_known_only_while_it_is_registered(studio) -> None:
    (studio.folder / "driver.toy").write_bytes(studio.walk(1).tobytes())
    with pytest.raises(IuvFileError, match="not a readable video"):
        open_stream(studio.folder / "driver.toy")


@pytest.mark.parametrize(
    ("row", "shared"),
    [
        (IuvFormat("toy", OPENER, suffixes=(".toy", ".npy")), r"\.npy belongs to array"),
        (IuvFormat("toy", OPENER, scheme="people:"), "people: belongs to motion"),
    ],
)
def test_two_formats_cannot_share_a_name(row: IuvFormat, shared: str) -> None:
    with pytest.raises(ValueError, match=shared):
        register_iuv_format(row)
    assert row not in IUV_FORMATS


@pytest.mark.parametrize(
    ("name", "row", "is_file"),
    [
        ("a.PNG", "IUV image", True),
        ("a.npz", "array", True),
        ("results.pkl", "detectron2 dump", True),
        ("a.mkv", "lossless video", True),
        ("a.unheard", "lossless video", True),
        ("a.jpg", "lossy picture", True),
        ("people:walk", "motion", False),
        ("people:clip.bvh,frames=9", "motion", False),
        ("people/walk.mkv", "lossless video", True),
    ],
)
def test_names_tell_the_format(name: str, row: str, is_file: bool) -> None:
    assert find_iuv_format(Path(name)).name == row
    assert names_file(name) == is_file


def test_the_table_is_light() -> None:
    """Help and option parsing read it."""
    code = (
        "import sys; from motion_transfer.media.iuv import formats;"
        "from motion_transfer.media.pictures import formats;"
        "print(sorted({'numpy', 'av', 'cv2', 'torch', 'PIL', 'imageio'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout == "[]\n"


def test_what_else_lies_in_a_folder_is_told(studio) -> None:
    """But for the photos that the IUV was made of, and the index that Caffe2 writes beside it."""
    folder = studio.driver(3)
    for name in ("frame_0.jpg", "frame_1_INDS.png"):
        (folder / name).write_bytes(b"")
    assert open_stream(folder).notes == ()
    for name in ("clip.mp4", "notes.txt"):
        (folder / name).write_bytes(b"")
    (folder / "old").mkdir()
    assert open_stream(folder).notes == (
        f"of {folder}, frame_0_IUV.png to frame_2_IUV.png is read, and not clip.mp4, notes.txt,"
        " old/",
    )
    for index in range(9):
        (folder / f"a{index}.txt").write_bytes(b"")
    (note,) = open_stream(folder).notes
    assert note.endswith("a0.txt, a1.txt, a2.txt, a3.txt, a4.txt and 7 more")
