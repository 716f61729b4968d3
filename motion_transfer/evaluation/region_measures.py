"""Measures of what a mean over the whole picture hides: the head, hidden sides, lattices."""

from __future__ import annotations

import math

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from motion_transfer.evaluation.framing import Image, PairPictures
from motion_transfer.evaluation.measures import (
    EFFICIENTNET,
    Column,
    Numbers,
    define_features,
    open_efficientnet,
    to_tensor,
)
from motion_transfer.training.faces import (
    HEAD_MARGIN,
    MIN_FACE_PIXELS,
    MIN_HEAD_PIXELS,
    crop_boxes,
    face_table,
    find_heads,
)
from motion_transfer.training.metrics import (
    FLAT_LEVELS,
    LATTICE_PERIODS,
    LATTICE_WINDOW,
    SHOWN_TEXELS,
    feature_distance,
    flat_windows,
    lattice_energy,
    shown_pixels,
    stack_iuv,
)

HEAD_SIZE = 128  # px: four of the coarsest features along a side, and no head of 256 px is larger
HIDDEN_FACE = 0.1  # share of the target's face that a source may show which does not show it
MIN_REGION_PIXELS = 64  # fewer, about 8 x 8, are a border and no region


class HiddenMeasure:
    """The perceptual distance where the source shows the body, and where it does not."""

    takes_turns = True

    def __init__(self, network: torch.nn.Module) -> None:
        distance = define_features(EFFICIENTNET, network)
        where = (
            f"of the target's IUV whose texel, of {SHOWN_TEXELS} x {SHOWN_TEXELS}, the source"
            " {}; at least " + f"{MIN_REGION_PIXELS} of them"
        )
        self.columns = (
            Column("visible", "lower", 4, f"{distance}; only pixels {where.format('shows')}"),
            Column("hidden", "lower", 4, f"{distance}; only pixels {where.format('hides')}"),
        )
        self._network = network

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        seen = shown_pixels(shown.source_iuv, shown.target.iuv)
        regions = seen, (shown.target.iuv[..., 0] > 0) & ~seen
        with torch.inference_mode():
            layers = self._network(to_tensor([shown.target.rgb, *shown.results]))
            real, rendered = [maps[:1] for maps in layers], [maps[1:] for maps in layers]
            columns = [
                feature_distance(rendered, real, region)
                if np.count_nonzero(region) >= MIN_REGION_PIXELS
                else [math.nan] * len(shown.results)
                for region in regions
            ]
        return list(zip(*columns, strict=True))


def load_hidden() -> HiddenMeasure:
    """Load that measure. Raises: InputError without the package of the network's weights."""
    return HiddenMeasure(open_efficientnet())


class HeadMeasure:
    """The perceptual distance of the enlarged head; and again, of heads whose face is hidden."""

    takes_turns = True

    def __init__(self, network: torch.nn.Module) -> None:
        definition = (
            f"{define_features(EFFICIENTNET, network)}; only the head: the square around the"
            f" target's parts 23 and 24, if they have {MIN_HEAD_PIXELS} px, with"
            f" {HEAD_MARGIN} of its side added on each, resampled to {HEAD_SIZE} x {HEAD_SIZE}"
        )
        hidden = (
            f"{definition}; only where the target shows {MIN_FACE_PIXELS} px of a face and the"
            f" source at most {HIDDEN_FACE:.0%} of their texels"
        )
        self.columns = (
            Column("head", "lower", 4, definition),
            Column("head-hidden", "lower", 4, hidden),
        )
        self._network = network
        self._table = face_table()

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        boxes, seen = find_heads(stack_iuv(shown.target.iuv))
        if not seen[0]:
            return [(math.nan, math.nan)] * len(shown.results)
        pictures = to_tensor([shown.target.rgb, *shown.results])
        with torch.inference_mode():
            heads = crop_boxes(pictures, boxes.expand(len(pictures), 4), (HEAD_SIZE, HEAD_SIZE))
            layers = self._network(heads)
            found = feature_distance([maps[1:] for maps in layers], [maps[:1] for maps in layers])
        hidden = self._is_hidden(shown)
        return [(distance, distance if hidden else math.nan) for distance in found]

    def _is_hidden(self, shown: PairPictures) -> bool:
        """Whether the target shows a face that the source does not."""
        face = mark_face(shown.target.iuv, self._table)
        known = shown_pixels(shown.source_iuv, shown.target.iuv)[face]
        return len(known) >= MIN_FACE_PIXELS and bool(known.mean() <= HIDDEN_FACE)


def load_head() -> HeadMeasure:
    """Load that measure. Raises: InputError without the package of the network's weights."""
    return HeadMeasure(open_efficientnet())


class CheckerboardMeasure:
    """Lattices that up-sampling leaves behind, where the target is smooth."""

    takes_turns = False
    columns = tuple(
        Column(
            f"checkerboard-{period}",
            "lower",
            2,
            f"energy of patterns of a period of {period} px along x, y or both above that of"
            f" neighbouring frequencies, levels^2 of 0..255, mean of R, G, B and of the windows of"
            f" {LATTICE_WINDOW} x {LATTICE_WINDOW} px inside the target's IUV in which the target"
            f" is a plane up to {FLAT_LEVELS:g} levels rms; Hann window",
        )
        for period in LATTICE_PERIODS
    )

    def measure(self, shown: PairPictures, _before: PairPictures | None = None) -> list[Numbers]:
        corners = flat_windows(shown.target.rgb, shown.target.iuv[..., 0] > 0)
        return [lattice_energy(result, corners) for result in shown.results]


def mark_face(iuv: Image, table: Bool[Tensor, "25 256 256"]) -> Bool[np.ndarray, "H W"]:
    """Mark the pixels of the face, chin to eyebrows, by `faces.face_table`."""
    part, u, v = stack_iuv(iuv).long().unbind(1)
    return table[part, v, u][0].numpy()
