"""A body fitted to the landmarks of one shot: all frames at once, so that nothing lags.

What is made small, by Gauss-Newton steps: how far landmarks are from where the picture shows them,
and (counting less) from BlazePose's metres; how much joints leave their usual angles; and how
suddenly they move; then once more, with feet that stand where they are. Landmarks that do not fit
the rest count less and less (Cauchy's weights), and so do sudden movements if the picture insists
on them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.linalg import solveh_banded

from motion_transfer.estimate.interface import LANDMARK
from motion_transfer.tracking.contacts import Standing, find_standing, pull
from motion_transfer.tracking.habits import usual_habits
from motion_transfer.tracking.puppet import LAYOUT, PARAMETERS, Points, Postures, Puppet, Slopes
from motion_transfer.tracking.starting import Observed, find_flipped, first_postures, unflipped

Blocks = Float64[np.ndarray, "N P P"]

STEPS = 14
"""Gauss-Newton's; measured: later ones move no joint by a millimetre."""

LAST_STEPS = 8
"""Those with feet that stand."""

IMAGE_SIGMA = 0.012
"""How far BlazePose's landmarks are off in the picture, as a share of the body's height there."""

WORLD_SIGMA = np.array([0.2, 0.15, 0.2])
"""How far its metres are off: across, in depth, up. Measured on synthetic people: 0.05, 0.1, 0.1;
but wrong metres stay wrong for many frames, and the picture knows better what is across or up."""

CAUCHY = 1.5
"""Sigmas from which a landmark counts less and less."""

LEAST_DEPTH = 0.1  # metres; nothing behind the camera is projected
HIPS = [LANDMARK["left-hip"], LANDMARK["right-hip"]]


def _degrees(**sigmas: tuple[float, ...]) -> dict[str, np.ndarray]:
    return {name: np.radians(values) for name, values in sigmas.items()}


ACCELERATION = {
    **_degrees(
        pelvis=(1.0, 1.0, 1.5),
        spine=(0.5, 0.5, 0.5),
        neck=(0.8, 0.8, 1.0),
        arm=(2.5, 2.5, 2.5),
        elbow=(2.5,),
        hand=(2.0, 2.0, 2.0),
        leg=(1.8, 1.8, 1.2),
        knee=(2.5,),
        foot=(1.8, 1.2, 0.8),
    ),
    "place": np.array([0.008, 0.006, 0.008]),
}
"""How much the speed usually changes from one frame to the next at 30 frames a second."""

SUDDEN = 2.0
"""Sigmas from which a change of speed counts less and less."""

VELOCITY_SHARE = 1 / 12
"""Of a change of speed's sigma over that of speed: keeps bodies where they were last seen."""


@dataclass(frozen=True)
class View:
    """A level camera at the world's origin that looks along y.

    Attributes:
        focal: Pixels.
        centre: Of the picture, px.
    """

    focal: float
    centre: tuple[float, float]


def fit_postures(
    puppet: Puppet, observed: Observed, view: View, frame_rate: float
) -> tuple[Postures, int]:
    """Fit a body to one shot.

    Returns: Its postures, and in how many frames left and right were exchanged.
    """
    flipped = find_flipped(observed, frame_rate)
    observed = unflipped(observed, flipped)
    postures = first_postures(puppet, observed, view.focal, view.centre)
    postures = refine(puppet, postures, observed, view, frame_rate)
    standing = find_standing(
        observed.image,
        observed.weight,
        puppet.place(postures).landmarks,
        _height_px(puppet, postures, view),
        frame_rate,
    )
    if standing:
        postures = refine(
            puppet, postures, observed, view, frame_rate, steps=LAST_STEPS, standing=standing
        )
    return postures, int(flipped.sum())


def refine(
    puppet: Puppet,
    postures: Postures,
    observed: Observed,
    view: View,
    frame_rate: float,
    steps: int = STEPS,
    standing: Sequence[Standing] = (),
) -> Postures:
    """Take Gauss-Newton steps towards what was observed.

    Args:
        standing: Feet that stand; the postures are taken for nearly right then.
    """
    moments, habits = Moments.at(frame_rate), usual_habits()
    for step in range(steps):
        # wide at first: far-off starts must not be taken for outliers
        width = CAUCHY if standing else CAUCHY * max(1.0, 8.0 / 2**step)
        placed = puppet.place(postures)
        slopes = placed.slopes()
        height = _height_px(puppet, postures, view)
        misfit = measure_misfit(placed.landmarks, slopes, observed, view, height, width)
        blocks, right = misfit.equations()
        pull(standing, placed.landmarks, slopes, blocks, right)
        habits.pull(postures, blocks, right)
        band = Band(blocks)
        moments.add(postures, band, right)
        postures = postures.turned(band.solve(right))
    return postures


@dataclass(frozen=True)
class Misfit:
    """How far a body is from what was observed, R numbers a frame, in sigmas or pixels.

    Attributes:
        away: The numbers.
        weight: What each one's square counts.
        slopes: How they change with each number of a step.
    """

    away: Float64[np.ndarray, "N R"]
    weight: Float64[np.ndarray, "N R"]
    slopes: Float64[np.ndarray, "N R P"]

    def equations(self) -> tuple[Blocks, Float64[np.ndarray, "N P"]]:
        """Make the normal equations of each frame alone."""
        weighted = self.slopes * self.weight[..., None]
        right = -np.einsum("nrp,nr->np", weighted, self.away)
        return weighted.swapaxes(1, 2) @ self.slopes, right


def measure_misfit(
    points: Points,
    slopes: Slopes,
    observed: Observed,
    view: View,
    height_px: float,
    width: float,
) -> Misfit:
    """Compare a body with what was observed.

    Args:
        points, slopes: Where its landmarks are, and how they move, see `Placed`.
        height_px: Of the body in the picture.
        width: Sigmas from which a landmark counts less and less.
    """
    x, depth, z = np.moveaxis(points, -1, 0)
    depth = np.maximum(depth, LEAST_DEPTH)
    scale = view.focal / depth
    away = np.stack([x * scale, -z * scale], -1) + np.array(view.centre) - observed.image
    # how the picture moves with a point: to the right, into it, up
    u = scale[..., None] * (slopes[:, :, 0] - (x / depth)[..., None] * slopes[:, :, 1])
    v = scale[..., None] * (-slopes[:, :, 2] + (z / depth)[..., None] * slopes[:, :, 1])
    sigma = IMAGE_SIGMA * height_px
    image = observed.weight * _cauchy((away**2).sum(-1) / sigma**2, width) / sigma**2
    apart = points - points[:, HIPS].mean(1, keepdims=True) - observed.world
    apart = apart / WORLD_SIGMA
    slopes = (slopes - slopes[:, HIPS].mean(1, keepdims=True)) / WORLD_SIGMA[:, None]
    world = observed.weight * _cauchy((apart**2).sum(-1), width)
    count = len(points)
    weights = [np.repeat(weight[..., None], n, -1) for weight, n in ((image, 2), (world, 3))]
    return Misfit(
        np.concatenate([away, apart], 2).reshape(count, -1),
        np.concatenate(weights, 2).reshape(count, -1),
        np.concatenate([np.stack([u, v], 2), slopes], 2).reshape(count, -1, PARAMETERS),
    )


def _height_px(puppet: Puppet, postures: Postures, view: View) -> float:
    depth = np.median(postures.place[:, 1])
    return float(view.focal * puppet.body.height / max(depth, LEAST_DEPTH))


def _cauchy(squares: np.ndarray, width: float) -> np.ndarray:
    return 1 / (1 + squares / width**2)


@dataclass(frozen=True)
class Moments:
    """How stiff movements are: of each number, against speed and changes of speed."""

    speed: Float64[np.ndarray, " P"]
    change: Float64[np.ndarray, " P"]

    @classmethod
    def at(cls, frame_rate: float) -> Moments:
        """Scale the sigmas to a frame rate."""
        sigma = np.empty(PARAMETERS)
        for name, part in LAYOUT.items():
            sigma[part] = ACCELERATION[name.split(".")[0]]
        change = sigma * (30 / frame_rate) ** 2
        speed = sigma * (30 / frame_rate) / VELOCITY_SHARE
        return cls(1 / speed**2, 1 / change**2)

    def add(self, postures: Postures, band: Band, right: Float64[np.ndarray, "N P"]) -> None:
        """Add the terms that tie frames to the next ones."""
        if len(postures) < 2:
            return
        moves = postures[slice(1, None)].away_from(postures[slice(None, -1)])
        stiff = np.broadcast_to(self.speed, moves.shape)
        band.add_chain([-1.0, 1.0], stiff)
        right[1:] -= stiff * moves
        right[:-1] += stiff * moves
        if len(postures) < 3:
            return
        bends = moves[1:] - moves[:-1]
        stiff = self.change * _grouped_cauchy(bends**2 * self.change)
        band.add_chain([1.0, -2.0, 1.0], stiff)
        right[2:] -= stiff * bends
        right[1:-1] += 2 * stiff * bends
        right[:-2] -= stiff * bends


def _grouped_cauchy(squares: Float64[np.ndarray, "N P"]) -> Float64[np.ndarray, "N P"]:
    """Weigh the numbers of one joint alike."""
    out = np.empty_like(squares)
    for part in LAYOUT.values():
        out[:, part] = _cauchy(squares[:, part].mean(1, keepdims=True), SUDDEN)
    return out


class Band:
    """The normal equations of all frames, of which only near ones are tied; lower band storage.

    Args:
        blocks: What stands on the diagonal, a block a frame.
    """

    def __init__(self, blocks: Blocks) -> None:
        count, size = blocks.shape[:2]
        self._size = size
        self._rows = np.zeros((2 * size + 1, count, size))
        row, column = np.tril_indices(size)
        self._rows[row - column, :, column] = blocks[:, row, column].T

    def add_chain(self, factors: list[float], stiff: Float64[np.ndarray, "M P"]) -> None:
        """Add stiffness against a weighted sum of each number over successive frames."""
        length = len(stiff)
        for i, first in enumerate(factors):
            for j, second in enumerate(factors[: i + 1]):
                self._rows[(i - j) * self._size, j : j + length] += first * second * stiff

    def solve(self, right: Float64[np.ndarray, "N P"]) -> Float64[np.ndarray, "N P"]:
        """Solve for the step of all frames."""
        band = self._rows.reshape(len(self._rows), -1)
        return solveh_banded(band, right.ravel(), lower=True, check_finite=False).reshape(
            right.shape
        )
