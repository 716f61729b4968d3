"""The estimator that needs no model of the user's: BlazePose finds people, a small network of this
project paints their IUV from landmarks and mask."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose_landmarks import SeenBody
from motion_transfer.estimate.blazepose_tracker import BodyTracker
from motion_transfer.estimate.body_features import body_input, body_window
from motion_transfer.estimate.body_fit import fit_body
from motion_transfer.estimate.interface import Box, PersonEstimate
from motion_transfer.estimate.iuv_network import IuvNetwork
from motion_transfer.estimate.iuv_painting import paint_iuv
from motion_transfer.estimate.iuv_weights import load_shipped
from motion_transfer.estimate.proportions import BodyFit

FAINT = 0.05
"""Of the mask; less is nobody."""

SOLID = 0.5


class BlazePoseEstimator:
    """Frames to people; one object serves one thread and one shot after another.

    Args:
        network: paints IUV; None: the weights that ship.
        most_people: how many are followed at once.
        smooth: smooth landmarks between frames; for photos that have nothing to do with each other
            call `start_shot` before each, or turn it off.
        frame_rate: frames per second, for smoothing.
        threads: of each of BlazePose's networks; the painting network uses torch's.
        fit: gives everybody other proportions, before their IUV is painted.
    Raises: InputError where the models or their package are missing; WeightsError.
    """

    def __init__(
        self,
        *,
        network: IuvNetwork | None = None,
        most_people: int = 4,
        smooth: bool = True,
        frame_rate: float = 30.0,
        threads: int = 1,
        fit: BodyFit | None = None,
    ) -> None:
        self._tracker = BodyTracker(
            most_people=most_people, smooth=smooth, frame_rate=frame_rate, threads=threads
        )
        self._network = network.fused() if network else load_shipped()
        self._fit = fit

    def start_shot(self) -> None:
        """Forget who was where."""
        self._tracker.start_shot()

    def estimate(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[PersonEstimate]:
        """The people of the next frame, the longest known first; maybe nobody.

        Raises: InputError if the frame is no RGB picture.
        """
        if frame.ndim != 3 or frame.shape[2] != 3 or frame.dtype != np.uint8 or not frame.size:
            raise InputError(
                f"a frame of shape {frame.shape} and type {frame.dtype}; RGB of 8 bits (H x W x 3)"
                " is needed"
            )
        people = []
        for number, body in self._tracker.follow(np.ascontiguousarray(frame)):
            if (person := self._painted(number, body, *frame.shape[:2])) is not None:
                people.append(person)
        return people

    def _painted(
        self, number: int, body: SeenBody, height: int, width: int
    ) -> PersonEstimate | None:
        if self._fit is not None:
            body = fit_body(body, self._fit)
        box = mask_on_frame(body, height, width, FAINT)
        if box is None:
            return None
        window = body_window(body.landmarks, mask_on_frame(body, height, width, SOLID))
        # the network looks at 256 x 256: no need to see the mask finer
        size = min(window.width, 2 * 256)
        scale = size / window.width
        seen = _mask_in(body, window, size, scale)
        with torch.inference_mode():
            logits = self._network(body_input(body.landmarks, seen, window))
            iuv = paint_iuv(logits, window, box)
        mask = np.rint(body.mask * 255).astype(np.uint8)
        return PersonEstimate(
            track=number,
            box=box,
            iuv=iuv,
            alpha=body.region.paste(mask, box),
            confidence=body.presence,
            landmarks=body.landmarks,
        )


def mask_on_frame(body: SeenBody, height: int, width: int, level: float) -> Box | None:
    """The box of the frame that holds what a body's mask covers; None if that is nothing."""
    rows, columns = np.nonzero(body.mask > level)
    if not len(rows):
        return None
    size = body.mask.shape[0]
    ends = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]], np.float32)
    corners = np.array([[x, y] for x in ends[:, 0] for y in ends[:, 1]], np.float32)
    on_frame = body.region.to_frame(corners / size)
    low = np.floor(on_frame.min(0)).clip(0).astype(int)
    high = np.ceil(on_frame.max(0)).astype(int).clip(max=(width, height))
    if (high <= low).any():
        return None
    return Box(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _mask_in(
    body: SeenBody, window: Box, size: int, scale: float
) -> Float32[np.ndarray, "size size"]:
    """The mask in a window, at size x size."""
    matrix = cv2.invertAffineTransform(body.region.matrix(body.mask.shape[0]))
    step = np.array([[1 / scale, 0, window.left], [0, 1 / scale, window.top], [0, 0, 1]])
    step[:2, 2] += 0.5 / scale - 0.5  # OpenCV's whole numbers are pixel centres
    return cv2.warpAffine(
        body.mask,
        (matrix @ step)[:2],
        (size, size),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
    )
