"""Samples: cut as the renderer cuts, and decided by their number alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from motion_transfer.drawing.engines.torch_engine import cut_pictures
from motion_transfer.drawing.person import find_people
from motion_transfer.drawing.source import SourcePicture, unfold_source
from motion_transfer.drawing.window import Window, cut_picture, plan_window
from motion_transfer.errors import InputError
from motion_transfer.training.config import build_config
from motion_transfer.training.pairs import open_pairs
from motion_transfer.training.samples import (
    TrainingSamples,
    number_batches,
    person_window,
)
from nhrr_core import ModelConfig


def open_samples(
    path: Path, *, textures: Path | None = None, half_size_samples: int = 0, **changes: Any
) -> TrainingSamples:
    """Samples of a run on a list of pairs; other changes are settings by their key."""
    settings = {
        "data.source": str(path),
        "data.background": "#00ff00",
        "data.jitter": 0.3,
        "model.image_size": 64,
        "model.texture_size": 64,
        "model.alpha": True,
        "model.clearance": False,
    }
    known = {name.partition(".")[2]: name for name in (*settings, "model.variant", "run.seed")}
    settings |= {known[key]: value for key, value in changes.items()}
    return TrainingSamples(
        open_pairs(path),
        build_config(settings),
        textures=textures,
        half_size_samples=half_size_samples,
    )


def same(one: dict, other: dict) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


def test_shapes_and_ranges(paint_pairs) -> None:
    sample = open_samples(paint_pairs())[0]
    shapes = {name: (tuple(value.shape), value.dtype) for name, value in sample.items()}
    picture, plane = ((3, 64, 64), torch.float32), ((1, 64, 64), torch.float32)
    assert shapes == {
        "target_image": picture,
        "target_iuv": ((3, 64, 64), torch.uint8),
        "target_alpha": plane,
        "target_background": ((3,), torch.float32),
        "source_texture": picture,
        "source_visibility": plane,
        "target_texture": picture,
        "target_visibility": plane,
    }
    assert set(sample["source_visibility"].unique().tolist()) == {0, 1}
    assert not sample["source_texture"][:, sample["source_visibility"][0] == 0].any()
    for name in ("target_image", "target_alpha", "source_texture"):
        assert -1 <= sample[name].min() < sample[name].max() <= 1


def test_the_background_is_replaced_where_alpha_is_known(paint_pairs) -> None:
    sample = open_samples(paint_pairs(1))[0]
    outside = sample["target_alpha"][0] == -1
    inside = (sample["target_iuv"][0] > 0) & (sample["target_alpha"][0] == 1)
    green = torch.tensor([-1.0, 1.0, -1.0])
    assert torch.equal(sample["target_background"], green)
    assert outside.float().mean() > 0.3
    assert torch.equal(sample["target_image"][:, outside], green[:, None].expand(3, outside.sum()))
    assert not (sample["target_image"][:, inside] == green[:, None]).all(0).any()


def test_a_photo_without_alpha_is_refused_by_a_model_with(paint_pairs) -> None:
    samples = open_samples(paint_pairs(1, alpha=False))
    with pytest.raises(InputError, match=r"0_1\.png has no alpha"):
        samples[0]
    plain = open_samples(paint_pairs(1, alpha=False), alpha=False)[0]
    assert not {"target_alpha", "target_background"} & set(plain)
    left = open_samples(paint_pairs(1), background="photo")[0]
    assert "target_alpha" in left
    assert "target_background" not in left


def test_the_first_samples_have_half_the_sides(paint_pairs, tmp_path) -> None:
    path = paint_pairs()
    samples = open_samples(path, half_size_samples=2, textures=tmp_path)
    sides = [
        {value.shape[-1] for value in samples[number].values() if value.ndim == 3}
        for number in range(4)
    ]
    assert sides == [{32}, {32}, {64}, {64}]
    assert same(samples[2], open_samples(path)[2])
    assert same(samples[0], open_samples(path, half_size_samples=2)[0]), "kept or not"
    whole, half = (open_samples(path, jitter=0, half_size_samples=count)[0] for count in (0, 1))
    shrunk = torch.nn.functional.avg_pool2d(whole["target_image"], 2)
    assert (half["target_image"] - shrunk).abs().mean() < 0.02, "the same crop"


@pytest.mark.parametrize("half", [0, 1])
def test_the_photo_is_cut_as_rendering_cuts_it(paint_pairs, half: int) -> None:
    path = paint_pairs(1)
    sample = open_samples(path, variant="cbi", half_size_samples=half)[0]
    side = 64 // (1 + half)
    assert sample["source_pictures"].shape == (1, 6, side, side)
    source = open_pairs(path)[0].source.load()
    picture = SourcePicture(source.as_photo(), source.iuv)
    config = ModelConfig(variant="cbi", image_size=side, texture_size=64)
    cut = cut_pictures(unfold_source([picture], 64), config)
    assert cut is not None
    assert torch.equal(sample["source_pictures"], torch.from_numpy(cut))
    assert "source_pictures" not in open_samples(path)[0]


def test_a_texture_is_halved_over_the_texels_seen(paint_pairs) -> None:
    path = paint_pairs(1)
    whole, half = (open_samples(path, half_size_samples=count)[0] for count in (0, 1))
    colours, seen = whole["source_texture"], whole["source_visibility"][0] > 0
    assert 0 < seen.float().mean() < 1
    for row, column in torch.cartesian_prod(torch.arange(32), torch.arange(32)).tolist():
        place = (slice(2 * row, 2 * row + 2), slice(2 * column, 2 * column + 2))
        found = half["source_texture"][:, row, column]
        assert half["source_visibility"][0, row, column] == seen[place].any()
        texels = colours[:, *place][:, seen[place]]
        expected = texels.mean(1) if texels.numel() else torch.zeros(3)
        assert torch.allclose(found, expected, atol=1e-6)


def test_the_clearance_is_now_and_then_unknown(paint_pairs) -> None:
    """Learning, so that photos of which it is not known can be drawn; judging, never."""
    samples = open_samples(paint_pairs(1), clearance=True)
    assert "source_clearance" not in open_samples(paint_pairs(1))[0]
    known = [bool(samples[number]["source_clearance"][1].any()) for number in range(60)]
    assert 0.6 < sum(known) / 60 < 0.98
    pair = open_pairs(paint_pairs(1))[0]
    assert all(samples.load(pair)["source_clearance"][1].any() for _ in range(9))
    assert samples.load(pair)["source_clearance"].shape == (2, 128, 128)


def test_the_number_decides(paint_pairs) -> None:
    path = paint_pairs(3)
    first, again = open_samples(path), open_samples(path)
    backwards = {number: again[number] for number in reversed(range(7))}
    assert all(same(first[number], backwards[number]) for number in range(7))
    assert not same(first[0], open_samples(path, seed=1)[0])


def test_an_epoch_shows_each_pair_once(paint_pairs) -> None:
    samples = open_samples(paint_pairs(5), jitter=0.0)
    orders = []
    for epoch in range(3):
        seen = [
            samples[number]["source_texture"].numpy().tobytes()
            for number in range(5 * epoch, 5 * epoch + 5)
        ]
        assert len(set(seen)) == 5
        orders.append(seen)
    assert orders[0] != orders[1] or orders[1] != orders[2]


def test_kept_textures_change_nothing(paint_pairs, tmp_path: Path) -> None:
    path = paint_pairs(2)
    folder = tmp_path / "textures"
    folder.mkdir()
    fresh, kept = open_samples(path), open_samples(path, textures=folder)
    for _ in range(2):  # the second time they are read
        assert all(same(fresh[number], kept[number]) for number in range(3))
    assert sorted(item.name for item in folder.iterdir()) == [
        *("0_0_64.png", "0_1_64.png", "1_0_64.png", "1_1_64.png"),
    ]


def test_without_jitter_the_window_is_the_renderers(studio, paint_pairs) -> None:
    pairs = open_pairs(paint_pairs(1))
    target = pairs[0].target.load()
    people = find_people(target.iuv)
    assert person_window(target) == plan_window([person.box for person in people.persons])


def test_windows_of_about_the_image_size_are_not_scaled(paint_pairs) -> None:
    """As in rendering."""
    path = paint_pairs(1)
    target = open_pairs(path)[0].target.load()
    window = person_window(target)
    size = round(window.side / 1.1 / 8) * 8
    assert size < window.side
    plain = open_samples(path, image_size=size, jitter=0)[0]
    x, y = (place + (window.side - size) // 2 for place in (window.x, window.y))
    expected = Window(x, y, size).cut(target.iuv, size)
    assert (plain["target_iuv"].permute(1, 2, 0).numpy() == expected).all()
    jittered = open_samples(path, image_size=size, jitter=0.1)
    drawn = [jittered[number]["target_iuv"] for number in range(6)]
    assert len({int((iuv[0] > 0).sum()) for iuv in drawn}) == 1, "moved, not scaled"
    assert len({iuv.numpy().tobytes() for iuv in drawn}) > 3


def test_jitter_keeps_the_whole_person(paint_pairs) -> None:
    samples = open_samples(paint_pairs(1), jitter=0.5)
    parts = {frozenset(samples[number]["target_iuv"][0].unique().tolist()) for number in range(8)}
    assert len(parts) == 1  # nobody is cut off
    widths = {int((samples[n]["target_iuv"][0] > 0).any(0).sum()) for n in range(8)}
    assert len(widths) > 3


def test_beyond_the_photo(studio) -> None:
    photo = np.full((10, 20, 3), 7, np.uint8)
    cut = cut_picture(Window(x=-5, y=-5, side=10), photo, 10, (1, 2, 3))
    assert (cut[5:, 5:] == 7).all()
    assert (cut[:5] == (1, 2, 3)).all() and (cut[:, :5] == (1, 2, 3)).all()


def test_processes_share_the_numbers() -> None:
    def batches(steps: range, process: int, processes: int = 2) -> list[list[int]]:
        return list(
            number_batches(
                batch_size=3,
                accumulation=2,
                steps=steps,
                process=process,
                processes=processes,
            )
        )

    together = [number for p in (0, 1) for batch in batches(range(4), p) for number in batch]
    assert sorted(together) == list(range(4 * 2 * 2 * 3))
    assert batches(range(4), 1) == batches(range(2), 1) + batches(range(2, 4), 1)
    assert batches(range(1), 0, 1) == [[0, 1, 2], [3, 4, 5]]
