"""What workers do: functions of plain arguments, and what a worker keeps warm between them.

A task takes and gives blobs: what one worker computed (a driver's scan, a source's appearance, a
prepared run) goes to the others as bytes, which the scheduler hands around and never opens.
"""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.batch.signature import (
    Files,
    audio_files,
    check_unchanged,
    driver_files,
    sign_files,
    source_files,
)
from motion_transfer.render.options import RenderOptions

if TYPE_CHECKING:  # the scheduler imports this module, and has no need of the libraries below
    import numpy as np

    from motion_transfer.media.iuv_stream import IuvReader
    from motion_transfer.render.plan import Chunk
    from motion_transfer.render.prepare import DriverFile, Prepared
    from motion_transfer.render.renderer import Renderer

KEPT_OBJECTS = 16
KEPT_FRAMES_BYTES = 256 << 20
"""A worker keeps the decoded frames of its last chunk, for the next source with that driver."""

Fetch = Callable[[], bytes]


@dataclass(frozen=True)
class ChunkOutline:
    """What the scheduler knows of a chunk: its frames, the name of its segment, its content."""

    index: int
    start: int
    stop: int
    piece: str
    key: str


@dataclass(frozen=True)
class Outline:
    """What the scheduler knows of a prepared run.

    `note` says in which frames nobody was found; empty if there are none.
    """

    chunks: tuple[ChunkOutline, ...]
    frame_count: int
    duration_seconds: float
    renderer: str
    chunks_at_once: int
    output_key: str
    note: str


class Warm:
    """What a worker process keeps between tasks; the oldest goes first."""

    def __init__(self) -> None:
        self._objects: OrderedDict[str, Any] = OrderedDict()
        self.frames: tuple[Any, list[np.ndarray]] = (None, [])

    def get(self, name: str, make: Callable[[], Any]) -> Any:
        """The object of a name, made if it is not there."""
        if name not in self._objects:
            self._objects[name] = make()
            while len(self._objects) > KEPT_OBJECTS:
                self._objects.popitem(last=False)
        self._objects.move_to_end(name)
        return self._objects[name]


WARM = Warm()
"""Of this worker process."""


def scan(options: RenderOptions, folder: Path) -> tuple[bytes, Files, list[str]]:
    """A driver's scan, its files, and what is worth saying.

    Args:
        folder: where the IUV of drivers is kept that are raw pictures.
    Raises: InputError, IuvFileError.
    """
    from motion_transfer.render.events import Event, Notice
    from motion_transfer.render.prepare import scan_driver

    notices: list[str] = []

    def listen(event: Event) -> None:
        if isinstance(event, Notice):
            notices.append(event.message)

    files = sign_files(driver_files(options))
    scanned = scan_driver(replace(options, workers=1), folder, listen)
    return pickle.dumps(scanned, 5), files, notices


def look(options: RenderOptions) -> tuple[bytes, bytes, Files]:
    """A source, its appearance (the feature map), its files. Raises: InputError, WeightsError."""
    from motion_transfer.render.content import digest_weights
    from motion_transfer.render.recipe import Recipe
    from motion_transfer.render.source import prepare_source

    files = sign_files(source_files(options))
    recipe = Recipe(options.renderer, options.weights_file, digest_weights(options))
    source = prepare_source(options, recipe.texture_size)
    return pickle.dumps(source, 5), pickle.dumps(recipe.appearance_of(source), 5), files


def prepare(
    options: RenderOptions, scanned: Fetch, source: Fetch, source_files: Files
) -> tuple[bytes, Outline]:
    """A run, planned.

    Raises: InputError and its kinds, also if a source is no longer what its appearance was made
        from: chunks are keyed by what its files hold now.
    """
    from motion_transfer.media.formats import choose_format
    from motion_transfer.render.engine import CHUNKS_AT_ONCE
    from motion_transfer.render.events import ignore
    from motion_transfer.render.missing import describe_missing
    from motion_transfer.render.prepare import (
        check_length,
        choose_run_recipe,
        plan_run,
        prepare_run,
    )
    from motion_transfer.render.run import output_key, piece_of

    output_format = choose_format(options.output, codec=options.codec, crf=options.crf)
    driver = pickle.loads(scanned())
    plan = plan_run(options, driver)
    check_length(options, output_format, plan)
    recipe = choose_run_recipe(options, plan, ignore)
    run = prepare_run(options, output_format, driver, plan, recipe, pickle.loads(source()))
    check_unchanged(source_files)
    chunks = tuple(
        ChunkOutline(c.index, c.start, c.stop, piece_of(run, c), run.chunk_keys[c.index])
        for c in plan.chunks
    )
    outline = Outline(
        chunks,
        len(plan.frames),
        float(len(plan.frames) / plan.frame_rate),
        recipe.name,
        CHUNKS_AT_ONCE if recipe.name == "nhrr" else 1,
        output_key(run),
        describe_missing(plan.frames, plan.first, plan.frame_rate),
    )
    return pickle.dumps(run, 5), outline


def render(
    name: str,
    prepared: Fetch,
    look_name: str,
    appearance: Fetch,
    folder: Path,
    chunks: Sequence[tuple[int, Path, str]],
    with_sheet: bool,
) -> list[tuple[int, str]]:
    """Render chunks to finished segments; index and digest of each.

    Args:
        name, look_name: of the prepared run and of the appearance, for what is kept warm.
        chunks: index, a temporary path, and the segment's name in `folder`.
    Raises: InputError for a driver that is damaged or changed; RenderError; OutputError.
    """
    import torch

    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.media.work import publish_piece
    from motion_transfer.render.engine import Engine
    from motion_transfer.render.sheet import ContactSheet

    run: Prepared = WARM.get(f"run {name}", lambda: pickle.loads(prepared()))
    renderer: Renderer = WARM.get(
        f"renderer {look_name} {run.recipe}",
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
        plan_chunks = run.plan.chunks
        engine.render(
            [(plan_chunks[index], path) for index, path, _ in chunks],
            torch.get_num_threads(),
            finish,
        )
    return digests


def assemble(
    options: RenderOptions, prepared: Fetch, folder: Path, pictures: Path
) -> tuple[Path, bool, Files]:
    """Join finished segments.

    Returns: the output without its name yet, whether it has posters, its sound's file.
    """
    from motion_transfer.batch.poster import write_posters
    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.render.run import assemble as join
    from motion_transfer.render.sheet import ContactSheet

    run: Prepared = pickle.loads(prepared())
    files = sign_files(audio_files(options))
    sheet = ContactSheet(folder, len(run.plan.frames)) if options.sheet else None
    with explain_disk_errors(options.output):
        finished = join(options, run, folder, sheet)
    posters = write_posters(options.source, finished, pictures)
    return finished, posters, files


class _SharedFrames:
    """A reader that keeps a chunk's frames, so that jobs that share a driver share its decoding."""

    def __init__(self, reader: IuvReader, file: DriverFile) -> None:
        self._reader = reader
        self._file = file
        self.stream = reader.stream

    def read(self, start: int, stop: int) -> Iterator[np.ndarray]:
        """As `IuvReader.read`."""
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
