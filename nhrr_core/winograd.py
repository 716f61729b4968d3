"""Winograd's algorithm for 3x3 convolutions of stride 1, as tensor operations around one bmm.

F(4x4, 3x3) computes 4x4 outputs from 6x6 inputs with 36 multiplications a channel pair instead of
144. Everything but the multiplications is additions and scalings, which stay in float32; only the
two factors of the product are rounded, so that it can run in bfloat16.

Source: Lavin and Gray, "Fast Algorithms for Convolutional Neural Networks", CVPR 2016. Departs from
it: the interpolation points are 0, +-2/3, +-3/2 and infinity; against the usual 0, +-1, +-2 they
more than halve the error that rounding to bfloat16 leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import reduce

import torch
from jaxtyping import Float
from torch import Tensor

TILE = 4  # outputs along a side
SPAN = TILE + 2  # inputs along a side, and points

_POINTS = (Fraction(0), Fraction(2, 3), Fraction(-2, 3), Fraction(3, 2), Fraction(-3, 2))
Matrix = list[list[Fraction]]


def cook_toom() -> tuple[Matrix, Matrix, Matrix]:
    """Compute exact (A, G, B) with conv(x, w) = A [(G w) * (B x)] for a filter w of 3 taps.

    Returns: A of TILE x SPAN, G of SPAN x 3, B of SPAN x SPAN.
    """
    output = [[p**i for p in _POINTS] + [Fraction(i == TILE - 1)] for i in range(TILE)]
    weight: Matrix = []
    signal: Matrix = []
    for p in _POINTS:
        others = [q for q in _POINTS if q != p]
        scale = reduce(lambda product, q: product * (p - q), others, Fraction(1))
        weight.append([p**k / scale for k in range(3)])
        signal.append([*_polynomial(others), Fraction(0)])
    # the point at infinity: the filter's last tap
    weight.append([Fraction(0), Fraction(0), Fraction(1)])
    signal.append(_polynomial(_POINTS))
    return output, weight, signal


def _polynomial(roots: Sequence[Fraction]) -> list[Fraction]:
    """Coefficients, lowest power first, of the product of (x - root)."""
    coefficients = [Fraction(1)]
    for root in roots:
        shifted = [Fraction(0), *coefficients]
        coefficients = [
            s - root * c for s, c in zip(shifted, [*coefficients, Fraction(0)], strict=True)
        ]
    return coefficients


_OUTPUT, _WEIGHT, _SIGNAL = cook_toom()


def transform_weight(
    weight: Float[Tensor, "O I 3 3"], dtype: torch.dtype
) -> Float[Tensor, "P I O"]:
    """Transform a filter to P = SPAN * SPAN matrices; computed in float64, rounded once."""
    g = torch.tensor([[float(x) for x in row] for row in _WEIGHT], dtype=torch.float64)
    transformed = torch.einsum("xi,yj,ocij->xyco", g, g, weight.detach().double().cpu())
    return transformed.flatten(0, 1).to(weight.device, dtype).contiguous()


def winograd_convolution(
    padded: Float[Tensor, "B Hp Wp I"], weight: Float[Tensor, "P I O"]
) -> Float[Tensor, "B H W O"]:
    """Convolve an input padded by 1 with a 3x3 filter, channels last, float32.

    Args:
        padded: H + 2 by W + 2, H and W multiples of TILE.
        weight: What `transform_weight` makes of the filter; the product runs in its type.
    """
    batch, height, width = padded.shape[0], padded.shape[1] - 2, padded.shape[2] - 2
    products = torch.bmm(_transform_signal(padded, weight.dtype), weight).float()
    grid = products.view(SPAN, SPAN, batch, height // TILE, width // TILE, weight.shape[2])
    rows = torch.stack([_combine(c, grid.unbind(0)) for c in _OUTPUT], 3)
    tiles = torch.stack([_combine(c, rows.unbind(0)) for c in _OUTPUT], 4)
    return tiles.reshape(batch, height, width, weight.shape[2])


def _transform_signal(
    padded: Float[Tensor, "B Hp Wp I"], dtype: torch.dtype
) -> Float[Tensor, "P N I"]:
    """Every tile's SPAN x SPAN inputs, transformed: one matrix of tiles by channels a point."""
    bottom, right = padded.shape[1] - TILE - 1, padded.shape[2] - TILE - 1
    rows = [padded[:, i : i + bottom : TILE] for i in range(SPAN)]
    half = torch.stack([_combine(c, rows) for c in _SIGNAL])
    columns = [half[:, :, :, j : j + right : TILE] for j in range(SPAN)]
    full = torch.stack([_combine(c, columns).to(dtype) for c in _SIGNAL], 1)
    return full.reshape(SPAN * SPAN, -1, padded.shape[3])


def _combine(coefficients: Sequence[Fraction], terms: Sequence[Tensor]) -> Tensor:
    """Sum of coefficient * term, unrolled and without the zeros, so that it compiles to FMAs."""
    parts = [t * float(c) if c != 1 else t for c, t in zip(coefficients, terms, strict=True) if c]
    return reduce(torch.add, parts)
