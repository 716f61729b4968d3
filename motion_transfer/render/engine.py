"""The engine: chunks of a driver, rendered by workers, each to its own segment, then joined.

A worker takes a chunk from decoding to encoding. A renderer that fills the machine by itself takes
turns, so that one worker decodes and encodes while another's batch is in the network. Nothing is
queued: memory is bounded by the number of workers, not by the length of the driver.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import RenderError
from motion_transfer.media.formats import OutputFormat
from motion_transfer.media.iuv_stream import IuvReader
from motion_transfer.media.segments import join_segments, open_segment, segment_path
from motion_transfer.render.compose import Comparison, paste
from motion_transfer.render.events import FramesDone, Listener
from motion_transfer.render.person import isolate
from motion_transfer.render.plan import Chunk, DriverPlan
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.sheet import ContactSheet
from motion_transfer.render.window import Window

Image = UInt8[np.ndarray, "H W 3"]


@dataclass(frozen=True)
class Canvas:
    """Where results are laid out.

    Attributes:
        background: an empty output frame, without the comparison's other panels.
        crop: the output is the window itself, at the renderer's working size.
        comparison: adds source and IUV beside the result, if wanted.
    """

    background: Image
    crop: bool
    comparison: Comparison | None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the output."""
        height, width = self.comparison.size if self.comparison else self.background.shape[:2]
        return width, height


class StoppedError(Exception):
    """A worker gives up its chunk because the run is being stopped."""


class Engine:
    """Renders one plan; `run` does it all."""

    def __init__(
        self,
        *,
        reader: IuvReader,
        plan: DriverPlan,
        renderer: Renderer,
        canvas: Canvas,
        output_format: OutputFormat,
        workers: int,
        sheet: ContactSheet | None,
        listener: Listener,
    ) -> None:
        self._reader = reader
        self._plan = plan
        self._renderer = renderer
        self._canvas = canvas
        self._format = output_format
        self._workers = workers
        self._sheet = sheet
        self._listener = listener
        self._draw = renderer.render
        self._stop = threading.Event()

    def run(self, folder: Path, destination: Path) -> None:
        """Render every chunk into `folder` and join them at `destination`.

        Raises: the first worker's error, after all workers have stopped.
        """
        with (
            ThreadPoolExecutor(1, thread_name_prefix="renderer") as turns,
            ThreadPoolExecutor(self._workers, thread_name_prefix="chunk") as pool,
        ):
            if self._renderer.takes_turns:
                # one thread, not a lock: torch keeps a team of threads for each one that calls it,
                # and teams that wait for work take the cores from the one that has some
                self._draw = lambda crops: turns.submit(self._renderer.render, crops).result()
            futures = [
                pool.submit(self._render_chunk, chunk, folder) for chunk in self._plan.chunks
            ]
            try:
                self._wait(futures)
            except BaseException:
                self._stop.set()
                pool.shutdown(wait=True, cancel_futures=True)
                raise
        segments = [
            (segment_path(folder, chunk.index, self._format), chunk.stop - chunk.start)
            for chunk in self._plan.chunks
        ]
        join_segments(segments, destination, self._format, self._plan.frame_rate)

    @staticmethod
    def _wait(futures: list[Future[None]]) -> None:
        done, _ = wait(futures, return_when=FIRST_EXCEPTION)
        for future in done:
            future.result()

    def _render_chunk(self, chunk: Chunk, folder: Path) -> None:
        path = segment_path(folder, chunk.index, self._format)
        with open_segment(
            path,
            self._format,
            size=self._canvas.size,
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

    def _render_batches(self, chunk: Chunk) -> Iterator[list[Image]]:
        """Output frames of a chunk, a batch at a time; batches begin at the chunk's start."""
        window = self._plan.window
        size = self._renderer.working_size(window.side)
        frames = self._read(chunk)
        while batch := list(islice(frames, self._renderer.batch_size)):
            if self._stop.is_set():
                raise StoppedError
            crops = np.zeros((self._renderer.batch_size, size, size, 3), np.uint8)
            for slot, iuv in enumerate(batch):
                crops[slot] = window.cut(iuv, size)
            try:
                results = self._draw(crops)
            except (RuntimeError, MemoryError) as error:  # what torch raises, out of memory too
                first = self._plan.first + chunk.start
                raise RenderError(
                    f"the {self._renderer.name} renderer failed in the driver's frames {first} to"
                    f" {first + chunk.stop - chunk.start - 1}: {error}"
                ) from error
            yield [
                self._lay_out(iuv, crop, rgba)
                for iuv, crop, rgba in zip(batch, crops, results, strict=False)
            ]

    def _read(self, chunk: Chunk) -> Iterator[Image]:
        """The chunk's IUV frames with only the followed person in them."""
        first = self._plan.first
        frames = self._reader.read(first + chunk.start, first + chunk.stop)
        held, shown = None, None
        for plan, iuv in zip(self._plan.frames[chunk.start : chunk.stop], frames, strict=True):
            if plan.held is not None:
                if plan.held != held:
                    held, shown = plan.held, next(self._reader.read(plan.held, plan.held + 1))
                iuv = shown if shown is not None else iuv
            if plan.alone:
                yield iuv
            elif plan.person is None:
                yield np.zeros_like(iuv)
            else:
                yield isolate(iuv, plan.person)

    def _lay_out(self, iuv: Image, crop: Image, rgba: UInt8[np.ndarray, "S S 4"]) -> Image:
        frame = self._canvas.background.copy()
        if self._canvas.crop:
            paste(frame, rgba, Window(0, 0, len(rgba)))
            iuv = crop
        else:
            paste(frame, rgba, self._plan.window)
        return self._canvas.comparison.frame(iuv, frame) if self._canvas.comparison else frame
