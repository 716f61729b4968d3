"""SphereFace-20, the network that says whether two faces are the same person's.

Source: SphereFace (Liu et al., CVPR 2017). Names and layers are those of the PyTorch version by
clcarwin (github.com/clcarwin/sphereface_pytorch), whose published weights it reads.
"""

from __future__ import annotations

from pathlib import Path

from torch import Tensor, nn

from motion_transfer.training.pretrained import FrozenNetwork, load_weights

CROP_HEIGHT, CROP_WIDTH = 112, 96
EMBEDDING = 512

STAGES = ((64, 1), (128, 2), (256, 4), (512, 1))
"""Channels and residual pairs of the four stages; each begins with a halving."""

WHAT = "SphereFace's weights"
REMEDY = (
    "give --sphereface FILE (sphere20a_20171020.pth, unpacked, of"
    " github.com/clcarwin/sphereface_pytorch) or leave the face loss out with --no-identity"
)


class SphereFace20(FrozenNetwork):
    """Twenty convolutions with PReLU, no norm: a face crop becomes an embedding."""

    def __init__(self) -> None:
        super().__init__()
        inputs = 3
        for stage, (channels, pairs) in enumerate(STAGES, start=1):
            for layer in range(1, 2 * pairs + 2):
                first = layer == 1
                convolution = nn.Conv2d(
                    inputs if first else channels, channels, 3, stride=2 if first else 1, padding=1
                )
                self.add_module(f"conv{stage}_{layer}", convolution)
                self.add_module(f"relu{stage}_{layer}", nn.PReLU(channels))
            inputs = channels
        self.fc5 = nn.Linear(inputs * (CROP_HEIGHT // 16) * (CROP_WIDTH // 16), EMBEDDING)
        self.freeze()

    def forward(self, face: Tensor) -> Tensor:
        """The embedding, B x 512, of a face crop, B x 3 x 112 x 96, RGB in [-1, 1].

        It was trained on crops in which the eyes lie at about (30, 52) and (66, 52) px and the
        mouth at y = 92, as BGR and (value in 0..255 - 127.5) / 128.
        """
        x = face.flip(1) * (127.5 / 128)
        for stage, (_, pairs) in enumerate(STAGES, start=1):
            x = self._layer(x, stage, 1)
            for pair in range(1, pairs + 1):
                x = x + self._layer(self._layer(x, stage, 2 * pair), stage, 2 * pair + 1)
        return self.fc5(x.flatten(1))

    def _layer(self, x: Tensor, stage: int, layer: int) -> Tensor:
        convolved = self.get_submodule(f"conv{stage}_{layer}")(x)
        return self.get_submodule(f"relu{stage}_{layer}")(convolved)


def load_sphereface(path: Path) -> SphereFace20:
    """SphereFace-20 from a file, `.safetensors` or as torch saves it; its classifier is ignored.

    Raises: WeightsError if the file is missing, unreadable, or of another network.
    """
    network = SphereFace20()
    load_weights(
        network,
        path,
        what=WHAT,
        remedy=REMEDY,
        rename=lambda name: None if name == "fc6.weight" else name,
    )
    network.freeze()
    return network
