"""Torch: the specification itself, and the fastest on CUDA devices."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.interface import FeatureMap, Occupied
from motion_transfer.drawing.engines.threads import one_torch_thread
from motion_transfer.drawing.source import Source
from motion_transfer.weights.checkpoint import load_checkpoint
from nhrr_core import NeuralReRenderer

DTYPES = {"bf16": torch.bfloat16, "f32": torch.float32}


def fast_precisions(device: str) -> list[str]:
    """List the precisions that a device is fast in."""
    fast = choose_dtype(torch.device(device))
    return [name for name, dtype in DTYPES.items() if dtype in (fast, torch.float32)]


def choose_dtype(device: torch.device) -> torch.dtype:
    """Choose bf16 where the hardware multiplies it, else float32."""
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float32
    fast = torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
    return torch.bfloat16 if fast else torch.float32


def open_engine(weights: Path, execution: Execution) -> TorchEngine:
    """Load a checkpoint. Raises: WeightsError if it cannot be read."""
    return TorchEngine(load_checkpoint(weights), execution)


class TorchEngine:
    """A model in memory, its RenderNet in the engine's precision."""

    batch_size = 4

    def __init__(self, model: NeuralReRenderer, execution: Execution) -> None:
        self.config = model.config
        self._device = torch.device(execution.device)
        self._dtype = DTYPES[execution.precision]
        self._model = model.to(self._device)
        net = deepcopy(model.render_net).to(device=self._device, dtype=self._dtype)
        self._net = net.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        self.occupies: Occupied = "core" if self._device.type == "cpu" else "device"

    def encode(self, source: Source) -> FeatureMap:
        return encode_source(self._model, source).numpy()

    def prepare(self, side: int) -> None:
        pass

    def take(self, feature_map: FeatureMap) -> Tensor:
        return torch.from_numpy(feature_map).to(self._device)

    def draw(
        self, feature_map: Tensor, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> UInt8[np.ndarray, "B S S K"]:
        with torch.inference_mode():
            features = self._features(feature_map, iuv)
            drawn = self._net(features.to(self._dtype, memory_format=torch.channels_last)).float()
            frame = self._model.blend(drawn, features)
            levels = ((frame + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
            return levels.permute(0, 2, 3, 1).cpu().numpy()

    def feature_image(
        self, feature_map: Tensor, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> Float[np.ndarray, "B C S S"]:
        with torch.inference_mode():
            return self._features(feature_map, iuv).float().cpu().numpy()

    def _features(self, feature_map: Tensor, iuv: UInt8[np.ndarray, "B S S 3"]) -> Tensor:
        target = torch.from_numpy(iuv).to(self._device).permute(0, 3, 1, 2)
        return self._model.feature_image(feature_map, target)


def encode_source(model: NeuralReRenderer, source: Source) -> Tensor:
    """Compute a source's feature map, 1 x D x T x T, where the model lies; return it on the CPU.

    Measured: FeatureNet's last bits depend on the number of threads, so it gets one, wherever it
    runs; RenderNet's do not.
    """
    device = next(model.parameters()).device
    known = (source.texture, source.visibility, source.clearance)
    texture, visibility, clearance = (
        None if array is None else torch.from_numpy(array)[None].to(device) for array in known
    )
    assert texture is not None and visibility is not None
    with one_torch_thread(), torch.inference_mode():
        return model.encode_texture(texture, visibility, clearance).cpu()
