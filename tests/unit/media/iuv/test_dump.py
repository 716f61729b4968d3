"""detectron2 dumps: what they show, how large their frames are, and what is never run."""

from __future__ import annotations

import base64
import os
import pickle
import zipfile
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from reference import densepose_dump as dump

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.opening import open_reader, open_stream


def read(path: Path) -> np.ndarray:
    reader = open_reader(open_stream(path))
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
    ok, png = cv2.imencode(".png", frame[..., ::-1])
    assert ok
    quantised = dump.result(
        name="DensePoseChartResultQuantized",
        labels_uv_uint8=torch.from_numpy(frame.transpose(2, 0, 1).copy()),
    )
    compressed = dump.result(
        name="DensePoseChartResultCompressed",
        shape_chw=(3, *frame.shape[:2]),
        labels_uv_str=base64.encodebytes(png.tobytes()).decode(),
    )
    for held in (quantised, compressed):
        entry = {**dump.photo(frame, "a"), "pred_densepose": [held]}
        path = dump.save(studio.folder / "results.pkl", [entry])
        np.testing.assert_array_equal(read(path)[0][:96, :64], frame)


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


@pytest.mark.parametrize("kind", list(bombs(Path(), np.zeros((2, 2, 3), np.uint8))))
@pytest.mark.parametrize("zipped", [True, False])
def test_a_dump_that_would_run_code_is_refused(studio, kind: str, zipped: bool) -> None:
    trace = studio.folder / "exploded"
    held = bombs(trace, studio.iuv())[kind]
    path = studio.folder / "results.pkl"
    dump.save(path, held, zipped=zipped)
    with pytest.raises(IuvFileError, match=r"is refused: .* could run code"):
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


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pred_densepose": []}, "1 boxes, but pred_densepose holds 0"),
        ({"scores": torch.ones(2)}, "2 scores for 1 boxes"),
        ({"scores": "high"}, "scores is a str"),
        ({"pred_boxes_XYXY": torch.ones(4)}, r"is \[4\], not N x 4"),
        ({"pred_densepose": [{}]}, "a result without labels and uv"),
        (
            {"pred_densepose": [dump.result(labels=torch.ones(3, 3).long(), uv=torch.ones(2, 4, 4))]},
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
