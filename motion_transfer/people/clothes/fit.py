"""How cloth that follows the body stands off it: ease, bridged hollows, straight falls, folds.

Everything here works on a pattern's vertices at rest, on one body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motion_transfer.people.clothes.flattening import (
    ANGLES,
    Table,
    Tube,
    bridged,
    hanging,
    vertex_normals,
)
from motion_transfer.people.clothes.patterns import Pattern
from motion_transfer.people.clothes.surface import BodySurface, along_polyline
from motion_transfer.people.figure.body import Body, Points

_ROUNDS = 6  # of smoothing: bridges navel, breasts and armpits at the mesh's 2 cm edges
_CHEST_LEVELS = 8  # of the trunk's table, whose middle is the axis about which cloth hangs
_SOFT = 0.006  # metres; how gently a fall begins


@dataclass(frozen=True)
class Fall:
    """How a tube of cloth hangs.

    Attributes:
        ease: From the skin, metres.
        radii: Least radius at evenly spread levels from the tube's top to its end, metres; a few
            numbers, interpolated; 0 where the body decides; on a body of the template's height.
        drop: By how much the radius may shrink for each metre further down; 0 hangs straight.
        under: The room is below the limb, not all around it.
    """

    ease: float
    radii: tuple[float, ...] = (0.0,)
    drop: float = 10.0
    under: bool = False


class Fitting:
    """One body, measured for its clothes.

    Attributes:
        surface: Fields over the skin.
        body: The one that is dressed.
        scale: Of the body's height to the template's.
    """

    def __init__(self, surface: BodySurface, body: Body) -> None:
        self.surface, self.body = surface, body
        self.scale = body.height / surface.model.template.height

    @cached_property
    def trunk(self) -> tuple[Table, float]:
        """Radii of the trunk, and the y of its axis."""
        cells = self.surface.torso_tube.gather(self.body.points)
        upper = cells[:_CHEST_LEVELS]
        axis = float((upper[..., 1].max() + upper[..., 1].min()) / 2)
        radii = np.hypot(cells[..., 0], cells[..., 1] - axis)
        return bridged(radii), axis

    def close(
        self,
        pattern: Pattern,
        ease: np.ndarray,
        trunk: Fall | None = None,
        limbs: Fall | None = None,
        folds: float = 0.0,
        seed: int = 0,
        hang: np.ndarray | float = 1.0,
    ) -> Points:
        """Lay a pattern's cloth around the body at rest.

        Args:
            ease: V of the pattern, least distance from the skin in metres.
            trunk: How cloth hangs from chest and shoulder blades; None follows the body.
            limbs: How sleeves (of a top) or legs (of trousers) hang.
            folds: Height of slow waves of the cloth, metres.
            seed: Of the folds.
            hang: V or a number, 0..1: where the trunk's cloth hangs (0: is held to the body).
        """
        skin = self.body.points[pattern.index]
        outward = vertex_normals(skin, pattern.faces, pattern.sums)
        points = skin
        for _ in range(_ROUNDS):
            points = pattern.smoother @ points
        normals = vertex_normals(points, pattern.faces, pattern.sums)
        points = points + normals * ease[:, None]
        if trunk is not None:
            points = self._hang_trunk(pattern, points, trunk, hang)
        if limbs is not None:
            for name in ("arm.L", "arm.R") if pattern.kind == "top" else ("leg.L", "leg.R"):
                points = self._hang_limb(pattern, points, name, limbs)
        if folds > 0:
            height = folds * (1 + _waves(pattern.home, seed)) * pattern.loose * hang
            points = points + normals * height[:, None]
        # smoothing and hanging may have sunk cloth into the skin: push it out again
        clearance = np.einsum("vi,vi->v", points - skin, outward)
        short = np.maximum(np.minimum(ease, 0.8 * ease + 0.0015) - clearance, 0)
        short = pattern.smoother @ short + np.float32(0.5) * short
        return (points + outward * short[:, None]).astype(np.float32)

    def _hang_trunk(
        self, pattern: Pattern, points: Points, fall: Fall, hang: np.ndarray | float
    ) -> Points:
        radii, axis = self.trunk
        hung = _fallen(self.surface.torso_tube, radii, fall, self.scale)
        wanted = pattern.readers["trunk"] @ hung.ravel()
        share = pattern.shares["trunk"] * hang
        away = points[:, :2] - np.array([0, axis], np.float32)
        away = away * _widened(away, wanted, share)
        out = points.copy()
        out[:, 0], out[:, 1] = away[:, 0], away[:, 1] + axis
        return out

    def _hang_limb(self, pattern: Pattern, points: Points, name: str, fall: Fall) -> Points:
        joints = self.surface.limb_joints(self.body, *name.split("."))
        tube = self.surface.limb_tubes[name]
        cells = tube.gather(self.body.points).reshape(-1, 3)
        radii = np.linalg.norm(cells - along_polyline(cells, joints)[1], axis=1)
        hung = _fallen(tube, radii.reshape(-1, ANGLES), fall, self.scale)
        own = pattern.limbs[name]
        wanted = pattern.readers[name] @ hung.ravel()
        _, axis = along_polyline(points[own], joints)
        away = points[own] - axis
        moved = axis + away * _widened(away, wanted, pattern.shares[name])
        if pattern.kind == "bottom":  # the legs do not pass through each other
            sign = 1 if name.endswith("L") else -1
            inside = pattern.shares[name] > 0.3
            moved[inside, 0] = sign * np.maximum(sign * moved[inside, 0], 0.004)
        out = points.copy()
        out[own] = moved
        return out


def _fallen(tube: Tube, radii: Table, fall: Fall, scale: float) -> Table:
    """Work out the radii of cloth that hangs around a tube."""
    at = np.linspace(0, 1, len(radii))
    least = np.interp(at, np.linspace(0, 1, len(fall.radii)), fall.radii) * scale
    eased = (radii + fall.ease).astype(np.float32)
    steps = np.diff(tube.levels) * scale
    widest = np.maximum(bridged(eased, 1), least[:, None])
    hung = hanging(widest, (fall.drop * steps).astype(np.float32))
    if not fall.under:
        return hung
    # sleeves rest on the arm: a fifth of their room is above it, nearly all the rest below
    return eased + (hung - eased) * (1 - 0.8 * np.sin(tube.angles))


def _widened(away: np.ndarray, wanted: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Tell by how much, N x 1, places `away` from an axis move out to radii, a `share` of the way.

    The larger radius counts, rounded where they cross.
    """
    radius = np.sqrt((away**2).sum(1)) + 1e-6
    larger = (radius + wanted + np.sqrt((radius - wanted) ** 2 + _SOFT**2)) / 2 - _SOFT / 4
    return (1 + share * (larger / radius - 1))[:, None]


def _waves(home: Points, seed: int) -> np.ndarray:
    """Make slow waves of cloth, about -1..1, by places on the template; V."""
    rng = np.random.default_rng(seed)
    out = np.zeros(len(home), np.float32)
    for _ in range(4):
        direction = rng.normal(size=3) * np.array([1, 1, 0.7])  # folds run rather up and down
        wave = direction / np.linalg.norm(direction) * (2 * np.pi / rng.uniform(0.10, 0.24))
        out += np.sin(home @ wave.astype(np.float32) + np.float32(rng.uniform(0, 6.28)))
    return out / 3
