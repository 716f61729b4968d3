"""What an engine does for one checkpoint, on one device."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from jaxtyping import Bool, Float, Float32, UInt8

from motion_transfer.drawing.hair import Hair
from motion_transfer.drawing.source import Source
from nhrr_core.config import ModelConfig

Occupied = Literal["core", "device", "nothing"]
"""What a call keeps busy for long: a `core`, so that there are threads for calls alone, one for
each worker; the `device`, so that a few threads make them; or `nothing`, and whoever wants a
picture draws it."""

LANES = 2
"""Calls that a device takes at once: while one computes, the other copies."""

KEPT_SIZES = 4
"""Of crops, for which an engine stays ready; each takes memory for its activations."""


@dataclass(frozen=True, eq=False)
class FeatureMap:
    """What a network knows of a source.

    Attributes:
        features: The paper's feature map, and what is carried with it.
        detail: What the photos show finer: added to the first three channels where they are looked
            up, see `nhrr_core.NeuralReRenderer.detail`; None where a model has no use for it.
        hair: Long hair beside the neck, of which a texture knows nothing; None where there is none.
    """

    features: Float[np.ndarray, "1 D T T"]
    detail: Float[np.ndarray, "1 3 t t"] | None = None
    hair: Hair | None = None


@dataclass(frozen=True)
class Guess:
    """The colours of a feature map, to be amended in place, and what photos show, at their size.

    Attributes:
        texture: Of what is seen, and of its mirror image.
        shown: Where that is.
        hidden: How much of each texel no photo shows, 0 to 1, as FeatureNet's guess counts.
    """

    colours: Float32[np.ndarray, "3 T T"]
    texture: Float32[np.ndarray, "3 T T"]
    shown: Bool[np.ndarray, "T T"]
    hidden: Float32[np.ndarray, "T T"]


class Engine(Protocol):
    """A checkpoint that is ready to run; called from several threads.

    Attributes:
        occupies: What a call keeps busy.
    """

    config: ModelConfig
    occupies: Occupied

    def batch_size(self, side: int) -> int:
        """Tell how many crops of that side, px, a call takes."""
        ...

    def encode(self, source: Source) -> FeatureMap:
        """Compute a source's feature map, the same bits for any number of threads."""
        ...

    def prepare(self, sides: Collection[int]) -> None:
        """Make ready for sources, and for crops of those sides, px."""
        ...

    def take(self, feature_map: FeatureMap) -> Any:
        """Bring a feature map to where it is read."""
        ...

    def draw(
        self, feature_map: Any, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> UInt8[np.ndarray, "B S S K"]:
        """Draw frames: RGB, and alpha where the model has it.

        Args:
            feature_map: What `take` gave.
        """
        ...

    def feature_image(
        self, feature_map: Any, iuv: UInt8[np.ndarray, "B S S 3"]
    ) -> Float[np.ndarray, "B C S S"]:
        """Give what RenderNet sees, in float32."""
        ...
