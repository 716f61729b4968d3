"""Hands and faces of the people in a frame, seen by networks of their own and steadied over time.

A detail is an array of points on the frame; its name is a side's hand (`left`, `right`) or `face`.
Frames are finished side by side, so a frame's details are found whenever a thread comes to them,
but steadied in the order of the frames: whoever needs those of a frame first finds those of the
frames before, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from threading import Lock

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.estimate.blazepose.faces import find_face
from motion_transfer.estimate.blazepose.hands import find_hands
from motion_transfer.estimate.blazepose.networks import SeenBody
from motion_transfer.estimate.blazepose.retarget import BodyFit
from motion_transfer.estimate.blazepose.tracker import OneEuroFilter
from motion_transfer.estimate.interface import LANDMARK, SIDES, Landmarks
from motion_transfer.estimate.surfaces.head_surface import load_head

Details = dict[str, Float32[np.ndarray, "N 3"]]
Filters = dict[tuple[int, str], OneEuroFilter]

SMOOTHING = (1.0, 20.0)
"""Cut-off and gain of a `OneEuroFilter`, the size being the detail's own."""


ANCHORS: dict[str, tuple[str, str]] = {
    "left": ("left-wrist", "lower-arm"),
    "right": ("right-wrist", "lower-arm"),
    "face": ("nose", "head"),
}
"""The landmark that a detail hangs on, and the bone whose scale is its own."""

FOLLOWED = {
    **{
        side: [LANDMARK[f"{side}-{name}"] for name in ("wrist", "index", "pinky")] for side in SIDES
    },
    "face": list(range(LANDMARK["mouth-right"] + 1)),
}
"""The landmarks whose mean a detail moves with."""

TURNS = (("left", "face"), ("right",))
"""What is looked at in turns, frame by frame; the rest moves along with the body meanwhile."""

MOST_SECONDS = 1 / 20
"""Between frames that take turns; farther apart all details are looked at in each frame."""


LOOKS_MISSED = 2
"""So many looks in a row may see no face where one was before: it moves along meanwhile, as fast
heads blur, and heads that lose and find their direction flicker."""

LEAST_AHEAD = 0.64
"""Cosine of the angle, 50 degrees, by which a face that is missed may have looked past the camera:
one that looked farther away has likely turned, and is not held."""


class DetailsInFrame:
    """The details of everybody in a frame; threads may share it.

    Args:
        before: Those of the frame before, of the same shot.
        seconds: Since then, for smoothing; None smooths nothing.
    """

    def __init__(
        self,
        frame: UInt8[np.ndarray, "H W 3"],
        people: Sequence[tuple[int, SeenBody]],
        before: DetailsInFrame | None,
        seconds: float | None,
    ) -> None:
        self._before = before if seconds else None
        self._seconds = seconds
        self._landmarks = {number: body.landmarks for number, body in people}
        takes_turns = self._before is not None and seconds is not None and seconds <= MOST_SECONDS
        self._turn = (self._before._turn + 1) % len(TURNS) if self._before and takes_turns else 0
        known = self._before._landmarks if self._before and takes_turns else {}
        self._known = known.keys()
        self._names = {
            number: TURNS[self._turn] if number in known else tuple(ANCHORS)
            for number in self._landmarks
        }
        self._find = partial(_find_details, frame, self._landmarks, self._names)
        self._lock = Lock()
        self._found: dict[int, Details] | None = None
        self._missed: dict[int, int] = {}  # looks since a face was seen
        self._filters: Filters = {}

    def work_out(self) -> dict[int, Details]:
        """Find the details of everybody, by their tracks' numbers, unless that was done before."""
        with self._lock:
            if self._found is None:
                found = self._find()
                if self._before is not None:
                    found = self._take_along(found, self._before.work_out(), self._before)
                    self._filters = self._before._filters
                if self._seconds:
                    found = self._smooth(found, self._seconds)
                self._found = found
                # nobody asks for frames and details of the past any more
                self._find, self._before = dict, None
            return self._found

    def _take_along(
        self, found: dict[int, Details], earlier: dict[int, Details], before: DetailsInFrame
    ) -> dict[int, Details]:
        """Add what was not looked at, and faces that were just seen: where they were, moved as the
        body's landmarks there did."""
        for number, details in found.items():
            for name, points in earlier.get(number, {}).items():
                due = name in self._names[number]
                if name == "face" and name not in details:
                    missed = before._missed.get(number, 0) + due
                    given_up = missed > LOOKS_MISSED or number not in self._known
                    self._missed[number] = missed
                    due = given_up or (missed > 0 and _looks_aside(points))
                if not due:
                    moved = points.copy()
                    new, old = (
                        each._landmarks[number].image[FOLLOWED[name], :2] for each in (self, before)
                    )
                    moved[:, :2] += (new - old).mean(0)
                    details[name] = moved
        return found

    def _smooth(self, found: dict[int, Details], seconds: float) -> dict[int, Details]:
        # one that was not seen in the frame before begins anew
        seen = [(person, name) for person, details in found.items() for name in details]
        self._filters = {key: self._filters.get(key) or OneEuroFilter(*SMOOTHING) for key in seen}
        for person, name in seen:
            points = found[person][name]
            size = max(1.0, float(np.ptp(points[:, :2], axis=0).max()))
            found[person][name] = self._filters[person, name](points, seconds, size)
        return found


def _looks_aside(face: Float32[np.ndarray, "468 3"]) -> bool:
    _, turn, _ = load_head().fit(face)
    return bool(turn[2, 2] < LEAST_AHEAD)


def _find_details(
    frame: UInt8[np.ndarray, "H W 3"],
    landmarks: Mapping[int, Landmarks],
    names: Mapping[int, Sequence[str]],
) -> dict[int, Details]:
    """Find some details of each person."""
    found: dict[int, Details] = {}
    for number, marks in landmarks.items():
        wanted = names[number]
        found[number] = find_hands(frame, marks, [side for side in SIDES if side in wanted])
        if "face" in wanted and (face := find_face(frame, marks)) is not None:
            found[number]["face"] = face
    return found


def fit_details(details: Details, seen: Landmarks, fitted: Landmarks, fit: BodyFit) -> Details:
    """Bring details to where the fitted body has them."""
    moved: Details = {}
    for name, points in details.items():
        landmark, bone = ANCHORS[name]
        place, scale = LANDMARK[landmark], fit.scales[bone]
        moved[name] = points * np.float32(scale)
        moved[name][:, :2] += fitted.image[place, :2] - scale * seen.image[place, :2]
    return moved
