"""From raw pictures to a BVH file: what `mt people track` does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.drawing.person import EVERYBODY, Follower
from motion_transfer.errors import InputError, OutputError
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.opening import landmark_estimators, open_estimator
from motion_transfer.extras import require_extra
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.people import write_bvh
from motion_transfer.tracking.clip import Track, track_clip


@dataclass(frozen=True, kw_only=True)
class TrackOptions:
    """Whom to track, and where to write it.

    Attributes:
        source: A video, a folder of photos, or a photo.
        output: A `.bvh`.
        person: `largest`, an index from the left, or a box `x0,y0,x1,y1` in px.
        estimator: Who finds the landmarks, `blazepose` or `blazepose-heavy`.
    Raises: InputError for a choice that means nobody, or everybody, or for an estimator without
        landmarks; OutputError for another file.
    """

    source: Path
    output: Path
    person: str = "largest"
    estimator: str = "blazepose"
    force: bool = False

    def __post_init__(self) -> None:
        if self.output.suffix.lower() != ".bvh":
            raise OutputError(f"cannot write {self.output}: a motion is a .bvh file")
        if self.person == EVERYBODY:
            raise InputError(
                "a motion is one person's; choose largest, an index from the left, or a box"
            )
        Follower(self.person)  # refuses what is no choice
        if self.estimator not in landmark_estimators():
            supported = " and ".join(landmark_estimators())
            raise InputError(
                f"estimator {self.estimator!r}; those that give landmarks are {supported}"
            )


def track_motion(
    options: TrackOptions,
    done: Callable[[int, int], object] = lambda _count, _total: None,
    *,
    estimator: Estimator | None = None,
) -> Track:
    """Write the motion of one person of a clip.

    Args:
        done: Called with 1 and the number of all frames after each frame.
        estimator: One that is ready; None opens that of the options.
    Raises: InputError and its kinds, also for a source that changes meanwhile; nothing half-written
        stays behind.
    """
    require_extra("people")
    inputs = Inputs([options.source])
    pictures = open_pictures(options.source)
    check_destination(options.output, force=options.force)
    estimator = estimator or open_estimator(options.estimator, None, frame_rate=pictures.frame_rate)
    track = track_clip(
        pictures,
        estimator,
        person=options.person,
        done=lambda count: done(count, pictures.frame_count),
    )
    inputs.check()
    with work_folder(options.output) as folder:
        written = folder / options.output.name
        write_bvh(written, track.body, track.motion(), track.frame_rate)
        publish(written, options.output)
    return track
