"""RenderNet for inference on a CPU: the same function in fewer and cheaper operations.

`RenderNet` is the specification; this is held to it within a tolerance. What differs:

1. The convolutions' factors are rounded to `dtype` (bfloat16 where the CPU multiplies it in
   hardware) and their sums kept in float32; norms, residual stream and transforms are float32.
2. The 3x3 convolutions of the residual blocks, 72 % of the arithmetic, run by Winograd's algorithm
   where multiplications are dear; with AMX they are not, and the plain form is faster.
3. The last 7x7 convolution, whose few outputs would leave most vector lanes idle, is written as an
   8x8 convolution of stride 2 that makes 2 x 2 pixels at once.
4. Biases before a norm are left out: the norm subtracts them again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from nhrr_core.render_net import RenderNet, ResidualBlock, UpConvolution
from nhrr_core.winograd import TILE, transform_weight, winograd_convolution

EPSILON = 1e-5  # of torch.nn.InstanceNorm2d


class FastRenderNet(nn.Module):
    """A RenderNet's twin for inference; its weights are copies, later changes have no effect.

    Compiled, it takes about half a minute at the first call with each batch size and image size;
    torch keeps the result on disk for later processes.

    Args:
        dtype: What the convolutions' factors are rounded to.
        winograd: Whether the residual blocks run by Winograd's algorithm; None: the CPU decides.
        compiled: Whether to use torch.compile; off, it is for tests and slower than `RenderNet`.
    Attributes:
        multiple: What the sides of an image must be multiples of.
    """

    def __init__(
        self,
        net: RenderNet,
        *,
        dtype: torch.dtype,
        winograd: bool | None = None,
        compiled: bool = True,
    ) -> None:
        super().__init__()
        if winograd is None:
            winograd = not torch.cpu._is_amx_tile_supported()
        plain = [layer for layer in net.layers if isinstance(layer, nn.Conv2d)]
        up = [layer for layer in net.layers if isinstance(layer, UpConvolution)]
        blocks = [layer.body for layer in net.layers if isinstance(layer, ResidualBlock)]
        inner = [layer for body in blocks for layer in body if isinstance(layer, nn.Conv2d)]
        self.shortcut = net.shortcut
        self.multiple = 2 ** len(up) * (TILE if winograd else 1)
        self.encoder: Callable[[Tensor], Tensor] = _Encoder(plain[:-1], dtype)
        self.trunk: Callable[[Tensor], Tensor] = _Trunk(inner, dtype, winograd)
        self.decoder: Callable[[Tensor, Tensor | None], Tensor] = _Decoder(up, plain[-1], dtype)
        if compiled:
            self._compile(winograd)

    def _compile(self, winograd: bool) -> None:
        # freezing lets oneDNN pack the weights once instead of at every call
        frozen: dict[str, Any] = {"freezing": True}
        self.encoder = torch.compile(self.encoder, dynamic=False, options=frozen)
        self.decoder = torch.compile(self.decoder, dynamic=False, options=frozen)
        if winograd and isinstance(self.trunk, _Trunk):
            # bmm needs no packing, so one compiled block serves all of them; a graph of twelve
            # unrolled Winograd convolutions would take minutes to compile
            self.trunk.block = torch.compile(_residual_block, dynamic=False)
        else:
            self.trunk = torch.compile(self.trunk, dynamic=False, options=frozen)

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B K H W"]:
        """Draw a frame in [-1, 1], float32; H and W are multiples of `multiple`."""
        # one sample's large activations fit the cache, a batch's do not: only the trunk, whose
        # matrix products want rows, sees the whole batch
        encoded = torch.cat([self.encoder(sample) for sample in features.split(1)])
        inputs = features.split(1) if self.shortcut else [None] * len(features)
        trunk = self.trunk(encoded).split(1)
        return torch.cat([self.decoder(x, y) for x, y in zip(trunk, inputs, strict=True)])


class _Encoder(nn.Module):
    """The first and the down-sampling convolutions: B x C x H x W to B x h x w x C'."""

    def __init__(self, convolutions: list[nn.Conv2d], dtype: torch.dtype) -> None:
        super().__init__()
        self.weights = _constants((layer.weight for layer in convolutions), dtype)

    def forward(self, x: Tensor) -> Tensor:
        first, *down = self.weights
        x = x.to(first.dtype, memory_format=torch.channels_last)
        x = F.conv2d(F.pad(x, (3, 3, 3, 3), mode="reflect"), first)
        for weight in down:
            x = F.conv2d(_norm_relu(x), weight, stride=2, padding=1)
        return _normalise(x.permute(0, 2, 3, 1).float()).relu()


class _Trunk(nn.Module):
    """The residual blocks, B x H x W x C, float32 throughout."""

    def __init__(self, convolutions: list[nn.Conv2d], dtype: torch.dtype, winograd: bool) -> None:
        super().__init__()
        weights = (layer.weight for layer in convolutions)
        self.weights = (
            _constants((transform_weight(w, dtype) for w in weights), dtype)
            if winograd
            else _constants(weights, dtype)
        )
        self.block: Callable[[Tensor, Tensor, Tensor], Tensor] = _residual_block

    def forward(self, x: Tensor) -> Tensor:
        weights = list(self.weights)
        for first, second in zip(weights[::2], weights[1::2], strict=True):
            x = self.block(x, first, second)
        return x


class _Decoder(nn.Module):
    """The up-sampling convolutions and the last one: B x h x w x C' to B x K x H x W.

    The last one also reads what the network did, where it is given.
    """

    def __init__(
        self, convolutions: list[UpConvolution], last: nn.Conv2d, dtype: torch.dtype
    ) -> None:
        super().__init__()
        # the four pixels of a 2 x 2 block see the 7x7 filter at four places of an 8x8 window
        places = [F.pad(last.weight, (x, 1 - x, y, 1 - y)) for y in (0, 1) for x in (0, 1)]
        block = torch.stack(places, 1).flatten(0, 1)
        self.weights = _constants([*(layer.kernel for layer in convolutions), block], dtype)
        bias = torch.zeros(len(last.weight)) if last.bias is None else last.bias
        self.bias = nn.Parameter(bias.detach().float().clone().view(-1, 1, 1), requires_grad=False)

    def forward(self, x: Tensor, features: Tensor | None) -> Tensor:
        *up, last = self.weights
        y = x.to(last.dtype).permute(0, 3, 1, 2)
        for weight in up:
            y = F.conv_transpose2d(y, weight, stride=2, padding=1, output_padding=1)
            y = _norm_relu(y)
        if features is not None:
            y = torch.cat([y, features.to(y.dtype)], dim=1)
        y = F.conv2d(F.pad(y, (3, 3, 3, 3), mode="reflect"), last, stride=2)
        return torch.tanh(F.pixel_shuffle(y.float(), 2) + self.bias)


def _residual_block(x: Tensor, first: Tensor, second: Tensor) -> Tensor:
    return x + _convolve_norm(_convolve_norm(x, first).relu(), second)


def _convolve_norm(x: Tensor, weight: Tensor) -> Tensor:
    """Reflection padding, 3x3 convolution and norm; Winograd's where the weight is transformed."""
    padded = F.pad(x.permute(0, 3, 1, 2), (1, 1, 1, 1), mode="reflect")
    if weight.ndim == 3:
        return _normalise(winograd_convolution(padded.permute(0, 2, 3, 1), weight))
    y = F.conv2d(padded.to(weight.dtype), weight)
    return _normalise(y.permute(0, 2, 3, 1).float())


def _norm_relu(x: Tensor) -> Tensor:
    """Norm and ReLU between convolutions, B x C x H x W in and out."""
    return _normalise(x.permute(0, 2, 3, 1).float()).relu().to(x.dtype).permute(0, 3, 1, 2)


def _normalise(x: Float[Tensor, "B H W C"]) -> Float[Tensor, "B H W C"]:
    """Instance norm from one pass over the data: the sum and the sum of squares."""
    # first along rows, then down: both cores read whole cache lines, each its own
    mean = x.mean(2, keepdim=True).mean(1, keepdim=True)
    variance = (x * x).mean(2, keepdim=True).mean(1, keepdim=True) - mean * mean
    return (x - mean) * torch.rsqrt(variance.clamp_min(0) + EPSILON)


def _constants(tensors: Iterable[Tensor], dtype: torch.dtype) -> nn.ParameterList:
    return nn.ParameterList(
        nn.Parameter(
            tensor.detach().to(
                dtype,
                memory_format=torch.channels_last if tensor.ndim == 4 else torch.contiguous_format,
                copy=True,
            ),
            requires_grad=False,
        )
        for tensor in tensors
    )
