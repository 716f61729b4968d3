"""The paper's renderer: a feature map once per source, RenderNet once per frame."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.render.person import disc, occupancy
from motion_transfer.render.source import Source
from nhrr_core import FastRenderNet, NeuralReRenderer, RenderNet

MASK_REACH_SHARE = 0.04  # of the crop's side: how far hair and clothes may leave the IUV


class NeuralRenderer:
    """Runs a model on the best device there is, in bf16 where that is fast.

    Compiling happens here, before the first frame is asked for.

    A model with an alpha channel says itself what the person covers. One without, as in the paper,
    paints its own background; what lies beyond the (grown, softened) IUV outline is left out.
    """

    name = "nhrr"
    takes_turns = True

    def __init__(self, model: NeuralReRenderer, source: Source, *, compile: bool) -> None:
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.dtype = choose_dtype(self.device)
        self.batch_size = 4
        self._config = model.config
        self._model = model.to(self.device)
        with torch.inference_mode():
            self._feature_map = self._model.encode_texture(
                source.texture.to(self.device), source.visibility.to(self.device)
            )
        self._draw = self._prepare_net(model.render_net, compile=compile)
        if compile:
            side = self._config.image_size
            self.render(np.zeros((self.batch_size, side, side, 3), np.uint8))

    def _prepare_net(self, net: RenderNet, *, compile: bool) -> Callable[[Tensor], Tensor]:
        """Float32 features to a float32 frame, in the form that runs fastest here."""
        if compile and self.device.type == "cpu":
            fast = FastRenderNet(net, dtype=self.dtype)
            if self._config.image_size % fast.multiple == 0:
                return fast
        plain = net.to(device=self.device, dtype=self.dtype).to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        run = torch.compile(plain) if compile else plain
        return lambda features: run(
            features.to(self.dtype, memory_format=torch.channels_last)
        ).float()

    def working_size(self, window_side: int) -> int:
        return self._config.image_size

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        with torch.inference_mode():
            target = torch.from_numpy(iuv).to(self.device).permute(0, 3, 1, 2)
            features = self._model.feature_image(self._feature_map, target)
            frame = self._model.blend(self._draw(features), features)
            pixels = ((frame + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
            images = pixels.permute(0, 2, 3, 1).cpu().numpy()
        if images.shape[-1] == 4:
            return images
        masks = np.stack([grow_mask(crop) for crop in iuv])
        return np.concatenate([images, masks[..., None]], axis=-1)


def grow_mask(iuv: UInt8[np.ndarray, "S S 3"]) -> UInt8[np.ndarray, "S S"]:
    """Coverage for a model without alpha: the IUV outline, grown and softened."""
    reach = max(1, round(iuv.shape[0] * MASK_REACH_SHARE))
    mask = occupancy(iuv) * 255
    return cv2.blur(cv2.dilate(mask, disc(reach)), (reach | 1, reach | 1))


def choose_dtype(device: torch.device) -> torch.dtype:
    """bf16 where the hardware multiplies it, else float32."""
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float32
    fast = torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
    return torch.bfloat16 if fast else torch.float32
