"""Where the face is, from IUV alone, and the crop that a face network reads.

Convention: a box is (left, top, right, bottom) in px; pixel (0, 0) covers [0, 1] x [0, 1], so a box
around the whole image is (0, 0, W, H). Boxes may be fractional and may reach outside the image.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor, nn

from motion_transfer.training.sphereface import CROP_HEIGHT, CROP_WIDTH, SphereFace20
from nhrr_core import UVLayout, face_identity_loss, load_uv_layout

HEAD_PARTS = (23, 24)

MIN_FACE_PIXELS = 64
"""Fewer pixels of a face, about 8 x 8, have no identity."""

# Places on the head in metres, as in UVLayout.position: y up, z forward. From the layout itself:
# nose tip at y = 0.395, eyes at 0.425; the mouth, at 0.355, follows from the distance to the eyes.
FACE_BOTTOM, FACE_TOP = 0.33, 0.45  # chin to eyebrows, which no hair covers
FACE_DEPTH = 0.03  # in front of the ears
FACE_WIDTH = 0.146  # of that region

# SphereFace's reference landmarks have the eyes at row 51.6 and the mouth at row 92.3 of 112
METRES_PER_CROP_PIXEL = (0.425 - 0.355) / (92.3 - 51.6)
CROP_CENTRE = 0.425 - (CROP_HEIGHT / 2 - 51.6) * METRES_PER_CROP_PIXEL


def face_table(layout: UVLayout | None = None) -> Bool[Tensor, "25 256 256"]:
    """Whether `[part, V, U]` is a place on the face, chin to eyebrows; False for other parts."""
    layout = layout or load_uv_layout()
    size = layout.position.shape[0]
    places = (layout.charts * size).long().clamp_max(size - 1)
    position = layout.position[places[..., 1], places[..., 0]]
    height, depth = position[..., 1], position[..., 2]
    table = (height > FACE_BOTTOM) & (height < FACE_TOP) & (depth > FACE_DEPTH)
    part = torch.arange(1, len(table) + 1)
    table &= torch.isin(part, torch.tensor(HEAD_PARTS))[:, None, None]
    return torch.cat([torch.zeros_like(table[:1]), table])


def find_faces(
    iuv: UInt8[Tensor, "B 3 H W"], table: Bool[Tensor, "25 256 256"]
) -> tuple[Float[Tensor, "B 4"], Bool[Tensor, " B"]]:
    """The box that puts an upright face where SphereFace's training crops had it.

    It is found from the pixels between chin and eyebrows, in the crop's 112 : 96. A head seen from
    behind shows none of them and is no face.

    Returns: boxes, and whether at least MIN_FACE_PIXELS of the face are seen; where they are not,
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
    half_width = half_height * CROP_WIDTH / CROP_HEIGHT
    centre_x = (left + right) / 2
    centre_y = (top + bottom) / 2 - px_per_metre * (CROP_CENTRE - (FACE_TOP + FACE_BOTTOM) / 2)
    boxes = torch.stack(
        [
            centre_x - half_width,
            centre_y - half_height,
            centre_x + half_width,
            centre_y + half_height,
        ],
        dim=1,
    )
    seen = face.sum((1, 2)) >= MIN_FACE_PIXELS
    whole = boxes.new_tensor([0, 0, width, height])
    return torch.where(seen[:, None], boxes, whole), seen


def crop_boxes(
    image: Float[Tensor, "B C H W"],
    boxes: Float[Tensor, "B 4"],
    size: tuple[int, int] = (CROP_HEIGHT, CROP_WIDTH),
) -> Float[Tensor, "B C h w"]:
    """Each image's box, resampled to `size` (height, width); differentiable in the image.

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
    """

    table: Tensor

    def __init__(self, network: SphereFace20) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("table", face_table(), persistent=False)

    def forward(
        self,
        generated: Float[Tensor, "B 3 H W"],
        truth: Float[Tensor, "B 3 H W"],
        iuv: UInt8[Tensor, "B 3 H W"],
    ) -> Float[Tensor, ""]:
        """The loss of generated images, RGB in [-1, 1], whose pose and truth share the IUV."""
        boxes, seen = find_faces(iuv, self.table)
        with torch.no_grad():
            wanted = self.network(crop_boxes(truth, boxes))
        return face_identity_loss(self.network(crop_boxes(generated, boxes)), wanted, seen)
