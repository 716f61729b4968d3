"""Samples, their augmentation, and training that goes on where it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.networks import BodyFeatures
from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.interface import LANDMARK_NAMES, Landmarks
from motion_transfer.estimate.iuv.network import IuvNetworkConfig
from motion_transfer.training.iuv.augmentation import NOTHING, Augmentation, mask_box, training_pair
from motion_transfer.training.iuv.samples import (
    Sample,
    choose_cut,
    cut_landmarks,
    list_samples,
    read_sample,
    write_sample,
)
from motion_transfer.training.iuv.trainer import IuvTraining, TrainingSettings, score_samples
from motion_transfer.training.progress import Logged


def make_sample(seed: int, *, seen: bool = True) -> Sample:
    """A rectangle whose landmarks lie on a line down its middle."""
    rng = np.random.default_rng(seed)
    left, top = rng.integers(60, 100, 2)
    iuv = np.zeros((256, 256, 3), np.uint8)
    iuv[top : top + 130, left : left + 50] = 2, 60, 90
    alpha = (iuv[..., 0] > 0) * np.uint8(255)
    y = np.linspace(top, top + 130, 33)
    image = np.stack([np.full(33, left + 25), y, np.zeros(33)], 1).astype(np.float32)
    world = np.stack([np.zeros(33), np.linspace(-0.9, 0.9, 33), np.zeros(33)], 1)
    sure = np.ones(33, np.float32)
    exact = Landmarks(image, world.astype(np.float32), sure, sure)
    if not seen:
        return Sample(iuv, alpha, alpha * 0, exact, None, None)
    return Sample(iuv, alpha, alpha, exact, exact, seen_features(alpha))


def seen_features(alpha: np.ndarray) -> BodyFeatures:
    """Those of a network that looked at the whole photo: each channel is the mask."""
    fine, coarse = (cv2.resize(alpha, (n, n), interpolation=cv2.INTER_AREA) for n in (128, 64))
    maps = (
        np.repeat(np.float32(each > 127)[..., None], n, 2) for each, n in ((coarse, 48), (fine, 8))
    )
    return BodyFeatures(*maps, Region(128, 128, 256))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    for number in range(3):
        write_sample(folder / f"{number:06d}_0.npz", make_sample(number, seen=number != 1))
    return folder


def settings(**changes) -> TrainingSettings:
    network = IuvNetworkConfig(widths=(8, 8, 8, 8), code=8)
    return TrainingSettings(
        **{"steps": 4, "batch_size": 2, "save_every": 2, "network": network} | changes
    )


def test_samples_go_to_disk_and_back(data: Path) -> None:
    assert [path.name for path in list_samples(data)] == [f"00000{n}_0.npz" for n in range(3)]
    first, second = (read_sample(path) for path in list_samples(data)[:2])
    assert np.array_equal(first.iuv, make_sample(0).iuv)
    assert first.seen is not None
    assert np.array_equal(first.seen.image, make_sample(0).exact.image)
    assert second.seen is None and second.features is None
    assert first.features is not None and first.features.region == Region(128, 128, 256)
    assert np.array_equal(first.features.fine, seen_features(first.alpha).fine)
    (data / "000002_0.npz").write_bytes(b"half")
    with pytest.raises(InputError, match="is damaged"):
        read_sample(data / "000002_0.npz")
    with pytest.raises(InputError, match="holds no samples"):
        list_samples(data.parent)


def test_without_augmentation_the_pair_is_the_sample() -> None:
    sample = make_sample(5)
    pair = training_pair(sample, NOTHING, np.random.default_rng(0))
    assert pair is not None
    body, answer = pair
    assert training_pair(make_sample(5, seen=False), NOTHING, np.random.default_rng(0)) is None
    box = mask_box(body.mask[0, 0].numpy())
    assert box is not None
    points = body.points[0, :, :2].numpy() * 256
    assert points[0] == pytest.approx([(box.left + box.right) / 2, box.top], abs=2)
    assert points[-1] == pytest.approx([(box.left + box.right) / 2, box.bottom], abs=2)
    painted = mask_box((answer[..., 0] > 0).astype(np.float32))
    assert painted is not None
    assert np.array(
        [painted.left, painted.top, painted.right, painted.bottom]
    ) * 2 == pytest.approx([box.left, box.top, box.right, box.bottom], abs=2)


@pytest.mark.parametrize("seed", range(6))
def test_views_move_mask_points_and_answer_together(seed: int) -> None:
    only_view = replace(NOTHING, turn_degrees=25, zoom=0.3, shift=0.1)
    pair = training_pair(make_sample(seed), only_view, np.random.default_rng(seed))
    assert pair is not None
    body, answer = pair
    solid = body.mask[0, 0].numpy()[::2, ::2] > 0.5
    painted = answer[..., 0] > 0
    assert (solid & painted).sum() / (solid | painted).sum() > 0.95
    for features in (
        body.coarse[0, ..., 5].repeat_interleave(2, 0).repeat_interleave(2, 1),
        body.fine[0, ..., 5],
    ):
        known = features.numpy() > 0.5
        assert (known & painted).sum() / (known | painted).sum() > 0.93
    columns, rows = (body.points[0, 3:-3, :2].numpy().T * 128).astype(int)
    assert painted[rows.clip(0, 127), columns.clip(0, 127)].mean() > 0.95


def test_some_samples_come_without_features() -> None:
    for share, expected in ((0, True), (1, False)):
        pair = training_pair(
            make_sample(0), replace(NOTHING, blind=share), np.random.default_rng(0)
        )
        assert pair is not None and bool(pair[0].coarse.any()) is expected


def test_a_cut_photo_ends_in_the_body() -> None:
    sample = make_sample(0)
    top, bottom = sample.exact.image[[0, -1], 1]
    shares = []
    for seed in range(12):
        kept = choose_cut(sample.alpha, np.random.default_rng(seed))
        shares.append((sample.alpha[kept.slices] > 0).sum() / (sample.alpha > 0).sum())
        cut = cut_landmarks(sample.exact, kept)
        inside = (sample.exact.image[:, 1] > kept.top) & (sample.exact.image[:, 1] < kept.bottom)
        assert np.array_equal(cut.presence > 0, inside)
        assert np.allclose(cut.image[:, 1] + kept.top, np.linspace(top, bottom, 33))
    assert min(shares) > 0.35 and max(shares) < 0.97


def test_the_same_generator_gives_the_same_pair() -> None:
    pairs = [training_pair(make_sample(1), Augmentation(), np.random.default_rng(3)) for _ in "ab"]
    assert pairs[0] is not None and pairs[1] is not None
    assert torch.equal(pairs[0][0].points, pairs[1][0].points)
    assert np.array_equal(pairs[0][1], pairs[1][1])


def test_training_goes_on_to_the_same_weights(data: Path, tmp_path: Path) -> None:
    whole = IuvTraining(data, tmp_path / "whole", settings())
    assert not whole.train()
    halves = IuvTraining(data, tmp_path / "halves", settings())
    assert halves.train(should_stop=lambda: halves.step == 3)
    assert halves.step == 3, "between two states that are kept anyway"
    resumed = IuvTraining(data, tmp_path / "halves", settings())
    assert resumed.step == 3
    told: list[object] = []
    assert not resumed.train(told.append)
    assert [type(event) for event in told] == [Logged]
    for name, value in whole.averaged.state_dict().items():
        assert torch.equal(value, resumed.averaged.state_dict()[name]), name


def test_training_learns_and_the_scores_tell(data: Path, tmp_path: Path) -> None:
    run = IuvTraining(
        data, tmp_path / "run", settings(steps=60, learning_rate=1e-2, warm_up_steps=5)
    )
    first = run._learn(run.batch(0))["total"]
    run.train()
    assert run._learn(run.batch(60))["total"] < 0.6 * first
    scores = list(score_samples(run.files, run.averaged.eval()))
    assert len(scores) == 2  # nobody was seen in one
    assert np.mean([score.iou for score in scores]) > 0.5


def test_a_damaged_state_is_told(data: Path, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run/state.pt").write_bytes(b"half")
    with pytest.raises(InputError, match=r"state\.pt is damaged"):
        IuvTraining(data, tmp_path / "run", settings())


def test_a_mask_of_nobody_has_no_box() -> None:
    assert mask_box(np.zeros((4, 4), np.float32)) is None
    mask = np.zeros((4, 6), np.float32)
    mask[1:3, 2] = 1
    assert mask_box(mask) == Box(2, 1, 3, 3)


def test_there_are_33_names() -> None:
    assert len(set(LANDMARK_NAMES)) == 33
    assert LANDMARK_NAMES[23] == "left-hip"
    assert LANDMARK_NAMES[10] == "mouth-right"
    assert LANDMARK_NAMES[32] == "right-foot-index"
