"""The paper's renderer: a feature map once per source, RenderNet once per frame."""

from __future__ import annotations

import logging
import threading
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from motion_transfer.drawing.engines import Execution, Wish, choose_execution, open_engine
from motion_transfer.drawing.engines.interface import Engine, FeatureMap, Occupied
from motion_transfer.drawing.hair import colour_hair, find_hair
from motion_transfer.drawing.kept_source import load_features
from motion_transfer.drawing.person import disc, occupancy
from motion_transfer.drawing.renderers.interface import Appearance
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import drawn_side
from motion_transfer.errors import WeightsError
from motion_transfer.weights.checkpoint import digest_weights, inspect_checkpoint

log = logging.getLogger(__name__)

MASK_REACH_SHARE = 0.04  # of the crop's side: how far hair and clothes may leave the IUV
OPENING = threading.Lock()  # of networks, by a run's several threads
KEPT_NETWORKS = 8  # a process keeps so many warm: as many as anybody compares side by side


@dataclass(frozen=True)
class NetworkRecipe:
    """Makes `NeuralRenderer`s of one checkpoint.

    Attributes:
        weights: The checkpoint.
        content: SHA-256 of it, hexadecimal.
        how: How the network is run.
    """

    weights: Path
    content: str
    how: Execution
    name = "nhrr"

    @property
    def execution(self) -> str:
        return str(self.how)

    @property
    def device(self) -> str:
        return self.how.device

    @property
    def occupies(self) -> Occupied:
        return "core" if self.how.device == "cpu" else "device"

    def facts(self) -> dict[str, Any]:
        info = inspect_checkpoint(self.weights)
        return {
            "file": self.weights.name,
            "sha256": self.content,
            "configuration": info.config.to_dict(),
            "execution": self.execution,
        }

    @property
    def texture_size(self) -> int:
        return inspect_checkpoint(self.weights).config.finest_texture

    def working_size(self, window_side: int) -> int:
        return drawn_side(window_side, inspect_checkpoint(self.weights).config)

    def make_ready(self, window_sides: Collection[int]) -> None:
        _open_network(self).prepare({self.working_size(side) for side in window_sides})

    def appearance_of(self, source: Source) -> FeatureMap:
        config = inspect_checkpoint(self.weights).config
        known = source.kept and load_features(source.kept, self.content, config)
        known = known or _open_network(self).encode(source)
        # a model that is told what stands off the body draws hair there
        return replace(known, hair=find_hair(source)) if config.clearance else known

    def renderer(self, appearance: Appearance) -> NeuralRenderer:
        assert isinstance(appearance, FeatureMap)
        return NeuralRenderer(_open_network(self), appearance)


def open_recipe(weights: Path, wish: Wish) -> NetworkRecipe:
    """Make the recipe of a checkpoint.

    Raises: InputError if it cannot be read, or not be run as wished.
    """
    how = choose_execution(wish, inspect_checkpoint(weights))
    log.debug("weights %s run by %s", weights, how)
    return NetworkRecipe(weights, digest_weights(weights), how)


def _open_network(recipe: NetworkRecipe) -> Engine:
    """Load a checkpoint, once. Raises: WeightsError if its digest is another by now."""
    with OPENING:
        return _load_network(recipe)


@lru_cache(maxsize=KEPT_NETWORKS)
def _load_network(recipe: NetworkRecipe) -> Engine:
    engine = open_engine(recipe.weights, recipe.how)
    if digest_weights(recipe.weights) != recipe.content:
        raise WeightsError(
            f"weights {recipe.weights} have changed since the run began; start again when they are"
            " whole"
        )
    return engine


class NeuralRenderer:
    """A network that is ready to run, and one source's feature map.

    Attributes:
        feature_channels: Of the map, FeatureNet's own; what follows is carried past it.

    A model with an alpha channel says itself what the person covers. One without, as in the paper,
    paints its own background; what lies beyond the (grown, softened) IUV outline is left out.
    """

    name = "nhrr"

    def __init__(self, engine: Engine, appearance: FeatureMap) -> None:
        self._engine = engine
        self._feature_map = engine.take(appearance)
        self._hair = appearance.hair
        self.occupies: Occupied = engine.occupies
        self.feature_channels = engine.config.feature_outputs

    def working_size(self, window_side: int) -> int:
        return drawn_side(window_side, self._engine.config)

    def batch_size(self, side: int) -> int:
        return self._engine.batch_size(side)

    def feature_image(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> Float[np.ndarray, "B D S S"]:
        return self._engine.feature_image(self._feature_map, iuv)

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        images = self._engine.draw(self._feature_map, iuv)
        if images.shape[-1] == 4:
            return self._with_hair(images, iuv)
        masks = np.stack([grow_mask(crop) for crop in iuv])
        return np.concatenate([images, masks[..., None]], axis=-1)

    def _with_hair(
        self, images: UInt8[np.ndarray, "B S S 4"], iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> UInt8[np.ndarray, "B S S 4"]:
        if self._hair is None:
            return images
        images = np.require(images, requirements="W")  # engines may lend memory of their own
        for image, crop in zip(images, iuv, strict=True):
            colour_hair(image, crop, self._hair)
        return images


def grow_mask(iuv: UInt8[np.ndarray, "S S 3"]) -> UInt8[np.ndarray, "S S"]:
    """Make coverage for a model without alpha: the IUV outline, grown and softened."""
    reach = max(1, round(iuv.shape[0] * MASK_REACH_SHARE))
    mask = occupancy(iuv) * 255
    return cv2.blur(cv2.dilate(mask, disc(reach)), (reach | 1, reach | 1))
