"""detectron2 dumps: what they show, how large their frames are, and what is never run."""

from __future__ import annotations

import os
import pickle
import zipfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from reference import densepose_dump as dump

from motion_transfer.errors import InputError, IuvFileError
from motion_transfer.media.iuv.opening import open_reader, open_stream


def read(path: Path, **options) -> np.ndarray:
    reader = open_reader(open_stream(path, **options))
    return np.stack(list(reader.read(0, reader.stream.frame_count)))


@pytest.mark.parametrize("zipped", [True, False])
def test_a_dump_gives_the_frames_it_was_made_of(studio, zipped: bool) -> None:
    frames = studio.walk(4)
    for index, frame in enumerate(frames):
        studio.image(f"photo_{index}.png", frame)
    photos = [dump.photo(frame, f"shoot/photo_{i}.png") for i, frame in enumerate(frames)]
    path = dump.save(studio.folder / "results.pkl", photos, zipped=zipped)
    stream = open_stream(path)
    assert (stream.kind, stream.frame_count, stream.notes) == ("detectron2 dump", 4, ())
    np.testing.assert_array_equal(read(path), frames)
    assert "photo_2.png" in stream.where(2)


def test_without_the_photos_frames_are_as_large_as_the_boxes(studio) -> None:
    frames = studio.walk(2)
    photos = [
        dump.photo(frame, "gone.png", left=left)
        for frame, left in zip(frames, (0, 30), strict=True)
    ]
    path = dump.save(studio.folder / "results.pkl", photos)
    stream = open_stream(path)
    assert "2 of 2 are not beside it: 95 x 97" in stream.notes[0]
    read_frames = read(path)
    np.testing.assert_array_equal(read_frames[1][:96, 30:94], frames[1])


def test_the_surest_person_stands_in_front_and_doubtful_ones_are_left_out(studio) -> None:
    low, high, ghost = (np.full((8, 8, 3), (part, 9, 9), np.uint8) for part in (1, 2, 3))
    entry = {
        "file_name": "x.png",
        "scores": torch.tensor([0.99, 0.85, 0.4]),
        "pred_boxes_XYXY": torch.tensor([[0.0, 0, 8, 8], [4, 0, 12, 8], [20, 0, 28, 8]]),
        "pred_densepose": [dump.person(high), dump.person(low), dump.person(ghost)],
    }
    (frame,) = read(dump.save(studio.folder / "results.pkl", [entry]))
    assert frame[0, :, 0].tolist() == [2] * 8 + [1] * 4 + [0] * 16


def test_a_photo_without_anybody_is_background(studio) -> None:
    frame = studio.iuv()
    empty = {"file_name": "b", "scores": torch.zeros(0), "pred_boxes_XYXY": torch.zeros(0, 4)}
    path = dump.save(studio.folder / "r.pkl", [dump.photo(frame, "a"), empty])
    assert not read(path)[1].any()


def test_results_of_a_gpu_are_read_without_one(studio) -> None:
    """apply_net leaves labels and uv on the GPU: the file then says cuda:0."""
    frame = studio.iuv()
    path = dump.save(studio.folder / "results.pkl", [dump.photo(frame, "a")])
    moved = studio.folder / "moved.pkl"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(moved, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name.endswith("data.pkl"):
                assert b"X\x03\x00\x00\x00cpu" in data
                data = data.replace(b"X\x03\x00\x00\x00cpu", b"X\x06\x00\x00\x00cuda:0")
            new.writestr(name, data)
    np.testing.assert_array_equal(read(moved)[0][:96, :64], frame)


def test_quantised_and_compressed_results(studio) -> None:
    frame = studio.iuv()
    quantised = dump.result(
        name="DensePoseChartResultQuantized",
        labels_uv_uint8=torch.from_numpy(frame.transpose(2, 0, 1).copy()),
    )
    compressed = dump.result(
        name="DensePoseChartResultCompressed",
        shape_chw=(3, *frame.shape[:2]),
        labels_uv_str=dump.compress(frame),
    )
    for held in (quantised, compressed):
        entry = {**dump.photo(frame, "a"), "pred_densepose": [held]}
        path = dump.save(studio.folder / "results.pkl", [entry])
        np.testing.assert_array_equal(read(path)[0][:96, :64], frame)


PROTOCOLS = range(pickle.HIGHEST_PROTOCOL + 1)
PHOTOS = (dump.photo, dump.array_photo, dump.photo_of_2020)


@pytest.mark.parametrize("photo", PHOTOS)
@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_plain_pickles_are_read_too(studio, photo: Callable, protocol: int) -> None:
    frames = studio.walk(3)
    photos = [photo(frame, f"{index}.png") for index, frame in enumerate(frames)]
    path = dump.save_pickle(studio.folder / "results.pkl", photos, protocol)
    np.testing.assert_array_equal(read(path)[:, :96, :64], frames)


@pytest.mark.parametrize("photo", PHOTOS)
@pytest.mark.parametrize("zipped", [True, False])
def test_torch_files_may_hold_arrays_and_old_results(studio, photo: Callable, zipped: bool) -> None:
    frame = studio.iuv()
    path = dump.save(studio.folder / "results.pkl", [photo(frame, "a")], zipped=zipped)
    np.testing.assert_array_equal(read(path)[0][:96, :64], frame)


@pytest.mark.parametrize("protocol", [2, 5])
@pytest.mark.parametrize(
    "change",
    [np.asfortranarray, lambda a: a.astype(a.dtype.newbyteorder(">")), lambda a: a[::-1][::-1]],
)
def test_arrays_of_any_layout(studio, change: Callable, protocol: int) -> None:
    frame = studio.iuv()
    entry = dump.array_photo(frame, "a")
    shown = vars(entry["pred_densepose"][0])
    shown.update({name: change(array) for name, array in shown.items()})
    path = dump.save_pickle(studio.folder / "results.pkl", [entry], protocol)
    np.testing.assert_array_equal(read(path)[0][:96, :64], frame)


# --- the order of frames


def numbered(studio, names: list[str | None]) -> Path:
    """A dump whose photo at index n is all part 1 with V = n."""
    photos = []
    for index, name in enumerate(names):
        entry = dump.photo(np.full((6, 5, 3), (1, 200, index), np.uint8), "")
        photos.append({**entry, "file_name": name} if name is not None else entry)
        if name is None:
            del photos[-1]["file_name"]
    return dump.save(studio.folder / "results.pkl", photos)


def played(path: Path, **options) -> list[int | None]:
    """The index of each frame's photo; None where nobody is shown."""
    return [int(frame[0, 0, 2]) if frame.any() else None for frame in read(path, **options)]


NUMBERS = "order of their numbers, and not in that of the file"


@pytest.mark.parametrize(
    ("names", "order", "note"),
    [
        (["a/3.png", "a/0.png", "a/2.png", "a/1.png"], [1, 3, 2, 0], NUMBERS),
        (["f0.jpg", "f1.jpg", "f10.jpg", "f2.jpg", "f5.jpg"], [0, 1, 3, 4, 2], NUMBERS),
        (["0.png", "1.png", "2.png"], [0, 1, 2], None),
        (["00.png", "10.png", "05.png"], [0, 2, 1], NUMBERS),
        (["b/0.png", "a/1.png", "b/1.png", "a/0.png"], [3, 1, 0, 2], NUMBERS),
        (["1.png", "0.png", "1.png", "0.png"], [0, 1, 2, 3], "1.png is in it more than once"),
        (["take2/b.png", "take2/a.png", "c.png"], [0, 1, 2], None),
        ([None, "1.png", "0.png"], [0, 1, 2], None),
        (["b1.png", "a0.png"], [1, 0], NUMBERS),
    ],
)
def test_photos_play_in_the_order_of_their_numbers(studio, names, order, note) -> None:
    path = numbered(studio, names)
    if len(names) == 5:  # numbers that are missing are another matter
        assert played(path, missing="hold") == [0, 1, 3, 3, 3, 4, 4, 4, 4, 4, 2]
        return
    assert played(path) == order
    notes = open_stream(path).notes[1:]  # the first is of the photos' size
    assert not notes if note is None else note in notes[0]


def test_numbers_missing_from_a_dump_are_as_those_of_a_folder(studio) -> None:
    path = numbered(studio, ["0005.png", "0001.png", "0002.png", "0006.png"])
    with pytest.raises(
        InputError, match=r"results.pkl: 2 missing frames \(3, 4\); add .* --missing hold"
    ):
        open_stream(path)
    assert played(path, missing="hold") == [1, 2, 2, 2, 0, 3]
    assert played(path, missing="background") == [1, 2, None, None, 0, 3]
    assert open_stream(path, missing="hold").gaps == (3, 4)
    assert "frame 4 of" in (where := open_stream(path, missing="hold").where(4))
    assert "0005.png" in where


# --- what is never run


class Bomb:
    """Runs a command when it is unpickled by a trusting reader."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple:
        return os.mkdir, (str(self.trace),)


def bombs(trace: Path, frame: np.ndarray) -> dict[str, object]:
    innocent = dump.photo(frame, "a")
    return {
        "instead of the list": Bomb(trace),
        "beside the photos": [innocent, Bomb(trace)],
        "inside a photo": [{**innocent, "scores": Bomb(trace)}],
        "inside a result": [
            {**innocent, "pred_densepose": [dump.result(labels=Bomb(trace), uv=None)]}
        ],
        "as another class": [{**innocent, "scores": Fraction(1, 2)}],
        "as a builtin": [{**innocent, "scores": eval}],
    }


SAVES: dict[str, Callable[[Path, object], object]] = {
    "zip": dump.save,
    "before torch 1.6": lambda path, held: dump.save(path, held, zipped=False),
    **{f"protocol {n}": lambda path, held, n=n: dump.save_pickle(path, held, n) for n in PROTOCOLS},
}


@pytest.mark.parametrize("kind", list(bombs(Path(), np.zeros((2, 2, 3), np.uint8))))
@pytest.mark.parametrize("way", SAVES)
def test_a_dump_that_would_run_code_is_refused(studio, kind: str, way: str) -> None:
    trace = studio.folder / "exploded"
    held = bombs(trace, studio.iuv())[kind]
    path = studio.folder / "results.pkl"
    SAVES[way](path, held)
    with pytest.raises(
        IuvFileError, match=r"is refused: .* could run code when read \(.*(mkdir|Fr|eval)"
    ):
        open_stream(path)
    assert not trace.exists()


def test_the_bombs_are_live(tmp_path: Path) -> None:
    torch.save(Bomb(tmp_path / "exploded"), tmp_path / "results.pkl")
    torch.load(tmp_path / "results.pkl", weights_only=False)
    assert (tmp_path / "exploded").exists()


@pytest.mark.parametrize("opcode", ["state", "call"])
def test_a_known_class_is_only_a_record(studio, opcode: str) -> None:
    """State with dunder names, or arguments, make nothing of the record but a record."""
    name = b"cdensepose.structures.chart_result\nDensePoseChartResult\n"
    tricks = {
        "state": name + b")\x81}(X\x0c\x00\x00\x00__setstate__X\x01\x00\x00\x00xub",
        "call": name + b"X\x04\x00\x00\x00true\x85R",
    }
    path = studio.folder / "results.pkl"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("results/data.pkl", b"\x80\x02](" + tricks[opcode] + b"e.")
        archive.writestr("results/version", b"3\n")
    with pytest.raises(IuvFileError):
        open_stream(path)


ARRAY = b"cnumpy.core.multiarray\n_reconstruct\n)R"
TYPE = b"cnumpy\ndtype\n(X\x02\0\0\0u1\x89\x88tR"
TUPLES = b")" + b"\x85" * 50_000  # a tuple in a tuple in a tuple ...


@pytest.mark.parametrize(
    ("opcodes", "reason"),
    [
        (b"cos\nsystem\nX\x02\0\0\0id\x85R", "asks for os.system"),
        (b"X\x02\0\0\0osX\x06\0\0\0system\x93", "asks for os.system"),
        (b"cbuiltins\ngetattr\n", "asks for builtins.getattr"),
        (b"cnumpy\nndarray.tofile\n", "asks for numpy.ndarray.tofile"),
        (b"ctorch.storage\n_load_from_bytes\nC\x03abc\x85R", "not a whole"),
        (b"X\x02\0\0\0id)R", "a call of a str"),
        (ARRAY + b")R", "a call of a PickledArray"),
        (b"]}b", "state for a list"),
        (ARRAY + b"(K\x01K\x09\x85" + TYPE + b"\x89C\x04abcdtb", "another shape"),
        (ARRAY + b"(K\x01J\xff\xff\xff\xff\x85" + TYPE + b"\x89C\0tb", "another shape"),
        (b"cnumpy\ndtype\nX\x02\0\0\0O8\x85R", "other things than numbers"),
        (b"cnumpy\ndtype\nX\x03\0\0\0V99\x85R", "other things than numbers"),
        (b"c_codecs\nencode\n(VABC\nVzip\ntR", "the codec 'zip'"),
        (b"Pid\n", "the opcode PERSID"),
        (b"K\x01Q", "the opcode BINPERSID"),
        (b"\x82\x01", "the opcode EXT1"),
        (b"\x97", "the opcode NEXT_BUFFER"),
        (b"}" + TUPLES + b"Ns", "a dict whose keys are no names"),
        (b"(" + TUPLES + b"Nd", "a dict whose keys are no names"),
        (b"(" + TUPLES + b"\x90", "the opcode FROZENSET|the opcode ADDITEMS"),
        (b"h\xff", "not a whole"),
        (b"Nr\xff\xff\xff\xff", "holds a NoneType|holds a list"),
        (b"I" + b"9" * 6000 + b"\n", "not a whole"),
        (b"\x8b\xff\xff\xff\x7f", "not a whole|the opcode LONG4"),
        (b"X\xff\xff\xff\x7f", "not a whole"),
        (b"\x96\0\0\0\0\0\0\0\x70", "not a whole"),
        (TUPLES, "holds a tuple"),
    ],
)
def test_hostile_opcodes_are_refused_by_name(studio, opcodes: bytes, reason: str) -> None:
    path = studio.folder / "results.pkl"
    path.write_bytes(b"\x80\x04" + opcodes + b".")
    with pytest.raises(IuvFileError, match=reason) as refusal:
        open_stream(path)
    assert len(str(refusal.value)) < 500
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("protocol", [2, 5])
def test_a_pickle_cut_anywhere_is_refused(studio, protocol: int) -> None:
    path = studio.folder / "results.pkl"
    entry = dump.array_photo(np.full((3, 2, 3), (1, 200, 9), np.uint8), "a")
    data = dump.save_pickle(path, [entry], protocol).read_bytes()
    for end in range(len(data)):
        path.write_bytes(data[:end])
        with pytest.raises(IuvFileError, match=r"is not a whole|is refused"):
            open_stream(path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "not a whole detectron2 dump"),
        (b"nothing of the kind", "refused|not a whole"),
        (pickle.dumps({"file_name": "a"}, 2), "holds a dict; a detectron2 dump is a list"),
        (pickle.dumps([{"scores": torch.ones(1)}], 2)[:-9], "not a whole detectron2 dump"),
    ],
)
def test_what_is_no_dump_is_refused(studio, content: bytes, reason: str) -> None:
    path = studio.folder / "results.pkl"
    path.write_bytes(content)
    with pytest.raises(IuvFileError, match=reason):
        open_stream(path)


def test_a_truncated_dump_is_refused(studio) -> None:
    path = dump.save(studio.folder / "results.pkl", [dump.photo(studio.iuv(), "a")])
    path.write_bytes(path.read_bytes()[:-400])
    with pytest.raises(IuvFileError, match="not a whole detectron2 dump"):
        open_stream(path)


def shown(**attributes: torch.Tensor) -> object:
    """A person of 3 x 3 px, with some attributes of its own."""
    return dump.result(
        **{"labels": torch.ones(3, 3).long(), "uv": torch.ones(2, 3, 3), **attributes}
    )


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pred_densepose": []}, "1 boxes, but pred_densepose holds 0"),
        ({"scores": torch.ones(2)}, "2 scores for 1 boxes"),
        ({"scores": "high"}, "scores is a str"),
        ({"scores": torch.tensor([float("nan")])}, "scores holds NaN"),
        ({"scores": torch.ones(1, dtype=torch.complex64)}, "scores holds complex64, and not num"),
        ({"scores": torch.ones(1).to_sparse()}, "it asks for torch._utils._rebuild_sparse_tensor"),
        ({"pred_boxes_XYXY": torch.tensor([[0, 0, 1e12, 9]])}, r"needs 99\d* x 9 px; at most 134,"),
        ({"pred_boxes_XYXY": torch.full((1, 4), 60000.0)}, "needs 60000 x 60000 px"),
        ({"pred_boxes_XYXY": torch.full((1, 4), float("inf"))}, "XYXY holds NaN or infinity"),
        ({"file_name": ["a"]}, "file_name is no path"),
        ({"file_name": "9" * 5000}, "file_name is no path"),
        ({"pred_densepose": [shown(labels=torch.ones(3, 3))]}, "labels holds float32, and not w"),
        ({"pred_densepose": [shown(labels=-torch.ones(3, 3).long())]}, "not part indices"),
        (
            {
                "pred_densepose": [
                    shown(
                        labels=torch.ones(1).long().expand(70000, 70000),
                        uv=torch.ones(1).expand(2, 70000, 70000),
                    )
                ]
            },
            "a tensor reaches beyond its numbers",
        ),
        ({"pred_densepose": [shown(uv=torch.ones(2, 3, 3).long())]}, "uv holds int64, and not fr"),
        ({"pred_densepose": [shown(uv=torch.ones(2, 3, 3) * 200)]}, r"uv is not within 0\.\.1"),
        ({"pred_densepose": [shown(uv=torch.ones(2, 3, 3) / 0)]}, r"uv is not within 0\.\.1"),
        (
            {"pred_densepose": [dump.result(labels_uv_uint8=torch.ones(2, 3, 3).byte())]},
            r"labels_uv_uint8 is uint8 \[2, 3, 3\]; it is uint8, 3 x H x W",
        ),
        (
            {"pred_densepose": [dump.result(labels_uv_uint8=torch.ones(3, 3).byte())]},
            r"labels_uv_uint8 is uint8 \[3, 3\]",
        ),
        ({"pred_densepose": [dump.result(labels_uv_str="AAAA")]}, "compressed result is damaged"),
        (
            {"pred_densepose": [dump.result(labels_uv_str=dump.compress(np.zeros((3, 3))))]},
            "damaged .it is L, 3 x 3 px.",
        ),
        ({"pred_boxes_XYXY": torch.ones(4)}, r"is \[4\], not N x 4"),
        ({"pred_densepose": [{}]}, "a result without labels and uv"),
        (
            {
                "pred_densepose": [
                    dump.result(labels=torch.ones(3, 3).long(), uv=torch.ones(2, 4, 4))
                ]
            },
            r"labels are \[3, 3\] and uv \[2, 4, 4\]",
        ),
        (
            {
                "pred_densepose": [
                    dump.result(labels=torch.full((3, 3), 25), uv=torch.ones(2, 3, 3))
                ]
            },
            "labels are not part indices",
        ),
    ],
)
def test_a_photo_that_is_not_whole_is_named(studio, change: dict, reason: str) -> None:
    entry = {**dump.photo(studio.iuv(), "pose.jpg"), **change}
    path = dump.save(studio.folder / "results.pkl", [entry])
    with pytest.raises(IuvFileError, match=reason):
        read(path)


def test_a_list_of_something_else_is_refused(studio) -> None:
    path = studio.folder / "model.pth"
    torch.save({"weight": torch.ones(2)}, path)
    with pytest.raises(IuvFileError, match="holds a dict; a detectron2 dump is a list"):
        open_stream(path)


@pytest.mark.parametrize(("left", "kept"), [(-5, slice(5, None)), (60, slice(4)), (90, slice(0))])
def test_people_are_cut_off_where_the_photo_ends(studio, left: int, kept: slice) -> None:
    frame = studio.iuv()
    studio.image("a.png", frame)  # a photo as large as the person, who stands beside it in part
    entry = dump.photo(frame, "a.png", left=left)
    everybody = {**dump.photo(frame, "a.png")}
    drawn = read(dump.save(studio.folder / "results.pkl", [entry, everybody]))[0]
    start = max(0, left)
    wanted = frame[:, kept]
    np.testing.assert_array_equal(drawn[:, start : start + wanted.shape[1]], wanted)
    assert drawn.any() == bool(wanted.any())


def test_a_photo_that_is_shown_turned_is_as_large_as_it_is_shown(studio) -> None:
    """detectron2 turns photos as EXIF says before it looks for people."""
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.new("RGB", (100, 70)).save(studio.folder / "a.jpg", exif=exif)
    path = dump.save(studio.folder / "results.pkl", [dump.photo(studio.iuv(), "a.jpg")])
    assert read(path)[0].shape == (100, 70, 3)


def test_half_precision_is_read(studio) -> None:
    frame = studio.iuv()
    entry = dump.photo(frame, "a")
    entry["scores"] = entry["scores"].bfloat16()
    path = dump.save(studio.folder / "results.pkl", [entry])
    np.testing.assert_array_equal(read(path)[0][:96, :64], frame)


@pytest.mark.parametrize(
    "opcodes",
    [
        b"}" + b")" + b"\x85" * 300_000 + b"Ns",  # a key of 300,000 levels: to hash it would crash
        b"}" + b")q\x00" + b"h\x00h\x00\x86q\x00" * 40 + b"h\x00Ns",  # of 2^40 tuples
        b"cbuiltins\nbytearray\n\x8a\x05\x00\x00\x00\x00\x02\x85R",  # 8 GiB of zeros
        b"c_codecs\nencode\n\x8a\x05\x00\x00\x00\x00\x02\x85R",
    ],
    ids=["deep key", "wide key", "bytearray", "encode"],
)
def test_an_archive_cannot_exhaust_its_reader(tmp_path: Path, opcodes: bytes) -> None:
    with zipfile.ZipFile(tmp_path / "results.pkl", "w") as archive:
        archive.writestr("results/data.pkl", b"\x80\x02" + opcodes + b".")
    with pytest.raises(IuvFileError, match=r"(is refused|not a whole).*write it again"):
        open_stream(tmp_path / "results.pkl")


def test_numbers_are_compared_with_their_checksum(studio) -> None:
    path = dump.save(studio.folder / "results.pkl", [dump.photo(studio.iuv(), "pose.jpg")])
    with zipfile.ZipFile(path) as archive:
        largest = max(archive.infolist(), key=lambda member: member.file_size)
    data = bytearray(path.read_bytes())
    data[largest.header_offset + 30 + 200 + largest.file_size // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(IuvFileError, match=r"frame 0 of .* are damaged \(Bad CRC-32"):
        next(open_stream(path).read_raw(0, 1))
