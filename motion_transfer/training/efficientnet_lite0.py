"""EfficientNet-Lite0: the architecture, without weights.

Source: EfficientNet (Tan and Le, ICML 2019); the Lite variant (TensorFlow, 2020) has ReLU6 for
swish and no squeeze-and-excitation.
"""

from __future__ import annotations

import math

import torch.nn.functional as F
from torch import Tensor, nn

EPSILON = 1e-3  # of TensorFlow's batch norm in this network
CLASSES = 1000
HEAD_WIDTH = 1280

STAGES = (
    # repeats, kernel, stride, expansion, inputs, outputs
    (1, 3, 1, 1, 32, 16),
    (2, 3, 2, 6, 16, 24),
    (2, 5, 2, 6, 24, 40),
    (3, 3, 2, 6, 40, 80),
    (3, 5, 1, 6, 80, 112),
    (4, 5, 2, 6, 112, 192),
    (1, 3, 1, 6, 192, 320),
)
FEATURE_BLOCKS = (0, 2, 4, 10, 15)
"""The last block before each halving, and the last of all: strides 2, 4, 8, 16, 32."""


class SamePadConv2d(nn.Conv2d):
    """A convolution padded as TensorFlow pads: by what the size needs, the odd pixel at the end."""

    def forward(self, input: Tensor) -> Tensor:
        pads: list[int] = []
        for axis in (1, 0):  # F.pad names the last axis first
            size, kernel, stride = input.shape[2 + axis], self.kernel_size[axis], self.stride[axis]
            missing = max((math.ceil(size / stride) - 1) * stride + kernel - size, 0)
            pads += [missing // 2, missing - missing // 2]
        return super().forward(F.pad(input, pads))


def _norm(channels: int) -> nn.BatchNorm2d:
    return nn.BatchNorm2d(channels, eps=EPSILON)


class InvertedResidual(nn.Module):
    """1x1 to more channels, depthwise k x k, 1x1 to few; added to its input where shapes allow."""

    def __init__(
        self, *, kernel: int, stride: int, expansion: int, inputs: int, outputs: int
    ) -> None:
        super().__init__()
        wide = inputs * expansion
        self.adds = stride == 1 and inputs == outputs
        self.expands = expansion > 1
        if self.expands:
            self.expand_conv = SamePadConv2d(inputs, wide, 1, bias=False)
            self.bn0 = _norm(wide)
        self.depthwise_conv = SamePadConv2d(
            wide, wide, kernel, stride=stride, groups=wide, bias=False
        )
        self.bn1 = _norm(wide)
        self.project_conv = SamePadConv2d(wide, outputs, 1, bias=False)
        self.bn2 = _norm(outputs)

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu6(self.bn0(self.expand_conv(x))) if self.expands else x
        y = F.relu6(self.bn1(self.depthwise_conv(y)))
        y = self.bn2(self.project_conv(y))
        return x + y if self.adds else y


class EfficientNetLite0(nn.Module):
    """4.65 M parameters. Input: B x 3 x H x W, RGB, (value in 0..255 - 127) / 128."""

    def __init__(self) -> None:
        super().__init__()
        self.conv_stem = SamePadConv2d(3, STAGES[0][4], 3, stride=2, bias=False)
        self.bn0 = _norm(STAGES[0][4])
        self.blocks = nn.ModuleList()
        for repeats, kernel, stride, expansion, inputs, outputs in STAGES:
            for i in range(repeats):
                self.blocks.append(
                    InvertedResidual(
                        kernel=kernel,
                        stride=1 if i else stride,
                        expansion=expansion,
                        inputs=outputs if i else inputs,
                        outputs=outputs,
                    )
                )
        self.conv_head = SamePadConv2d(STAGES[-1][-1], HEAD_WIDTH, 1, bias=False)
        self.bn1 = _norm(HEAD_WIDTH)
        self.fc = nn.Linear(HEAD_WIDTH, CLASSES)

    def features(self, x: Tensor) -> list[Tensor]:
        """Outputs of FEATURE_BLOCKS: 16, 24, 40, 112 and 320 channels, signed."""
        x = F.relu6(self.bn0(self.conv_stem(x)))
        kept = []
        for index, block in enumerate(self.blocks):
            x = block(x)
            if index in FEATURE_BLOCKS:
                kept.append(x)
        return kept

    def forward(self, x: Tensor) -> Tensor:
        """Logits of ImageNet's 1000 classes, B x 1000."""
        x = F.relu6(self.bn1(self.conv_head(self.features(x)[-1])))
        return self.fc(x.mean((2, 3)))
