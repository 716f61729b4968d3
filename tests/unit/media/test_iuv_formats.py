"""What circulates as IUV: arrays and global UV are read, look-alikes refused with the remedy."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.errors import InputError, IuvFileError, OutputError
from motion_transfer.media.global_uv import global_to_iuv, iuv_to_global
from motion_transfer.media.iuv_convert import ConvertOptions, convert_iuv
from motion_transfer.media.iuv_stream import open_reader, open_stream, read_single_iuv
from motion_transfer.media.iuv_writing import IuvFormat, write_iuv


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
    settings = IuvFormat(frame_count=3, height=96, width=64)
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
