"""Fréchet inception distance with clean-fid's resizing and network, if it is installed."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.measures import Column
from motion_transfer.media.work import digest_of
from motion_transfer.training.metrics import frechet_distance

Image = UInt8[np.ndarray, "H W 3"]

WEIGHTS_NAME = "inception-2015-12-05.pt"  # the only name that clean-fid reads
DROP = "or leave fid out of --metrics"


class FidMeasure:
    """FID of all results against all targets (Heusel et al. 2017; Parmar et al., CVPR 2022).

    One number for a whole set: without a standard error, biased upwards for small sets, and only to
    be compared between sets of the same size. The distance itself is computed here, in float64.

    Raises: InputError if the package cannot be imported or no file is given; WeightsError if the
        file is not the network that clean-fid uses.
    """

    takes_turns = True

    def __init__(self, weights: Path | None) -> None:
        if weights is None:
            raise InputError(
                f"fid needs Inception's weights: give {WEIGHTS_NAME} (TorchScript, as clean-fid"
                f" downloads it) with --fid-weights FILE, {DROP}"
            )
        if not weights.is_file():
            raise WeightsError(f"weights {weights} do not exist")
        if weights.name != WEIGHTS_NAME:
            raise WeightsError(f"weights {weights}: clean-fid reads only {WEIGHTS_NAME}")
        try:
            inception: Any = import_module("cleanfid.inception_torchscript")
            resizing: Any = import_module("cleanfid.resize")
        except ImportError as error:
            raise InputError(
                f"clean-fid cannot be imported ({error}); install it with `pip install clean-fid`,"
                f" {DROP}"
            ) from error
        try:
            self._network = inception.InceptionV3W(str(weights.parent), download=False).eval()
        except RuntimeError as error:
            raise WeightsError(f"weights {weights} cannot be read: {error}") from error
        self._resize = resizing.build_resizer("clean")
        digest = digest_of(weights)[:16]
        definition = f"FID, clean-fid's resizing and Inception; weights sha256 {digest}"
        self.columns = (Column("fid", "lower", 2, definition),)

    def features(self, images: Sequence[Image]) -> list[Float[np.ndarray, " D"]]:
        """What the network makes of each picture."""
        resized = np.stack([self._resize(image) for image in images])
        with torch.inference_mode():
            batch = torch.from_numpy(resized).permute(0, 3, 1, 2).float()
            return list(self._network(batch).double().numpy())

    def distance(
        self,
        results: Sequence[Float[np.ndarray, " D"]],
        targets: Sequence[Float[np.ndarray, " D"]],
    ) -> float:
        """NaN for fewer than two pictures, which have no spread."""
        if len(results) < 2:
            return float("nan")
        return frechet_distance(np.stack(results), np.stack(targets))
