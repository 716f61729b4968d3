"""ComfyUI's IMAGE and MASK as the arrays of 8 bits that are drawn from, and back.

IMAGE is float32, B x H x W x C in [0, 1]; MASK is float32, B x H x W in [0, 1]. A byte that goes to
either and back is the same byte, so that IUV passes through IMAGE without loss.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.errors import InputError

SCALE = 255


def to_bytes(values: Float[Tensor, "*shape"]) -> UInt8[np.ndarray, "*shape"]:
    """Round values in [0, 1] to 0..255, one picture after the other to spare memory."""
    levels = np.empty(tuple(values.shape), np.uint8)
    for picture, level in zip(values, levels, strict=True):
        level[:] = picture.clamp(0, 1).mul(SCALE).round().to("cpu", torch.uint8).numpy()
    return levels


def to_pictures(image: Float[Tensor, "B H W C"]) -> UInt8[np.ndarray, "B H W 3"]:
    """Take the colours of an IMAGE, or the (I, U, V) that is in its place."""
    return to_bytes(image[..., :3])


def to_photo(
    image: Float[Tensor, "B H W C"], mask: Float[Tensor, "B H W"] | None
) -> UInt8[np.ndarray, "H W C"]:
    """Take the first picture of a batch as a photo, RGBA where a mask says where the person is.

    Raises: InputError for a mask of another size.
    """
    photo = to_bytes(image[:1])[0]
    if mask is None:
        return photo
    mask = mask if mask.ndim == 3 else mask[None]
    if mask.shape[1:] != photo.shape[:2]:
        raise InputError(
            f"the mask is {mask.shape[2]} x {mask.shape[1]}, and the image {photo.shape[1]} x"
            f" {photo.shape[0]}; leave the mask out where the photo has no alpha"
        )
    return np.dstack([photo[..., :3], to_bytes(mask[:1])[0]])


def put(values: UInt8[np.ndarray, "*shape"], into: Float[Tensor, "*shape"]) -> None:
    """Write 0..255 as values in [0, 1] into one picture of a batch."""
    torch.div(torch.from_numpy(np.ascontiguousarray(values)), SCALE, out=into)
