"""Looking a feature map up where a body is, for graphs that are given it.

A tenth of a crop is body, as a rule. A graph, whose sizes are fixed, looks every pixel up, which
takes six times as long.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int32, UInt8

from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.unfolding import smooth_coordinates
from nhrr_core.config import CLEARANCE_SIZE, COLOUR_CHANNELS, DETAIL_FULL, DETAIL_NONE


class FeatureRows:
    """A feature map, texel by texel.

    Attributes:
        feature_map: As it was.
    """

    def __init__(self, feature_map: FeatureMap) -> None:
        self.feature_map = feature_map
        self._features = _Rows(feature_map.features)
        self._detail = None if feature_map.detail is None else _Rows(feature_map.detail)

    def look_up(
        self, iuv: UInt8[np.ndarray, "H W 3"], scale: float
    ) -> Float32[np.ndarray, "1 H W D"]:
        """Look each pixel up, bilinearly; 0 outside the body, see `nhrr_core.sample_features`.

        Args:
            scale: What `pixels_per_texel` measured of the body.
        """
        body = np.flatnonzero(iuv[..., 0])
        places = smooth_coordinates(iuv).reshape(2, -1)[:, body]
        features = self._features.at(places)
        if self._detail is not None and (share := detail_share(scale, self._detail.size)):
            features[:, :COLOUR_CHANNELS] += share * self._detail.at(places)
        looked_up = np.zeros((iuv.shape[0] * iuv.shape[1], features.shape[1]), np.float32)
        looked_up[body] = features
        return looked_up.reshape(1, *iuv.shape[:2], -1)


def detail_share(scale: float, size: int) -> float:
    """Tell how much of a source's detail a body is drawn with, see `nhrr_core.clearance`."""
    apart = size / CLEARANCE_SIZE / scale
    return min(max((DETAIL_NONE - apart) / (DETAIL_NONE - DETAIL_FULL), 0.0), 1.0)


class _Rows:
    """A map of which the channels of a texel lie together.

    Attributes:
        size: Its side, texels.
    """

    def __init__(self, values: Float32[np.ndarray, "1 C T T"]) -> None:
        self.size = values.shape[-1]
        self._rows = np.ascontiguousarray(values.reshape(values.shape[1], -1).T)

    def at(self, places: Float32[np.ndarray, "2 N"]) -> Float32[np.ndarray, "N C"]:
        """Look up, bilinearly; beyond the outermost centres the map is constant."""
        centres = places * np.float32(self.size) - np.float32(0.5)
        corner = np.floor(centres).clip(0, self.size - 2)
        right, down = (centres - corner).clip(0, 1)[..., None]
        column, row = corner.astype(np.int32)
        first = row * np.int32(self.size) + column
        above = self._between(first, right)
        below = self._between(first + self.size, right)
        below -= above
        below *= down
        below += above
        return below

    def _between(
        self, corner: Int32[np.ndarray, " N"], right: Float32[np.ndarray, "N 1"]
    ) -> Float32[np.ndarray, "N D"]:
        """Between a texel and the one to its right."""
        here = self._rows.take(corner, axis=0)
        step = self._rows.take(corner + 1, axis=0)
        step -= here
        step *= right
        step += here
        return step
