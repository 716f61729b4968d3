"""From raw pictures to an IUV file: what `mt iuv` does."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path
from typing import get_args

from motion_transfer.drawing.person import EVERYBODY, Follower
from motion_transfer.errors import InputError
from motion_transfer.estimate.clip import ClipSummary, MissingPeople, estimate_clip
from motion_transfer.estimate.interface import Estimator
from motion_transfer.estimate.opening import check_estimator, open_estimator
from motion_transfer.media.iuv.formats import ChannelOrder
from motion_transfer.media.iuv.writing import VIDEO_RATE, IuvOutput, check_iuv_output, write_iuv
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.unchanged import Inputs
from motion_transfer.option import frame_range


@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """What to look at, and what to write.

    Attributes:
        source: A photo, a folder of photos, or a video.
        output: A folder of PNG, `.mkv`, `.npy`, or `.png` for one frame.
        model: The file of the `densepose` estimator.
        person: `all`, `largest`, an index from the left, or a box `x0,y0,x1,y1` in px.
        missing: What frames show in which nobody is found; see `estimate_clip`.
        frames: The half-open range of frames that is wanted, either end open.
        output_order: The channel order to write, for pictures and video.
        frame_rate: A video's; None means the source's, or 30.
        alpha: Whether to write the people's alpha beside the IUV, see `name_alpha`.
    """

    source: Path
    output: Path
    estimator: str = "blazepose"
    model: Path | None = None
    person: str = EVERYBODY
    missing: MissingPeople = "background"
    frames: tuple[int | None, int | None] = (None, None)
    output_order: ChannelOrder = "vui"
    frame_rate: Fraction | None = None
    force: bool = False
    alpha: bool = False

    def __post_init__(self) -> None:
        supported = get_args(MissingPeople)
        if self.missing not in supported:
            raise InputError(f"missing {self.missing!r}; supported are {', '.join(supported)}")
        check_estimator(self.estimator, self.model)
        Follower(self.person)  # refuses what is no choice, before anything is opened


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
        done: Called with 1 and the number of all chosen frames after each of them.
        estimator: One that is ready; None opens the one that the options name.
    Raises: InputError and its kinds, also for a source that changes meanwhile; nothing half-written
        stays behind.
    """
    inputs = Inputs(filter(None, (options.source, options.model)))
    pictures = open_pictures(options.source)
    chosen = frame_range(options.frames, pictures.frame_count, str(options.source))
    rate = options.frame_rate or pictures.frame_rate
    settings = IuvOutput(
        frame_count=len(chosen),
        height=pictures.height,
        width=pictures.width,
        order=options.output_order,
        frame_rate=rate,
        force=options.force,
        alpha=options.alpha,
    )
    # before the estimator, which takes seconds to load
    check_iuv_output(options.output, settings)
    estimator = estimator or open_estimator(
        options.estimator,
        options.model,
        frame_rate=pictures.frame_rate,
        for_photos=pictures.frame_count == 1,
    )
    summary = ClipSummary()
    frames = estimate_clip(
        pictures,
        estimator,
        person=options.person,
        missing=options.missing,
        chosen=chosen,
        summary=summary,
        with_alpha=options.alpha,
    )
    with closing(frames):
        write_iuv(
            inputs.guard(islice(frames, chosen.start, None)),
            options.output,
            settings,
            lambda count: done(count, len(chosen)),
        )
    return EstimateReport(summary, rate or VIDEO_RATE, pictures.notes)
