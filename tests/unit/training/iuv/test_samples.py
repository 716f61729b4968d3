"""Samples for the network that paints IUV: what BlazePose sees of synthetic people."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("anny")

from motion_transfer.training.iuv.samples import (
    SampleOptions,
    list_samples,
    make_samples,
    read_sample,
)


def test_blazepose_sees_them_there(models, tmp_path: Path) -> None:
    options = SampleOptions(out=tmp_path / "data", people=3, views=2, split="held-out", workers=1)
    assert make_samples(options) == 3
    away = []
    for file in list_samples(options.out):
        sample = read_sample(file)
        assert sample.iuv.shape == (256, 256, 3)
        if sample.seen is not None:
            tall = np.ptp(sample.exact.image[:, 1])
            shown = sample.exact.visibility > 0.5
            moves = (sample.seen.image - sample.exact.image)[shown, :2]
            away.append(np.median(np.linalg.norm(moves, axis=1)) / tall)
            person = sample.alpha > 127
            assert ((sample.mask > 127) & person).sum() / person.sum() > 0.8
    assert len(away) >= 4
    assert np.median(away) < 0.02
    before = sorted(path.read_bytes() for path in list_samples(options.out))
    assert make_samples(options) == 0
    assert sorted(path.read_bytes() for path in list_samples(options.out)) == before
