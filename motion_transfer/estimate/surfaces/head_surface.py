"""A head's surface, and how it is brought to the points of a face.

Convention: that of `hand_surface`; at rest the head's middle is at 0, and the face looks at who
looks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files

import numpy as np
from jaxtyping import Float32, Int64, UInt8

from motion_transfer.estimate.surfaces.hand_surface import fit_turn


@dataclass(frozen=True)
class HeadSurface:
    """The head at rest, down to where the neck moves it.

    Attributes:
        points: Vertices.
        faces: Triangles of them, clockwise in the picture seen from outside.
        marks: Where the face network's 468 points are.
        part, uv: Charts: the part of each triangle, and (U, V) of its corners, 0..255.
    """

    points: Float32[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    marks: Float32[np.ndarray, "468 3"]
    part: UInt8[np.ndarray, " F"]
    uv: UInt8[np.ndarray, "F 3 2"]

    def fit(self, seen: Float32[np.ndarray, "468 3"]) -> tuple[float, np.ndarray, np.ndarray]:
        """Find the scale, the turn (3 x 3) and the place of its middle that bring the surface, as
        a whole, to where the points are seen."""
        scale, turn = fit_turn(self.marks, seen)
        return scale, turn, seen.mean(0) - scale * turn @ self.marks.mean(0)


@cache
def load_head() -> HeadSurface:
    """Load the head, once a process; its arrays are shared."""
    with (
        as_file(files("motion_transfer.estimate.surfaces") / "head.npz") as path,
        np.load(path) as table,
    ):
        arrays = dict(table)
    return HeadSurface(**arrays | {"faces": arrays["faces"].astype(np.int64)})
