"""Torch: the specification itself, and the fastest on CUDA devices."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from copy import deepcopy
from functools import partial
from pathlib import Path
from queue import Queue
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.guesses import encode_amended
from motion_transfer.drawing.engines.interface import KEPT_SIZES, LANES, FeatureMap, Occupied
from motion_transfer.drawing.engines.threads import one_torch_thread
from motion_transfer.drawing.source import Source, cut_source
from motion_transfer.errors import InputError
from motion_transfer.weights.checkpoint import load_checkpoint
from nhrr_core import ModelConfig, NeuralReRenderer
from nhrr_core.config import COLOUR_CHANNELS, IUV_CHANNELS

CPU_BATCH = 4
BATCHES = (48, 24, 16, 12, 8, 6, 4, 3, 2, 1)  # divisors of a chunk's length, which is 48
LARGEST_LAYERS = 16  # about so many tensors of the first convolution's size are alive at a time
MEMORY_SHARE = 0.25  # of what is free

BF16_CPUS = ("_is_avx512_bf16_supported", "_is_amx_tile_supported")
DTYPES = {"bf16": torch.bfloat16, "f32": torch.float32}


def fast_precisions(device: str) -> list[str]:
    """List the precisions that a device is fast in."""
    fast = choose_dtype(torch.device(device))
    return [name for name, dtype in DTYPES.items() if dtype in (fast, torch.float32)]


def choose_dtype(device: torch.device) -> torch.dtype:
    """Choose bf16 where the hardware multiplies it, else float32."""
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float32
    if device.type != "cpu":  # on Apple's GPUs it was never measured
        return torch.float32
    # no public names tell it, and these may go: then 32 bits, which any CPU multiplies
    told = (getattr(torch.cpu, name, None) for name in BF16_CPUS)
    return torch.bfloat16 if any(tell() for tell in told if tell) else torch.float32


def open_engine(weights: Path, execution: Execution) -> TorchEngine:
    """Load a checkpoint. Raises: WeightsError if it cannot be read."""
    return TorchEngine(load_checkpoint(weights), execution)


class TorchEngine:
    """A model in memory, its RenderNet in the engine's precision."""

    def __init__(self, model: NeuralReRenderer, execution: Execution) -> None:
        self.config = model.config
        self._device = torch.device(execution.device)
        self._dtype = DTYPES[execution.precision]
        self._model = model.to(self._device)
        net = deepcopy(model.render_net).to(device=self._device, dtype=self._dtype)
        self._net = net.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        self._on_cuda = self._device.type == "cuda"
        self.occupies: Occupied = "core" if self._device.type == "cpu" else "device"
        self._batches: dict[int, int] = {}
        self._lanes: dict[int, Queue[_CudaLane]] = {}
        self._opening = threading.Lock()

    def batch_size(self, side: int) -> int:
        """Tell how many crops of that side, px, a call takes."""
        if not self._on_cuda:
            return CPU_BATCH
        if side not in self._batches:
            free_bytes, _ = torch.cuda.mem_get_info(self._device)
            self._batches[side] = choose_batch(self.config, side, free_bytes)
        return self._batches[side]

    def encode(self, source: Source) -> FeatureMap:
        return encode_source(self._model, source)

    def prepare(self, sides: Collection[int]) -> None:
        for side in sides if self._on_cuda else ():
            self._lanes_of(side)

    def take(self, feature_map: FeatureMap) -> Known:
        features, detail = torch.from_numpy(feature_map.features), feature_map.detail
        return Known(
            features.to(self._device),
            None if detail is None else torch.from_numpy(detail).to(self._device),
        )

    def draw(
        self, feature_map: Known, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> UInt8[np.ndarray, "B S S K"]:
        side = iuv.shape[1]
        if not self._on_cuda or len(iuv) != self.batch_size(side):
            frames = self._frames(feature_map, torch.from_numpy(iuv).to(self._device))
            return frames.cpu().numpy()
        lanes = self._lanes_of(side)
        lane = lanes.get()
        try:
            return lane.draw(feature_map, iuv)
        finally:
            lanes.put(lane)

    def feature_image(
        self, feature_map: Known, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> Float[np.ndarray, "B C S S"]:
        with torch.inference_mode():
            target = torch.from_numpy(iuv).to(self._device).permute(0, 3, 1, 2)
            features = self._model.feature_image(feature_map.features, target, feature_map.detail)
            return features.float().cpu().numpy()

    def _frames(self, known: Known, iuv: Tensor) -> Tensor:
        """Draw B x S x S x 3 uint8 as B x S x S x K uint8, where they lie."""
        with torch.inference_mode():
            target = iuv.permute(0, 3, 1, 2)
            features = self._model.feature_image(known.features, target, known.detail)
            drawn = self._net(features.to(self._dtype, memory_format=torch.channels_last)).float()
            frame = self._model.blend(drawn, features)
            levels = ((frame + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
            return levels.permute(0, 2, 3, 1).contiguous()

    def _lanes_of(self, side: int) -> Queue[_CudaLane]:
        with self._opening:
            if side not in self._lanes:
                lanes: Queue[_CudaLane] = Queue()
                size = self.batch_size(side)
                for _ in range(LANES):
                    lanes.put(_CudaLane(self._frames, self.config, size, side, self._device))
                self._lanes[side] = lanes
                while len(self._lanes) > KEPT_SIZES:
                    del self._lanes[next(iter(self._lanes))]
            return self._lanes[side]


class Known(NamedTuple):
    """A `FeatureMap` where it is read."""

    features: Tensor
    detail: Tensor | None


class _CudaLane:
    """One of several ways through a CUDA device: while one computes, another copies.

    Everything from IUV to frames is recorded once as a CUDA graph and then started by one call;
    what crosses the bus is 8 bits a channel, from and to pinned memory.
    """

    def __init__(
        self,
        frames: Callable[[Known, Tensor], Tensor],
        config: ModelConfig,
        batch: int,
        side: int,
        device: torch.device,
    ) -> None:
        texels, finest = config.texture_size, config.finest_texture
        self._stream = torch.cuda.Stream(device)
        self._shown: Known | None = None
        self._host_iuv = pinned((batch, side, side, IUV_CHANNELS))
        self._host_frames = pinned((batch, side, side, config.render_outputs))
        self._iuv = torch.zeros_like(self._host_iuv, device=device)
        self._known = Known(
            torch.zeros((1, config.map_channels, texels, texels), device=device),
            torch.zeros((1, COLOUR_CHANNELS, finest, finest), device=device)
            if config.has_detail
            else None,
        )
        self._graph = torch.cuda.CUDAGraph()
        torch.cuda.synchronize(device)
        with torch.cuda.stream(self._stream):  # as recording asks for: once before, aside
            frames(self._known, self._iuv)
        self._stream.synchronize()
        # other threads may be drawing crops of another size meanwhile
        mode = "thread_local"
        with torch.cuda.graph(self._graph, stream=self._stream, capture_error_mode=mode):
            self._frames = frames(self._known, self._iuv)

    def draw(self, known: Known, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S K"]:
        """Draw a batch; waits for the device without Python's lock."""
        self._host_iuv.numpy()[:] = iuv
        with torch.cuda.stream(self._stream):
            if self._shown is not known:
                for own, given in zip(self._known, known, strict=True):
                    if own is not None and given is not None:
                        own.copy_(given)
                self._shown = known
            self._iuv.copy_(self._host_iuv, non_blocking=True)
            self._graph.replay()
            self._host_frames.copy_(self._frames, non_blocking=True)
        self._stream.synchronize()
        return self._host_frames.numpy().copy()


def pinned(shape: tuple[int, ...]) -> Tensor:
    """Take memory for 8-bit numbers from and to which a device copies by itself."""
    return torch.empty(shape, dtype=torch.uint8, pin_memory=True)


def choose_batch(config: ModelConfig, side: int, free_bytes: int) -> int:
    """Choose how many crops fill a device: as many as a share of its free memory holds.

    The result divides a chunk of a run, so that few crops are drawn for nothing.
    """
    each_bytes = side**2 * config.render_width * LARGEST_LAYERS * torch.bfloat16.itemsize
    fitting = max(1, int(free_bytes * MEMORY_SHARE / LANES / each_bytes))
    return next(batch for batch in BATCHES if batch <= fitting)


def encode_source(model: NeuralReRenderer, source: Source) -> FeatureMap:
    """Compute a source's feature map, where the model lies.

    Raises: InputError if the model reads photos, and the source does not hold them.
    """
    return encode_amended(source, partial(_encode, model))


def _encode(model: NeuralReRenderer, source: Source) -> FeatureMap:
    """Compute what the model alone knows of a source.

    Measured: FeatureNet's last bits depend on the number of threads, so it gets one, wherever it
    runs; RenderNet's do not.
    """
    device = next(model.parameters()).device
    known = (source.texture, source.visibility, source.clearance)
    texture, visibility, clearance = (
        None if array is None else torch.from_numpy(array)[None].to(device) for array in known
    )
    assert texture is not None and visibility is not None
    pictures = cut_pictures(source, model.config)
    with one_torch_thread(), torch.inference_mode():
        shown = None if pictures is None else torch.from_numpy(pictures)[None].to(device)
        features = model.encode_texture(texture, visibility, clearance, shown).cpu().numpy()
        detail = model.detail(texture, visibility)
        return FeatureMap(features, None if detail is None else detail.cpu().numpy())


def cut_pictures(source: Source, config: ModelConfig) -> UInt8[np.ndarray, "P 6 S S"] | None:
    """Cut out the photos that a model reads; None if it reads none. Raises: InputError."""
    if not config.reads_photo:
        return None
    shown = [picture for picture in source.pictures if picture.iuv[..., 0].any()]
    if not shown:
        raise InputError(
            f"source {source.kept or source.photo.path} does not hold all of its photos, which"
            f" weights of variant {config.variant} read; give the photos, or save it again with"
            " `mt source save --weights`"
        )
    return np.stack([cut_source(picture, config.image_size) for picture in shown])
