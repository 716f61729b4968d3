"""What the engine asks of a renderer, and which one a run gets."""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np
from jaxtyping import UInt8

Occupied = Literal["core", "device", "nothing"]


class Renderer(Protocol):
    """Turns crops of target IUV into pictures of one source; called from several threads.

    Attributes:
        name: what `mt run` reports.
        batch_size: frames a call; the engine pads the last batch of a chunk to it.
        occupies: what a call keeps busy for long: a `core`, so that there are threads for calls
            alone, one for each worker; the `device`, so that one thread makes them; or `nothing`,
            and whoever wants a picture draws it.
    """

    name: str
    batch_size: int
    occupies: Occupied

    def working_size(self, window_side: int) -> int:
        """Side of the crops this renderer wants, px, for a window of that side in the driver."""
        ...

    def render(self, iuv: UInt8[np.ndarray, "B S S 3"]) -> UInt8[np.ndarray, "B S S 4"]:
        """RGB and coverage of each crop; colour is defined wherever coverage is not 0."""
        ...
