"""What painters share: linear light, and noise that varies slowly."""

from __future__ import annotations

import numpy as np
import pytest

from motion_transfer.people.picture.paint import smooth_noise, to_linear


def test_srgb_is_decoded_as_the_standard_says() -> None:
    light = to_linear([0.0, 0.04045, 0.5, 1.0])
    assert light.dtype == np.float32
    np.testing.assert_allclose(light, [0, 0.0031308, 0.21404, 1], atol=1e-5)


@pytest.mark.parametrize("wave", [3.0, 15.0, 60.0])
def test_smooth_noise_has_unit_spread_and_is_smooth(wave: float) -> None:
    fields = np.stack([smooth_noise((96, 160), wave, np.random.default_rng(s)) for s in range(60)])
    assert fields.shape == (60, 96, 160)
    assert abs(fields.mean()) < 0.15 and fields.std() == pytest.approx(1, abs=0.2)
    assert np.abs(np.diff(fields, axis=2)).mean() < 2 / wave
