"""The engine: chunks of a driver, rendered by threads, each to its own segment.

A thread takes a chunk from decoding to encoding; others may draw for it, see `frames`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.canvas import Picture, show_alpha
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.events import FramesDone, Listener, ignore
from motion_transfer.media.output.segments import open_segment
from motion_transfer.media.pictures.photo import read_photo, write_png
from motion_transfer.render.backdrop import OpenBackdrop
from motion_transfer.render.composition import Prepared
from motion_transfer.render.frames import FrameDrawer, StoppedError
from motion_transfer.render.plan import Chunk, FrameReader

CHUNKS_AT_ONCE = 2  # where others draw: while one chunk ends, the next one's batches are on the way

STOP_SECONDS = 0.2  # how soon a thread that waits for another process heeds a stop

SHEET_FRAMES, SHEET_COLUMNS = 12, 4
SHEET_LINE_PX, SHEET_GAP_PX, SHEET_TEXT_SCALE = 20, 8, 0.45
SHEET_GREY = 96
"""Of the sheet between its pictures: most people are drawn on white, and some on black."""

SHEET_EDGE: Any = {"mode": "constant", "constant_values": SHEET_GREY}
THUMBNAIL_PX = 320  # the longer side: twelve of them fit a screen


class Helpers(Protocol):
    """Who renders chunks for an engine's threads, elsewhere; called by any of them."""

    def begin(self, chunk: Chunk) -> Future[Any] | None:
        """Have a chunk rendered; None if nobody is free."""
        ...

    def finish(self, chunk: Chunk, future: Future[Any]) -> None:
        """Take a chunk's segment over. Raises: what rendering it raised."""
        ...


class Engine:
    """Renders chunks of one prepared run in this process, and with helpers in others."""

    def __init__(
        self,
        prepared: Prepared,
        *,
        readers: Sequence[FrameReader],
        renderers: Sequence[Renderer],
        backdrop: OpenBackdrop,
        sheet: ContactSheet | None = None,
        listener: Listener = ignore,
        helpers: Helpers | None = None,
    ) -> None:
        """Take what was prepared; of readers and renderers there is one for each actor."""
        self._prepared = prepared
        self._drawer = FrameDrawer(
            prepared, readers=readers, renderers=renderers, backdrop=backdrop
        )
        self._sheet = sheet
        self._listener = listener
        self._helpers = helpers

    def render(
        self,
        chunks: Sequence[tuple[Chunk, Path]],
        threads: int,
        finished: Callable[[Chunk, Path], None],
    ) -> None:
        """Render chunks, each to its path; `finished` is called, by any thread, as they complete.

        Args:
            threads: How many draw.
        Raises: the first thread's error, after all threads have stopped; InputError if the run's
            inputs change meanwhile.
        """
        with (
            self._drawer.at_work(threads) as drawers,
            ThreadPoolExecutor(
                CHUNKS_AT_ONCE if drawers else threads, thread_name_prefix="chunk"
            ) as pool,
        ):
            futures = [
                pool.submit(self._render_chunk, chunk, path, finished) for chunk, path in chunks
            ]
            try:
                done, _ = wait(futures, return_when=FIRST_EXCEPTION)
                for future in done:
                    future.result()
            except BaseException:
                self._drawer.stop()
                pool.shutdown(wait=True, cancel_futures=True)
                raise

    def _render_chunk(
        self, chunk: Chunk, path: Path, finished: Callable[[Chunk, Path], None]
    ) -> None:
        if self._helpers is not None and (future := self._helpers.begin(chunk)) is not None:
            while wait([future], timeout=STOP_SECONDS).not_done:
                if self._drawer.stopped:
                    raise StoppedError
            self._helpers.finish(chunk, future)
            self._listener(FramesDone(chunk.stop - chunk.start))
            return
        with open_segment(
            path,
            self._prepared.output_format,
            size=self._prepared.canvas.size,
            rate=self._prepared.plan.frame_rate,
            first=chunk.start,
        ) as write:
            for index, frame in enumerate(self._drawer.frames(chunk), chunk.start):
                write(frame)
                if self._sheet is not None:
                    self._sheet.offer(index, frame)
                self._listener(FramesDone(1))
        finished(chunk, path)
        self._prepared.inputs.glance()


class ContactSheet:
    """Collects thumbnails of evenly spread frames in a folder, from any thread or process."""

    def __init__(self, folder: Path, frame_count: int) -> None:
        count = min(SHEET_FRAMES, frame_count)
        self._folder = folder
        self._wanted = {int(index) for index in np.linspace(0, frame_count - 1, count).round()}

    def offer(self, index: int, frame: Picture) -> None:
        """Keep a frame if it is one of the wanted; in any order."""
        if index in self._wanted:
            frame = show_alpha(frame)
            scale = min(1, THUMBNAIL_PX / max(frame.shape[:2]))
            size = (max(1, round(frame.shape[1] * scale)), max(1, round(frame.shape[0] * scale)))
            write_png(self._path(index), cv2.resize(frame, size, interpolation=cv2.INTER_AREA))

    def picture(self) -> UInt8[np.ndarray, "H W 3"]:
        """Lay out the sheet; every wanted frame must have been offered."""
        cells = [
            _label(read_photo(self._path(index)).rgb, f"frame {index}")
            for index in sorted(self._wanted)
        ]
        columns = min(SHEET_COLUMNS, len(cells))
        cells += [np.full_like(cells[0], SHEET_GREY)] * (-len(cells) % columns)
        rows = [np.hstack(cells[i : i + columns]) for i in range(0, len(cells), columns)]
        return np.pad(np.vstack(rows), ((SHEET_GAP_PX, 0), (SHEET_GAP_PX, 0), (0, 0)), **SHEET_EDGE)

    def _path(self, index: int) -> Path:
        return self._folder / f"thumbnail_{index:06d}.png"


def _label(picture: UInt8[np.ndarray, "h w 3"], words: str) -> UInt8[np.ndarray, "H W 3"]:
    """Put words below a picture, and a gap below and beside both."""
    below, beside = SHEET_LINE_PX + SHEET_GAP_PX, SHEET_GAP_PX
    cell = np.pad(picture, ((0, below), (0, beside), (0, 0)), **SHEET_EDGE)
    place = (2, picture.shape[0] + SHEET_LINE_PX - 5)
    font, white = cv2.FONT_HERSHEY_SIMPLEX, (255, 255, 255)
    return cv2.putText(cell, words, place, font, SHEET_TEXT_SCALE, white, 1, cv2.LINE_AA)
