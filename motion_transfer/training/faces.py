"""The face identity loss: where the face is, from IUV alone, and whether two are one person's.

The network that tells is SphereFace-20 (Liu et al., CVPR 2017). Names and layers are those of the
PyTorch version by clcarwin (github.com/clcarwin/sphereface_pytorch), whose weights it reads.

Convention: a box is (left, top, right, bottom) in px; pixel (0, 0) covers [0, 1] x [0, 1], so a box
around the whole image is (0, 0, W, H). Boxes may be fractional and may reach outside the image.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor, nn

from motion_transfer.training.feature_networks import FrozenNetwork, load_weights
from nhrr_core import UVLayout, face_identity_loss, load_uv_layout

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
        """Embed a face crop, B x 3 x 112 x 96, RGB in [-1, 1], as B x 512.

        It was trained on crops in which the eyes lie at about (30, 52) and (66, 52) px and the
        mouth at y = 92, as BGR and (value in 0..255 - 127.5) / 128.
        """
        x = face.flip(1) * (127.5 / 128)  # to BGR, and to the range it was trained on
        for stage, (_, pairs) in enumerate(STAGES, start=1):
            x = self._layer(x, stage, 1)
            for pair in range(1, pairs + 1):
                x = x + self._layer(self._layer(x, stage, 2 * pair), stage, 2 * pair + 1)
        return self.fc5(x.flatten(1))

    def _layer(self, x: Tensor, stage: int, layer: int) -> Tensor:
        convolved = self.get_submodule(f"conv{stage}_{layer}")(x)
        return self.get_submodule(f"relu{stage}_{layer}")(convolved)


def load_sphereface(path: Path) -> SphereFace20:
    """Load SphereFace-20 from `.safetensors` or what torch saved; its classifier is ignored.

    Raises: WeightsError if the file is missing, unreadable, or of another network.
    """
    return load_weights(
        SphereFace20(),
        path,
        what=WHAT,
        remedy=REMEDY,
        rename=lambda name: None if name == "fc6.weight" else name,
    )


HEAD_PARTS = (23, 24)

MIN_FACE_PIXELS = 64
"""Fewer pixels of a face, about 8 x 8, have no identity."""

MIN_HEAD_PIXELS = 120
"""Fewer pixels of a head, about 11 x 11, show no features."""

HEAD_MARGIN = 0.175
"""Of the head's longer side, left around it on each side."""

# Places on the head in metres, as in UVLayout.position: y up, z forward. From the layout itself:
# nose tip at y = 0.395, eyes at 0.425; the mouth, at 0.355, follows from the distance to the eyes.
FACE_BOTTOM, FACE_TOP = 0.33, 0.45  # chin to eyebrows, which no hair covers
FACE_DEPTH = 0.03  # in front of the ears
FACE_WIDTH = 0.146  # of that region

# SphereFace's reference landmarks have the eyes at row 51.6 and the mouth at row 92.3 of 112
METRES_PER_CROP_PIXEL = (0.425 - 0.355) / (92.3 - 51.6)
CROP_CENTRE = 0.425 - (CROP_HEIGHT / 2 - 51.6) * METRES_PER_CROP_PIXEL


def face_table(layout: UVLayout | None = None) -> Bool[Tensor, "25 256 256"]:
    """Mark each `[part, V, U]` that is a place on the face, chin to eyebrows.

    It is found in the layout's positions, so that no picture of a face is needed.
    """
    layout = layout or load_uv_layout()
    size = layout.position.shape[0]
    places = (layout.charts * size).long().clamp_max(size - 1)  # 1.0 belongs to the last texel
    position = layout.position[places[..., 1], places[..., 0]]
    height, depth = position[..., 1], position[..., 2]
    table = (height > FACE_BOTTOM) & (height < FACE_TOP) & (depth > FACE_DEPTH)
    part = torch.arange(1, len(table) + 1)
    table &= torch.isin(part, torch.tensor(HEAD_PARTS))[:, None, None]
    return torch.cat([torch.zeros_like(table[:1]), table])  # part 0, the background, comes first


def find_faces(
    iuv: UInt8[Tensor, "B 3 H W"], table: Bool[Tensor, "25 256 256"]
) -> tuple[Float[Tensor, "B 4"], Bool[Tensor, " B"]]:
    """Find the box that puts an upright face where SphereFace's training crops had it.

    It follows from the pixels between chin and eyebrows, in the crop's 112 : 96. A head seen from
    behind shows none of them and is no face.

    Returns: Boxes, and whether at least MIN_FACE_PIXELS of the face are seen; where they are not,
        the box is the whole image.
    """
    part, u, v = iuv.long().unbind(1)
    face = table[part, v, u]
    height, width = face.shape[1:]
    left, right = _extent(face.any(1))
    top, bottom = _extent(face.any(2))
    # a face seen from the side is narrow, one that looks up or down is low: the larger one rules
    px_per_metre = torch.maximum(
        (right - left) / FACE_WIDTH, (bottom - top) / (FACE_TOP - FACE_BOTTOM)
    )
    half_height = px_per_metre * METRES_PER_CROP_PIXEL * CROP_HEIGHT / 2
    half = torch.stack([half_height * CROP_WIDTH / CROP_HEIGHT, half_height], 1)
    rise = px_per_metre * (CROP_CENTRE - (FACE_TOP + FACE_BOTTOM) / 2)
    centre = torch.stack([(left + right) / 2, (top + bottom) / 2 - rise], 1)
    boxes = torch.cat([centre - half, centre + half], 1)
    seen = face.sum((1, 2)) >= MIN_FACE_PIXELS
    whole = boxes.new_tensor([0, 0, width, height])
    return torch.where(seen[:, None], boxes, whole), seen


def find_heads(
    iuv: UInt8[Tensor, "B 3 H W"],
) -> tuple[Float[Tensor, "B 4"], Bool[Tensor, " B"]]:
    """Find the square around each head, hair included as far as HEAD_MARGIN reaches.

    Returns: Boxes, and whether at least MIN_HEAD_PIXELS of the head are seen; where they are not,
        the box is the whole image.
    """
    head = (iuv[:, 0] >= HEAD_PARTS[0]) & (iuv[:, 0] <= HEAD_PARTS[1])
    height, width = head.shape[1:]
    left, right = _extent(head.any(1))
    top, bottom = _extent(head.any(2))
    half = torch.maximum(right - left, bottom - top) * (0.5 + HEAD_MARGIN)
    middle = torch.stack([left + right, top + bottom], 1) / 2
    boxes = torch.cat([middle - half[:, None], middle + half[:, None]], 1)
    seen = head.sum((1, 2)) >= MIN_HEAD_PIXELS
    whole = boxes.new_tensor([0, 0, width, height])
    return torch.where(seen[:, None], boxes, whole), seen


def crop_boxes(
    image: Float[Tensor, "B C H W"],
    boxes: Float[Tensor, "B 4"],
    size: tuple[int, int] = (CROP_HEIGHT, CROP_WIDTH),
) -> Float[Tensor, "B C h w"]:
    """Resample each image's box to `size` (height, width); differentiable in the image.

    Bilinear; where a box is shrunk, its pixels are averaged instead of skipped. Samples outside
    the image are taken at its border.
    """
    left, top, right, bottom = boxes.unbind(1)
    rows = _resampling(top, bottom, image.shape[2], size[0]).to(image.dtype)
    columns = _resampling(left, right, image.shape[3], size[1]).to(image.dtype)
    return rows[:, None] @ image @ columns[:, None].mT


def _extent(occupied: Bool[Tensor, "B N"]) -> tuple[Tensor, Tensor]:
    """Where the first True begins and the last one ends, as float; 0 and N if there is none."""
    length = occupied.shape[1]
    first = occupied.int().argmax(1)
    last = length - occupied.flip(1).int().argmax(1)
    return first.float(), last.float()


def _resampling(
    low: Float[Tensor, " B"], high: Float[Tensor, " B"], length: int, count: int
) -> Float[Tensor, "B count length"]:
    """Weights that turn `length` pixels into `count` samples spread evenly from low to high."""
    steps = torch.arange(count, device=low.device, dtype=low.dtype) + 0.5
    step = (high - low)[:, None] / count
    place = (low[:, None] + steps * step).clamp(0.5, length - 0.5)
    pixels = torch.arange(length, device=low.device, dtype=low.dtype) + 0.5
    reach = step.clamp_min(1)[..., None]  # of the triangle around a sample
    weights = (1 - (place[..., None] - pixels).abs() / reach).clamp_min(0)
    return weights / weights.sum(-1, keepdim=True)


class FaceIdentity(nn.Module):
    """The face identity loss of a batch: find, crop, embed, compare.

    Its network is frozen: keep this outside what is optimised and saved.

    Args:
        frame: Turns the boxes of `find_faces`, SphereFace's, into those that the network wants.
        size: Of the crops that it takes, (height, width).
    """

    table: Tensor

    def __init__(
        self,
        network: FrozenNetwork,
        *,
        frame: Callable[[Tensor], Tensor] = lambda boxes: boxes,
        size: tuple[int, int] = (CROP_HEIGHT, CROP_WIDTH),
    ) -> None:
        super().__init__()
        self.network = network
        self._frame, self._size = frame, size
        self.register_buffer("table", face_table(), persistent=False)

    def forward(
        self,
        generated: Float[Tensor, "B 3 H W"],
        truth: Float[Tensor, "B 3 H W"],
        iuv: UInt8[Tensor, "B 3 H W"],
    ) -> Float[Tensor, ""]:
        """Compute the loss of generated images, RGB in [-1, 1], whose truth shares their IUV."""
        faces, seen = find_faces(iuv, self.table)
        boxes = self._frame(faces)
        with torch.no_grad():
            wanted = self.network(crop_boxes(truth, boxes, self._size))
        found = self.network(crop_boxes(generated, boxes, self._size))
        return face_identity_loss(found, wanted, seen)
