"""detectron2's DensePose results, as `apply_net.py dump` writes them with `torch.save`.

The file is a list with a dict for each photo: `file_name`, `scores` (N), `pred_boxes_XYXY` (N x 4,
px) and `pred_densepose`, N objects with `labels` (H x W) and `uv` (2 x H x W, floats), each as
large as its box. A pickle can run any program; here it is read by torch's unpickler for weights,
which runs none, and which is told of DensePose's result classes by name. Each of them becomes a
`_Result`, a plain record. Tensors stay on disk until their frame is read.
"""

from __future__ import annotations

import base64
import binascii
import pickle
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from PIL import Image, UnidentifiedImageError

from motion_transfer.errors import IuvFileError
from motion_transfer.media.iuv.stream import IuvStream, Raw
from nhrr_core.iuv import PART_COUNT

LOWEST_SCORE = 0.8  # `apply_net.py show` draws no detection below it; a dump holds them all
MALFORMED = (ValueError, KeyError, TypeError, IndexError, AttributeError, AssertionError)
"""What torch's unpickler raises where opcodes do not fit each other."""
REPICKLE = (
    "save it again where it was made: torch.save(pickle.load(open('old.pkl', 'rb')), 'new.pkl')"
)


class _Result:
    """What stands for DensePose's result classes: a record of attributes, without behaviour."""


RESULT_CLASSES = (
    "densepose.structures.chart_result.DensePoseChartResult",
    "densepose.structures.chart_result.DensePoseChartResultWithConfidences",
    "densepose.structures.chart_result.DensePoseChartResultQuantized",
    "densepose.structures.chart_result.DensePoseChartResultCompressed",
    "densepose.vis.extractor.DensePoseChartResultWithConfidences",
)


class DumpStream(IuvStream):
    """Frames of a dump, one for each photo in it, in its order; everybody scored 0.8 or more.

    A dump does not say how large its photos were. They are looked for by name; where one is gone,
    the frame is as large as the boxes of all photos need.
    """

    def __init__(self, path: Path) -> None:
        self._photos = _load(path)
        super().__init__(path, "detectron2 dump", len(self._photos))
        self.order = "iuv"
        self._sizes = self._find_sizes()

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            yield self._draw(index)

    def where(self, index: int) -> str:
        return f"frame {index} of {self.path} ({_name(self._photos[index])})"

    def _draw(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """Draw the people of a frame in order of score, so that the surest stands in front."""
        photo, where = self._photos[index], self.where(index)
        height, width = self._sizes[index]
        frame = np.zeros((height, width, 3), np.uint8)
        boxes, scores = _boxes(photo, where), _scores(photo, where)
        results = _results(photo, where, len(boxes))
        for person in np.argsort(scores, kind="stable"):
            if scores[person] < LOWEST_SCORE:
                continue
            # a box may begin between pixels, and outside the photo
            left, top = (max(0, int(edge)) for edge in boxes[person][:2])
            patch = _patch(results[person], where)[: height - top, : width - left]
            target = frame[top : top + patch.shape[0], left : left + patch.shape[1]]
            np.copyto(target, patch, where=patch[..., :1] > 0)
        return frame

    def _find_sizes(self) -> list[tuple[int, int]]:
        """Find (height, width) of every frame."""
        found = [_photo_size(self.path, _name(photo)) for photo in self._photos]
        if all(found):
            return [size for size in found if size]
        need = np.ones(2, int)  # a frame without anybody has a pixel, too
        for index, photo in enumerate(self._photos):
            boxes = _boxes(photo, self.where(index))
            if len(boxes):
                need = np.maximum(need, np.ceil(boxes[:, [3, 2]].max(0)).astype(int))
        height, width = (int(side) for side in need)
        self.notes = (
            "a dump does not say how large its photos were, and"
            f" {sum(size is None for size in found)} of {len(found)} are not beside it:"
            f" {width} x {height}, which the boxes need, is taken",
        )
        return [(height, width)] * len(found)


def _load(path: Path) -> list[dict[str, Any]]:
    """Read the dump's list. Raises: IuvFileError if it is no dump, or could run code."""
    allowed: list[Any] = [(_Result, name) for name in RESULT_CLASSES]
    try:
        with torch.serialization.safe_globals(allowed):
            # files from before torch 1.6 are no archives, and cannot be mapped
            photos = torch.load(
                path, map_location="cpu", weights_only=True, mmap=zipfile.is_zipfile(path)
            )
    except (pickle.UnpicklingError, RuntimeError, EOFError, OSError, *MALFORMED) as error:
        raise IuvFileError(_explain(path, error)) from None
    if not isinstance(photos, list) or not all(isinstance(photo, dict) for photo in photos):
        raise IuvFileError(
            f"{path} holds a {type(photos).__name__}; a detectron2 dump is a list with one dict for"
            " each photo"
        )
    return photos


def _explain(path: Path, error: Exception) -> str:
    reason = str(error)
    if any(mark in reason for mark in ("magic number", "_load_from_bytes")):
        return f"{path} was written by pickle, not by torch.save; {REPICKLE}"
    if isinstance(error, pickle.UnpicklingError):
        return (
            f"{path} is refused: it holds more than DensePose results and could run code when read"
            f" ({_first_sentence(reason)})"
        )
    return (
        f"{path} is not a whole detectron2 dump ({_first_sentence(reason)}); write it again with"
        " apply_net.py dump"
    )


def _first_sentence(reason: str) -> str:
    """Take from torch's message, which advises at length, the part that names the culprit."""
    for line in reason.splitlines():
        for mark in ("Unsupported global", "Trying to", "Can only", "Unsupported operand"):
            if mark in line:
                return line[line.index(mark) :].split(". ")[0].strip()
    return reason.splitlines()[0] if reason else "no reason given"


def _name(photo: dict[str, Any]) -> str:
    return str(photo.get("file_name", "unnamed"))


def _photo_size(dump: Path, name: str) -> tuple[int, int] | None:
    """Find (height, width) of a photo that a dump names: beside the dump, or where it says."""
    for candidate in (dump.parent / Path(name).name, dump.parent / name, Path(name)):
        if candidate.is_file():
            try:
                with Image.open(candidate) as file:
                    return file.height, file.width
            except (UnidentifiedImageError, OSError, ValueError, Image.DecompressionBombError):
                continue
    return None


def _array(value: Any, what: str, where: str) -> np.ndarray:
    if not isinstance(value, torch.Tensor):
        raise IuvFileError(f"{where}: {what} is a {type(value).__name__}, not a tensor")
    return value.detach().cpu().numpy()


def _boxes(photo: dict[str, Any], where: str) -> np.ndarray:
    if "pred_boxes_XYXY" not in photo:
        return np.zeros((0, 4))
    boxes = _array(photo["pred_boxes_XYXY"], "pred_boxes_XYXY", where)
    if boxes.ndim != 2 or boxes.shape[1] != 4 or not np.isfinite(boxes).all():
        raise IuvFileError(f"{where}: pred_boxes_XYXY is {list(boxes.shape)}, not N x 4 numbers")
    return boxes


def _scores(photo: dict[str, Any], where: str) -> np.ndarray:
    count = len(_boxes(photo, where))
    scores = _array(photo["scores"], "scores", where) if "scores" in photo else np.ones(count)
    if scores.shape != (count,):
        raise IuvFileError(f"{where}: {len(scores)} scores for {count} boxes")
    return scores


def _results(photo: dict[str, Any], where: str, count: int) -> list[Any]:
    results = photo.get("pred_densepose", [])
    if not isinstance(results, (list, tuple)) or len(results) != count:
        raise IuvFileError(
            f"{where}: {count} boxes, but pred_densepose holds"
            f" {len(results) if isinstance(results, (list, tuple)) else type(results).__name__};"
            " dump it with a chart-based (IUV) model"
        )
    return list(results)


def _patch(result: Any, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """Draw (I, U, V) of one person, as large as the box."""
    held = vars(result) if isinstance(result, _Result) else {}
    if "labels" in held and "uv" in held:
        labels, uv = _array(held["labels"], "labels", where), _array(held["uv"], "uv", where)
        if labels.ndim != 2 or uv.shape != (2, *labels.shape):
            raise IuvFileError(
                f"{where}: labels are {list(labels.shape)} and uv {list(uv.shape)}; they are H x W"
                " and 2 x H x W"
            )
        patch = np.empty((*labels.shape, 3), np.uint8)
        patch[..., 0] = np.clip(labels, 0, 255)
        patch[..., 1:] = np.clip(np.nan_to_num(uv.transpose(1, 2, 0)) * 255, 0, 255).round()
    elif "labels_uv_uint8" in held:
        patch = _array(held["labels_uv_uint8"], "labels_uv_uint8", where).transpose(1, 2, 0)
    elif "labels_uv_str" in held:
        patch = _unpack_png(str(held["labels_uv_str"]), where)
    else:
        raise IuvFileError(f"{where}: a result without labels and uv; dump it with an IUV model")
    if patch.dtype != np.uint8 or patch[..., 0].max(initial=0) > PART_COUNT:
        raise IuvFileError(f"{where}: labels are not part indices, 0 to {PART_COUNT}")
    return patch


def _unpack_png(text: str, where: str) -> UInt8[np.ndarray, "H W 3"]:
    try:
        packed = np.frombuffer(base64.decodebytes(text.encode("ascii")), np.uint8)
        pixels = cv2.imdecode(packed, cv2.IMREAD_COLOR) if packed.size else None
    except (binascii.Error, UnicodeEncodeError) as error:
        raise IuvFileError(f"{where}: a compressed result is damaged ({error})") from error
    if pixels is None:
        raise IuvFileError(f"{where}: a compressed result is damaged; dump it again")
    return np.ascontiguousarray(pixels[..., ::-1])
