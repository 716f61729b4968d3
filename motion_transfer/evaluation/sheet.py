"""A contact sheet of pairs: source, target, every method; the worst, the usual and the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.evaluation.scoring import PairPictures
from motion_transfer.training.pairs import Pair, flat_stem

Image = UInt8[np.ndarray, "H W 3"]

ROWS_EACH = 3
CELL_PX = 256
GAP_PX = 4
LINE_PX = 22
TEXT_SCALE = 0.45
NAME_LENGTH = 22


@dataclass(frozen=True)
class SheetRow:
    """One pair: why it is shown, its pictures, and words above each result."""

    word: str
    pair: Pair
    pictures: PairPictures
    scores: Sequence[str]


def choose_rows(values: Sequence[float], better: str) -> list[tuple[str, int]]:
    """Which pairs to show, as (`worst`, `median` or `best`, index); each at most once.

    Pairs without a number (NaN) are not shown.
    """
    known = [index for index, value in enumerate(values) if not np.isnan(value)]
    order = sorted(known, key=lambda index: values[index], reverse=better == "lower")
    count = len(order)
    if count <= 3 * ROWS_EACH:
        third = -(-count // 3)
        words = ["worst"] * third + ["median"] * (count - 2 * third) + ["best"] * third
        return list(zip(words[:count], order, strict=True))
    middle = (count - ROWS_EACH) // 2
    picks = (
        ("worst", order[:ROWS_EACH]),
        ("median", order[middle : middle + ROWS_EACH]),
        ("best", order[-ROWS_EACH:]),
    )
    return [(word, index) for word, indices in picks for index in indices]


def draw_sheet(labels: Sequence[str], rows: Sequence[SheetRow]) -> Image:
    """The sheet: a heading over each column, then the rows."""
    columns = len(labels) + 2
    heading = _line(["source", "target", *labels], columns)
    parts = [heading]
    for row in rows:
        pictures = [row.pictures.source, row.pictures.target.rgb, *row.pictures.results]
        names = [_tail(picture.name) for picture in (row.pair.source, row.pair.target)]
        parts.append(_line([f"{row.word}: {names[0]}", names[1], *row.scores], columns))
        parts.append(_join([_thumbnail(picture) for picture in pictures]))
    return np.vstack(parts)


def _tail(name: str) -> str:
    """The end of a picture's name, which tells more than its beginning."""
    stem = flat_stem(name)
    return stem if len(stem) <= NAME_LENGTH else ".." + stem[-NAME_LENGTH:]


def _thumbnail(picture: Image) -> Image:
    scale = CELL_PX / max(picture.shape[:2])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    if size != picture.shape[1::-1]:
        kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST
        picture = cv2.resize(picture, size, interpolation=kind)
    cell = np.full((picture.shape[0], CELL_PX, 3), 255, np.uint8)
    left = (CELL_PX - picture.shape[1]) // 2
    cell[:, left : left + picture.shape[1]] = picture
    return cell


def _join(cells: Sequence[Image]) -> Image:
    gap = np.full((cells[0].shape[0], GAP_PX, 3), 255, np.uint8)
    return np.hstack([piece for cell in cells for piece in (cell, gap)])


def _line(words: Sequence[str], columns: int) -> Image:
    """A strip of text, a word over each column; what is too long is cut."""
    strip = np.full((LINE_PX, columns * (CELL_PX + GAP_PX), 3), 255, np.uint8)
    for column, word in enumerate(words):
        word = word.encode("ascii", "replace").decode()  # the font has no more
        cell = np.ascontiguousarray(strip[:, column * (CELL_PX + GAP_PX) :][:, :CELL_PX])
        place = (4, LINE_PX - 7)
        cv2.putText(
            cell, word, place, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SCALE, (0, 0, 0), 1, cv2.LINE_AA
        )
        strip[:, column * (CELL_PX + GAP_PX) :][:, :CELL_PX] = cell
    return strip
