"""The contact sheet: evenly spread frames, in order, however they come in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motion_transfer.render.engine import (
    SHEET_FRAMES,
    SHEET_GAP_PX,
    SHEET_GREY,
    SHEET_LINE_PX,
    ContactSheet,
)


@pytest.mark.parametrize("count", [1, 3, 12, 100])
def test_frames_are_spread_and_in_order(tmp_path: Path, count: int) -> None:
    sheet = ContactSheet(tmp_path, count)
    for index in reversed(range(count)):
        sheet.offer(index, np.full((8, 10, 3), 2 * index, np.uint8))
    picture = sheet.picture()
    columns = min(4, count)
    rows = -(-min(SHEET_FRAMES, count) // columns)
    down, across = 8 + SHEET_LINE_PX + SHEET_GAP_PX, 10 + SHEET_GAP_PX
    assert picture.shape == (down * rows + SHEET_GAP_PX, across * columns + SHEET_GAP_PX, 3)
    cells = picture[SHEET_GAP_PX::down, SHEET_GAP_PX::across, 0]
    levels = cells[:rows].reshape(-1)[: min(SHEET_FRAMES, count)]
    expected = np.linspace(0, count - 1, min(SHEET_FRAMES, count)).round() * 2
    np.testing.assert_array_equal(levels, expected)


def test_large_frames_become_thumbnails(tmp_path: Path) -> None:
    sheet = ContactSheet(tmp_path, 1)
    sheet.offer(0, np.zeros((640, 960, 3), np.uint8))
    gap, line = SHEET_GAP_PX, SHEET_LINE_PX
    assert sheet.picture().shape == (213 + line + 2 * gap, 320 + 2 * gap, 3)


def test_frames_have_their_numbers_and_stand_out_from_the_sheet(tmp_path: Path) -> None:
    """White people on white are told apart, and so are black ones."""
    sheets = []
    for last in (11, 29):
        sheet = ContactSheet(tmp_path, last + 1)
        for index in range(last + 1):
            sheet.offer(index, np.full((60, 80, 3), 255, np.uint8))
        sheets.append(sheet.picture())
    line = sheets[0][SHEET_GAP_PX + 60 :][:SHEET_LINE_PX, : 80 + SHEET_GAP_PX]
    assert (line > 200).any()  # words
    assert (sheets[0][:SHEET_GAP_PX] == SHEET_GREY).all()
    second = slice(60 + SHEET_LINE_PX + 2 * SHEET_GAP_PX, None)
    assert not np.array_equal(sheets[0][second, :88], sheets[1][second, :88])  # frames 4 and 11
