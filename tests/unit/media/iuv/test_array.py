"""NumPy files: what is read of them, how much is taken, and what becomes of damaged ones."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.iuv import array_file
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv


def read(path: Path) -> np.ndarray:
    reader = open_reader(open_stream(path))
    return np.stack(list(reader.read(0, reader.stream.frame_count)))


def npy(header: str, version: bytes = b"\1\0") -> bytes:
    return b"\x93NUMPY" + version + len(header).to_bytes(2, "little") + header.encode() + bytes(64)


def test_orders_of_the_numbers_in_memory(studio) -> None:
    frames = studio.walk(3)
    np.testing.assert_array_equal(read(studio.array(np.asfortranarray(frames))), frames)
    np.testing.assert_array_equal(read(studio.array(np.asfortranarray(frames[0]))), frames[:1])
    planar = np.asfortranarray(frames.transpose(0, 3, 1, 2))
    np.testing.assert_array_equal(read(studio.array(planar)), frames)


@pytest.mark.parametrize("dtype", ["<f2", ">f4", ">f8"])
def test_global_uv_of_any_float(studio, dtype: str) -> None:
    places = np.full((2, 8, 8, 2), np.nan, dtype)
    places[:, 2:5, 2:5] = -0.25
    np.save(studio.folder / "places.npy", places)
    stream = open_stream(studio.folder / "places.npy")
    shown = np.stack(list(stream.read_raw(0, 2)))[..., 0] > 0
    np.testing.assert_array_equal(shown, ~np.isnan(places[..., 0]))


def test_a_file_that_becomes_shorter_is_an_error_that_names_the_frame(studio) -> None:
    path = studio.array(studio.walk(4))
    stream = open_stream(path)
    os.truncate(path, path.stat().st_size * 5 // 8)
    assert len(list(stream.read_raw(0, 2))) == 2
    with pytest.raises(IuvFileError, match=r"frame 2 of .*driver.npy is gone: .* shorter"):
        list(stream.read_raw(0, 4))


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("{'descr': '|u1', 'fortran_order': False, 'shape': (-1, 4, 4, 3)}", "an IUV array is"),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': (2, 0, 4, 3)}", "at least a pixel"),
        (
            "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 999999, 999999, 3)}",
            r"frames of \[999999, 999999, 3\]; .* at most 1,073",
        ),
        (
            "{'descr': '|u1', 'fortran_order': False, 'shape': (9, 4, 4, 3)}",
            "of 9 frames it holds 1",
        ),
        (
            "{'descr': [('a', '|u1')], 'fortran_order': False, 'shape': (1, 4, 4, 3)}",
            "an IUV array is",
        ),
        (
            "{'descr': '|u1', 'fortran_order': False, 'shape': (1, 4, 4, " + "9" * 4200 + ")}",
            "an IUV array is",
        ),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': " + "(" * 5000, "not a whole"),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': " + "-" * 9000 + "1}", "not a whole"),
        ("{'descr': '|u1', 'fortran_order': False, 'shape': 1if 1else 2}", "not a whole"),
    ],
)
def test_what_a_header_may_not_claim(studio, header: str, reason: str) -> None:
    path = studio.folder / "driver.npy"
    path.write_bytes(npy(header))
    with pytest.raises(IuvFileError, match=reason) as refusal:
        open_stream(path)
    assert len(str(refusal.value)) < 500
    assert "\n" not in str(refusal.value)


def test_an_archive_is_no_npy(studio) -> None:
    studio.array(studio.walk(2), name="driver.npz").rename(studio.folder / "driver.npy")
    with pytest.raises(IuvFileError, match="not a whole NumPy array"):
        open_stream(studio.folder / "driver.npy")


def test_an_archive_that_becomes_far_larger_is_not_unpacked(studio, monkeypatch) -> None:
    path = studio.folder / "driver.npz"
    np.savez_compressed(path, iuv=np.zeros((50, 64, 64, 3), np.uint8))
    monkeypatch.setattr(array_file, "SURELY_UNPACKED_BYTES", 100_000)
    with pytest.raises(IuvFileError, match=r"unpacks to 614,528 bytes, .* save the array as .npy"):
        open_stream(path)
    frames = np.random.default_rng(0).integers(0, 24, (50, 64, 64, 3), np.uint8)
    np.savez_compressed(path, iuv=frames)
    assert open_stream(path).frame_count == 50


def test_an_encrypted_archive_is_refused(studio) -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("iuv.npy", npy("{}"))
    data = packed.getvalue()
    entry = data.index(b"PK\1\2")
    path = studio.folder / "driver.npz"
    path.write_bytes(data[: entry + 8] + b"\1" + data[entry + 9 :])
    with pytest.raises(IuvFileError, match="is encrypted"):
        open_stream(path)


def test_a_stack_is_written_frame_by_frame(studio) -> None:
    """Not mapped, where a full disk would end the process: the file grows with the frames."""
    frames, sizes = studio.walk(3), []
    output = studio.folder / "out.npy"

    def watch(_: int) -> None:
        (work,) = studio.folder.glob(".out.npy.work-*/finished.npy")
        sizes.append(work.stat().st_size)

    big = frames.repeat(8, 1).repeat(8, 2)  # larger than what Python gathers before it writes
    write_iuv(big, output, IuvOutput(frame_count=3, height=768, width=512), watch)
    assert [size // big[0].nbytes for size in sizes] == [1, 2, 3]
    np.testing.assert_array_equal(np.load(output), big)
    expected = io.BytesIO()
    np.save(expected, big)
    assert output.read_bytes() == expected.getvalue()


def test_a_folder_whose_numbers_jump_far_is_refused_at_once(studio) -> None:
    for name in ("1", "2", "20231231235959"):
        studio.image(f"driver/{name}.png", studio.iuv())
    with pytest.raises(InputError, match="more than 1,000,000 numbers are missing"):
        open_stream(studio.folder / "driver", missing="hold")


def test_superscripts_are_no_numbers(studio) -> None:
    for name in ("a1\u00b21", "a1\u00b22"):
        studio.image(f"driver/{name}.png", studio.iuv())
    assert open_stream(studio.folder / "driver").frame_count == 2
