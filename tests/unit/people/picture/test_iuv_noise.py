"""DensePose's faults, put on clean IUV: none, each alone, and all together."""

from __future__ import annotations

from dataclasses import fields, replace
from importlib.resources import as_file, files

import cv2
import numpy as np
import pytest
from reference.iuv_difference import IuvDifference, iuv_difference

from motion_transfer.people.picture.iuv_noise import (
    IuvNoise,
    add_iuv_noise,
    lose_parts,
    swap_faces,
    swap_sides,
)

SEEDS = range(30)
NONE, DENSEPOSE = IuvNoise(), IuvNoise.densepose()
HAND_RIGHT, HAND_LEFT, FOOT_LEFT, FOOT_RIGHT = 3, 4, 5, 6


@pytest.fixture(scope="module")
def clean() -> np.ndarray:
    """The demo's synthetic person, 256 x 256."""
    with as_file(files("motion_transfer").joinpath("demo/source_IUV.png")) as path:
        iuv = cv2.imread(str(path))  # stored as RGB = V, U, I
    assert iuv is not None
    x, y, width, height = cv2.boundingRect(iuv[..., 0])
    side, left = height + 30, x + width // 2 - (height + 30) // 2
    crop = np.zeros((side, side, 3), np.uint8)
    crop[15 : 15 + height, x - left : x - left + width] = iuv[y : y + height, x : x + width]
    return cv2.resize(crop, (256, 256), interpolation=cv2.INTER_NEAREST)


def medians(clean: np.ndarray, noise: IuvNoise, seeds: range = SEEDS) -> IuvDifference:
    found = [
        iuv_difference(clean, add_iuv_noise(clean, noise, np.random.default_rng(seed)))
        for seed in seeds
    ]
    return IuvDifference(
        iou=float(np.median([d.iou for d in found])),
        part_agreement=float(np.median([d.part_agreement for d in found])),
        median_uv_error=float(np.median([d.median_uv_error for d in found])),
    )


def packed(iuv: np.ndarray) -> np.ndarray:
    """I, U and V as one number."""
    return iuv.astype(np.int32) @ (65536, 256, 1)


def is_valid(iuv: np.ndarray) -> bool:
    background = iuv[..., 0] == 0
    return bool(iuv.dtype == np.uint8 and iuv[..., 0].max() <= 24 and not iuv[background].any())


def test_without_noise_the_bytes_are_the_same(clean: np.ndarray) -> None:
    out = add_iuv_noise(clean, NONE, np.random.default_rng(0))
    assert out.tobytes() == clean.tobytes() and out is not clean
    assert all(getattr(NONE, field.name) == 0 for field in fields(IuvNoise))


@pytest.mark.parametrize("field", [f.name for f in fields(IuvNoise) if f.name != "forearm_loss"])
def test_each_fault_alone_changes_something_and_leaves_valid_iuv(clean, field: str) -> None:
    noise = replace(NONE, **{field: {"grid_cells": 40, "holes": 5}.get(field, 1)})
    before = clean.copy()
    out = add_iuv_noise(clean, noise, np.random.default_rng(1))
    assert is_valid(out) and (out != clean).any()
    np.testing.assert_array_equal(clean, before)


def test_the_same_seed_gives_the_same_faults(clean: np.ndarray) -> None:
    first, again, other = (
        add_iuv_noise(clean, DENSEPOSE, np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_densepose_errs_as_much_as_densepose(clean: np.ndarray) -> None:
    difference = medians(clean, DENSEPOSE)
    assert 0.90 < difference.iou < 0.955
    assert 0.89 < difference.part_agreement < 0.97
    assert 0.015 < difference.median_uv_error < 0.05


def test_every_estimate_is_valid(clean: np.ndarray) -> None:
    for seed in SEEDS:
        assert is_valid(add_iuv_noise(clean, DENSEPOSE, np.random.default_rng(seed)))


def test_a_larger_picture_is_disturbed_alike(clean: np.ndarray) -> None:
    large = cv2.resize(clean, (512, 512), interpolation=cv2.INTER_NEAREST)
    noise = replace(DENSEPOSE, hand_loss=0, foot_loss=0, side_swap=0, face_swap=0)
    seeds = range(10)
    small_difference, large_difference = (medians(iuv, noise, seeds) for iuv in (clean, large))
    assert large_difference.iou == pytest.approx(small_difference.iou, abs=0.02)
    assert large_difference.part_agreement == pytest.approx(
        small_difference.part_agreement, abs=0.025
    )


def test_the_silhouette_moves_by_pixels_and_keeps_what_is_inside(clean: np.ndarray) -> None:
    inside = cv2.erode(clean[..., 0], np.ones((17, 17), np.uint8)) > 0
    for seed in SEEDS:
        out = add_iuv_noise(clean, replace(NONE, silhouette_px=1.0), np.random.default_rng(seed))
        np.testing.assert_array_equal(out[inside], clean[inside])
        grown = (out[..., 0] > 0) & (clean[..., 0] == 0)
        near = cv2.dilate(clean[..., 0], np.ones((15, 15), np.uint8)) > 0
        assert grown.any() and near[grown].all()
        assert np.isin(packed(out[grown]), packed(clean)).all()


def test_borders_between_parts_move_inside_the_silhouette(clean: np.ndarray) -> None:
    noise = replace(NONE, part_border_px=1.5)
    out = add_iuv_noise(clean, noise, np.random.default_rng(0))
    np.testing.assert_array_equal(out[..., 0] > 0, clean[..., 0] > 0)
    assert 0.01 < (out[..., 0] != clean[..., 0])[clean[..., 0] > 0].mean() < 0.15
    same = out[..., 0] == clean[..., 0]
    np.testing.assert_array_equal(out[same], clean[same])


def test_a_pixel_that_joins_a_part_takes_that_parts_nearest_uv() -> None:
    iuv = np.zeros((64, 64, 3), np.uint8)
    iuv[8:56, 8:32], iuv[8:56, 32:56] = (1, 10, 20), (2, 200, 210)
    out = add_iuv_noise(iuv, replace(NONE, part_border_px=8), np.random.default_rng(0))
    assert (out[..., 0] != iuv[..., 0]).any()
    for part, u, v in ((1, 10, 20), (2, 200, 210)):
        assert (out[out[..., 0] == part] == (part, u, v)).all()


def test_coarse_cells_turn_fingers_into_a_mitten() -> None:
    iuv = np.zeros((256, 256, 3), np.uint8)
    iuv[4:200, 60:200] = (2, 128, 128)
    iuv[200:252:1, 100:160] = (3, 128, 128)
    gaps = np.arange(100, 160) % 4 < 1
    iuv[210:252, 100:160][:, gaps] = 0
    out = add_iuv_noise(iuv, replace(NONE, grid_cells=28), np.random.default_rng(0))
    between = out[215:245, 105:155, 0]
    assert (between == between[0, 0]).all(), "the gaps are still there"


def test_uv_drift_and_shift_have_the_stated_size(clean: np.ndarray) -> None:
    person = clean[..., 0] > 0
    room = person & (clean[..., 1:] > 60).all(-1) & (clean[..., 1:] < 195).all(-1)
    for noise in (replace(NONE, uv_drift=0.03), replace(NONE, uv_shift=0.03)):
        errors = []
        for seed in SEEDS:
            out = add_iuv_noise(clean, noise, np.random.default_rng(seed))
            np.testing.assert_array_equal(out[..., 0], clean[..., 0])
            errors.append((out[room][:, 1:].astype(float) - clean[room][:, 1:]) / 255)
        assert np.concatenate(errors).std() == pytest.approx(0.03, rel=0.35)


def test_a_shift_is_one_number_a_part(clean: np.ndarray) -> None:
    out = add_iuv_noise(clean, replace(NONE, uv_shift=0.03), np.random.default_rng(0))
    for part in (2, 9, 10, 23):
        inside = (clean[..., 0] == part) & (abs(clean[..., 1].astype(int) - 128) < 60)
        step = out[inside][:, 1].astype(int) - clean[inside][:, 1]
        assert np.ptp(step) == 0


@pytest.mark.parametrize(
    ("rates", "missing", "kept"),
    [
        ((1, 0, 0), {HAND_RIGHT, HAND_LEFT}, {19, 20, FOOT_LEFT, FOOT_RIGHT}),
        ((1, 1, 0), {HAND_RIGHT, HAND_LEFT, 19, 20, 21, 22}, {15, 16, FOOT_LEFT, FOOT_RIGHT}),
        ((0, 1, 1), {FOOT_LEFT, FOOT_RIGHT}, {HAND_RIGHT, HAND_LEFT, 19, 20}),
    ],
)
def test_hands_forearms_and_feet_get_lost(clean, rates, missing: set, kept: set) -> None:
    hand, forearm, foot = rates
    out = lose_parts(clean, hand, forearm, foot, np.random.default_rng(0))
    left = set(np.unique(out[..., 0]).tolist())
    assert not left & missing and kept <= left and is_valid(out)


def test_hands_are_lost_as_often_as_asked(clean: np.ndarray) -> None:
    rng = np.random.default_rng(0)
    lost = [HAND_LEFT not in lose_parts(clean, 0.3, 0, 0, rng)[..., 0] for _ in range(200)]
    assert 0.2 < np.mean(lost) < 0.4


def test_sides_are_swapped_with_their_charts() -> None:
    iuv = np.array([[[3, 10, 20], [13, 10, 20], [15, 10, 20], [24, 10, 20], [2, 10, 20]]], np.uint8)
    seen: set[tuple[int, ...]] = set()
    for seed in range(60):
        out = swap_sides(iuv, 1, np.random.default_rng(seed))[0]
        seen |= {tuple(value) for value in out.tolist()}
    wanted = {(4, 245, 20), (14, 10, 20), (16, 10, 20), (23, 245, 20), (2, 10, 20)}
    unchanged = {tuple(value) for value in iuv[0].tolist()}
    assert seen == wanted | unchanged


def test_faces_are_swapped_in_patches_with_their_charts() -> None:
    iuv = np.zeros((40, 40, 3), np.uint8)
    iuv[:20], iuv[20:] = (9, 10, 20), (1, 10, 20)
    seen: set[tuple[int, ...]] = set()
    for seed in range(20):
        out = swap_faces(iuv, 1, np.random.default_rng(seed))
        seen |= {tuple(value) for value in out.reshape(-1, 3).tolist()}
    assert seen == {(9, 10, 20), (1, 10, 20), (7, 245, 235), (2, 10, 20)}


def test_swaps_of_probability_zero_change_nothing(clean: np.ndarray) -> None:
    for swap in (swap_sides, swap_faces):
        np.testing.assert_array_equal(swap(clean, 0.0, np.random.default_rng(0)), clean)


@pytest.mark.parametrize("shape", [(0, 0, 3), (1, 1, 3), (2, 300, 3), (64, 64, 3)])
def test_pictures_of_any_size_and_without_anybody(shape: tuple[int, ...]) -> None:
    empty = np.zeros(shape, np.uint8)
    np.testing.assert_array_equal(add_iuv_noise(empty, DENSEPOSE, np.random.default_rng(0)), empty)
    full = np.full(shape, 5, np.uint8)
    for seed in range(5):
        out = add_iuv_noise(full, replace(DENSEPOSE, foot_loss=0.5), np.random.default_rng(seed))
        assert out.shape == shape and (out.size == 0 or is_valid(out))


def test_what_is_no_iuv_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="H x W x 3"):
        add_iuv_noise(np.zeros((4, 4), np.uint8), DENSEPOSE, rng)
    with pytest.raises(ValueError, match="uint8"):
        add_iuv_noise(np.zeros((4, 4, 3), np.float32), DENSEPOSE, rng)
    with pytest.raises(ValueError, match="part 25"):
        add_iuv_noise(np.full((4, 4, 3), 25, np.uint8), DENSEPOSE, rng)


def test_differences_are_what_they_say() -> None:
    first, second = np.zeros((2, 1, 4, 3), np.uint8)
    first[0, :3] = (1, 0, 0)
    second[0, 1:] = [(1, 51, 0), (2, 0, 0), (1, 0, 0)]
    found = iuv_difference(first, second)
    assert (found.iou, found.part_agreement) == (0.5, 0.5)
    assert found.median_uv_error == pytest.approx(0.2)
    assert iuv_difference(first, first) == IuvDifference(1.0, 1.0, 0.0)
    nobody = iuv_difference(first * 0, first * 0)
    assert nobody.iou == 1 and np.isnan(nobody.part_agreement) and np.isnan(nobody.median_uv_error)
    with pytest.raises(ValueError, match="shape"):
        iuv_difference(first, second[:, :2])
