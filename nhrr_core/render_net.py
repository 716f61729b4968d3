"""RenderNet g: a feature image becomes a frame, I = g(R)."""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from nhrr_core.config import RenderSizes

Projection = Callable[[Float[Tensor, "I O 3 3"]], Float[Tensor, "I O 3 3"]]

LAST_LAYERS = 3
"""How many there are after the norms: padding, 7x7 and tanh."""


class ResidualBlock(nn.Module):
    """The input plus 3x3, norm, ReLU, 3x3, norm of it; reflected at the border."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
            nn.ReLU(inplace=True),
            nn.ReflectionPad2d(1),
            nn.Conv2d(channels, channels, 3),
            nn.InstanceNorm2d(channels),
        )

    def forward(self, x: Float[Tensor, "B C H W"]) -> Float[Tensor, "B C H W"]:
        return x + self.body(x)


class UpConvolution(nn.ConvTranspose2d):
    """A 3x3 transposed convolution of stride 2, as four convolutions, one for each output parity.

    A pixel of an even row and column sees the kernel's centre alone, others see two or four taps.
    Where those four sets of taps have different sums, it draws a checkerboard over whatever is
    flat; where the taps of a set differ, a line at a step of its input, on pixels of one parity
    only. Among the kernels that cannot, those of bilinear and of nearest up-sampling.

    Args:
        project: What takes those freedoms away: the weights are replaced by the nearest ones that
            may be, which costs nothing once they are fixed. `even_kernel`, or `bilinear_kernel`.
    """

    def __init__(self, inputs: int, outputs: int, *, project: Projection | None) -> None:
        super().__init__(inputs, outputs, 3, stride=2, padding=1, output_padding=1)
        self._project = project

    @property
    def kernel(self) -> Float[Tensor, "I O 3 3"]:
        """The weights that are convolved with."""
        return self._project(self.weight) if self._project else self.weight

    def forward(self, x: Float[Tensor, "B I H W"]) -> Float[Tensor, "B O 2*H 2*W"]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Convolve to twice the height and width."""
        return F.conv_transpose2d(x, self.kernel, self.bias, 2, 1, 1)


def even_kernel(weight: Float[Tensor, "I O 3 3"]) -> Float[Tensor, "I O 3 3"]:
    """Project kernels onto those whose taps have the same sum at each of the four output parities.

    The orthogonal projection: with S_p the sum of the n_p taps of parity p, each of these changes
    by (m - S_p) / n_p, where m is the mean of all S_p weighted by 1 / n_p.

    Source of the condition: Sugawara, Shiota and Kiya, "Checkerboard-artifacts-free CNNs" (2019).
    """
    rows = torch.stack([weight[..., 1], weight[..., 0] + weight[..., 2]], -1)
    sums = torch.stack([rows[..., 1, :], rows[..., 0, :] + rows[..., 2, :]], -2)
    share = weight.new_tensor([[1.0, 0.5], [0.5, 0.25]])  # 1 / n_p
    mean = (sums * share).sum((-2, -1), keepdim=True) / share.sum()
    change = (mean - sums) * share
    # tap k of a row or column belongs to parity 1, 0, 1
    return weight + change[..., [1, 0, 1], :][..., [1, 0, 1]]


def bilinear_kernel(weight: Float[Tensor, "I O 3 3"]) -> Float[Tensor, "I O 3 3"]:
    """Project kernels onto multiples of bilinear up-sampling's: `even`, and with taps all alike."""
    line = weight.new_tensor([0.5, 1.0, 0.5])
    bilinear = torch.outer(line, line)
    share = (weight * bilinear).sum((-2, -1), keepdim=True) / bilinear.square().sum()
    return share * bilinear


class RenderNet(nn.Module):
    """Pix2PixHD's global generator: 7x7, down blocks, residual blocks, up blocks, 7x7, tanh.

    Args:
        sizes: `width` is the channels of the first convolution, which double at each down block;
            with `shortcut` the last convolution reads the network's input, too; with `even` the up
            blocks can draw no checkerboard, and with `bilinear` the last one no lines, either, see
            `UpConvolution`.
    Source: the paper, Sec. 3.4, Eq. 3; layer shapes from Pix2PixHD (Wang et al., CVPR 2018).
        Departs from it: `shortcut`, `even` and `bilinear`, off by default.
    """

    def __init__(self, sizes: RenderSizes) -> None:
        super().__init__()
        width = sizes.width
        self.shortcut = sizes.shortcut
        layers: list[nn.Module] = [nn.ReflectionPad2d(3), nn.Conv2d(sizes.inputs, width, 7)]
        layers += [nn.InstanceNorm2d(width), nn.ReLU(inplace=True)]
        for i in range(sizes.down_blocks):
            wide = width * 2 ** (i + 1)
            layers += [nn.Conv2d(wide // 2, wide, 3, stride=2, padding=1)]
            layers += [nn.InstanceNorm2d(wide), nn.ReLU(inplace=True)]
        widest = width * 2**sizes.down_blocks
        layers += [ResidualBlock(widest) for _ in range(sizes.residual_blocks)]
        for i in reversed(range(sizes.down_blocks)):
            narrow = width * 2**i
            project = even_kernel if sizes.even else None
            if sizes.bilinear and i == 0:
                project = bilinear_kernel
            layers += [UpConvolution(narrow * 2, narrow, project=project)]
            layers += [nn.InstanceNorm2d(narrow), nn.ReLU(inplace=True)]
        read = width + sizes.inputs * sizes.shortcut
        layers += [nn.ReflectionPad2d(3), nn.Conv2d(read, sizes.outputs, 7), nn.Tanh()]
        self.layers = nn.Sequential(*layers)

    def forward(self, features: Float[Tensor, "B C H W"]) -> Float[Tensor, "B K H W"]:
        """Draw a frame in [-1, 1]; H and W are multiples of 2**down_blocks."""
        if not self.shortcut:
            return self.layers(features)
        drawn = self.layers[:-LAST_LAYERS](features)
        return self.layers[-LAST_LAYERS:](torch.cat([drawn, features], dim=1))
