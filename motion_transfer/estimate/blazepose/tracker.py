"""Following people from frame to frame with BlazePose's two networks.

Whoever was seen is looked for where the last landmarks were; the detector runs when somebody was
lost, now and then for newcomers, and in the first frame of a shot. Landmarks are smoothed by the
one-euro filter: steady when slow, without lag when fast.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from jaxtyping import UInt8

from motion_transfer.estimate.blazepose.networks import LandmarkModel, PersonDetector, SeenBody
from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.interface import mean_landmarks
from motion_transfer.estimate.models import DETECTOR, choose_landmarker, find_model

NEWCOMERS_EVERY = 12  # frames between two searches while everybody is in sight
LEAST_NEWCOMER = 0.75  # presence from which somebody is followed; ghosts have less
STEADY = 0.03
"""Shares of its side by which a region has to move or grow, and radians by which it has to turn,
before one looks elsewhere: who stands still is looked at through the same pixels. Measured: of a
still body 1.0 instead of 3.0 % of the pixels change their part from frame to frame, and of one that
turns 0.847 instead of 0.841 are right."""

SAME_PLACE = 0.25  # share of their side; regions whose middles are closer show one person

SECOND_LOOKS = 2
"""At a newcomer, each where the last one's landmarks are: nearer than where the detector points.
Measured: the right part on 0.864 instead of 0.862 of synthetic people's pixels, on 0.870 instead
of 0.865 of real photos'."""

OTHER_LOOKS = ((7.0, 1.0), (-7.0, 1.0))
"""At somebody in a photo: by how many degrees a region is turned, and how many times as large.

Measured, with a mirror for each: of 78 photos of held-out people the right part on 0.887 instead of
0.865 of the pixels, the other side's on 0.012 instead of 0.019, U and V off by 0.030 instead of
0.034; on real photos 0.880 instead of 0.877. Two more, nearer and farther, gain nothing."""

TILE_OVERLAP = 0.5
MOST_TILES = 8  # in a row or a column
LEAST_TILE_SCORE = 0.65  # more certain than in the whole frame: many looks see more ghosts
SMALLEST_TILE = 224  # the detector's own size: in fewer pixels it would not see anything more

IMAGE_SMOOTHING, WORLD_SMOOTHING = (0.05, 80.0), (0.1, 40.0)
"""Cut-off and gain of a `OneEuroFilter`, from MediaPipe's graph `pose_landmark_filtering`
(0.10.14)."""


class BodyTracker:
    """People and their landmarks, frame after frame; one object serves one thread.

    Args:
        heavy: Whether to look with the large landmark model.
        most_people: How many are followed at once; the most certain ones.
        smooth: Whether to smooth the landmarks between frames.
        frame_rate: Frames per second, for smoothing.
        mirror: Whether to look at everybody in a mirror, too, and take the mean of both looks'
            landmarks; MediaPipe's own tracker does not.
        second_looks: At somebody new; MediaPipe's has none.
        steady: The change of a region from which one looks elsewhere; MediaPipe's tracker does so
            in every frame.
    Raises: InputError where the models are missing.
    """

    def __init__(
        self,
        *,
        heavy: bool = False,
        most_people: int = 4,
        smooth: bool = True,
        frame_rate: float = 30.0,
        mirror: bool = True,
        second_looks: int = SECOND_LOOKS,
        steady: float = STEADY,
    ) -> None:
        self._detector = PersonDetector(find_model(DETECTOR))
        self._landmarker = LandmarkModel(find_model(choose_landmarker(heavy=heavy)))
        self._most_people, self._smooth = most_people, smooth
        self._mirror, self._second_looks, self._steady = mirror, second_looks, steady
        self._seconds = 1 / frame_rate
        self._numbers = 0
        self.start_shot()

    def start_shot(self) -> None:
        """Forget who was where; numbers go on."""
        self._tracks: list[_Track] = []
        self._until_search = 0

    def follow(self, frame: UInt8[np.ndarray, "H W 3"]) -> list[tuple[int, SeenBody]]:
        """Find everybody in the next frame, with their track's number, the longest known first."""
        known = len(self._tracks)
        seen: list[tuple[_Track, SeenBody]] = []
        for track in self._tracks:
            self._locate(frame, track, seen)
        self._until_search -= 1
        due = self._until_search < 0 and len(seen) < self._most_people
        if due or len(seen) < known or not seen:
            # parts of the frame cost a look each: only now and then, and while nobody is in sight
            for region in self._search(frame, everywhere=due and not seen):
                full = len(seen) == self._most_people
                if not full and not any(same_place(region, body.region) for _, body in seen):
                    self._locate(frame, _Track(-1, region), seen)
        if due:
            self._until_search = NEWCOMERS_EVERY
        self._tracks = [track for track, _ in seen]
        if self._smooth:
            seen = [(track, track.smooth(body, self._seconds)) for track, body in seen]
        return [(track.number, body) for track, body in seen]

    def look_again(self, frame: UInt8[np.ndarray, "H W 3"], body: SeenBody) -> list[SeenBody]:
        """Look at somebody through other regions, see `OTHER_LOOKS`, and in a mirror.

        Returns: What was seen first and through the others, all with the mean of all landmarks; a
            mirror's features are none that the networks know.
        """
        regions = [body.region.changed(*each) for each in OTHER_LOOKS]
        others = [self._landmarker.locate(frame, region) for region in regions]
        mirrors = [
            self._landmarker.locate(frame, region, mirrored=True)
            for region in (body.region, *regions)
        ]
        seen = [body, *(other for other in others if other is not None)]
        found = [*seen, *(mirror for mirror in mirrors if mirror is not None)]
        mean = mean_landmarks([each.landmarks for each in found])
        return [replace(each, landmarks=mean) for each in seen]

    def _locate(
        self, frame: np.ndarray, track: _Track, seen: list[tuple[_Track, SeenBody]]
    ) -> None:
        """Add the body at a track's place, unless it is nobody, or somebody seen already."""
        body = self._landmarker.locate(frame, track.region)
        for _ in range(self._second_looks if track.number < 0 else 0):
            if body is not None and body.next_region.is_usable:
                body = self._landmarker.locate(frame, body.next_region) or body
        if body is None or not body.next_region.is_usable:
            return
        if track.number < 0 and body.presence < LEAST_NEWCOMER:
            return
        # two tracks may drift onto one person: the longer known keeps it
        if any(same_place(body.next_region, other.next_region) for _, other in seen):
            return
        if track.number < 0:  # numbered only now, so that ghosts leave no gaps
            track.number, self._numbers = self._numbers, self._numbers + 1
        if track.region.change_to(body.next_region) > self._steady:
            track.region = body.next_region
        if self._mirror:
            mirrored = self._landmarker.locate(frame, body.region, mirrored=True)
            both = [look.landmarks for look in (body, mirrored) if look is not None]
            body = replace(body, landmarks=mean_landmarks(both))
        seen.append((track, body))

    def _search(self, frame: np.ndarray, *, everywhere: bool) -> list[Region]:
        """Find people in the whole frame; if asked for also in parts of it, where small ones are
        large enough for the detector."""
        found = self._detector.detect(frame)
        for tile in tiles(*frame.shape[:2]) if everywhere else ():
            for detection in self._detector.detect(frame, tile, LEAST_TILE_SCORE):
                if not any(same_place(detection.region, other.region) for other in found):
                    found.append(detection)
        return [one.region for one in sorted(found, key=lambda detection: -detection.score)]


def same_place(one: Region, other: Region) -> bool:
    """Tell whether two regions show the same person."""
    distance = np.hypot(one.x - other.x, one.y - other.y)
    return bool(distance < SAME_PLACE * min(one.side, other.side))


def tiles(height: int, width: int) -> list[Region]:
    """Cover a frame with overlapping squares: as large as its short side, then half as large."""
    squares = []
    for share in (1.0, 0.5):
        side = min(height, width) * share
        # of a frame that is nearly square, the largest square is nearly all of it: seen already
        if side < SMALLEST_TILE or (share == 1.0 and max(height, width) < 1.2 * side):
            continue
        rows, columns = _middles(height, side), _middles(width, side)
        squares += [Region(x, y, side) for y in rows for x in columns]
    return squares


def _middles(length: int, side: float) -> np.ndarray:
    """Place the centres of overlapping stretches that cover a length."""
    count = 1 + int(np.ceil((length - side) / (side * (1 - TILE_OVERLAP)) - 1e-6))
    # never more than so many, as panoramas are not searched inch by inch
    return np.linspace(side / 2, length - side / 2, max(1, min(count, MOST_TILES)))


class OneEuroFilter:
    """A filter that smooths an array which is measured again and again.

    Speeds are measured in sizes of the object a second, so that near and far people are smoothed
    alike.

    Args:
        least_cutoff: At rest, hertz; lower is steadier.
        speed_gain: How much the cut-off rises with speed, hertz for a size a second.
        speed_cutoff: For the speed itself, hertz.
    Source: Casiez, Roussel and Vogel, 1 euro filter (CHI 2012).
    """

    def __init__(self, least_cutoff: float, speed_gain: float, speed_cutoff: float = 1.0) -> None:
        self._least_cutoff, self._speed_gain = least_cutoff, speed_gain
        self._speed_cutoff = speed_cutoff
        self._value: np.ndarray | None = None
        self._speed: np.ndarray | float = 0.0
        self._raw: np.ndarray | None = None

    def __call__(self, value: np.ndarray, seconds: float, size: float = 1.0) -> np.ndarray:
        """Smooth the next value.

        Args:
            seconds: Since the last call, > 0.
            size: The object's, in the value's unit.
        """
        if self._value is None or self._raw is None:
            self._value = self._raw = value
            return value
        speed = (value - self._raw) / (size * seconds)
        share = _passed_share(self._speed_cutoff, seconds)
        self._speed = share * speed + (1 - share) * self._speed
        cutoff = self._least_cutoff + self._speed_gain * np.abs(self._speed)
        share = _passed_share(cutoff, seconds)
        self._value = (share * value + (1 - share) * self._value).astype(value.dtype)
        self._raw = value
        return self._value


def _passed_share(cutoff: np.ndarray | float, seconds: float) -> np.ndarray | float:
    """Compute how much of a new value a low pass lets through."""
    return 1 / (1 + 1 / (2 * pi * cutoff * seconds))


@dataclass
class _Track:
    """Somebody who is being followed; the number is negative for a newcomer."""

    number: int
    region: Region
    image_filter: OneEuroFilter = field(default_factory=lambda: OneEuroFilter(*IMAGE_SMOOTHING))
    world_filter: OneEuroFilter = field(default_factory=lambda: OneEuroFilter(*WORLD_SMOOTHING))

    def smooth(self, body: SeenBody, seconds: float) -> SeenBody:
        """Take the tremble out of landmarks."""
        image, world = body.landmarks.image, body.landmarks.world
        size = max(1.0, float(np.ptp(image[:, :2], axis=0).mean()))
        image, world = self.image_filter(image, seconds, size), self.world_filter(world, seconds)
        return replace(body, landmarks=replace(body.landmarks, image=image, world=world))
