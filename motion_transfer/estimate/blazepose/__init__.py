"""The estimator that needs no model of the user's: BlazePose finds people, and a small network of
this project paints their IUV from landmarks and mask."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float32, Float64, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.estimate.blazepose.details import Details, DetailsInFrame, fit_details
from motion_transfer.estimate.blazepose.networks import LandmarkModel, PersonDetector, SeenBody
from motion_transfer.estimate.blazepose.retarget import BodyFit, fit_body
from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.inference import CpuNetwork
from motion_transfer.estimate.interface import (
    AT_ONCE,
    LANDMARK,
    SIDES,
    Finish,
    PersonEstimate,
    check_frame,
)
from motion_transfer.estimate.iuv.body import MASK_SIZE, body_arrays, body_window
from motion_transfer.estimate.iuv.graph import build_graph, read_painted
from motion_transfer.estimate.iuv.painting import paint_iuv
from motion_transfer.estimate.iuv.weights import find_shipped, shipped_file
from motion_transfer.estimate.models import (
    DETECTOR,
    choose_landmarker,
    digest,
    find_model,
    wanted_files,
)
from motion_transfer.estimate.surfaces.hand_drawing import hand_room, lay_hand
from motion_transfer.estimate.surfaces.head_drawing import lay_head

__all__ = ["BlazePoseEstimator", "model_facts"]

FAINT = 0.05  # of the mask, 0..1; less is nobody
SOLID = 0.5  # of the mask; what the painting network's window is laid around


class BlazePoseEstimator:
    """What turns frames into people, one shot after another; frames come from one thread at a time.

    Args:
        heavy: Whether to look with the large landmark model, which sees more and takes 3.4 times as
            long.
        weights: Of the network that paints IUV; None means those that ship.
        most_people: How many are followed at once.
        smooth: Whether to smooth landmarks between frames; for photos that have nothing to do with
            each other call `start_shot` before each, or turn it off.
        frame_rate: Frames per second, for smoothing.
        fit: Gives everybody other proportions, before their IUV is painted.
        for_photos: Whether every frame is a photo of its own, and worth several looks at everybody
            (`BodyTracker.look_again`), of which the means count.
    Raises: InputError where the models are missing; WeightsError.
    """

    def __init__(
        self,
        *,
        heavy: bool = False,
        weights: Path | None = None,
        most_people: int = 4,
        smooth: bool = True,
        frame_rate: float = 30.0,
        fit: BodyFit | None = None,
        for_photos: bool = False,
    ) -> None:
        with ThreadPoolExecutor() as threads:  # each takes a quarter of a second
            landmarker = find_model(choose_landmarker(heavy=heavy))
            painter = partial(_open_painter, weights) if weights else partial(_open_shipped, heavy)
            network = threads.submit(painter)
            detector = threads.submit(PersonDetector, find_model(DETECTOR))
            threads.submit(LandmarkModel, landmarker).result()
            detector.result()  # the tracker finds them open
        self._network = network.result()
        smooth = smooth and not for_photos
        self._tracker = BodyTracker(
            heavy=heavy,
            most_people=most_people,
            smooth=smooth,
            frame_rate=frame_rate,
            mirror=not for_photos,  # which `look_again` sees to
        )
        self._fit, self._for_photos = fit, for_photos
        self._seconds = 1 / frame_rate if smooth else None
        self._details: DetailsInFrame | None = None

    def start_shot(self) -> None:
        """Forget who was where."""
        self._tracker.start_shot()
        self._details = None

    def estimate(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[PersonEstimate]:
        """Find the people of the next frame, the longest known first; maybe nobody.

        Raises: InputError if the frame is no RGB picture.
        """
        return self.locate(frame)()

    def locate(self, frame: UInt8[np.ndarray, "H W 3"]) -> Finish:
        """Find where the people of the next frame are, and leave it to others to paint their IUV.

        Raises: InputError if the frame is no RGB picture.
        """
        check_frame(frame)
        frame = np.ascontiguousarray(frame)
        if self._for_photos:
            self.start_shot()
        looks = [
            (number, self._tracker.look_again(frame, body) if self._for_photos else [body])
            for number, body in self._tracker.follow(frame)
        ]
        seen = [(number, bodies[0]) for number, bodies in looks]
        self._details = DetailsInFrame(frame, seen, self._details, self._seconds)
        return partial(self._finish, looks, self._details, *frame.shape[:2])

    def _finish(
        self,
        looks: list[tuple[int, list[SeenBody]]],
        details: DetailsInFrame,
        height: int,
        width: int,
    ) -> list[PersonEstimate]:
        # also where nobody is seen: each frame waits for the one before
        found = details.work_out()
        people = (
            self._paint(number, bodies, found[number], height, width) for number, bodies in looks
        )
        return [person for person in people if person is not None]

    def _paint(
        self, number: int, looks: list[SeenBody], details: Details, height: int, width: int
    ) -> PersonEstimate | None:
        """Paint one person, whom every look sees in the same pose."""
        if self._fit is not None:
            fitted = [fit_body(body, self._fit) for body in looks]
            seen, now = looks[0].landmarks, fitted[0].landmarks
            details, looks = fit_details(details, seen, now, self._fit), fitted
        body = looks[0]
        box = _box_on_frame(body, height, width, FAINT)
        if box is None:
            return None
        face = details.get("face")
        sides = [side for side in SIDES if side in details]
        # the farther one first
        sides.sort(key=lambda side: -body.landmarks.image[LANDMARK[f"{side}-wrist"], 2])
        hands = {side: details[side] for side in sides}
        for points in hands.values():
            box = hand_room(points, box, height, width)
        window = body_window(body.landmarks, _box_on_frame(body, height, width, SOLID))
        iuv = paint_iuv(*read_painted(self._run_network(looks, window)), window, box)
        if face is not None:
            lay_head(iuv, box, face)
        for side, points in hands.items():
            lay_hand(iuv, box, side, points, body.landmarks)
        return PersonEstimate(
            track=number,
            box=box,
            iuv=iuv,
            alpha=_mean_alpha(looks, box),
            confidence=body.presence,
            landmarks=body.landmarks,
        )

    def _run_network(self, looks: list[SeenBody], window: Box) -> Float32[np.ndarray, "1 73 n n"]:
        """Give the mean of what the network says of each look; the next call may overwrite it."""
        painted = self._ask_network(looks[0], window)
        if len(looks) == 1:
            return painted
        painted = painted.copy()  # the network's next answer overwrites this one
        for body in looks[1:]:
            painted += self._ask_network(body, window)
        painted /= len(looks)
        return painted

    def _ask_network(self, body: SeenBody, window: Box) -> Float32[np.ndarray, "1 73 n n"]:
        # it shrinks the mask to its own size: no need to see it much finer
        mask = _mask_in(body, window, min(window.width, 2 * MASK_SIZE))
        features = body.features.look(_into(window)) if body.features else None
        (painted,) = self._network.run(*body_arrays(body.landmarks, mask, features, window))
        return painted


@cache
def _open_shipped(heavy: bool) -> CpuNetwork:
    return _open_painter(find_shipped(heavy=heavy))


def _open_painter(weights: Path) -> CpuNetwork:
    return CpuNetwork(build_graph(weights), at_once=AT_ONCE)


def model_facts(_model: None = None, *, heavy: bool = False) -> dict[str, Any]:
    """Tell what decides the answers, for keys of content: the models, and the network's weights."""
    network = shipped_file(heavy=heavy)
    return {
        "models": [file.sha256 for file in wanted_files(heavy=heavy)],
        "network": digest(network.read_bytes()) if network.is_file() else None,
    }


def _box_on_frame(body: SeenBody, height: int, width: int, level: float) -> Box | None:
    """Find the box of the frame that holds what a body's mask covers; None if that is nothing."""
    left, top, across, down = cv2.boundingRect((body.mask > level).view(np.uint8))
    if not across:
        return None
    ends = np.array([[left, top], [left + across, top + down]], np.float32)
    # all four corners, as the region may be turned
    corners = np.array([[x, y] for x in ends[:, 0] for y in ends[:, 1]], np.float32)
    on_frame = body.region.to_frame(corners / body.mask.shape[0])
    low = np.floor(on_frame.min(0)).clip(0).astype(int)
    high = np.ceil(on_frame.max(0)).astype(int).clip(max=(width, height))
    if (high <= low).any():
        return None
    return Box(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _mean_alpha(looks: list[SeenBody], box: Box) -> UInt8[np.ndarray, "h w"]:
    seen = [body.region.paste(np.rint(body.mask * 255).astype(np.uint8), box) for body in looks]
    return seen[0] if len(seen) == 1 else np.rint(np.mean(seen, 0)).astype(np.uint8)


def _into(window: Box) -> Float64[np.ndarray, "2 3"]:
    """From frame coordinates to the window's own."""
    scale = 1 / window.width
    return np.array([[scale, 0, -window.left * scale], [0, scale, -window.top * scale]])


def _mask_in(body: SeenBody, window: Box, size: int) -> Float32[np.ndarray, "size size"]:
    """Look at the mask in a window, at size x size."""
    scale = size / window.width
    to_mask = cv2.invertAffineTransform(body.region.matrix(body.mask.shape[0]))
    to_frame = np.array([[1 / scale, 0, window.left], [0, 1 / scale, window.top], [0, 0, 1]])
    to_frame[:2, 2] += 0.5 / scale - 0.5  # OpenCV's whole numbers are pixel centres
    way = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(body.mask, (to_mask @ to_frame)[:2], (size, size), flags=way)
