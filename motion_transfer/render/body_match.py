"""Whose proportions a driver of raw pictures gets: `--fit-body`."""

from __future__ import annotations

import numpy as np

from motion_transfer.errors import InputError
from motion_transfer.estimate.choice import Follower
from motion_transfer.estimate.clip import follow_landmarks
from motion_transfer.estimate.interface import Landmarks
from motion_transfer.estimate.opening import open_estimator
from motion_transfer.estimate.proportions import BodyFit, compare_proportions, measure_proportions
from motion_transfer.media.image import read_photo
from motion_transfer.media.picture_stream import PictureStream
from motion_transfer.render.beside import find_iuv_beside
from motion_transfer.render.events import FramesDone, Listener, Stage
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.source import read_person

MEASURED_FRAMES = 60
"""Of the driver: the first ones that show its person. Two seconds hold several poses; a single
picture says a bone's length to no better than a tenth."""


def match_body(
    options: RenderOptions, pictures: PictureStream, chosen: range, listener: Listener
) -> BodyFit:
    """What brings the driver's person to the source's proportions, one answer for the whole clip.

    Measured before the clip is estimated, so that the first frames are fitted as the last are.
    Raises: InputError if either shows nobody, or they show too little in common.
    """
    source = measure_proportions([_source_landmarks(options)])
    estimator = open_estimator(
        options.estimator, options.estimator_model, frame_rate=pictures.frame_rate
    )
    listener(Stage("compare", min(MEASURED_FRAMES, len(chosen))))
    seen = follow_landmarks(
        pictures,
        estimator,
        person=options.driver_person,
        chosen=chosen,
        count=MEASURED_FRAMES,
        done=lambda count: listener(FramesDone(count)),
    )
    return compare_proportions(source, measure_proportions(seen))


def _source_landmarks(options: RenderOptions) -> Landmarks:
    """Of the person that the source is about, also where its IUV says who that is."""
    photo = read_photo(options.source)
    iuv_path = options.source_iuv or find_iuv_beside(options.source)
    choice = options.person
    if iuv_path is not None:
        iuv = read_person(photo, iuv_path, choice, options.source_iuv_order, "source")
        rows, columns = (np.flatnonzero(iuv[..., 0].any(axis)) for axis in (1, 0))
        if len(rows):
            ends = (columns[0], rows[0], columns[-1] + 1, rows[-1] + 1)
            choice = ",".join(str(end) for end in ends)
    estimator = open_estimator(options.estimator, options.estimator_model)
    chosen = Follower(choice).pick(estimator.estimate(photo.on_white()), f"source {options.source}")
    if not chosen or chosen[0].landmarks is None:
        raise InputError(
            f"--fit-body: no landmarks of a person were found in the source {options.source}; give"
            " a photo that shows one, or leave out --fit-body"
        )
    return chosen[0].landmarks
