"""The contact sheet: evenly spread frames, in order, however they come in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motion_transfer.render.engine import SHEET_FRAMES, ContactSheet


@pytest.mark.parametrize("count", [1, 3, 12, 100])
def test_frames_are_spread_and_in_order(tmp_path: Path, count: int) -> None:
    sheet = ContactSheet(tmp_path, count)
    for index in reversed(range(count)):
        sheet.offer(index, np.full((8, 10, 3), 2 * index, np.uint8))
    picture = sheet.picture()
    columns = min(4, count)
    rows = -(-min(SHEET_FRAMES, count) // columns)
    assert picture.shape == (8 * rows, 10 * columns, 3)
    levels = picture[::8, ::10, 0].reshape(-1)[: min(SHEET_FRAMES, count)]
    expected = np.linspace(0, count - 1, min(SHEET_FRAMES, count)).round() * 2
    np.testing.assert_array_equal(levels, expected)


def test_large_frames_become_thumbnails(tmp_path: Path) -> None:
    sheet = ContactSheet(tmp_path, 1)
    sheet.offer(0, np.zeros((640, 960, 3), np.uint8))
    assert sheet.picture().shape == (213, 320, 3)
