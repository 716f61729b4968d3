"""dlib's face recognition network: whose face it is, as a point in 128 dimensions.

The weights are public domain (CC0; Davis King, 2017), in the form in which dlib writes networks.
Pictures of one person lie within about 0.6 of each other, those of two people further apart; on
the benchmark Labeled Faces in the Wild that decides 99.4 % of the pairs rightly.

Source: He et al., Deep Residual Learning (CVPR 2016) for the blocks; layers, paddings and the
numbers of the input are those of dlib's example `dnn_face_recognition_ex` and its layers.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float
from torch import Tensor, nn

from motion_transfer.errors import WeightsError
from motion_transfer.media.files import read_bytes
from motion_transfer.training.faces import CROP_CENTRE as SPHEREFACE_CENTRE
from motion_transfer.training.faces import CROP_HEIGHT as SPHEREFACE_HEIGHT
from motion_transfer.training.faces import METRES_PER_CROP_PIXEL as SPHEREFACE_METRES
from motion_transfer.training.faces import FaceIdentity
from motion_transfer.training.feature_networks import FrozenNetwork

CHIP_SIZE = 150
"""Side of a face crop, px."""

SAME_PERSON = 0.6
"""The distance below which its author calls two faces one person's."""

BLOCKS = (*[32] * 3, *[64] * 4, *[128] * 3, *[256] * 3, 256)
"""Channels of the residual blocks."""

HALVING = (3, 7, 10, 13)
"""The blocks that halve height and width."""

EMBEDDING = 128
MEAN_RGB = (122.782, 117.001, 104.298)  # of the pictures it was trained on

# In its chips the middles of the eyes lie at row 46.6 and the mouth's at row 105, by dlib's mean
# face; on the layout's head those are 0.425 m and 0.355 m above the middle of the body
CHIP_METRES_PER_PX = (0.425 - 0.355) / (105 - 46.6)
CHIP_CENTRE = 0.425 - (CHIP_SIZE / 2 - 46.6) * CHIP_METRES_PER_PX


class Block(nn.Module):
    """Two convolutions, added to the block's input; where it halves, to the mean of 2 x 2 pixels.

    Channels and rows that only one of the summands has are taken as they are, as dlib does.
    """

    def __init__(self, inputs: int, outputs: int, *, halves: bool) -> None:
        super().__init__()
        # dlib pads no convolution that has a stride
        stride, padding = (2, 0) if halves else (1, 1)
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, padding)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, padding=1)
        self.halves = halves

    def forward(self, x: Tensor) -> Tensor:
        y = self.conv2(F.relu(self.conv1(x)))
        if self.halves:
            x = F.avg_pool2d(x, 2)
        largest = [max(pair) for pair in zip(x.shape[1:], y.shape[1:], strict=True)]
        return F.relu(_extend(x, largest) + _extend(y, largest))


class DlibFace(FrozenNetwork):
    """ResNet of 29 convolutions: a face crop becomes an embedding."""

    mean: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(3, BLOCKS[0], 7, 2)
        inputs = (BLOCKS[0], *BLOCKS[:-1])
        self.blocks = nn.Sequential(
            *(
                Block(before, width, halves=index in HALVING)
                for index, (before, width) in enumerate(zip(inputs, BLOCKS, strict=True))
            )
        )
        self.embed = nn.Linear(BLOCKS[-1], EMBEDDING, bias=False)
        self.register_buffer("mean", torch.tensor(MEAN_RGB).view(3, 1, 1), persistent=False)
        self.freeze()

    def forward(self, face: Float[Tensor, "B 3 150 150"]) -> Float[Tensor, "B 128"]:
        """Embed upright face crops, RGB in [-1, 1], framed as `frame_chips` does."""
        x = ((face + 1) * 127.5 - self.mean) / 256
        x = F.max_pool2d(F.relu(self.conv(x)), 3, 2)
        return self.embed(self.blocks(x).mean((2, 3)))


def frame_chips(boxes: Float[Tensor, "B 4"]) -> Float[Tensor, "B 4"]:
    """Turn boxes of `faces.find_faces`, SphereFace's crops, into those that this network wants."""
    left, top, right, bottom = boxes.unbind(1)
    px_per_metre = (bottom - top) / (SPHEREFACE_HEIGHT * SPHEREFACE_METRES)
    x, y = (left + right) / 2, (top + bottom) / 2 + (SPHEREFACE_CENTRE - CHIP_CENTRE) * px_per_metre
    half = px_per_metre * CHIP_METRES_PER_PX * CHIP_SIZE / 2
    return torch.stack([x - half, y - half, x + half, y + half], 1)


def dlib_identity(network: DlibFace) -> FaceIdentity:
    """Make the face identity loss by this network, whose weights are free."""
    return FaceIdentity(network, frame=frame_chips, size=(CHIP_SIZE, CHIP_SIZE))


def load_dlib_face(path: Path) -> DlibFace:
    """Load the network from `dlib_face_recognition_resnet_model_v1.dat`; nothing is executed.

    The affine layers behind its convolutions, batch norms once, become part of those.

    Raises: WeightsError if the file is missing, cut short, or of another network.
    """
    network = DlibFace()
    convolutions = [network.conv]
    for block in network.blocks:
        assert isinstance(block, Block)
        convolutions += [block.conv1, block.conv2]
    layers = read_dlib_layers(path)
    shapes = [
        size
        for conv in convolutions
        for size in (conv.weight.numel() + conv.out_channels, 2 * conv.out_channels)
    ]
    if [layer.size for layer in layers] != [*shapes, network.embed.weight.numel()]:
        raise WeightsError(f"{path} does not hold dlib's face recognition network (v1); {REMEDY}")
    with torch.no_grad():
        for conv, filters, affine in zip(convolutions, layers[0::2], layers[1::2], strict=False):
            gain, shift = torch.from_numpy(affine).view(2, -1)
            weight, bias = torch.from_numpy(filters).split([conv.weight.numel(), conv.out_channels])
            conv.weight.copy_(weight.view_as(conv.weight) * gain.view(-1, 1, 1, 1))
            assert conv.bias is not None
            conv.bias.copy_(bias * gain + shift)
        network.embed.weight.copy_(torch.from_numpy(layers[-1]).view(BLOCKS[-1], EMBEDDING).T)
    return network


REMEDY = "`mt models fetch --faces` fetches the right file"

LEARNED = re.compile(rb"\x01[\x05\x07\x04](con_4|affine_|fc_2)")
"""The name before a layer's own fields, among them one tensor of everything that it learned; dlib
writes a text as its length and its bytes, and a length as how many bytes it has and those."""


def read_dlib_layers(path: Path) -> list[np.ndarray]:
    """Read what each layer learned, from the first one on, out of a network that dlib wrote.

    The file is walked from name to name of the layers that learn; settings of the layers and of
    training are passed over. A tensor is a version, four lengths, and float32, lowest byte first.

    Raises: WeightsError if it cannot be read, or ends inside a tensor.
    """
    content = read_bytes(path, "face network")
    layers: list[np.ndarray] = []
    place = 0
    while found := LEARNED.search(content, place):
        place = found.end()
        if found[1] == b"fc_2":  # how many outputs and inputs it has come first
            for _ in range(2):
                _, place = _read_number(content, place)
        version, place = _read_number(content, place)
        lengths = []
        for _ in range(4):
            length, place = _read_number(content, place)
            lengths.append(length)
        end = place + 4 * int(np.prod(lengths))
        if version != 2 or end > len(content):
            raise WeightsError(f"{path} is not a whole network that dlib wrote; {REMEDY}")
        layers.append(np.frombuffer(content[place:end], "<f4").astype(np.float32))
        place = end
    return layers


def _read_number(content: bytes, place: int) -> tuple[int, int]:
    """A whole number, and where it ends: how many bytes it has, then those, the lowest first."""
    first = place + 1
    end = first + (content[place] & 0x0F if place < len(content) else 0)
    return int.from_bytes(content[first:end], "little"), end


def _extend(x: Tensor, shape: list[int]) -> Tensor:
    """Append zero channels, rows and columns up to (channels, height, width)."""
    channels, height, width = (wanted - own for wanted, own in zip(shape, x.shape[1:], strict=True))
    return F.pad(x, (0, width, 0, height, 0, channels))
