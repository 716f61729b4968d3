"""The paper's renderer: a feature map once per source, RenderNet once per frame."""

from __future__ import annotations

import threading
from collections.abc import Callable
from copy import deepcopy

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.render.person import disc, occupancy
from motion_transfer.render.renderer import Occupied
from motion_transfer.render.source import Source
from motion_transfer.render.threads import one_torch_thread
from motion_transfer.render.window import SIDE_STEP, drawn_side
from nhrr_core import FastRenderNet, NeuralReRenderer, RenderNet

COMPILED_SIDES = 64  # torch compiles a function for 8 shapes; after that it runs as it is written
MASK_REACH_SHARE = 0.04  # of the crop's side: how far hair and clothes may leave the IUV


class PreparedNetwork:
    """A model on the best device there is, in bf16 where that is fast; for any number of sources.

    Compiling happens here, before the first frame is asked for; on a CPU for calls of one thread.
    Measured: two such calls side by side are as fast as two threads in one call, or faster, and do
    not wait for each other when something else takes a core.
    """

    batch_size = 4

    def __init__(self, model: NeuralReRenderer, *, compile: bool) -> None:
        self.device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self.dtype = choose_dtype(self.device)
        self.config = model.config
        self._model = model.to(self.device)
        self._draw = self._prepare_net(model.render_net, compile=compile)
        self._compiles = compile
        self._compiled: set[int] = set()
        self._compiling = threading.Lock()

    def compile_for(self, side: int) -> None:
        """Make ready for crops of that side, px, unless that is done or nothing is compiled."""
        if not self._compiles or side in self._compiled:
            return
        limit = torch._dynamo.config.patch(recompile_limit=COMPILED_SIDES)
        with self._compiling, one_torch_thread(), limit:
            if side not in self._compiled:
                blank = torch.zeros(self.batch_size, 3, side, side, dtype=torch.uint8)
                map_side = self.config.finest_texture
                shape = (1, self.config.map_channels, map_side, map_side)
                self._draw_frames(torch.zeros(shape, device=self.device), blank)
                self._compiled.add(side)

    def draw(self, feature_map: Tensor, target: Tensor) -> Tensor:
        """RenderNet's frames, B x 3 or 4 x S x S uint8, of B x 3 x S x S target IUV."""
        self.compile_for(target.shape[-1])
        return self._draw_frames(feature_map, target)

    def _draw_frames(self, feature_map: Tensor, target: Tensor) -> Tensor:
        with torch.inference_mode():
            features = self._model.feature_image(feature_map, target.to(self.device))
            frame = self._model.blend(self._draw(features), features)
            return ((frame + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)

    def feature_image(self, feature_map: Tensor, target: Tensor) -> Tensor:
        """What RenderNet sees: B x D x S x S float32, on the CPU, of B x 3 x S x S target IUV."""
        with torch.inference_mode():
            return self._model.feature_image(feature_map, target.to(self.device)).float().cpu()

    def _prepare_net(self, net: RenderNet, *, compile: bool) -> Callable[[Tensor], Tensor]:
        """Float32 features to a float32 frame, in the form that runs fastest here."""
        if compile and self.device.type == "cpu":
            fast = FastRenderNet(net, dtype=self.dtype)
            if self.config.image_size % fast.multiple == SIDE_STEP % fast.multiple == 0:
                return fast
        plain = deepcopy(net).to(device=self.device, dtype=self.dtype)
        plain = plain.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        run = torch.compile(plain, dynamic=False) if compile else plain
        return lambda features: run(
            features.to(self.dtype, memory_format=torch.channels_last)
        ).float()


class NeuralRenderer:
    """A prepared network and one source's feature map.

    Attributes:
        feature_channels: of the map, FeatureNet's own; what follows is carried past it.

    A model with an alpha channel says itself what the person covers. One without, as in the paper,
    paints its own background; what lies beyond the (grown, softened) IUV outline is left out.
    """

    name = "nhrr"
    batch_size = PreparedNetwork.batch_size

    def __init__(self, network: PreparedNetwork, feature_map: Tensor) -> None:
        self._network = network
        self._feature_map = feature_map.to(network.device)
        self.feature_channels = network.config.feature_outputs
        self.occupies: Occupied = "core" if network.device.type == "cpu" else "device"

    def working_size(self, window_side: int) -> int:
        return drawn_side(window_side, self._network.config)

    def feature_image(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> Float[np.ndarray, "B D S S"]:
        """The feature map as the target's pixels see it."""
        target = torch.from_numpy(iuv).permute(0, 3, 1, 2)
        return self._network.feature_image(self._feature_map, target).numpy()

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        target = torch.from_numpy(iuv).permute(0, 3, 1, 2)
        pixels = self._network.draw(self._feature_map, target)
        images = pixels.permute(0, 2, 3, 1).cpu().numpy()
        if images.shape[-1] == 4:
            return images
        masks = np.stack([grow_mask(crop) for crop in iuv])
        return np.concatenate([images, masks[..., None]], axis=-1)


def encode_source(model: NeuralReRenderer, source: Source) -> Tensor:
    """A source's feature map, 1 x D x T x T, computed where the model lies, returned on the CPU.

    Measured: FeatureNet's last bits depend on the number of threads, so it gets one, wherever it
    runs; RenderNet's do not.
    """
    device = next(model.parameters()).device
    with one_torch_thread(), torch.inference_mode():
        clearance = None if source.clearance is None else source.clearance.to(device)
        return model.encode_texture(
            source.texture.to(device), source.visibility.to(device), clearance
        ).cpu()


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
