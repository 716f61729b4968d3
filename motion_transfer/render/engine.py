"""The engine: chunks of a driver, rendered by threads, each to its own segment.

A thread takes a chunk from decoding to encoding. A renderer that fills the machine by itself takes
turns, so that one thread decodes and encodes while another's batch is in the network. Nothing is
queued: memory is bounded by the number of threads, not by the length of the driver.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from itertools import islice
from pathlib import Path

import numpy as np

from motion_transfer.errors import InputError, RenderError
from motion_transfer.media.segments import open_segment
from motion_transfer.render.canvas import Image
from motion_transfer.render.events import FramesDone, Listener, ignore
from motion_transfer.render.plan import Chunk, FrameReader, digest_of_iuv
from motion_transfer.render.prepare import Prepared
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.sheet import ContactSheet
from motion_transfer.render.window import Window

TURN_TAKERS = 2  # threads for a renderer that takes turns: one's batch is drawn while another
# decodes and encodes


class StoppedError(Exception):
    """A thread gives up its chunk because the run is being stopped."""


class Engine:
    """Renders chunks of one prepared run in this process."""

    def __init__(
        self,
        prepared: Prepared,
        *,
        reader: FrameReader,
        renderer: Renderer,
        sheet: ContactSheet | None = None,
        listener: Listener = ignore,
    ) -> None:
        self._prepared = prepared
        self._plan = prepared.plan
        self._reader = reader
        self._renderer = renderer
        self._sheet = sheet
        self._listener = listener
        self._draw = renderer.render
        self._stop = threading.Event()

    def render(
        self,
        chunks: Sequence[tuple[Chunk, Path]],
        threads: int,
        finished: Callable[[Chunk, Path], None],
    ) -> None:
        """Render chunks, each to its path; `finished` is called, by any thread, as they complete.

        Raises: the first thread's error, after all threads have stopped.
        """
        with (
            ThreadPoolExecutor(1, thread_name_prefix="renderer") as turns,
            ThreadPoolExecutor(threads, thread_name_prefix="chunk") as pool,
        ):
            if self._renderer.takes_turns:
                # one thread, not a lock: torch keeps a team of threads for each one that calls it,
                # and teams that wait for work take the cores from the one that has some
                self._draw = lambda crops: turns.submit(self._renderer.render, crops).result()
            futures = [
                pool.submit(self._render_chunk, chunk, path, finished) for chunk, path in chunks
            ]
            try:
                done, _ = wait(futures, return_when=FIRST_EXCEPTION)
                for future in done:
                    future.result()
            except BaseException:
                self._stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
                raise

    def _render_chunk(
        self, chunk: Chunk, path: Path, finished: Callable[[Chunk, Path], None]
    ) -> None:
        with open_segment(
            path,
            self._prepared.output_format,
            size=self._prepared.canvas.size,
            rate=self._plan.frame_rate,
            first=chunk.start,
        ) as segment:
            index = chunk.start
            for frames in self._render_batches(chunk):
                for frame in frames:
                    segment.write(frame)
                    if self._sheet is not None:
                        self._sheet.offer(index, frame)
                    index += 1
                self._listener(FramesDone(len(frames)))
        finished(chunk, path)

    def _render_batches(self, chunk: Chunk) -> Iterator[list[Image]]:
        """Output frames of a chunk, a batch at a time; batches begin where chunk or shot does."""
        frames = self._read(chunk)
        for shot in self._plan.shots_in(chunk):
            for start in range(shot.start, shot.stop, self._renderer.batch_size):
                count = min(self._renderer.batch_size, shot.stop - start)
                if self._stop.is_set():
                    raise StoppedError
                yield self._render_batch(list(islice(frames, count)), start, shot.window)

    def _render_batch(self, batch: list[Image], start: int, window: Window) -> list[Image]:
        """Output frames from those of the driver, the first of which makes frame `start`."""
        canvas = self._prepared.canvas
        size = self._renderer.working_size(window.side)
        crops = np.zeros((self._renderer.batch_size, size, size, 3), np.uint8)
        for slot, iuv in enumerate(batch):
            crops[slot] = window.cut(iuv, size)
        try:
            results = self._draw(crops)
        except (RuntimeError, MemoryError) as error:  # what torch raises, out of memory too
            first = self._plan.first + start
            raise RenderError(
                f"the {self._renderer.name} renderer failed in the driver's frames {first} to"
                f" {first + len(batch) - 1}: {error}"
            ) from error
        return [
            canvas.lay_out(iuv, crop, rgba, window)
            for iuv, crop, rgba in zip(batch, crops, results, strict=False)
        ]

    def _read(self, chunk: Chunk) -> Iterator[Image]:
        """The IUV frames that the chunk shows, with only the followed person in them."""
        first = self._plan.first
        frames = self._reader.read(first + chunk.start, first + chunk.stop)
        plans = self._plan.frames[chunk.start : chunk.stop]
        shown_index, shown = -1, None
        for index, (plan, iuv) in enumerate(zip(plans, frames, strict=True), first + chunk.start):
            if plan.held is None:
                shown_index, shown = index, iuv
            elif plan.held != shown_index or shown is None:
                shown_index, shown = plan.held, next(self._reader.read(plan.held, plan.held + 1))
            if digest_of_iuv(shown) != plan.digest:
                raise InputError(
                    f"{self._reader.stream.where(shown_index)} has changed since the run began;"
                    " start again when it is complete"
                )
            yield plan.isolate(shown)
