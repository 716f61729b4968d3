"""The output frames of a scene, chunk by chunk: read, drawn, and laid out.

Where a picture takes long, threads draw it, a batch each, while whoever asks for a chunk's frames
decodes its driver and takes what is finished. Few batches are on their way at a time: memory is
bounded by the number of threads, not by the length of the driver.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.backgrounds import Frame
from motion_transfer.drawing.canvas import Figure, Picture, Rgba
from motion_transfer.drawing.engines.interface import LANES
from motion_transfer.drawing.engines.threads import one_torch_thread
from motion_transfer.drawing.renderers.interface import Renderer
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError, RenderError
from motion_transfer.render.backdrop import OpenBackdrop
from motion_transfer.render.composition import Scene
from motion_transfer.render.plan import Chunk, FrameReader, digest_of_iuv
from motion_transfer.render.scene import Actor

Pixels = UInt8[np.ndarray, "B S S 4"]


class StoppedError(Exception):
    """A thread gives up its chunk because the run is being stopped."""


class FrameDrawer:
    """Makes the frames of one scene, for any number of threads that ask for chunks."""

    def __init__(
        self,
        scene: Scene,
        *,
        readers: Sequence[FrameReader],
        renderers: Sequence[Renderer],
        backdrop: OpenBackdrop,
    ) -> None:
        """Take a scene; of readers and renderers there is one for each actor."""
        self._scene = scene
        self._roles = [_Role(*each) for each in zip(scene.actors, readers, renderers, strict=True)]
        self._backdrop = backdrop
        self._drawers: ThreadPoolExecutor | None = None
        self._ahead = 0  # batches of a chunk on their way, beyond the one that is wanted next
        self._stop = threading.Event()

    @contextmanager
    def at_work(self, threads: int) -> Iterator[int]:
        """Have threads that draw, as many as the renderer can use of those.

        Returns: How many there are; 0 where whoever wants a picture draws it.
        """
        drawers = {"core": threads, "device": LANES, "nothing": 0}[self._roles[0].renderer.occupies]
        with (
            one_torch_thread(),
            ThreadPoolExecutor(max(1, drawers), thread_name_prefix="draw") as draw,
        ):
            if drawers:
                self._drawers, self._ahead = draw, drawers
            try:
                yield drawers
            except BaseException:
                self.stop()
                raise

    def stop(self) -> None:
        """Draw no more; what is being drawn is waited for."""
        self._stop.set()
        if self._drawers is not None:
            self._drawers.shutdown(wait=True, cancel_futures=True)

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def frames(self, chunk: Chunk) -> Generator[Picture, None, None]:
        """Make a chunk's output frames.

        Raises: InputError for a driver that is damaged or changed; RenderError; StoppedError.
        """
        canvas = self._scene.canvas
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
        shown = list(crops) if self._scene.crops else batch
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
