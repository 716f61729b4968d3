"""Following people from frame to frame with BlazePose's two networks.

Whoever was seen is looked for where the last landmarks were; the detector runs when somebody was
lost, now and then for newcomers, and in the first frame of a shot.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import UInt8

from motion_transfer.estimate.blazepose_detector import Detection, PersonDetector
from motion_transfer.estimate.blazepose_landmarks import LandmarkModel, SeenBody
from motion_transfer.estimate.interface import Landmarks
from motion_transfer.estimate.model_files import DETECTOR, LANDMARKER, find_model
from motion_transfer.estimate.one_euro import IMAGE_SMOOTHNESS, WORLD_SMOOTHNESS, OneEuroFilter
from motion_transfer.estimate.region import Region

NEWCOMERS_EVERY = 12
"""Frames between two searches while everybody is in sight."""

SAME_PLACE = 0.25
"""Regions whose middles are closer than this share of their side show one person."""

LEAST_NEWCOMER = 0.75
"""Presence from which somebody is followed; ghosts have less."""

SECOND_LOOKS = 2
"""At a newcomer, each where the last one's landmarks are: nearer than where the detector points.
Measured: the right part on 0.864 instead of 0.862 of synthetic people's pixels, on 0.870 instead
of 0.865 of real photos'."""

TILE_OVERLAP = 0.5
MOST_TILES = 8
LEAST_TILE_SCORE = 0.65
"""More certain than in the whole frame: many looks see more ghosts."""

SMALLEST_TILE = 224
"""A tile of fewer pixels than the detector's own holds nothing that it would not see anyway."""


@dataclass
class Track:
    """Somebody who is being followed."""

    number: int
    region: Region
    image_filter: OneEuroFilter = field(default_factory=lambda: OneEuroFilter(IMAGE_SMOOTHNESS))
    world_filter: OneEuroFilter = field(default_factory=lambda: OneEuroFilter(WORLD_SMOOTHNESS))

    def smooth(self, landmarks: Landmarks, seconds: float) -> Landmarks:
        """The landmarks without their tremble."""
        size = float(np.ptp(landmarks.image[:, :2], axis=0).mean())
        return replace(
            landmarks,
            image=self.image_filter(landmarks.image, seconds, max(size, 1.0)),
            world=self.world_filter(landmarks.world, seconds),
        )


class BodyTracker:
    """People and their landmarks, frame after frame; one object serves one thread.

    Args:
        most_people: how many are followed at once; the most certain ones.
        smooth: smooth the landmarks between frames.
        frame_rate: frames per second, for smoothing.
        threads: of each network.
        second_looks: at somebody new; MediaPipe's own tracker has none.
    Raises: InputError where the models or the package that runs them are missing.
    """

    def __init__(
        self,
        *,
        most_people: int = 4,
        smooth: bool = True,
        frame_rate: float = 30.0,
        threads: int = 1,
        second_looks: int = SECOND_LOOKS,
    ) -> None:
        self._detector = PersonDetector(find_model(DETECTOR), threads)
        self._landmarker = LandmarkModel(find_model(LANDMARKER), threads)
        self._most_people, self._smooth = most_people, smooth
        self._second_looks = second_looks
        self._seconds = 1 / frame_rate
        self._numbers = 0
        self.start_shot()

    def start_shot(self) -> None:
        """Forget who was where; numbers go on."""
        self._tracks: list[Track] = []
        self._until_search = 0

    def follow(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[tuple[int, SeenBody]]:
        """Everybody in the next frame with their track's number, the longest known first."""
        known = len(self._tracks)
        seen: list[tuple[Track, SeenBody]] = []
        for track in self._tracks:
            self._look(frame, track, seen)
        self._until_search -= 1
        due = self._until_search < 0 and len(seen) < self._most_people
        if due or len(seen) < known or not seen:
            self._add_newcomers(frame, seen, everywhere=due and not seen)
        if due:
            self._until_search = NEWCOMERS_EVERY
        self._tracks = [track for track, _ in seen]
        return [(track.number, self._finished(track, body)) for track, body in seen]

    def _add_newcomers(
        self, frame: np.ndarray, seen: list[tuple[Track, SeenBody]], *, everywhere: bool
    ) -> None:
        for found in self._search(frame, everywhere=everywhere):
            if len(seen) == self._most_people:
                return
            if not any(same_place(found.region, body.region) for _, body in seen):
                self._look(frame, Track(-1, found.region), seen)

    def _look(self, frame: np.ndarray, track: Track, seen: list[tuple[Track, SeenBody]]) -> None:
        """Add the body at a track's place, unless it is nobody, or somebody seen already."""
        body = self._landmarker.look(frame, track.region)
        for _ in range(self._second_looks if track.number < 0 else 0):
            if body is not None and body.next_region.is_usable:
                body = self._landmarker.look(frame, body.next_region) or body
        if body is None or not body.next_region.is_usable:
            return
        if track.number < 0 and body.presence < LEAST_NEWCOMER:
            return
        if any(same_place(body.next_region, other.next_region) for _, other in seen):
            return
        if track.number < 0:
            track.number, self._numbers = self._numbers, self._numbers + 1
        track.region = body.next_region
        seen.append((track, body))

    def _finished(self, track: Track, body: SeenBody) -> SeenBody:
        if not self._smooth:
            return body
        return replace(body, landmarks=track.smooth(body.landmarks, self._seconds))

    def _search(self, frame: np.ndarray, *, everywhere: bool) -> list[Detection]:
        """People in the whole frame; if asked for also in parts of it, where small ones are large
        enough for the detector."""
        found = self._detector.detect(frame)
        for tile in tiles(*frame.shape[:2]) if everywhere else ():
            for detection in self._detector.detect_in(frame, tile, LEAST_TILE_SCORE):
                if not any(same_place(detection.region, other.region) for other in found):
                    found.append(detection)
        return sorted(found, key=lambda detection: -detection.score)


def same_place(one: Region, other: Region) -> bool:
    """Whether two regions show the same person."""
    distance = np.hypot(one.x - other.x, one.y - other.y)
    return bool(distance < SAME_PLACE * min(one.side, other.side))


def tiles(height: int, width: int) -> list[Region]:
    """Overlapping squares that cover a frame: as large as its short side, then half as large."""
    squares = []
    for share in (1.0, 0.5):
        side = min(height, width) * share
        if side < SMALLEST_TILE or (share == 1.0 and max(height, width) < 1.2 * side):
            continue
        rows, columns = _middles(height, side), _middles(width, side)
        squares += [Region(x, y, side) for y in rows for x in columns]
    return squares


def _middles(length: int, side: float) -> np.ndarray:
    """Centres of overlapping stretches that cover a length; no more than `MOST_TILES`, as
    panoramas are not searched inch by inch."""
    count = 1 + int(np.ceil((length - side) / (side * (1 - TILE_OVERLAP)) - 1e-6))
    return np.linspace(side / 2, length - side / 2, max(1, min(count, MOST_TILES)))
