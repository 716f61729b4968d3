"""Repairs on painted people: what is filled, removed and steadied, and what is left alone."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.media.iuv.blends import BlendMeter, mend_blends
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.repair.gaps import blend, fill_gaps
from motion_transfer.repair.run import FlickerMeter, RepairOptions, remove_speckles, repair_iuv
from motion_transfer.repair.smoothing import smooth


def measure(frames):
    meter = FlickerMeter()
    assert all(a is b for a, b in zip(meter.watch(frames), frames, strict=True))
    return meter.result


def trembling(studio, count: int = 9, seed: int = 0) -> np.ndarray:
    """A still mannequin whose outline and U, V tremble."""
    rng = np.random.default_rng(seed)
    frames = np.stack([studio.iuv(scale=2, size=(192, 128))] * count)
    for frame in frames:
        rows = rng.random(192) < 0.25
        for row in np.flatnonzero(rows):
            body = np.flatnonzero(frame[row, :, 0])
            if len(body):
                frame[row, body[-1] + 1] = frame[row, body[-1]]
        noise = rng.normal(0, 4, (192, 128, 2))
        noisy = np.clip(frame[..., 1:] + noise, 0, 255).round()
        frame[..., 1:] = np.where(frame[..., :1] > 0, noisy, 0)
    return frames


# --- flicker


def test_flicker_of_a_blinking_pixel_is_counted_by_hand() -> None:
    frames = np.zeros((3, 4, 4, 3), np.uint8)
    frames[:, :2, :, 0] = 5
    frames[1, 0, 0, 0] = 6  # one of eight pixels blinks
    frames[1, 1, 0, 1] = 14  # one of seven steady ones has U 14 between 0 and 0; V has none
    result = measure(list(frames))
    assert result.parts == pytest.approx(1 / 8)
    assert result.uv == pytest.approx(14 / 7 / 2)


def test_a_moving_edge_and_steady_change_do_not_flicker(studio) -> None:
    frames = np.zeros((6, 8, 20, 3), np.uint8)
    for index, frame in enumerate(frames):
        frame[:, : 4 + 2 * index, 0] = 7
        frame[:, : 4 + 2 * index, 1:] = 10 * index
    assert (measure(list(frames)).parts, measure(list(frames)).uv) == (0, 0)


def test_empty_frames_are_counted_and_part_the_rest(studio) -> None:
    frames = studio.walk(5)
    frames[2] = 0
    result = measure(list(frames))
    assert (result.empty_frames, result.frame_count, result.parts) == (1, 5, 0)


# --- speckles


def test_speckles_and_holes_take_what_is_around_them(studio) -> None:
    clean = studio.iuv(scale=2, size=(192, 128))
    frame = clean.copy()
    frame[60:63, 60:63] = (23, 1, 2)  # a patch of head on the torso
    frame[80:82, 70:72] = 0  # a hole in it
    frame[3:5, 3:5] = (5, 9, 9)  # a foot in the air
    mended = remove_speckles(frame, 20)
    assert (mended[..., 0] == clean[..., 0]).all()
    difference = np.abs(mended.astype(int) - clean)[..., 1:]
    assert difference.max() <= 40  # U and V of a neighbour of the same part
    assert difference[frame[..., 0] == clean[..., 0]].max() == 0


def test_regions_of_the_asked_size_stay(studio) -> None:
    frame = studio.iuv()
    frame[40:42, 30:40] = (23, 1, 2)
    assert remove_speckles(frame, 20) is frame
    assert remove_speckles(frame, 21) is not frame


def test_a_frame_of_speckles_only_is_left_as_it_is() -> None:
    frame = np.ones((2, 2, 3), np.uint8)
    np.testing.assert_array_equal(remove_speckles(frame, 50), frame)


# --- gaps


def test_gaps_are_held(studio) -> None:
    frames = studio.walk(8)
    gappy = frames.copy()
    gappy[[0, 3, 4, 7]] = 0
    filled = list(fill_gaps(gappy, "hold"))
    for index, shown in enumerate((1, 1, 2, 2, 2, 5, 6, 6)):
        np.testing.assert_array_equal(filled[index], frames[shown])


def test_nobody_stays_nobody() -> None:
    empty = np.zeros((4, 8, 8, 3), np.uint8)
    assert np.array_equal(list(fill_gaps(empty, "interpolate")), empty)


def test_a_walker_goes_on_through_a_gap(studio) -> None:
    """Straight across the frame: what is filled in is where the walker was."""
    frames = [studio.iuv(x, 8, size=(120, 200)) for x in range(10, 90, 10)]
    gappy = [f if i not in (3, 4, 5) else np.zeros_like(f) for i, f in enumerate(frames)]
    filled = list(fill_gaps(gappy, "interpolate"))
    assert len(filled) == len(frames)
    for index in (3, 4, 5):
        occupied = (filled[index][..., 0] | frames[index][..., 0]) > 0
        wrong = (filled[index][..., 0] != frames[index][..., 0])[occupied].mean()
        held = (frames[2][..., 0] != frames[index][..., 0])[occupied].mean()
        assert wrong < 0.06 < held


def test_two_people_are_each_moved_their_own_way(studio) -> None:
    def scene(left: int, right: int) -> np.ndarray:
        return studio.iuv(left, 8, size=(120, 300)) | studio.iuv(right, 8, size=(120, 300))

    middle = blend(scene(0, 200), scene(20, 180), 0.4)
    wanted = scene(8, 192)
    occupied = (middle[..., 0] | wanted[..., 0]) > 0
    assert (middle[..., 0] != wanted[..., 0])[occupied].mean() < 0.06


# --- smoothing


def test_smoothing_halves_the_trembling_of_a_still_person(studio) -> None:
    noisy, clean = trembling(studio), studio.iuv(scale=2, size=(192, 128))
    steady = list(smooth(noisy))
    assert len(steady) == len(noisy)
    before, after = measure(list(noisy)), measure(steady)
    assert after.parts < 0.6 * before.parts
    assert after.uv < 0.7 * before.uv

    def error(frames) -> float:
        return float(np.mean([(frame[..., 0] != clean[..., 0]).mean() for frame in frames]))

    assert error(steady[1:-1]) < 0.7 * error(noisy[1:-1])


def test_a_fast_thin_limb_is_not_worn_away() -> None:
    frames = np.zeros((7, 96, 200, 3), np.uint8)
    for index, frame in enumerate(frames):
        frame[10:90, 10:60] = (2, 100, 100)
        frame[20:80, 70 + 18 * index : 78 + 18 * index] = (15, 50, 60)
    for frame, steady in zip(frames, smooth(frames), strict=True):
        limb = (steady[..., 0] == 15).sum()
        assert limb >= 0.45 * (frame[..., 0] == 15).sum()  # two of eight pixels on each side


def test_a_cut_ends_smoothing(studio) -> None:
    first, second = studio.iuv(0, 0, size=(96, 160)), studio.iuv(90, 0, size=(96, 160))
    frames = [first] * 3 + [second] * 3
    assert all(np.array_equal(a, b) for a, b in zip(smooth(frames), frames, strict=True))


@pytest.mark.parametrize("count", [0, 1, 2])
def test_short_sequences(studio, count: int) -> None:
    frames = list(studio.walk(3)[:count])
    assert len(list(smooth(frames))) == len(list(fill_gaps(frames, "hold"))) == count


# --- the whole


def test_a_repair_is_written_and_measured(studio, mt) -> None:
    frames = trembling(studio)
    frames[4] = 0
    source, output = studio.driver(frames), studio.folder / "steady.mkv"
    result = mt(
        *("iuv", "repair", source, "-o", output, "--fill-gaps", "interpolate"),
        *("--speckle", 6, "--smooth"),
    )
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"wrote {output}: 9 frames; empty frames 1 -> 0, part flicker ")
    repaired = list(open_reader(open_stream(output)).read(0, 9))
    assert all(frame.any() for frame in repaired)


def test_nothing_to_repair_is_said(studio, mt) -> None:
    result = mt("iuv", "repair", studio.driver(2), "-o", studio.folder / "out")
    assert result.code == 2
    assert "nothing to repair: " in result.err
    assert "add --fill-gaps" in result.err


# --- blends


@pytest.mark.parametrize(
    ("how", "scale"),
    [
        *[(cv2.INTER_LINEAR, scale) for scale in (0.6, 1.5, 3.0)],
        *[(cv2.INTER_CUBIC, scale) for scale in (0.6, 1.5)],
        (cv2.INTER_AREA, 0.6),
    ],
)
def test_blends_are_told_and_mended_without_being_asked(studio, mt, how: int, scale: float) -> None:
    large = [studio.iuv(scale=4, size=(384, 256))] * 2
    size = round(256 * scale), round(384 * scale)
    right = cv2.resize(large[0], size, interpolation=cv2.INTER_NEAREST_EXACT)
    blended = [
        cv2.resize(frame, size, interpolation=how).clip(0, (24, 255, 255)) for frame in large
    ]
    source = studio.driver(np.stack(blended).astype(np.uint8))
    output = studio.folder / "mended"
    assert "resized with interpolation" in mt("inspect", source).out
    result = mt("iuv", "repair", source, "-o", output)
    assert result.code == 0
    assert "% of the body's pixels that have a part found nowhere near" in result.err
    mended = next(iter(open_reader(open_stream(output)).read(0, 1)))
    wrong = [(frame[..., 0] != right[..., 0]).sum() for frame in (blended[0], mended)]
    assert wrong[1] < 0.5 * wrong[0]
    assert "resized with interpolation" not in mt("inspect", output).out


@pytest.mark.parametrize("scale", [0.3, 0.6, 1.0, 1.5, 4.0])
def test_iuv_resized_by_nearest_neighbour_is_sound(studio, scale: float) -> None:
    meter = BlendMeter()
    frame = studio.iuv(scale=4, size=(384, 256))
    meter.add(cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST))
    assert not meter.found
    assert meter.warn("driver") is None


def test_u_and_v_left_in_the_background_go() -> None:
    frame = np.zeros((8, 8, 3), np.uint8)
    frame[2:6, 2:6] = (5, 100, 100)
    clean = frame.copy()
    frame[1, 2:6] = (0, 30, 30)
    np.testing.assert_array_equal(mend_blends(frame), clean)


@pytest.mark.parametrize(
    ("change", "reason"),
    [({"fill_gaps": "guess"}, "supported are hold, interpolate"), ({"speckle": -1}, "0 or more")],
)
def test_bad_options(change: dict, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        RepairOptions(source=Path("a"), output=Path("b"), **change)


def test_few_frames_are_held_at_a_time(studio) -> None:
    """The chain asks for a frame only two ahead of the one it gives, however long it is."""
    asked = 0

    def counted():
        nonlocal asked
        for frame in np.stack([studio.iuv()] * 50):
            asked += 1
            yield frame

    for given, _ in enumerate(smooth(fill_gaps(counted(), "hold")), 1):
        assert asked <= given + 2


def test_convert_through_the_command(studio, mt) -> None:
    source, output = studio.driver(3), studio.folder / "out.npy"
    result = mt("iuv", "convert", source, "-o", output)
    assert (result.code, result.out) == (0, f"wrote {output}: 3 frames\n")
    np.testing.assert_array_equal(np.load(output), studio.walk(3))


def test_a_repair_through_python(studio) -> None:
    frames = trembling(studio, 4)
    report = repair_iuv(
        RepairOptions(source=studio.array(frames), output=studio.folder / "out", smooth=True)
    )
    assert report.after.uv < report.before.uv
    assert report.before.frame_count == report.after.frame_count == 4
