"""detectron2's DensePose results, as `apply_net.py dump` writes them.

The file is a list with a dict for each photo: `file_name`, `scores` (N), `pred_boxes_XYXY` (N x 4,
px) and `pred_densepose`, N objects with `labels` (H x W) and `uv` (2 x H x W, floats), each as
large as its box. Until the middle of 2020 it was one object, whose `results` are N pairs of a shape
and a PNG. Nothing in a file is run (see `dump_file`), and in those of `torch.save` tensors stay on
disk until their frame is read.
"""

from __future__ import annotations

import base64
import io
import math
import pickle
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image

from motion_transfer.errors import IuvFileError
from motion_transfer.media.container import LARGEST_PICTURE
from motion_transfer.media.iuv.dump_file import (
    PickledArray,
    PickledTensor,
    Record,
    read_dump_file,
)
from motion_transfer.media.iuv.stream import IuvStream, Raw
from nhrr_core.parts import PART_COUNT

LOWEST_SCORE = 0.8  # `apply_net.py show` draws no detection below it; a dump holds them all
NOBODY = np.zeros((0, 4))  # boxes of
LONGEST_NAME = 4096  # the longest path that Linux opens
TURNED = (5, 6, 7, 8)  # EXIF's orientations with width and height swapped; detectron2 heeds them


class DumpStream(IuvStream):
    """Frames of a dump, one for each of the photos; everybody scored 0.8 or more.

    A dump does not say how large its photos were. They are looked for by name; where one is gone,
    the frame is as large as the boxes of all photos need.
    """

    def __init__(self, path: Path, photos: list[dict[str, Any]]) -> None:
        self._photos = photos
        super().__init__(path, "detectron2 dump", len(photos))
        self.order = "iuv"
        self._sizes = self._find_sizes()

    def read_raw(self, start: int, stop: int) -> Iterator[Raw]:
        for index in range(start, stop):
            yield self._draw(index)

    def where(self, index: int) -> str:
        name = _name(self._photos[index]) or "unnamed"
        return f"frame {index} of {self.path} ({shorten(name, 200)})"

    def _draw(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        """Draw the people of a frame in order of score, so that the surest stands in front."""
        where = self.where(index)
        height, width = self._sizes[index]
        frame = np.zeros((height, width, 3), np.uint8)
        boxes, scores, results = _people(self._photos[index], where)
        for person in np.argsort(scores, kind="stable"):
            if scores[person] < LOWEST_SCORE:
                continue
            patch = _patch(results[person], where)
            # a box may begin between pixels, and outside the photo
            left, top = (math.floor(edge) for edge in boxes[person][:2])
            patch = patch[max(0, -top) :, max(0, -left) :]
            target = frame[max(0, top) :, max(0, left) :][: len(patch), : patch.shape[1]]
            patch = patch[: len(target), : target.shape[1]]
            np.copyto(target, patch, where=patch[..., :1] > 0)
        return frame

    def _find_sizes(self) -> list[tuple[int, int]]:
        """Find (height, width) of every frame. Raises: IuvFileError for one that is too large."""
        found = [_photo_size(self.path, _name(photo)) for photo in self._photos]
        sizes = [size for size in found if size]
        if len(sizes) < len(found):
            need = np.ones(2)  # a frame without anybody has a pixel, too
            for index, photo in enumerate(self._photos):
                boxes, _, _ = _people(photo, self.where(index))
                need = np.maximum(need, np.ceil(boxes[:, [3, 2]].max(0, initial=1)))
            height, width = (int(side) for side in need)
            self.notes = (
                "a dump does not say how large its photos were, and"
                f" {len(found) - len(sizes)} of {len(found)} are not beside it:"
                f" {width} x {height}, which the boxes need, is taken",
            )
            sizes = [(height, width)] * len(found)
        for index, (height, width) in enumerate(sizes):
            if height * width > LARGEST_PICTURE:
                raise IuvFileError(
                    f"{self.where(index)} needs {width} x {height} px; at most {LARGEST_PICTURE:,}"
                    " px are drawn, which is 16K; dump smaller photos"
                )
        return sizes


def list_photos(path: Path) -> list[tuple[str | None, dict[str, Any]]]:
    """Read a dump's list, in its order, with what each photo is called.

    Raises: IuvFileError if it is no dump, or could run code.
    """
    photos = _load(path)
    if not isinstance(photos, list) or not all(isinstance(photo, dict) for photo in photos):
        raise IuvFileError(
            f"{path} holds a {type(photos).__name__}; a detectron2 dump is a list with one dict for"
            " each photo"
        )
    for index, photo in enumerate(photos):
        name = photo.get("file_name")
        if name is not None and (not isinstance(name, str) or len(name) > LONGEST_NAME):
            raise IuvFileError(
                f"frame {index} of {path}: file_name is no path; dump it again with apply_net.py"
            )
    return [(_name(photo), photo) for photo in photos]


def _load(path: Path) -> Any:
    try:
        return read_dump_file(path)
    except pickle.UnpicklingError as error:
        raise IuvFileError(
            f"{path} is refused: it holds more than DensePose results and could run code when read"
            f" ({shorten(str(error), 200)}); write it again with apply_net.py dump"
        ) from None
    except Exception as error:  # opcodes that do not fit each other bring about any
        reason = shorten(str(error), 200) or type(error).__name__
        raise IuvFileError(
            f"{path} is not a whole detectron2 dump ({reason}); write it again with"
            " apply_net.py dump"
        ) from None


def _name(photo: dict[str, Any]) -> str | None:
    return photo.get("file_name")


def _photo_size(dump: Path, name: str | None) -> tuple[int, int] | None:
    """Find (height, width) of a photo that a dump names: beside the dump, or where it says."""
    if not name:
        return None
    for candidate in (dump.parent / Path(name).name, dump.parent / name, Path(name)):
        try:
            if candidate.is_file():
                with _open_picture(candidate) as file:
                    # a PNG is decoded to the end where it may have an orientation
                    exif = file.getexif() if file.format != "PNG" else {}
                    turned = exif.get(ExifTags.Base.Orientation) in TURNED
                    return (file.width, file.height) if turned else (file.height, file.width)
        except Exception:  # whatever is wrong with a picture, or a name: it is not the photo
            continue
    return None


def _open_picture(source: Path | io.BytesIO, formats: tuple[str, ...] | None = None) -> Image.Image:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # its size is looked at
        return Image.open(source, formats=formats)


def _people(photo: dict[str, Any], where: str) -> tuple[np.ndarray, np.ndarray, list[Record]]:
    """Take apart what is known of a photo.

    Returns: Boxes (N x 4, px), scores (N) and results (N).
    Raises: IuvFileError where they do not fit each other.
    """
    boxes = _numbers(photo.get("pred_boxes_XYXY", NOBODY), "pred_boxes_XYXY", where)
    if boxes.ndim != 2 or boxes.shape[1] != 4:
        raise IuvFileError(f"{where}: pred_boxes_XYXY is {list(boxes.shape)}, not N x 4 numbers")
    results = photo.get("pred_densepose", [])
    if isinstance(results, Record):
        results = _split(results, where)
    if not isinstance(results, (list, tuple)) or len(results) != len(boxes):
        held = len(results) if isinstance(results, (list, tuple)) else type(results).__name__
        raise IuvFileError(
            f"{where}: {len(boxes)} boxes, but pred_densepose holds {held}; dump it with a"
            " chart-based (IUV) model"
        )
    scores = _numbers(photo.get("scores", np.ones(len(boxes))), "scores", where)
    if scores.shape != (len(boxes),):
        raise IuvFileError(
            f"{where}: {len(scores) if scores.ndim else 'no'} scores for {len(boxes)} boxes"
        )
    for what, values in (("pred_boxes_XYXY", boxes), ("scores", scores)):
        if not np.isfinite(values).all():
            raise IuvFileError(f"{where}: {what} holds NaN or infinity; dump it again")
    return boxes, scores, list(results)


def _split(result: Record, where: str) -> list[Record]:
    """Make of one result of 2020 one for each person."""
    pairs = vars(result).get("results")
    if not isinstance(pairs, list) or not all(isinstance(p, tuple) and len(p) == 2 for p in pairs):
        raise IuvFileError(f"{where}: pred_densepose holds no results; dump it with an IUV model")
    people = [Record() for _ in pairs]
    for person, (_, png) in zip(people, pairs, strict=True):
        vars(person)["labels_uv_str"] = png
    return people


def _numbers(value: object, what: str, where: str, kinds: str = "iuf") -> np.ndarray:
    """View a tensor or an array. Raises: IuvFileError unless its type is of one of `kinds`."""
    if isinstance(value, PickledArray | PickledTensor):
        try:
            value = value.array
        except (ValueError, OSError, RuntimeError, zipfile.BadZipFile) as error:
            raise IuvFileError(
                f"{where}: the numbers of {what} are damaged ({error}); dump it again"
            ) from None
    if not isinstance(value, np.ndarray):
        raise IuvFileError(f"{where}: {what} is a {type(value).__name__}, not a tensor")
    if value.dtype.kind not in kinds:
        wanted = {"iu": "whole numbers", "f": "fractions"}.get(kinds, "numbers")
        raise IuvFileError(f"{where}: {what} holds {value.dtype}, and not {wanted}")
    return value


def _patch(result: object, where: str) -> UInt8[np.ndarray, "H W 3"]:
    """Draw (I, U, V) of one person, as large as the box."""
    held = vars(result) if isinstance(result, Record) else {}
    if "labels" in held and "uv" in held:
        return _quantise(held["labels"], held["uv"], where)
    if "labels_uv_uint8" in held:
        planes = _numbers(held["labels_uv_uint8"], "labels_uv_uint8", where, "iu")
        if planes.dtype != np.uint8 or planes.ndim != 3 or len(planes) != 3:
            raise IuvFileError(
                f"{where}: labels_uv_uint8 is {planes.dtype} {list(planes.shape)}; it is uint8,"
                " 3 x H x W"
            )
        patch = planes.transpose(1, 2, 0)
    elif "labels_uv_str" in held:
        patch = _unpack_png(held["labels_uv_str"], where)
    else:
        raise IuvFileError(f"{where}: a result without labels and uv; dump it with an IUV model")
    _check_parts(patch[..., 0], where)
    return patch


def _quantise(labels: object, uv: object, where: str) -> UInt8[np.ndarray, "H W 3"]:
    parts, places = _numbers(labels, "labels", where, "iu"), _numbers(uv, "uv", where, "f")
    if parts.ndim != 2 or places.shape != (2, *parts.shape):
        raise IuvFileError(
            f"{where}: labels are {list(parts.shape)} and uv {list(places.shape)}; they are H x W"
            " and 2 x H x W"
        )
    _check_parts(parts, where)
    covered = places[:, parts > 0]
    if not np.isfinite(covered).all() or (covered.size and covered.mean() > 1):
        raise IuvFileError(f"{where}: uv is not within 0..1; dump it again")
    patch = np.zeros((*parts.shape, 3), np.uint8)
    patch[..., 0] = parts
    # the network may overshoot
    patch[parts > 0, 1:] = np.clip(covered.T * 255, 0, 255).round()
    return patch


def _check_parts(parts: np.ndarray, where: str) -> None:
    if parts.size > LARGEST_PICTURE:
        raise IuvFileError(f"{where}: a person of {list(parts.shape)} px; dump it again")
    if parts.min(initial=0) < 0 or parts.max(initial=0) > PART_COUNT:
        raise IuvFileError(f"{where}: labels are not part indices, 0 to {PART_COUNT}")


def _unpack_png(text: object, where: str) -> UInt8[np.ndarray, "H W 3"]:
    try:
        packed = base64.decodebytes(str(text).encode("ascii") if isinstance(text, str) else b"")
        with _open_picture(io.BytesIO(packed), formats=("PNG",)) as file:
            if file.mode != "RGB" or file.width * file.height > LARGEST_PICTURE:
                raise ValueError(f"it is {file.mode}, {file.width} x {file.height} px")
            return np.asarray(file)
    except Exception as error:  # a picture can be broken in any way
        reason = shorten(str(error), 100)
        raise IuvFileError(
            f"{where}: a compressed result is damaged ({reason}); dump it again"
        ) from None
