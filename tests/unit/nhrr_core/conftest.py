"""Inputs that the tests of `nhrr_core` share."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import jaxtyping
import pytest
import torch
from torch import Tensor

from nhrr_core import load_uv_layout

Ramp = Callable[..., Tensor]


@pytest.fixture(autouse=True)
def seed() -> None:
    torch.manual_seed(0)


@pytest.fixture
def unchecked() -> Iterator[None]:
    """Annotations unchecked, so that a wrong shape reaches the package's own refusal."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


@pytest.fixture
def charts() -> Tensor:
    """The real lookup table."""
    return load_uv_layout().charts


@pytest.fixture
def plain_charts() -> Tensor:
    """All 24 charts cover the whole texture: U runs along x, V along y.

    Entry (U, V) lies in the centre of texel (U, V) of a 256 x 256 texture.
    """
    line = (torch.arange(256) + 0.5) / 256
    chart = torch.stack(torch.meshgrid(line, line, indexing="xy"), dim=-1)
    return chart.expand(24, 256, 256, 2).contiguous()


@pytest.fixture
def ramp() -> Ramp:
    """IUV of one part whose U runs along x and V along y, background around it if `border`."""

    def make(
        part: int,
        height: int,
        width: int | None = None,
        *,
        low: int = 60,
        high: int = 190,
        border: int = 0,
    ) -> Tensor:
        width = width or height
        iuv = torch.zeros(1, 3, height + 2 * border, width + 2 * border, dtype=torch.uint8)
        inside = iuv[0, :, border : border + height, border : border + width]
        inside[0] = part
        inside[1] = torch.linspace(low, high, width).round().to(torch.uint8)
        inside[2] = torch.linspace(low, high, height).round().to(torch.uint8)[:, None]
        return iuv

    return make
