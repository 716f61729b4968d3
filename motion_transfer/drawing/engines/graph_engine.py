"""What the engines of ONNX graphs have in common."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
import onnx
from jaxtyping import Float, UInt8

from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.guesses import encode_amended
from motion_transfer.drawing.engines.interface import KEPT_SIZES, FeatureMap, Occupied
from motion_transfer.drawing.engines.lookup import FeatureRows
from motion_transfer.drawing.engines.outline import signed_distance
from motion_transfer.drawing.graphs.whole import (
    CLEARANCE,
    DETAIL,
    DISTANCE,
    FEATURE_MAP,
    FRAME,
    IUV,
    SAMPLED,
    TEXTURE,
    UNIT,
    VISIBILITY,
    build_encoder,
    build_painter,
    build_sampler,
)
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.unfolding import pixels_per_texel
from motion_transfer.weights.checkpoint import (
    inspect_checkpoint,
    load_checkpoint,
    read_checkpoint,
    read_ranges,
)
from nhrr_core.config import CLEARANCE_CHANNELS, CLEARANCE_SIZE, UNIT_PIXELS, UNIT_TEXELS


class Session(Protocol):
    """A graph that is ready to run, called from several threads."""

    def run(self, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Compute the first output."""
        ...

    def run_all(self, inputs: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Compute all outputs, by name."""
        ...


class GraphEngine(ABC):
    """Runs the graphs of one checkpoint, an image a call."""

    occupies: Occupied = "core"

    def __init__(self, weights: Path, execution: Execution) -> None:
        self.execution, self._weights = execution, weights
        self.config, self._tensors = read_checkpoint(weights)
        whole = execution.precision == "int8"
        self._ranges = read_ranges(inspect_checkpoint(weights)) if whole else None
        self._painters: dict[int, Session] = {}
        self._opened_encoder: Session | None = None
        self._opening, self._opening_encoder = threading.Lock(), threading.Lock()

    @abstractmethod
    def open(
        self, model: onnx.ModelProto, sizes: Mapping[str, tuple[int, ...]], *, exact: bool
    ) -> Session:
        """Make a graph ready.

        Args:
            sizes: Of inputs that the graph leaves open, where they are known.
            exact: Whether it is computed in float32, whatever the engine's precision, and a call at
                a time.
        """

    def batch_size(self, side: int) -> int:  # noqa: ARG002 - an image is enough
        return 1

    def encode(self, source: Source) -> FeatureMap:
        if self.config.reads_photo:  # once per source, and by research variants alone
            from motion_transfer.drawing.engines.torch_engine import encode_source

            return encode_source(load_checkpoint(self._weights), source)
        return encode_amended(source, self._encode)

    def _encode(self, source: Source) -> FeatureMap:
        clearance = source.clearance
        if clearance is None:
            clearance = np.zeros((CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE), np.float32)
        named = {TEXTURE: source.texture, VISIBILITY: source.visibility, CLEARANCE: clearance}
        inputs = {name: np.ascontiguousarray(array[None]) for name, array in named.items()}
        outputs = self._encoder.run_all(inputs)
        return FeatureMap(outputs[FEATURE_MAP], outputs.get(DETAIL))

    def prepare(self, sides: Collection[int]) -> None:
        for side in sides:
            self._painter(side)
        if not self.config.reads_photo:
            _ = self._encoder

    @property
    def _encoder(self) -> Session:
        with self._opening_encoder:  # beside painters
            if self._opened_encoder is None:
                model = build_encoder(self.config, self._tensors)
                self._opened_encoder = self.open(model, {}, exact=True)
        return self._opened_encoder

    def take(self, feature_map: FeatureMap) -> FeatureRows:
        return FeatureRows(feature_map)

    def draw(
        self, feature_map: FeatureRows, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> UInt8[np.ndarray, "B S S K"]:
        painter = self._painter(iuv.shape[1])
        frames = [painter.run(self._inputs(feature_map, crop)) for crop in iuv]
        return frames[0] if len(frames) == 1 else np.concatenate(frames)

    def feature_image(
        self, feature_map: FeatureRows, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> Float[np.ndarray, "B C S S"]:
        known = {FEATURE_MAP: feature_map.feature_map.features}
        if feature_map.feature_map.detail is not None:
            known[DETAIL] = feature_map.feature_map.detail
        return np.concatenate([self._sampler.run({**known, IUV: crop[None]}) for crop in iuv])

    @cached_property
    def _sampler(self) -> Session:
        return self.open(build_sampler(self.config), {}, exact=True)

    def read_by_convolutions(
        self, feature_map: FeatureMap, iuv: UInt8[np.ndarray, "S S 3"]
    ) -> dict[str, Float[np.ndarray, "1 C H W"]]:
        """Give what each of RenderNet's convolutions reads, by its name, in float32."""
        outputs = self._tapped.run_all(self._inputs(self.take(feature_map), iuv))
        return {name: values for name, values in outputs.items() if name != FRAME}

    @cached_property
    def _tapped(self) -> Session:
        model = build_painter(self.config, self._tensors, looked_up=True, taps=True)
        return self.open(model, {}, exact=True)

    def _inputs(
        self, feature_map: FeatureRows, iuv: UInt8[np.ndarray, "S S 3"]
    ) -> dict[str, np.ndarray]:
        scale = pixels_per_texel(iuv) if self.config.told_scale else 1.0
        inputs = {IUV: np.ascontiguousarray(iuv[None]), SAMPLED: feature_map.look_up(iuv, scale)}
        if self.config.geometry:
            inputs[DISTANCE] = signed_distance(iuv)[None, None]
        if self.config.clearance:
            inputs[UNIT] = np.full((1, 1, 1, 1), scale * UNIT_TEXELS / UNIT_PIXELS, np.float32)
        return inputs

    def _painter(self, side: int) -> Session:
        with self._opening:
            painter = self._painters.pop(side, None) or self._open_painter(side)
            self._painters[side] = painter  # the last of them was used last
            while len(self._painters) > KEPT_SIZES:
                del self._painters[next(iter(self._painters))]
        return painter

    def _open_painter(self, side: int) -> Session:
        tensors, ranges = self._tensors, self._ranges
        model = build_painter(self.config, tensors, ranges=ranges, looked_up=True)
        sizes = {
            IUV: (1, side, side, 3),
            SAMPLED: (1, side, side, self.config.map_channels),
            DISTANCE: (1, 1, side, side),
        }
        return self.open(model, sizes, exact=False)
