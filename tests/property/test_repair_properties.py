"""Promises of IUV repair on random sequences."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from motion_transfer.repair.gaps import blend, fill_gaps
from motion_transfer.repair.run import remove_speckles
from motion_transfer.repair.smoothing import BORDER_PX, smooth

SIDE = 40


@st.composite
def pictures(draw, count: int) -> np.ndarray:
    """Frames of overlapping rectangles, one part each, that tremble from frame to frame."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    boxes = [(*rng.integers(0, 28, 2), *rng.integers(4, 20, 2)) for _ in range(6)]
    parts = rng.choice(np.arange(1, 25), 6, replace=False)
    frames = np.zeros((count, SIDE, SIDE, 3), np.uint8)
    for frame in frames:
        for part, (top, left, height, width) in zip(parts, boxes, strict=True):
            y, x = np.array([top, left]) + rng.integers(0, 3, 2)
            box = frame[y : y + height, x : x + width]
            box[..., 0] = part
            # each part keeps to levels of its own: mixed ones would show
            box[..., 1:] = 10 * part + rng.integers(0, 9, (*box.shape[:2], 2))
    return frames


def assert_uv_of_its_part(frame: np.ndarray) -> None:
    body = frame[..., 0] > 0
    assert (frame[body][:, 1:] // 10 == frame[body][:, :1]).all()
    assert not frame[~body].any()


@given(pictures(1), st.integers(1, 6))
@settings(max_examples=20, deadline=None)
def test_a_still_sequence_is_never_changed(frames: np.ndarray, count: int) -> None:
    still = [frames[0]] * count
    for how in ("hold", "interpolate"):
        for frame in smooth(fill_gaps(still, how)):
            np.testing.assert_array_equal(frame, frames[0])


@given(pictures(4))
@settings(max_examples=20, deadline=None)
def test_smoothing_takes_parts_from_close_by_and_mixes_no_u_and_v(frames: np.ndarray) -> None:
    reach = BORDER_PX
    for index, steady in enumerate(smooth(frames)):
        assert_uv_of_its_part(steady)
        here = frames[index]
        for y, x in np.argwhere(steady[..., 0] != here[..., 0]):
            around = here[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1, 0]
            assert steady[y, x, 0] in around


@given(pictures(1), st.integers(1, 60))
@settings(max_examples=20, deadline=None)
def test_speckle_removal_invents_nothing(frames: np.ndarray, smallest: int) -> None:
    mended = remove_speckles(frames[0], smallest)
    assert_uv_of_its_part(mended)
    known = {tuple(pixel) for pixel in frames[0].reshape(-1, 3)}
    assert {tuple(pixel) for pixel in mended.reshape(-1, 3)} <= known


@given(pictures(2), st.floats(0.01, 0.99))
@settings(max_examples=20, deadline=None)
def test_filled_frames_show_parts_of_their_neighbours(frames: np.ndarray, time: float) -> None:
    filled = blend(frames[0], frames[1], time)
    assert_uv_of_its_part(filled)
    assert set(np.unique(filled[..., 0])) <= set(np.unique(frames[..., 0])) | {0}
