"""From raw pictures to an IUV file: what `mt iuv` does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import get_args

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import EVERYBODY, Follower
from motion_transfer.estimate.clip import ClipSummary, MissingPeople, estimate_clip
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.opening import check_estimator, open_estimator
from motion_transfer.media.iuv_image import ChannelOrder
from motion_transfer.media.iuv_writing import (
    VIDEO_RATE,
    IuvFormat,
    check_iuv_output,
    write_iuv,
)
from motion_transfer.media.picture_stream import open_pictures


@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """What to look at, and what to write.

    Attributes:
        source: a photo, a folder of photos, or a video.
        output: a folder of PNG, `.mkv`, `.npy`, or `.png` for one frame.
        model: of the `densepose` estimator.
        person: `all`, `largest`, an index from the left, or a box `x0,y0,x1,y1` in px.
        missing: what frames show in which nobody is found; see `estimate_clip`.
        output_order: the channel order to write, for pictures and video.
        frame_rate: of a video; None: the source's, or 30.
        alpha: write the people's alpha beside the IUV, see `name_alpha`.
    """

    source: Path
    output: Path
    estimator: str = "blazepose"
    model: Path | None = None
    person: str = EVERYBODY
    missing: MissingPeople = "background"
    output_order: ChannelOrder = "vui"
    frame_rate: Fraction | None = None
    force: bool = False
    alpha: bool = False

    def __post_init__(self) -> None:
        if self.missing not in get_args(MissingPeople):
            raise InputError(
                f"missing {self.missing!r}; supported are {', '.join(get_args(MissingPeople))}"
            )
        check_estimator(self.estimator, self.model)
        Follower(self.person)


@dataclass(frozen=True)
class EstimateReport:
    """What was written, and what was seen."""

    summary: ClipSummary
    frame_rate: Fraction
    notes: tuple[str, ...]


def estimate_iuv(
    options: EstimateOptions,
    done: Callable[[int, int], object] = lambda _count, _total: None,
    *,
    estimator: Estimator | None = None,
) -> EstimateReport:
    """Write the IUV of raw pictures of any length.

    Args:
        done: called with 1 and the number of all frames after each frame.
        estimator: one that is ready; None: the one that the options name.
    Raises: InputError and its kinds; nothing half-written stays behind.
    """
    pictures = open_pictures(options.source)
    rate = options.frame_rate or pictures.frame_rate
    settings = IuvFormat(
        frame_count=pictures.frame_count,
        height=pictures.height,
        width=pictures.width,
        order=options.output_order,
        frame_rate=rate,
        force=options.force,
        alpha=options.alpha,
    )
    check_iuv_output(options.output, settings)
    if estimator is None:
        estimator = open_estimator(options.estimator, options.model, frame_rate=pictures.frame_rate)
    summary = ClipSummary()
    frames = estimate_clip(
        pictures,
        estimator,
        person=options.person,
        missing=options.missing,
        summary=summary,
        with_alpha=options.alpha,
    )
    with closing(frames):
        write_iuv(frames, options.output, settings, lambda count: done(count, pictures.frame_count))
    return EstimateReport(summary, rate or VIDEO_RATE, pictures.notes)
