"""The engine: chunks of a driver, rendered by threads, each to its own segment.

A thread takes a chunk from decoding to encoding. Where a picture takes long, other threads draw it,
a batch each, while the chunks' threads decode and encode. Few batches are on their way at a time:
memory is bounded by the number of threads, not by the length of the driver.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.backgrounds import Frame
from motion_transfer.drawing.canvas import Figure, Picture, Rgba, show_alpha
from motion_transfer.drawing.engines.interface import LANES
from motion_transfer.drawing.engines.threads import one_torch_thread
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError, RenderError
from motion_transfer.events import FramesDone, Listener, ignore
from motion_transfer.media.output.segments import open_segment
from motion_transfer.media.pictures.photo import read_photo, write_png
from motion_transfer.render.backdrop import OpenBackdrop
from motion_transfer.render.composition import Prepared
from motion_transfer.render.plan import Chunk, FrameReader, digest_of_iuv
from motion_transfer.render.scene import Actor

CHUNKS_AT_ONCE = 2  # where others draw: while one chunk ends, the next one's batches are on the way

STOP_SECONDS = 0.2  # how soon a thread that waits for another process heeds a stop

SHEET_FRAMES, SHEET_COLUMNS = 12, 4
SHEET_LINE_PX, SHEET_GAP_PX, SHEET_TEXT_SCALE = 20, 8, 0.45
SHEET_GREY = 96
"""Of the sheet between its pictures: most people are drawn on white, and some on black."""

SHEET_EDGE: Any = {"mode": "constant", "constant_values": SHEET_GREY}
THUMBNAIL_PX = 320  # the longer side: twelve of them fit a screen

Pixels = UInt8[np.ndarray, "B S S 4"]


class StoppedError(Exception):
    """A thread gives up its chunk because the run is being stopped."""


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
        self._plan = prepared.plan
        self._roles = [
            _Role(*each) for each in zip(prepared.actors, readers, renderers, strict=True)
        ]
        self._backdrop = backdrop
        self._sheet = sheet
        self._listener = listener
        self._helpers = helpers
        self._drawers: ThreadPoolExecutor | None = None
        self._ahead = 0  # batches of a chunk on their way, beyond the one that is wanted next
        self._stop = threading.Event()

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
        drawers = {"core": threads, "device": LANES, "nothing": 0}[self._roles[0].renderer.occupies]
        with (
            one_torch_thread(),
            ThreadPoolExecutor(max(1, drawers), thread_name_prefix="draw") as draw,
            ThreadPoolExecutor(
                CHUNKS_AT_ONCE if drawers else threads, thread_name_prefix="chunk"
            ) as pool,
        ):
            if drawers:
                self._drawers, self._ahead = draw, drawers
            futures = [
                pool.submit(self._render_chunk, chunk, path, finished) for chunk, path in chunks
            ]
            try:
                done, _ = wait(futures, return_when=FIRST_EXCEPTION)
                for future in done:
                    future.result()
            except BaseException:
                self._stop.set()
                draw.shutdown(wait=True, cancel_futures=True)
                pool.shutdown(wait=True, cancel_futures=True)
                raise

    def _render_chunk(
        self, chunk: Chunk, path: Path, finished: Callable[[Chunk, Path], None]
    ) -> None:
        if self._helpers is not None and (future := self._helpers.begin(chunk)) is not None:
            while wait([future], timeout=STOP_SECONDS).not_done:
                if self._stop.is_set():
                    raise StoppedError
            self._helpers.finish(chunk, future)
            self._listener(FramesDone(chunk.stop - chunk.start))
            return
        with open_segment(
            path,
            self._prepared.output_format,
            size=self._prepared.canvas.size,
            rate=self._plan.frame_rate,
            first=chunk.start,
        ) as write:
            for index, frame in enumerate(self._lay_out(chunk), chunk.start):
                write(frame)
                if self._sheet is not None:
                    self._sheet.offer(index, frame)
                self._listener(FramesDone(1))
        finished(chunk, path)
        self._prepared.inputs.glance()

    def _lay_out(self, chunk: Chunk) -> Iterator[Picture]:
        """Make a chunk's output frames."""
        canvas = self._prepared.canvas
        drawn = zip(*(self._draw(role, chunk) for role in self._roles), strict=True)
        behind = self._backdrop.read(chunk.start, chunk.stop)
        for index, (background, figures) in enumerate(zip(behind, drawn, strict=True), chunk.start):
            people = [
                Figure(rgba, role.actor.spots[index], role.actor.table)
                for role, (_, rgba) in zip(self._roles, figures, strict=True)
            ]
            yield canvas.lay_out(background, people, figures[0][0])

    def _draw(self, role: _Role, chunk: Chunk) -> Iterator[tuple[Frame, Rgba]]:
        """Draw an actor frame by frame; batches begin where chunk or shot does.

        Returns: With each picture the IUV to compare it with: the driver's, or the square that was
            drawn, where that is the output.
        """
        frames = self._read(role, chunk)
        on_their_way: deque[Callable[[], list[tuple[Frame, Rgba]]]] = deque()
        renderer = role.renderer
        for shot in role.actor.plan.shots_in(chunk):
            size = renderer.batch_size(renderer.working_size(shot.window.side))
            for start in range(shot.start, shot.stop, size):
                count = min(size, shot.stop - start)
                batch = list(islice(frames, count))
                on_their_way.append(self._begin_batch(role, batch, start, shot.window))
                if len(on_their_way) > self._ahead:
                    yield from on_their_way.popleft()()
                if self._stop.is_set():
                    raise StoppedError
        for finish in on_their_way:
            yield from finish()

    def _begin_batch(
        self, role: _Role, batch: list[Frame], start: int, window: Window
    ) -> Callable[[], list[tuple[Frame, Rgba]]]:
        """Have driver frames drawn, which make frames from `start` on; give what waits for it."""
        renderer = role.renderer
        size = renderer.working_size(window.side)
        # padded to full batches: what one frame looks like must not depend on its neighbours
        crops = np.zeros((renderer.batch_size(size), size, size, 3), np.uint8)
        for slot, iuv in enumerate(batch):
            crops[slot] = window.cut(iuv, size)
        drawn = partial(renderer.render, crops)
        if self._drawers is not None:
            drawn = self._drawers.submit(drawn).result
        shown = list(crops) if self._prepared.crops else batch
        return partial(_finish_batch, role, shown[: len(batch)], start, drawn)

    def _read(self, role: _Role, chunk: Chunk) -> Iterator[Frame]:
        """Read the IUV frames that the chunk shows, with only the followed person in them."""
        reader, plan = role.reader, role.actor.plan
        first = plan.first
        frames = reader.read(first + chunk.start, first + chunk.stop)
        entries = plan.frames[chunk.start : chunk.stop]
        shown_index, shown = -1, None
        for index, (entry, iuv) in enumerate(
            zip(entries, frames, strict=True), first + chunk.start
        ):
            if entry.held is None:
                shown_index, shown = index, iuv
            elif entry.held != shown_index or shown is None:
                shown_index, shown = entry.held, next(reader.read(entry.held, entry.held + 1))
            if digest_of_iuv(shown) != entry.digest:
                raise InputError(
                    f"{reader.stream.where(shown_index)} has changed since the run began;"
                    " start again when it is complete"
                )
            yield entry.isolate(shown)


@dataclass(frozen=True)
class _Role:
    """An actor, and what reads and draws for it."""

    actor: Actor
    reader: FrameReader
    renderer: Renderer


def _finish_batch(
    role: _Role, shown: Sequence[Frame], start: int, drawn: Callable[[], Pixels]
) -> list[tuple[Frame, Rgba]]:
    """Wait for a batch."""
    try:
        results = drawn()
    except RuntimeError as error:  # what torch raises, out of memory too
        first = role.actor.plan.first + start
        raise RenderError(
            f"the {role.renderer.name} renderer failed in the driver's frames {first} to"
            f" {first + len(shown) - 1}: {error}"
        ) from error
    return list(zip(shown, results, strict=False))


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


def _label(picture: Frame, words: str) -> Frame:
    """Put words below a picture, and a gap below and beside both."""
    below, beside = SHEET_LINE_PX + SHEET_GAP_PX, SHEET_GAP_PX
    cell = np.pad(picture, ((0, below), (0, beside), (0, 0)), **SHEET_EDGE)
    place = (2, picture.shape[0] + SHEET_LINE_PX - 5)
    font, white = cv2.FONT_HERSHEY_SIMPLEX, (255, 255, 255)
    return cv2.putText(cell, words, place, font, SHEET_TEXT_SCALE, white, 1, cv2.LINE_AA)
