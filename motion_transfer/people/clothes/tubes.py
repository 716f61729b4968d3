"""Tubes around limbs and trunk: a body's thickness as small tables, and cloth that hangs on it.

A tube's table has one row for each level along the limb and one column for each angle about it. A
sparse operator averages the skin's vertices into cells, another one reads cells at vertices.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32
from scipy.sparse import csr_array
from scipy.spatial import KDTree

ANGLES = 24
Table = Float32[np.ndarray, "levels angles"]


class Tube:
    """Levels and angles over part of the skin.

    Convention: angle 0 is in front (-y), positive towards the outside of a limb or the person's
    left hand on the trunk. Column k lies at angle 2 pi k / ANGLES.

    Attributes:
        levels: metres along the limb on the template, ascending.
        inside: V; the skin's vertices that the table averages.
    """

    def __init__(
        self, level: np.ndarray, angle: np.ndarray, inside: np.ndarray, levels: np.ndarray
    ) -> None:
        self.levels = levels.astype(np.float32)
        self.inside = inside
        self._level, self._angle = level, angle
        self._gather = self._averages()

    @property
    def angles(self) -> np.ndarray:
        """Of the columns, radians."""
        return np.arange(ANGLES, dtype=np.float32) * np.float32(2 * np.pi / ANGLES)

    def _averages(self) -> csr_array:
        """cells x V: each cell is the mean of the three nearest vertices, the nearer the more."""
        radius = 0.1  # turns angles into metres
        index = np.nonzero(self.inside)[0]

        def on_circle(level: np.ndarray, angle: np.ndarray) -> np.ndarray:
            return np.stack([level, radius * np.cos(angle), radius * np.sin(angle)], -1)

        tree = KDTree(on_circle(self._level[index], self._angle[index]))
        level, angle = np.meshgrid(self.levels, self.angles, indexing="ij")
        distance, nearest = tree.query(on_circle(level, angle).reshape(-1, 3), k=3)
        share = 1 / (distance + 0.003)
        share /= share.sum(1, keepdims=True)
        rows = np.repeat(np.arange(len(share)), 3)
        size = (len(share), len(self.inside))
        columns = index[nearest.ravel()]
        return csr_array((share.ravel().astype(np.float32), (rows, columns)), size)

    def gather(self, values: np.ndarray) -> np.ndarray:
        """Average values over the skin into cells: V x C or V -> levels x ANGLES (x C)."""
        shape = (len(self.levels), ANGLES, *values.shape[1:])
        return (self._gather @ values).reshape(shape)

    def at(self, level: np.ndarray, angle: np.ndarray) -> csr_array:
        """The operator that averages the skin's values at places between the cells, N x V."""
        return csr_array(self._between(level, angle) @ self._gather, dtype=np.float32)

    def reader(self, index: np.ndarray) -> csr_array:
        """The operator that reads a flattened table at some vertices (bilinear).

        Levels beyond the table's are held at its edges.
        """
        return self._between(self._level[index], self._angle[index])

    def _between(self, level: np.ndarray, angle: np.ndarray) -> csr_array:
        row = np.interp(level, self.levels, np.arange(len(self.levels)))
        column = np.mod(angle / (2 * np.pi) * ANGLES, ANGLES)
        r0 = np.minimum(row.astype(int), len(self.levels) - 2)
        c0 = column.astype(int) % ANGLES
        fr, fc = row - r0, column - np.floor(column)
        cells, shares = [], []
        for dr, wr in ((0, 1 - fr), (1, fr)):
            for dc, wc in ((0, 1 - fc), (1, fc)):
                cells.append((r0 + dr) * ANGLES + (c0 + dc) % ANGLES)
                shares.append(wr * wc)
        rows = np.tile(np.arange(len(level)), 4)
        data = np.concatenate(shares).astype(np.float32)
        size = (len(level), len(self.levels) * ANGLES)
        return csr_array((data, (rows, np.concatenate(cells))), size)


def bridged(radii: Table, rounds: int = 3) -> Table:
    """Cloth pulled over hollows: no radius is below the mean of its neighbours around the tube."""
    for _ in range(rounds):
        around = (np.roll(radii, 1, 1) + np.roll(radii, -1, 1)) / 2
        radii = np.maximum(radii, around)
    return radii


def hanging(radii: Table, drops: Float32[np.ndarray, " levels-1"]) -> Table:
    """Cloth that hangs from what is above it.

    Args:
        drops: by how much the radius may shrink from each level to the next, metres; 0 hangs
            straight down, large values let it follow the body.
    """
    out = radii.copy()
    for level in range(1, len(out)):
        out[level] = np.maximum(out[level], out[level - 1] - drops[level - 1])
    return out
