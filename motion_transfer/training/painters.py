"""Ever new people for training, painted by processes of their own while the networks learn."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing import get_context

import cv2
import numpy as np
from jaxtyping import Float16, UInt8

from motion_transfer.drawing.outline import clearance_of
from motion_transfer.drawing.source import SourcePicture, cut_source
from motion_transfer.drawing.trimming import trim
from motion_transfer.errors import MotionTransferError, TrainingError
from motion_transfer.processes import begin_child, deaf
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.samples import cut_target
from motion_transfer.training.sources import StreamedPairs, StreamedPhoto
from motion_transfer.training.speed import keep_memory
from nhrr_core.config import PICTURE_CHANNELS
from nhrr_core.parts import ALL_PARTS

MOST_SKIPPED = 5
"""More people than these who cannot be painted are no accident any more; chosen."""

ASKED_EACH = 2
"""People asked for at once of each process: one is painted, the next one waits."""


PAINTERS_ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "CUDA_VISIBLE_DEVICES": "",
}


@dataclass(frozen=True)
class PaintedPerson:
    """Some photos of one person: as sources, whole, and as targets, cut out; (I, U, V), 0..255.

    Attributes:
        photo, photo_iuv: What a texture is unfolded from; the IUV is trimmed as alpha says.
        clearance: Of each photo, see `nhrr_core.unfold_clearance`.
        image, iuv, alpha: Crops as the networks draw them, `image` over the background.
        picture: Crops as networks read them that look at the photo itself; empty for others.
    """

    photo: UInt8[np.ndarray, "V 3 P P"]
    photo_iuv: UInt8[np.ndarray, "V 3 P P"]
    clearance: Float16[np.ndarray, "V 2 128 128"]
    image: UInt8[np.ndarray, "V 3 S S"]
    iuv: UInt8[np.ndarray, "V 3 S S"]
    alpha: UInt8[np.ndarray, "V 1 S S"]
    picture: UInt8[np.ndarray, "V 6 _ _"]


@dataclass(frozen=True)
class Painter:
    """Paints people by number: the same number gives the same person, photos and crops."""

    people: StreamedPairs
    config: TrainConfig

    def __call__(self, number: int) -> PaintedPerson:
        data, size = self.config.data, self.config.model.image_size
        random = np.random.default_rng((self.config.run.seed, 1, number))
        views = []
        for view in range(data.views):
            picture = StreamedPhoto(self.people, number, view).load()
            assert picture.alpha is not None  # people always have one
            crop = cut_target(picture, size, data, random)
            assert crop.alpha is not None
            shown = SourcePicture(picture.as_photo(), picture.iuv)
            clearance = clearance_of(shown.photo, shown.iuv, ALL_PARTS)
            read = np.empty((PICTURE_CHANNELS, 0, 0), np.uint8)
            if self.config.model.reads_photo:
                read = cut_source(shown, size)
            trimmed = trim(picture.rgb, picture.iuv, picture.alpha)
            flat = (picture.rgb, trimmed, crop.rgb, crop.iuv, crop.alpha[..., None])
            photo, photo_iuv, image, iuv, alpha = (plane.transpose(2, 0, 1) for plane in flat)
            views.append((photo, photo_iuv, clearance.astype(np.float16), image, iuv, alpha, read))
        return PaintedPerson(*(np.stack(planes) for planes in zip(*views, strict=True)))


class Painters:
    """Processes that paint one person after the other, as long as what they painted is taken.

    They touch no GPU, and end with the process that began them, however that ends. Who cannot be
    painted is left out, with a note.

    Args:
        numbers: Of the people, in order.
        workers: How many processes; 0: this one paints when somebody is asked for.
        note: Hears of who is left out.
    """

    def __init__(
        self,
        paint: Callable[[int], PaintedPerson],
        numbers: Iterator[int],
        *,
        workers: int,
        note: Callable[[str], object],
    ) -> None:
        self._paint, self._numbers, self._note = paint, numbers, note
        self._skipped = 0
        self._most_asked = workers * ASKED_EACH
        self._asked: dict[Future[PaintedPerson], int] = {}
        self._pool: ProcessPoolExecutor | None = None
        if workers:
            # spawned: neither torch's threads nor a GPU survive a fork
            self._pool = ProcessPoolExecutor(workers, get_context("spawn"), _begin_painter)
            with _starting_painters():
                self._ask(self._pool)

    def take(self, *, wait_for_one: bool) -> PaintedPerson | None:
        """Take a person who is painted; None if none is yet.

        Raises: TrainingError if people cannot be painted; what a painter raised on purpose.
        """
        while True:
            if self._pool is None:
                number = next(self._numbers)
                painted = partial(self._paint, number)
            else:
                if wait_for_one:
                    wait(self._asked, return_when=FIRST_COMPLETED)
                future = next(filter(Future.done, self._asked), None)
                if future is None:
                    return None
                number, painted = self._asked.pop(future), future.result
            try:
                if self._pool is not None:
                    self._ask(self._pool)
                return painted()
            except MotionTransferError:
                raise
            except BrokenProcessPool as error:
                raise TrainingError(
                    "a process that paints people was ended, perhaps for want of memory; go on by"
                    " --resume, with fewer --workers"
                ) from error
            except Exception as error:
                self._skip(number, error)

    def close(self) -> None:
        """End the processes at once: what they do is not worth waiting for."""
        if self._pool is not None:
            for process in list((self._pool._processes or {}).values()):
                process.kill()
            self._pool.shutdown(cancel_futures=True)

    def _ask(self, pool: ProcessPoolExecutor) -> None:
        for number in islice(self._numbers, self._most_asked - len(self._asked)):
            self._asked[pool.submit(self._paint, number)] = number

    def _skip(self, number: int, error: Exception) -> None:
        self._skipped += 1
        reason = f"person {number} cannot be painted ({type(error).__name__}: {error})"
        if self._skipped > MOST_SKIPPED:
            raise TrainingError(f"{reason}, nor could {MOST_SKIPPED} others") from error
        self._note(f"{reason}; left out")


def _begin_painter() -> None:
    begin_child()
    cv2.setNumThreads(1)
    keep_memory()


@contextmanager
def _starting_painters() -> Iterator[None]:
    """Let processes begin inside with one thread and no GPU; Ctrl-C is heard by this one alone."""
    # libraries read it when they are loaded, which is before a process could say so itself
    before = {name: os.environ.get(name) for name in PAINTERS_ENVIRONMENT}
    os.environ.update(PAINTERS_ENVIRONMENT)
    try:
        with deaf(signal.SIGINT, signal.SIGTERM):
            yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
