"""The paper's renderer: a feature map once per source, RenderNet once per frame."""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from motion_transfer.drawing.kept_source import load_features
from motion_transfer.drawing.person import disc, occupancy
from motion_transfer.drawing.renderers.interface import Appearance, Occupied
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import SIDE_STEP, drawn_side
from motion_transfer.errors import InputError, WeightsError
from motion_transfer.weights.checkpoint import digest_weights, inspect_checkpoint, load_checkpoint
from nhrr_core import FastRenderNet, NeuralReRenderer, RenderNet

COMPILED_SIDES = 64  # torch compiles a function for 8 shapes; after that it runs as it is written
MASK_REACH_SHARE = 0.04  # of the crop's side: how far hair and clothes may leave the IUV
COMPILE_PAYS_FRAMES = 300  # a driver this long earns back the half minute that compiling takes
KEPT_NETWORKS = 8  # a process keeps so many warm: as many as anybody compares side by side


@dataclass(frozen=True)
class NetworkRecipe:
    """Makes `NeuralRenderer`s of one checkpoint.

    Attributes:
        weights: The checkpoint.
        content: SHA-256 of it, hexadecimal.
        compiled: Whether RenderNet is compiled.
    """

    weights: Path
    content: str
    compiled: bool = False
    name = "nhrr"

    @property
    def occupies(self) -> Occupied:
        return "device" if torch.cuda.is_available() else "core"

    def facts(self) -> dict[str, Any]:
        info = inspect_checkpoint(self.weights)
        return {
            "file": self.weights.name,
            "sha256": self.content,
            "configuration": info.config.to_dict(),
        }

    @property
    def texture_size(self) -> int:
        return inspect_checkpoint(self.weights).config.finest_texture

    def working_size(self, window_side: int) -> int:
        return drawn_side(window_side, inspect_checkpoint(self.weights).config)

    def made_ready(
        self,
        wish: bool | None,
        frame_count: int,
        window_sides: Collection[int],
        say: Callable[[str], object],
    ) -> NetworkRecipe:
        compiles = _decide_compile(wish, frame_count)
        recipe = replace(self, compiled=compiles)
        if compiles:
            words = "compiling the network, half a minute at most for each size of crop"
            say(f"{words}; later runs find it done")
        began = time.perf_counter()
        network = _open_network(recipe)
        for side in {recipe.working_size(side) for side in window_sides}:
            network.compile_for(side)
        if compiles:
            say(f"compiled in {time.perf_counter() - began:.0f} s")
        return recipe

    def appearance_of(self, source: Source) -> Appearance:
        if source.kept is not None:
            config = inspect_checkpoint(self.weights).config
            side = config.finest_texture
            shape = (1, config.map_channels, side, side)
            if (kept := load_features(source.kept, self.content, shape)) is not None:
                return kept.numpy()
        return encode_source(_open_model(self.weights, self.content), source).numpy()

    def renderer(self, appearance: Appearance) -> NeuralRenderer:
        return NeuralRenderer(_open_network(self), torch.from_numpy(appearance))


def open_recipe(weights: Path) -> NetworkRecipe:
    """Make the recipe of a checkpoint. Raises: InputError if it cannot be read."""
    return NetworkRecipe(weights, digest_weights(weights))


@lru_cache(maxsize=KEPT_NETWORKS)
def _open_model(weights: Path, digest: str) -> NeuralReRenderer:
    """Load a checkpoint. Raises: WeightsError if its digest is another by now."""
    model = load_checkpoint(weights)
    if digest_weights(weights) != digest:
        raise WeightsError(
            f"weights {weights} have changed since the run began; start again when they are whole"
        )
    return model.to("cuda" if torch.cuda.is_available() else "cpu")


@lru_cache(maxsize=KEPT_NETWORKS)
def _open_network(recipe: NetworkRecipe) -> PreparedNetwork:
    model = _open_model(recipe.weights, recipe.content)
    return PreparedNetwork(model, compile=recipe.compiled)


def _decide_compile(wish: bool | None, frame_count: int) -> bool:
    """Decide whether to compile. Raises: InputError if it is asked for and there is no compiler."""
    compiler = os.environ.get("CXX") or next(filter(shutil.which, ("g++", "clang++")), None)
    if wish and compiler is None:
        raise InputError(
            "--compile needs a C++ compiler, g++ or clang++; install one, or leave it out"
        )
    if wish is None:
        return compiler is not None and frame_count >= COMPILE_PAYS_FRAMES
    return wish


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
        """Draw frames, B x 3 or 4 x S x S uint8, of B x 3 x S x S target IUV."""
        self.compile_for(target.shape[-1])
        return self._draw_frames(feature_map, target)

    def _draw_frames(self, feature_map: Tensor, target: Tensor) -> Tensor:
        with torch.inference_mode():
            features = self._model.feature_image(feature_map, target.to(self.device))
            frame = self._model.blend(self._draw(features), features)
            return ((frame + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)

    def feature_image(self, feature_map: Tensor, target: Tensor) -> Tensor:
        """Give what RenderNet sees: B x D x S x S float32 on the CPU, of B x 3 x S x S IUV."""
        with torch.inference_mode():
            return self._model.feature_image(feature_map, target.to(self.device)).float().cpu()

    def _prepare_net(self, net: RenderNet, *, compile: bool) -> Callable[[Tensor], Tensor]:
        """Make float32 features to a float32 frame, in the form that runs fastest here."""
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
        feature_channels: Of the map, FeatureNet's own; what follows is carried past it.

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
    """Compute a source's feature map, 1 x D x T x T, where the model lies; return it on the CPU.

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
    """Make coverage for a model without alpha: the IUV outline, grown and softened."""
    reach = max(1, round(iuv.shape[0] * MASK_REACH_SHARE))
    mask = occupancy(iuv) * 255
    return cv2.blur(cv2.dilate(mask, disc(reach)), (reach | 1, reach | 1))


def choose_dtype(device: torch.device) -> torch.dtype:
    """Choose bf16 where the hardware multiplies it, else float32."""
    if device.type == "cuda":
        return torch.bfloat16 if torch.cuda.is_bf16_supported() else torch.float32
    fast = torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported()
    return torch.bfloat16 if fast else torch.float32


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Let torch compute with one thread a call inside: here, and in threads that begin inside."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
