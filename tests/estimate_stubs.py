"""Estimators that see coloured rectangles, and a network that says what it is told."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor, nn

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.retarget import BodyFit, fit_landmarks
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Landmarks, PersonEstimate
from motion_transfer.estimate.iuv.network import PARTS, IuvLogits
from motion_transfer.estimate.models import MODEL_FILES, find_model
from motion_transfer.media.pictures.stream import PictureStream

RED, GREEN, BLUE = (250, 0, 0), (0, 250, 0), (0, 0, 250)
COLOURS = (RED, GREEN, BLUE)


def scene(*boxes: tuple[tuple[int, int, int], Box], size=(60, 80), ground=90) -> np.ndarray:
    """A grey picture with rectangles, the later ones in front."""
    picture = np.full((*size, 3), ground, np.uint8)
    for colour, box in boxes:
        picture[box.slices] = colour
    return picture


class FramesInMemory(PictureStream):
    """Frames as a clip; counts those that were taken."""

    def __init__(self, frames: list[np.ndarray]) -> None:
        super().__init__(Path("clip"), len(frames), *frames[0].shape[:2])
        self._frames = frames
        self.taken = 0

    def read(self) -> Iterator[np.ndarray]:
        for frame in self._frames:
            self.taken += 1
            yield frame

    def where(self, index: int) -> str:
        return f"frame {index}"


class RectangleEstimator:
    """A rectangle of a pure colour is somebody: part 2, U and V from place in the box.

    Each colour is a track; what covers a rectangle is cut out of its alpha, but not of its IUV.
    """

    def __init__(self) -> None:
        self.shots = 0
        self.frames = 0

    def start_shot(self) -> None:
        self.shots += 1

    def estimate(self, frame: np.ndarray) -> list[PersonEstimate]:
        self.frames += 1
        people = []
        for track, colour in enumerate(COLOURS):
            mine = (np.abs(frame.astype(int) - colour) < 60).all(-1)
            rows, columns = np.flatnonzero(mine.any(1)), np.flatnonzero(mine.any(0))
            if not len(rows):
                continue
            box = Box(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
            iuv = np.zeros((box.height, box.width, 3), np.uint8)
            iuv[..., 0] = 2 + track
            iuv[..., 1] = np.linspace(30, 255, box.width)
            iuv[..., 2] = np.linspace(30, 255, box.height)[:, None]
            alpha = np.where(mine[box.slices], 255, 20).astype(np.uint8)
            people.append(PersonEstimate(track, box, iuv, alpha, 0.9, None))
        return people


class StandingEstimator:
    """Red above blue is somebody who stands, with landmarks: trunk and legs; fitted if asked to."""

    def __init__(self, fit: BodyFit | None = None) -> None:
        self._fit = fit

    def start_shot(self) -> None:
        pass

    def estimate(self, frame: np.ndarray) -> list[PersonEstimate]:
        red, blue = ((np.abs(frame.astype(int) - c) < 60).all(-1) for c in (RED, BLUE))
        _, regions = cv2.connectedComponents((red | blue).astype(np.uint8))
        people = []
        for track in range(1, regions.max() + 1):
            upper, lower = red & (regions == track), blue & (regions == track)
            if upper.sum() + lower.sum() > 50:
                people.append(self._somebody(track, upper, lower))
        return people

    def _somebody(self, track: int, upper: np.ndarray, lower: np.ndarray) -> PersonEstimate:
        columns = np.flatnonzero((upper | lower).any(0))[[0, -1]]
        ends = np.flatnonzero(upper.any(1))[0], np.flatnonzero(lower.any(1))[[0, -1]]
        landmarks = standing(int(columns.mean()), int(ends[0]), *(int(end) for end in ends[1]))
        if self._fit is not None:
            landmarks = fit_landmarks(landmarks, self._fit)
        rows = landmarks.image[:, 1].round().astype(int)
        hips, feet = rows[LANDMARK["left-hip"]], rows[LANDMARK["left-ankle"]]
        box = Box(int(columns[0]), int(rows.min()), int(columns[1]) + 1, int(feet) + 1)
        iuv = np.zeros((box.height, box.width, 3), np.uint8)
        iuv[..., 0] = np.where(np.arange(box.top, box.bottom) < hips, 2, 10)[:, None]
        iuv[..., 1] = np.linspace(30, 255, box.width)
        iuv[..., 2] = np.linspace(30, 255, box.height)[:, None]
        alpha = np.full((box.height, box.width), 255, np.uint8)
        return PersonEstimate(track, box, iuv, alpha, 0.9, landmarks)


def standing(x: int, top: int, hips: int, feet: int) -> Landmarks:
    """Landmarks of somebody who stands upright in a picture: rows of ears, hips and ankles."""
    neck = top + 0.3 * (hips - top)
    heights = {"shoulder": neck, "elbow": (neck + hips) / 2, "hip": hips, "knee": (hips + feet) / 2}
    heights |= dict.fromkeys(("wrist", "pinky", "index", "thumb"), hips)
    heights |= dict.fromkeys(("ankle", "heel", "foot-index"), feet)
    image = np.zeros((LANDMARK_COUNT, 3), np.float32)
    for name, row in LANDMARK.items():
        away = 6 if "left" in name else -6
        image[row, :2] = x + away * (name != "nose"), heights.get(name.partition("-")[2], top)
    world = (image - image[[LANDMARK["left-hip"], LANDMARK["right-hip"]]].mean(0)) / 50
    sure = np.ones(LANDMARK_COUNT, np.float32)
    return Landmarks(image, world, sure, sure)


class RedModel(nn.Module):
    """DensePose's interface: a red rectangle is one person, front torso above, left thigh below."""

    def forward(self, image: Tensor) -> dict[str, Tensor]:
        picture = image.int()  # blue, green, red
        mine = (picture[:, :, 2] > 170) & (picture[:, :, 0] < 90) & (picture[:, :, 1] < 90)
        rows, columns = torch.where(mine.any(1))[0], torch.where(mine.any(0))[0]
        count = 1 if len(rows) > 0 else 0
        box = torch.zeros(count, 4)
        if count > 0:
            corners = [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]
            box = torch.stack(corners)[None].float()
        fine, coarse = torch.zeros(count, 25, 32, 32), torch.zeros(count, 2, 32, 32)
        coarse[:, 1] = 9.0
        fine[:, 2, :16], fine[:, 10, 16:] = 9.0, 9.0
        ramp = torch.linspace(0.0, 1.0, 32)
        u = ramp[None, None, None, :].expand(count, 25, 32, 32)
        v = ramp[None, None, :, None].expand(count, 25, 32, 32)
        return {
            "pred_boxes": box,
            "scores": torch.ones(count),
            "pred_densepose_coarse_segm": coarse,
            "pred_densepose_fine_segm": fine,
            "pred_densepose_u": u,
            "pred_densepose_v": v,
        }


def write_red_model(path: Path) -> Path:
    """The model as a TorchScript file."""
    with warnings.catch_warnings(action="ignore"):
        torch.jit.script(RedModel()).save(str(path))
    return path


def iuv_logits(parts: np.ndarray, uv: float = 0.5) -> IuvLogits:
    """Logits that say these parts, with that U and V everywhere."""
    logits = torch.full((1, PARTS, 128, 128), -8.0)
    logits.scatter_(1, torch.from_numpy(parts).long()[None, None], 8.0)
    return IuvLogits(logits, torch.full((1, PARTS - 1, 2, 128, 128), uv))


def find_models() -> dict[str, Path]:
    """BlazePose's model files by name; a test that asks is skipped where they were not fetched."""
    try:
        return {file.name: find_model(file) for file in MODEL_FILES}
    except InputError as error:
        pytest.skip(str(error))
