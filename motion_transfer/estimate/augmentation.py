"""Samples made to look like what BlazePose gives on real photos: its errors, and its views.

Everything follows from one random generator.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.body_features import MASK_SIZE, BodyInput, body_input, body_window
from motion_transfer.estimate.interface import LANDMARK_NAMES, Box, Landmarks
from motion_transfer.estimate.iuv_network import OUTPUT_SIZE
from motion_transfer.estimate.samples import Sample

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


@dataclass(frozen=True)
class Augmentation:
    """How much is changed; shares of samples, or sizes in heights of the body.

    Attributes:
        exact: share that gets the true landmarks (with `exact_jitter`), not BlazePose's.
        exact_mask: share that gets the true alpha, softened, not BlazePose's mask.
        jitter, exact_jitter: standard deviation of each landmark, at most.
        depth_jitter: of each depth in metres; depths are also scaled by up to `depth_scale`.
        lost_limb: share in which a limb's landmarks are elsewhere, invisible.
        cut: share whose picture ends somewhere in the body.
        turn_degrees, zoom, shift: of the window, at most; shift is a share of its side.
    """

    exact: float = 0.2
    exact_mask: float = 0.3
    jitter: float = 0.006
    exact_jitter: float = 0.015
    depth_jitter: float = 0.04
    depth_scale: float = 0.25
    lost_limb: float = 0.06
    cut: float = 0.15
    turn_degrees: float = 12.0
    zoom: float = 0.15
    shift: float = 0.05


NOTHING = Augmentation(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
"""As BlazePose says, for evaluation."""


def training_pair(
    sample: Sample, settings: Augmentation, rng: Rng
) -> tuple[BodyInput, UInt8[np.ndarray, "128 128 3"]] | None:
    """What the network gets and what it should answer; None where BlazePose saw nobody and its own
    view was asked for."""
    use_exact = rng.random() < settings.exact
    landmarks = sample.exact if use_exact else sample.seen
    if landmarks is None:
        return None
    tall = float(np.ptp(sample.exact.image[:, 1]))
    landmarks = _jittered(landmarks, settings, tall, use_exact, rng)
    mask = sample.mask.astype(np.float32) / 255
    if sample.seen is None or rng.random() < settings.exact_mask:
        mask = _softened(sample.alpha.astype(np.float32) / 255, rng)
    iuv = sample.iuv
    if rng.random() < settings.cut:
        iuv, mask, landmarks = _cut(iuv, mask, landmarks, rng)
    window = body_window(landmarks, mask_box(mask))
    matrix = _view(window, settings, rng)
    seen = _warped(mask, matrix, window.width, MASK_SIZE, cv2.INTER_LINEAR)
    answer = _warped(iuv, matrix, window.width, OUTPUT_SIZE, cv2.INTER_NEAREST)
    moved = _moved(landmarks, matrix)
    own = Box(0, 0, window.width, window.width)
    return body_input(moved, seen, own), answer


def mask_box(mask: Float32[np.ndarray, "H W"], level: float = 0.5) -> Box | None:
    """What a mask covers; None if that is nothing."""
    rows, columns = (np.flatnonzero((mask > level).any(axis)) for axis in (1, 0))
    if not len(rows):
        return None
    return Box(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)


def _jittered(
    landmarks: Landmarks, settings: Augmentation, tall: float, exact: bool, rng: Rng
) -> Landmarks:
    most = settings.exact_jitter if exact else settings.jitter
    sigma = most * rng.random()
    image, world = landmarks.image.copy(), landmarks.world.copy()
    visibility = landmarks.visibility.copy()
    moves = rng.normal(0, 1, image.shape) * sigma
    image += (moves * tall).astype(np.float32)
    world[:, :2] += moves[:, :2] * 1.7  # metres of an average body
    scale = 1 + rng.uniform(-1, 1) * settings.depth_scale
    world[:, 2] = world[:, 2] * scale + rng.normal(0, settings.depth_jitter * rng.random(), 33)
    image[:, 2] *= scale
    if rng.random() < settings.lost_limb:
        limb = list(LIMBS[rng.integers(len(LIMBS))])
        away = rng.normal(0, 0.06, (1, 3)) + rng.normal(0, 0.02, (len(limb), 3))
        image[limb] += away * tall
        world[limb] += away * 1.7
        visibility[limb] *= rng.uniform(0, 0.5)
    if exact:  # BlazePose is never quite sure
        visibility = np.abs(visibility - np.abs(rng.normal(0, 0.12, 33))).clip(0, 1)
    return replace(
        landmarks,
        image=image.astype(np.float32),
        world=world.astype(np.float32),
        visibility=visibility.astype(np.float32),
    )


def _softened(alpha: Float32[np.ndarray, "H W"], rng: Rng) -> Float32[np.ndarray, "H W"]:
    """A little fatter or thinner, with a soft edge, as networks see borders."""
    sigma = rng.uniform(0.6, 3.0)
    soft = cv2.GaussianBlur(alpha, (0, 0), sigma)
    level = rng.uniform(0.3, 0.7)
    return ((soft - level) * rng.uniform(1.5, 4) + 0.5).clip(0, 1).astype(np.float32)


def _cut(
    iuv: np.ndarray, mask: np.ndarray, landmarks: Landmarks, rng: Rng
) -> tuple[np.ndarray, np.ndarray, Landmarks]:
    """The picture ends at a line through the body; landmarks beyond are guesses."""
    box = mask_box(mask)
    if box is None:
        return iuv, mask, landmarks
    iuv, mask = iuv.copy(), mask.copy()
    presence = landmarks.presence.copy()
    visibility = landmarks.visibility.copy()
    x, y = landmarks.image[:, 0], landmarks.image[:, 1]
    side = rng.choice(["bottom", "bottom", "bottom", "left", "right", "top"])
    share = rng.uniform(0.1, 0.6) if side == "bottom" else rng.uniform(0.05, 0.3)
    if side in ("bottom", "top"):
        down = side == "bottom"
        line = round(box.bottom - share * box.height if down else box.top + share * box.height)
        gone, rows = (y > line, slice(line, None)) if down else (y < line, slice(0, line))
        iuv[rows], mask[rows] = 0, 0
    else:
        left = side == "left"
        line = round(box.left + share * box.width if left else box.right - share * box.width)
        gone, columns = (x < line, slice(0, line)) if left else (x > line, slice(line, None))
        iuv[:, columns], mask[:, columns] = 0, 0
    presence[gone] *= 0.1
    visibility[gone] *= rng.uniform(0, 0.6)
    guess = landmarks.image.copy()
    tall = float(np.ptp(guess[:, 1]))
    guess[gone] += (rng.normal(0, 0.02, (33, 3)) * tall)[gone].astype(np.float32)
    return iuv, mask, replace(landmarks, image=guess, presence=presence, visibility=visibility)


def _view(window: Box, settings: Augmentation, rng: Rng) -> np.ndarray:
    """2 x 3: frame pixels -> window pixels, the window turned, zoomed and shifted a little."""
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
    world[:, :2] = world[:, :2] @ (matrix[:, :2] / zoom).T
    return replace(landmarks, image=image.astype(np.float32), world=world.astype(np.float32))
