"""What workers do: functions of plain arguments, and what a worker keeps warm between them.

A task takes and gives blobs: what one worker computed (a driver's scan, a source's appearance, a
prepared run) goes to the others as bytes, which the scheduler hands around and never opens.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.batch.state import Files
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render.options import RenderOptions

if TYPE_CHECKING:  # the scheduler imports this module, and has no need of the libraries below
    import numpy as np

    from motion_transfer.drawing.renderers.interface import Renderer
    from motion_transfer.media.iuv.stream import IuvReader
    from motion_transfer.render.composition import DriverFile, Prepared
    from motion_transfer.render.plan import Chunk

KEPT_OBJECTS = 16  # of a few jobs at once: run, renderer and reader of each
KEPT_FRAMES_BYTES = 256 << 20
"""A worker keeps the decoded frames of its last chunk, for the next source with that driver."""

PICKLE_PROTOCOL = 5  # large arrays are not copied on their way
Fetch = Callable[[], bytes]
"""Gives a blob, wherever it lies; what `Workers.share` returns."""


@dataclass(frozen=True)
class ChunkOutline:
    """What the scheduler knows of a chunk.

    Attributes:
        piece: The name of its segment in the work folder.
        key: That of the content it is made from.
    """

    index: int
    start: int
    stop: int
    piece: str
    key: str


@dataclass(frozen=True)
class Outline:
    """What the scheduler knows of a prepared run.

    Attributes:
        chunks_at_once: How many chunks one task renders.
        output_key: That of the whole output.
        note: What the user should know: of the sound, and in which frames nobody was found.
        files: What it is made from.
    """

    chunks: tuple[ChunkOutline, ...]
    frame_count: int
    duration_seconds: float
    renderer: str
    chunks_at_once: int
    output_key: str
    note: str
    files: Files


class Warm:
    """What a worker process keeps between tasks; the oldest goes first."""

    def __init__(self) -> None:
        self._objects: OrderedDict[str, Any] = OrderedDict()
        self.frames: tuple[Any, list[np.ndarray]] = (None, [])

    def get(self, name: str, make: Callable[[], Any]) -> Any:
        """Give the object of a name; make it if it is not there."""
        if name not in self._objects:
            self._objects[name] = make()
            while len(self._objects) > KEPT_OBJECTS:
                self._objects.popitem(last=False)
        self._objects.move_to_end(name)
        return self._objects[name]


WARM = Warm()
"""Kept by this worker process."""


def scan(options: RenderOptions, folder: Path) -> tuple[bytes, list[str]]:
    """Look through a driver.

    Args:
        folder: Where the IUV of drivers is kept that are raw pictures.
    Returns: The scan, and what is worth saying.
    Raises: InputError, IuvFileError.
    """
    from motion_transfer.events import Event, Notice
    from motion_transfer.render.driver import scan_driver

    notices: list[str] = []

    def listen(event: Event) -> None:
        if isinstance(event, Notice):
            notices.append(event.message)

    scanned = scan_driver(options, folder, listen, workers=1)
    return pickle.dumps(scanned, PICKLE_PROTOCOL), notices


def encode(options: RenderOptions) -> tuple[bytes, bytes, tuple[str, ...]]:
    """Read a source and compute its appearance, the feature map.

    Returns: The source with what it was read from, its appearance, and what is worth saying.
    Raises: InputError, WeightsError.
    """
    from motion_transfer.events import ignore
    from motion_transfer.render.composition import open_recipe, settle_weights
    from motion_transfer.render.inputs import appearance_files
    from motion_transfer.render.source import read_source

    options = settle_weights(options, ignore)
    inputs = Inputs(appearance_files(options))
    recipe = open_recipe(options)
    source = read_source(options, recipe.texture_size)
    appearance = recipe.appearance_of(source)
    told = pickle.dumps((source, inputs), PICKLE_PROTOCOL)
    return told, pickle.dumps(appearance, PICKLE_PROTOCOL), source.notes


def prepare(options: RenderOptions, scanned: Fetch, encoded: Fetch) -> tuple[bytes, Outline]:
    """Plan a run and put its parts together.

    Raises: InputError and its kinds, also if a source is no longer what its appearance was made
        from.
    """
    from motion_transfer.events import ignore
    from motion_transfer.render.composition import (
        open_recipe,
        plan_run,
        prepare_run,
        settle_weights,
    )
    from motion_transfer.render.engine import CHUNKS_AT_ONCE
    from motion_transfer.render.plan import describe_missing
    from motion_transfer.render.run import output_key, piece_of

    driver = pickle.loads(scanned())
    plan = plan_run(options, driver)
    options = settle_weights(options, ignore)  # in the cache by now
    recipe = open_recipe(options)
    source, inputs = pickle.loads(encoded())
    run = prepare_run(options, driver, plan, recipe, source, inputs, ignore)
    chunks = tuple(
        ChunkOutline(c.index, c.start, c.stop, piece_of(run, c), run.chunk_keys[c.index])
        for c in plan.chunks
    )
    missing = describe_missing(plan.frames, plan.first, plan.frame_rate)
    outline = Outline(
        chunks,
        len(plan.frames),
        float(len(plan.frames) / plan.frame_rate),
        recipe.name,
        # a thread that draws for itself would gain nothing from a second chunk
        CHUNKS_AT_ONCE if recipe.occupies != "nothing" else 1,
        output_key(run),
        "; ".join(filter(None, [*(run.audio.notes if run.audio else ()), missing])),
        run.inputs.keys(),
    )
    return pickle.dumps(run, PICKLE_PROTOCOL), outline


def render(
    name: str,
    prepared: Fetch,
    source_name: str,
    appearance: Fetch,
    folder: Path,
    chunks: Sequence[tuple[int, Path, str]],
    with_sheet: bool,
) -> list[tuple[int, str]]:
    """Render chunks to finished segments.

    Args:
        name, source_name: Tell the prepared run and the appearance from others that are kept warm.
        chunks: Index, a temporary path, and the segment's name in `folder`.
    Returns: Index and digest of each segment.
    Raises: InputError for a driver that is damaged or changed; RenderError; OutputError.
    """
    from motion_transfer.cores import core_count
    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.media.work import publish_piece
    from motion_transfer.render.engine import ContactSheet, Engine

    run: Prepared = WARM.get(f"run {name}", lambda: pickle.loads(prepared()))
    renderer: Renderer = WARM.get(
        f"renderer {source_name} {run.recipe}",
        lambda: run.recipe.renderer(pickle.loads(appearance())),
    )
    reader = WARM.get(f"reader {run.driver}", run.driver.open)
    digests: list[tuple[int, str]] = []
    pieces = {index: folder / piece for index, _, piece in chunks}

    def finish(chunk: Chunk, path: Path) -> None:
        digests.append((chunk.index, publish_piece(path, pieces[chunk.index])))

    engine = Engine(
        run,
        reader=_SharedFrames(reader, run.driver),
        renderer=renderer,
        sheet=ContactSheet(folder, len(run.plan.frames)) if with_sheet else None,
    )
    with explain_disk_errors(folder):
        wanted = [(run.plan.chunks[index], path) for index, path, _ in chunks]
        engine.render(wanted, core_count(), finish)
    return digests


def assemble(
    options: RenderOptions, prepared: Fetch, folder: Path, pictures: Path
) -> tuple[Path, bool]:
    """Join finished segments, and make the report's pictures.

    Args:
        pictures: What their names begin with, see `write_posters`.
    Returns: The output without its name yet, and whether it has pictures.
    """
    from motion_transfer.batch.report import write_posters
    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.render.engine import ContactSheet
    from motion_transfer.render.run import assemble as join

    run: Prepared = pickle.loads(prepared())
    sheet = ContactSheet(folder, len(run.plan.frames)) if options.sheet else None
    with explain_disk_errors(options.output):
        finished = join(options, run, folder, sheet)
    posters = write_posters(options.source[0], finished, pictures)
    return finished, posters


class _SharedFrames:
    """A reader that keeps a chunk's frames, so that jobs that share a driver share its decoding."""

    def __init__(self, reader: IuvReader, file: DriverFile) -> None:
        self._reader = reader
        self._file = file
        self.stream = reader.stream

    def read(self, start: int, stop: int) -> Iterator[np.ndarray]:
        """Read frames start..stop-1, see `IuvReader.read`."""
        wanted = (self._file, start, stop)
        if WARM.frames[0] == wanted:
            yield from WARM.frames[1]
            return
        if (stop - start) * self._reader.height * self._reader.width * 3 > KEPT_FRAMES_BYTES:
            yield from self._reader.read(start, stop)
            return
        frames: list[np.ndarray] = []
        for iuv in self._reader.read(start, stop):
            frames.append(iuv)
            yield iuv
        WARM.frames = (wanted, frames)
