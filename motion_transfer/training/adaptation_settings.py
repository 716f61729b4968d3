"""How a person is learned: known without torch, since what was learned before is found by it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class AdaptationSettings:
    """How a person is learned; `benchmarks/adaptation.py` measures it.

    Attributes:
        learning_rate: The highest, of Adam.
        held_every: One step of so many holds a pose that shows what no photo shows; 0: none does.
            The whole of it is held, not the hidden side alone: what the photo shows is to be no
            worse in other poses than the photo's, either.
        held_poses: How many poses there are.
        maps: How many feature maps are learned from, at least one for each way to draw a photo.
        light, tint: Standard deviations of the logarithms of exposure, and of each colour's gain.
        seed: Of whatever is left to chance.
    """

    steps: int = 360
    learning_rate: float = 5e-4
    held_every: int = 4
    held_poses: int = 8
    maps: int = 4
    light: float = 0.05
    tint: float = 0.02
    seed: int = 0
