"""A clip of raw pictures as the motion of a body, shot by shot.

Landmarks of the whole clip are kept, 2 kB a frame, and so are postures; frames are not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.clip import follow_people
from motion_transfer.estimate.interface import LANDMARK, Estimator, Landmarks
from motion_transfer.media.pictures.stream import DEFAULT_RATE, PictureStream
from motion_transfer.people import (
    Body,
    BodyModel,
    Bones,
    Camera,
    Shape,
    hold_motion,
    load_body_model,
    load_charts,
    render_iuv,
)
from motion_transfer.tracking.fitting import View, fit_postures
from motion_transfer.tracking.puppet import Postures, Puppet
from motion_transfer.tracking.starting import observe

FOCAL = 1.2
"""Of the longer side of the picture, in pixels of the focal length: a picture does not tell it;
phones have 0.8 to 1.1 when they film, cameras 1 to 3."""

WINDOW, OVERLAP = 300, 60
"""Frames that are fitted at once, and those that two neighbouring windows share."""

MOST_TILT = np.radians(35)
TILT_SHARE = 0.6
"""How much of the body's mean lean towards the camera or away is taken for the camera's tilt."""

CAMERA_METRES = 4.0  # of a camera that sees the motion from elsewhere, from its middle

ON_FLOOR = 0.05
"""Share of the frames in which the lower foot may dip below the floor."""


@dataclass(frozen=True)
class Shot:
    """Frames between two cuts.

    Attributes:
        frames: Of the track.
        camera: In whose picture the postures lie over the person.
    """

    frames: range
    camera: Camera


@dataclass(frozen=True)
class Track:
    """A body's motion over a clip, one posture a frame.

    Attributes:
        puppet: The body.
        postures: Upright, on the floor z = 0, facing -y where a person faces the camera.
        seen: Frames in which the person was found; others are filled in.
        flipped_count: Frames in which left and right were exchanged, and set right.
    """

    puppet: Puppet
    postures: Postures
    frame_rate: Fraction
    shots: tuple[Shot, ...]
    seen: Bool[np.ndarray, " N"]
    flipped_count: int

    def __len__(self) -> int:
        return len(self.postures)

    @property
    def body(self) -> Body:
        """The body that moves."""
        return self.puppet.body

    @property
    def unseen(self) -> list[tuple[int, int]]:
        """Half-open ranges of frames in which the person was not found."""
        edges = np.flatnonzero(np.diff(np.concatenate([[False], ~self.seen, [False]])))
        return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]

    def bones(self, frame: int) -> tuple[Bones, tuple[float, float, float]]:
        """Find the bone rotations and offset of a frame, for `body.transforms`."""
        return self.puppet.bones(self.postures, frame), self.puppet.offset(self.postures, frame)

    def motion(self) -> Iterator[tuple[Bones, tuple[float, float, float]]]:
        """Find those of all frames."""
        return (self.bones(frame) for frame in range(len(self)))

    def points(self, frame: int, model: BodyModel) -> Float32[np.ndarray, "V 3"]:
        """Place the body's vertices in a frame, metres."""
        return model.pose(self.body, self.body.transforms(*self.bones(frame)))

    def iuv(self, frame: int, model: BodyModel) -> UInt8[np.ndarray, "H W 3"]:
        """Draw the body over its picture, (I, U, V)."""
        (shot,) = (shot for shot in self.shots if frame in shot.frames)
        return render_iuv(self.points(frame, model), model.faces, load_charts(), shot.camera)

    def seen_from(self, azimuth: float) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
        """Draw the body of all frames as another camera sees it, as large as the pictures.

        It stands still in each shot and holds all of its motion, as high as the pictures' camera.

        Args:
            azimuth: How far it stands from theirs, towards the person's left hand, degrees.
        """
        model, charts = load_body_model(), load_charts()
        for shot in self.shots:
            camera = hold_motion(
                partial(self.points, model=model),
                shot.frames,
                (shot.camera.width, shot.camera.height),
                distance=CAMERA_METRES,
                azimuth=np.radians(azimuth),
                elevation=shot.camera.elevation,
            )
            for frame in shot.frames:
                yield render_iuv(self.points(frame, model), model.faces, charts, camera)


def track_clip(
    pictures: PictureStream,
    estimator: Estimator,
    *,
    person: str = "largest",
    chosen: range | None = None,
    shape: Shape | None = None,
    done: Callable[[int], object] = int,
) -> Track:
    """Fit a body to one person of a clip.

    Args:
        person: `largest`, an index from the left, or a box; see `Follower`.
        chosen: The frames that are tracked; None: all.
        shape: The body's; None: the middle of all.
        done: Called with 1 after each frame that was looked at.
    Raises: InputError if nobody is found in any frame, or for a frame that is broken.
    """
    chosen = chosen or range(pictures.frame_count)
    found, starts = find_landmarks(pictures, estimator, person, chosen, done)
    if not any(found):
        raise InputError(
            f"{pictures.where(chosen.start)} to {chosen.stop - 1}: nobody found; a motion needs a"
            " person whose body is seen"
        )
    model = load_body_model()
    puppet = Puppet(model.body(shape or Shape()), model)
    rate = pictures.frame_rate or DEFAULT_RATE
    return fit_track(puppet, found, starts, (pictures.width, pictures.height), rate)


def find_landmarks(
    pictures: PictureStream,
    estimator: Estimator,
    person: str,
    chosen: range,
    done: Callable[[int], object] = int,
) -> tuple[list[Landmarks | None], list[int]]:
    """Find one person's landmarks in the chosen frames, None where it is not seen, and all cuts.

    Both count from the first chosen frame.
    """
    found: list[Landmarks | None] = []
    starts = []
    frames = follow_people(pictures, estimator, person, chosen)
    with closing(frames):
        for seen in frames:
            if not seen.is_chosen:
                continue
            if seen.begins:
                starts.append(seen.index - chosen.start)
            found.append(seen.people[0].landmarks if seen.people else None)
            done(1)
    return found, starts


def fit_track(
    puppet: Puppet,
    found: list[Landmarks | None],
    starts: list[int],
    size: tuple[int, int],
    frame_rate: Fraction,
) -> Track:
    """Fit a body to landmarks.

    Args:
        starts: The frames with which shots begin, 0 first.
        size: (width, height) of the pictures.
    Raises: ValueError where there are no landmarks at all.
    """
    stops = [*starts[1:], len(found)]
    view = View(FOCAL * max(size), (size[0] / 2, size[1] / 2))
    fitted: list[Postures | None] = []
    shots, flipped = [], 0
    for start, stop in zip(starts, stops, strict=True):
        if not any(found[start:stop]):
            fitted.append(None)
            shots.append(Shot(range(start, stop), _camera(size, view, 0.0, np.zeros(3))))
            continue
        postures, count = _fit_shot(puppet, found[start:stop], view, float(frame_rate))
        flipped += count
        upright, camera = _stood_up(puppet, postures, size, view)
        fitted.append(upright)
        shots.append(Shot(range(start, stop), camera))
    lengths = [len(shot.frames) for shot in shots]
    seen = np.array([one is not None for one in found])
    postures = _joined(_filled(fitted, lengths))
    return Track(puppet, postures, frame_rate, tuple(shots), seen, flipped)


def _fit_shot(
    puppet: Puppet, found: list[Landmarks | None], view: View, frame_rate: float
) -> tuple[Postures, int]:
    """Fit one shot, window by window; what is before the first sight and after the last is held."""
    known = [index for index, one in enumerate(found) if one is not None]
    first, last = known[0], known[-1] + 1
    observed = observe(found[first:last])
    postures, flipped = None, 0
    start = 0
    while True:
        stop = min(start + WINDOW, len(observed))
        # a rest that is shorter than an overlap is fitted along
        if len(observed) - stop < OVERLAP:
            stop = len(observed)
        window, count = fit_postures(puppet, observed.at(slice(start, stop)), view, frame_rate)
        flipped += count
        postures = window if postures is None else _blended(postures, window, start)
        if stop == len(observed):
            break
        start = stop - OVERLAP
    index = np.clip(np.arange(len(found)) - first, 0, len(postures) - 1)
    return postures[index], flipped


def _blended(before: Postures, after: Postures, start: int) -> Postures:
    """Let one window fade into the next, which begins at a frame of the first."""
    overlap = len(before) - start
    share = (np.arange(overlap) + 0.5) / overlap
    a, b = before[slice(start, None)], after[slice(None, overlap)]
    mixed = a.turned(b.away_from(a) * share[:, None])
    return _joined([before[slice(None, start)], mixed, after[slice(overlap, None)]])


def _joined(parts: list[Postures]) -> Postures:
    arrays = [[getattr(part, entry.name) for part in parts] for entry in fields(Postures)]
    return Postures(*map(np.concatenate, arrays))


def _filled(fitted: list[Postures | None], lengths: list[int]) -> list[Postures]:
    """Hold the posture before, or the first one after, through shots that show nobody."""
    known = [index for index, postures in enumerate(fitted) if postures is not None]
    out = []
    for index, (postures, length) in enumerate(zip(fitted, lengths, strict=True)):
        if postures is None:
            before = [other for other in known if other < index]
            nearest = fitted[before[-1] if before else known[0]]
            assert nearest is not None
            held = len(nearest) - 1 if before else 0
            postures = nearest[np.full(length, held)]
        out.append(postures)
    return out


def _stood_up(
    puppet: Puppet, postures: Postures, size: tuple[int, int], view: View
) -> tuple[Postures, Camera]:
    """Turn a level camera's world so that people stand upright in it, and put them on its floor."""
    marks = puppet.place(postures).landmarks
    top, ankles = (
        marks[:, [LANDMARK[f"{side}-{name}"] for side in ("left", "right")]].mean(1)
        for name in ("shoulder", "ankle")
    )
    rise = top - ankles
    lean = float(np.median(np.arctan2(rise[:, 1], rise[:, 2])))
    tilt = float(np.clip(TILT_SHARE * lean, -MOST_TILT, MOST_TILT))
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    postures = postures.moved(turn, np.zeros(3))
    soles = puppet.soles(postures)
    floor = float(np.quantile(soles[..., 2].min(1), ON_FLOOR))
    middle = np.median(postures.place, axis=0)
    shift = -np.array([middle[0], middle[1], floor])
    return postures.moved(np.eye(3), shift), _camera(size, view, -tilt, shift)


def _camera(
    size: tuple[int, int], view: View, elevation: float, place: Float64[np.ndarray, 3]
) -> Camera:
    """Make the camera that stands at a place and looks ahead."""
    ahead = Camera(*size, view.focal, 1.0, (0.0, 0.0, 0.0), elevation=elevation)
    x, y, z = (place - ahead.position).tolist()
    return replace(ahead, target=(x, y, z))
