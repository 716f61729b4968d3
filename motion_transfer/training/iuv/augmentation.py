"""Samples made to look like what BlazePose gives on real photos: its errors, and its views.

Everything follows from one random generator. All shares, sizes and ranges were chosen by eye, wide
enough to cover how BlazePose errs.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.interface import LANDMARK_COUNT, LANDMARK_NAMES, Landmarks
from motion_transfer.estimate.iuv.body import MASK_SIZE, body_window
from motion_transfer.estimate.iuv.features import BodyInput, body_input
from motion_transfer.estimate.iuv.network import OUTPUT_SIZE
from motion_transfer.training.iuv.samples import Sample

Rng = np.random.Generator

LIMBS: tuple[tuple[int, ...], ...] = tuple(
    tuple(i for i, name in enumerate(LANDMARK_NAMES) if name in wanted)
    for side in ("left", "right")
    for wanted in (
        {f"{side}-{joint}" for joint in ("elbow", "wrist", "pinky", "index", "thumb")},
        {f"{side}-{joint}" for joint in ("wrist", "pinky", "index", "thumb")},
        {f"{side}-{joint}" for joint in ("knee", "ankle", "heel", "foot-index")},
        {f"{side}-{joint}" for joint in ("ankle", "heel", "foot-index")},
    )
)
"""What BlazePose loses together."""

BODY_METRES = 1.7  # an average body, to turn shares of a body's height into metres
LIMB_AWAY, JOINT_AWAY = 0.06, 0.02  # heights: errors of a lost limb, and of its landmarks besides
LOST_VISIBILITY = 0.5  # what is left of it, at most
DOUBT = 0.12  # by about so much BlazePose is less sure than the truth
SOFT_PX, EDGE, SLOPE = (0.6, 3.0), (0.3, 0.7), (1.5, 4)  # a mask's border; at 0.5 it is the alpha's


@dataclass(frozen=True)
class Augmentation:
    """How much is changed; shares of samples, or sizes in heights of the body.

    Attributes:
        exact: The share that gets the true landmarks (with `exact_jitter`), not BlazePose's.
        exact_mask: The share that gets the true alpha, softened, not BlazePose's mask.
        jitter, exact_jitter: The standard deviation of each landmark, at most.
        depth_jitter: That of each depth in metres; depths are also scaled by up to `depth_scale`.
        lost_limb: The share in which a limb's landmarks are elsewhere, invisible.
        gain: The standard deviation of a factor on each feature channel, at most: synthetic people
            do not excite all of them as real ones do.
        blind: The share without features, as if BlazePose had not looked at this very body.
        turn_degrees, zoom, shift: Of the window, at most; shift is a share of its side.
    """

    exact: float = 0.2
    exact_mask: float = 0.3
    jitter: float = 0.006
    exact_jitter: float = 0.015
    depth_jitter: float = 0.04
    depth_scale: float = 0.25
    lost_limb: float = 0.06
    gain: float = 0.2
    blind: float = 0.08
    turn_degrees: float = 12.0
    zoom: float = 0.15
    shift: float = 0.05


NOTHING = Augmentation(*(0,) * len(fields(Augmentation)))
"""What BlazePose says is left as it is, for evaluation."""


def training_pair(
    sample: Sample, settings: Augmentation, rng: Rng
) -> tuple[BodyInput, UInt8[np.ndarray, "128 128 3"]] | None:
    """Make what the network gets and what it should answer.

    Returns: None where BlazePose saw nobody and its own view was asked for.
    """
    use_exact = rng.random() < settings.exact
    landmarks = sample.exact if use_exact else sample.seen
    if landmarks is None:
        return None
    tall = float(np.ptp(sample.exact.image[:, 1]))
    landmarks = _jittered(landmarks, settings, tall, use_exact, rng)
    mask = sample.mask.astype(np.float32) / 255
    if sample.seen is None or rng.random() < settings.exact_mask:
        mask = _softened(sample.alpha.astype(np.float32) / 255, rng)
    window = body_window(landmarks, mask_box(mask))
    matrix = _view(window, settings, rng)
    seen = _warped(mask, matrix, window.width, MASK_SIZE, cv2.INTER_LINEAR)
    answer = _warped(sample.iuv, matrix, window.width, OUTPUT_SIZE, cv2.INTER_NEAREST)
    moved = _moved(landmarks, matrix)
    features = None
    if sample.features is not None and rng.random() >= settings.blind:
        gain = settings.gain * rng.random()
        coarse, fine = (
            each * (1 + gain * rng.standard_normal(each.shape[-1], np.float32))
            for each in sample.features.look(matrix / window.width)
        )
        features = coarse, fine
    own = Box(0, 0, window.width, window.width)
    return body_input(moved, seen, features, own), answer


def mask_box(mask: Float32[np.ndarray, "H W"]) -> Box | None:
    """Find the box around what a mask covers by more than half; None if that is nothing."""
    left, top, width, height = cv2.boundingRect((mask > 0.5).astype(np.uint8))
    return Box(left, top, left + width, top + height) if width else None


def _jittered(
    landmarks: Landmarks, settings: Augmentation, tall: float, exact: bool, rng: Rng
) -> Landmarks:
    most = settings.exact_jitter if exact else settings.jitter
    sigma = most * rng.random()  # of this sample: some are nearly exact
    image, world = landmarks.image.copy(), landmarks.world.copy()
    visibility = landmarks.visibility.copy()
    moves = rng.normal(0, 1, image.shape) * sigma
    image += (moves * tall).astype(np.float32)
    world[:, :2] += moves[:, :2] * BODY_METRES
    scale = 1 + rng.uniform(-1, 1) * settings.depth_scale
    noise = rng.normal(0, settings.depth_jitter * rng.random(), LANDMARK_COUNT)
    world[:, 2] = world[:, 2] * scale + noise
    image[:, 2] *= scale
    if rng.random() < settings.lost_limb:
        limb = list(LIMBS[rng.integers(len(LIMBS))])
        away = rng.normal(0, LIMB_AWAY, (1, 3)) + rng.normal(0, JOINT_AWAY, (len(limb), 3))
        image[limb] += away * tall
        world[limb] += away * BODY_METRES
        visibility[limb] *= rng.uniform(0, LOST_VISIBILITY)
    if exact:  # BlazePose is never quite sure
        doubt = np.abs(rng.normal(0, DOUBT, LANDMARK_COUNT))
        visibility = np.abs(visibility - doubt).clip(0, 1)
    return _replaced(landmarks, image=image, world=world, visibility=visibility)


def _replaced(landmarks: Landmarks, **arrays: np.ndarray) -> Landmarks:
    return replace(landmarks, **{name: new.astype(np.float32) for name, new in arrays.items()})


def _softened(alpha: Float32[np.ndarray, "H W"], rng: Rng) -> Float32[np.ndarray, "H W"]:
    """A little fatter or thinner, with a soft edge, as networks see borders."""
    soft = cv2.GaussianBlur(alpha, (0, 0), rng.uniform(*SOFT_PX))
    level = rng.uniform(*EDGE)
    return ((soft - level) * rng.uniform(*SLOPE) + 0.5).clip(0, 1).astype(np.float32)


def _view(window: Box, settings: Augmentation, rng: Rng) -> np.ndarray:
    """2 x 3: frame pixels -> window pixels, the window turned, zoomed and shifted a little."""
    # the product of two draws: most windows are nearly upright
    turn = np.radians(settings.turn_degrees) * rng.uniform(-1, 1) * rng.random()
    zoom = 1 + settings.zoom * rng.uniform(-1, 1)
    side = window.width
    middle = np.array([window.left, window.top]) + side / 2
    target = np.full(2, side / 2) + settings.shift * side * rng.uniform(-1, 1, 2)
    c, s = np.cos(turn) * zoom, np.sin(turn) * zoom
    matrix = np.array([[c, -s], [s, c]])
    return np.concatenate([matrix, (target - matrix @ middle)[:, None]], 1)


def _warped(image: np.ndarray, matrix: np.ndarray, side: int, size: int, way: int) -> np.ndarray:
    """An image in the window, at size x size."""
    scaled = matrix * (size / side)
    # OpenCV's whole numbers are pixel centres
    scaled[:, 2] += scaled[:, :2] @ (0.5, 0.5) - 0.5
    return cv2.warpAffine(image, scaled, (size, size), flags=way)


def _moved(landmarks: Landmarks, matrix: np.ndarray) -> Landmarks:
    image, world = landmarks.image.copy(), landmarks.world.copy()
    image[:, :2] = image[:, :2] @ matrix[:, :2].T + matrix[:, 2]
    zoom = np.hypot(*matrix[:, 0])
    image[:, 2] *= zoom
    world[:, :2] = world[:, :2] @ (matrix[:, :2] / zoom).T  # metres do not grow with the picture
    return _replaced(landmarks, image=image, world=world)
