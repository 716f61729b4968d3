"""Which renderer a run gets, and how to make it anywhere from what was computed once."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Shaped

from motion_transfer.errors import InputError
from motion_transfer.render.events import Listener, Notice
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.source import Source
from motion_transfer.render.window import drawn_side

TEXTURE_SIZE = 256
COMPILE_PAYS_FRAMES = 300  # a driver this long earns back the half minute that compiling takes
KEPT_NETWORKS = 2  # a process keeps so many warm

if TYPE_CHECKING:
    from motion_transfer.render.neural_renderer import PreparedNetwork
    from nhrr_core import NeuralReRenderer

Appearance = Shaped[np.ndarray, "..."]
"""What a renderer knows of a source: the network's feature map, or the table of its texture."""


@dataclass(frozen=True)
class Recipe:
    """How to make a renderer: the same in every process.

    Attributes:
        name: `texture` or `nhrr`.
        weights: for `nhrr`, with the digest of their content.
        compile: whether the network is compiled.
    """

    name: str
    weights: Path | None = None
    weights_digest: str = ""
    compile: bool = False

    @property
    def texture_size(self) -> int:
        """Side, px, of the partial texture that `appearance_of` wants. Raises: WeightsError."""
        if self.weights is None:
            return TEXTURE_SIZE
        from motion_transfer.weights.checkpoint import inspect_checkpoint

        return inspect_checkpoint(self.weights).config.finest_texture

    def working_size(self, window_side: int) -> int:
        """Side of the crops that the renderer will want, px. Raises: WeightsError."""
        if self.weights is None:
            return window_side
        from motion_transfer.weights.checkpoint import inspect_checkpoint

        return drawn_side(window_side, inspect_checkpoint(self.weights).config)

    def appearance_of(self, source: Source) -> Appearance:
        """What has to be computed once per source. Raises: WeightsError."""
        if self.weights is None:
            from motion_transfer.render.texture_renderer import tabulate_texture

            return tabulate_texture(source)
        from motion_transfer.render.neural_renderer import encode_source

        return encode_source(_open_model(self.weights, self.weights_digest), source).numpy()

    def renderer(self, appearance: Appearance) -> Renderer:
        """A renderer of one source; the network stays warm between calls. Raises: WeightsError."""
        if self.weights is None:
            from motion_transfer.render.texture_renderer import TextureRenderer

            return TextureRenderer(appearance)
        from motion_transfer.render.neural_renderer import NeuralRenderer

        return NeuralRenderer(_open_network(self), torch.from_numpy(appearance))


@lru_cache(maxsize=KEPT_NETWORKS)
def _open_model(weights: Path, _digest: str) -> NeuralReRenderer:
    from motion_transfer.weights.checkpoint import load_checkpoint

    return load_checkpoint(weights).to("cuda" if torch.cuda.is_available() else "cpu")


@lru_cache(maxsize=KEPT_NETWORKS)
def _open_network(recipe: Recipe) -> PreparedNetwork:
    from motion_transfer.render.neural_renderer import PreparedNetwork

    if recipe.weights is None:
        raise InputError("the nhrr renderer needs weights")
    model = _open_model(recipe.weights, recipe.weights_digest)
    return PreparedNetwork(model, compile=recipe.compile)


def choose_recipe(
    options: RenderOptions,
    frame_count: int,
    digest: str,
    listener: Listener,
    window_sides: Collection[int] = (),
) -> Recipe:
    """The renderer that the options name, its network loaded and compiled if it is to be.

    Args:
        window_sides: of the windows in the driver, px, which it is compiled for.
        digest: of the weights file; empty if there is none.
    Raises: WeightsError; InputError if compiling is asked for and there is no compiler.
    """
    if options.renderer == "texture":
        return Recipe("texture")
    compiles = _decide_compile(options.compile, frame_count)
    recipe = Recipe("nhrr", options.weights_file, digest, compiles)
    if compiles:
        words = "compiling the network, half a minute at most for each size of crop"
        listener(Notice(f"{words}; later runs find it done"))
    began = time.perf_counter()
    network = _open_network(recipe)
    for side in {recipe.working_size(side) for side in window_sides}:
        network.compile_for(side)
    if compiles:
        listener(Notice(f"compiled in {time.perf_counter() - began:.0f} s"))
    return recipe


def _decide_compile(wish: bool | None, frame_count: int) -> bool:
    """Whether to compile. Raises: InputError if it is asked for and there is no compiler."""
    compiler = os.environ.get("CXX") or next(filter(shutil.which, ("g++", "clang++")), None)
    if wish and compiler is None:
        raise InputError(
            "--compile needs a C++ compiler, g++ or clang++; install one, or leave it out"
        )
    if wish is None:
        return compiler is not None and frame_count >= COMPILE_PAYS_FRAMES
    return wish
