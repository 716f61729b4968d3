"""What a renderer is asked for, and its recipe, from which any process can make it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float, Shaped, UInt8

from motion_transfer.drawing.engines.interface import FeatureMap, Occupied
from motion_transfer.drawing.source import Source

Appearance = FeatureMap | Shaped[np.ndarray, "..."]
"""What a renderer knows of a source: the network's feature map, or its completed texture."""


class Renderer(Protocol):
    """Turns crops of target IUV into pictures of one source; called from several threads.

    Attributes:
        name: What `mt run` reports.
        occupies: What a call keeps busy.
        feature_channels: How many channels of its appearance are learned features; 0: none is.
    """

    name: str
    occupies: Occupied
    feature_channels: int

    def working_size(self, window_side: int) -> int:
        """Tell the side, px, of the crops it wants for a window of that side, px, in the driver."""
        ...

    def batch_size(self, side: int) -> int:
        """Tell how many crops of that side, px, a call takes; a chunk's last batch is padded."""
        ...

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        """Draw RGB and coverage of each crop; colour is defined wherever coverage is not 0."""
        ...

    def feature_image(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> Float[np.ndarray, "B D S S"]:
        """Look the appearance up as the target's pixels see it; only where there are features."""
        ...


class Recipe(Protocol):
    """How to make a renderer, the same in every process: it is hashable and can be pickled.

    Attributes:
        name: The renderer's.
        content: What decides the appearance of a source, besides the source.
        execution: How it is computed, which may change the last bits of a picture.
        device: Where, `cpu`, `cuda` or `cuda:1`.
        texture_size: Side, texels, of the partial texture that `appearance_of` wants.
        occupies: What a call of the renderer will keep busy.
    """

    @property
    def name(self) -> str: ...
    @property
    def content(self) -> str: ...
    @property
    def execution(self) -> str: ...
    @property
    def device(self) -> str: ...
    @property
    def texture_size(self) -> int: ...
    @property
    def occupies(self) -> Occupied: ...

    def facts(self) -> dict[str, Any]:
        """Tell what it draws with, for results files; empty for a renderer without weights."""
        ...

    def working_size(self, window_side: int) -> int:
        """Tell the side of the crops that the renderer will want, px. Raises: WeightsError."""
        ...

    def make_ready(self, window_sides: Collection[int]) -> None:
        """Load what draws, for windows of those sides in the driver, px. Raises: WeightsError."""
        ...

    def appearance_of(self, source: Source) -> Appearance:
        """Compute what has to be computed once per source. Raises: WeightsError."""
        ...

    def renderer(self, appearance: Appearance) -> Renderer:
        """Make a renderer of one source; what it loads stays warm. Raises: WeightsError."""
        ...
