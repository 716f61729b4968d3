"""A pair as measures see it."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.evaluation.framing import PairPictures, TargetFrame


@pytest.fixture
def shown(studio) -> PairPictures:
    """Three results: the target itself, with noise, and darker."""
    iuv = studio.iuv()
    rgb = studio.dress(iuv)
    noisy = rgb + np.random.default_rng(0).normal(0, 20, rgb.shape)
    results = [rgb, np.clip(noisy, 0, 255).astype(np.uint8), rgb // 2]
    return PairPictures(rgb, iuv, TargetFrame(rgb, iuv, iuv[..., 0] > 0), results)
