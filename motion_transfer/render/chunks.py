"""Chunks rendered by a worker process.

A prepared run and an appearance come as blobs, and are opened once. Libraries are imported by the
functions that need them: whoever only hands tasks around imports this module, too.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motion_transfer.render.workers import WARM, Fetch

if TYPE_CHECKING:
    import numpy as np

    from motion_transfer.drawing.renderers.interface import Renderer
    from motion_transfer.media.iuv.stream import IuvReader
    from motion_transfer.render.backdrop import OpenBackdrop
    from motion_transfer.render.composition import Prepared
    from motion_transfer.render.driver import DriverIuv
    from motion_transfer.render.plan import Chunk, FrameReader

KEPT_FRAMES_BYTES = 256 << 20
"""A worker keeps the decoded frames of its last chunk, for the next source with that driver."""

PICKLE_PROTOCOL = 5  # large arrays are not copied on their way


def render(
    name: str,
    prepared: Fetch,
    source_name: str,
    appearances: Fetch,
    folder: Path,
    output: Path,
    chunks: Sequence[tuple[int, Path, str]],
    with_sheet: bool,
    keep_frames: bool,
) -> list[tuple[int, str]]:
    """Render chunks to finished segments.

    Args:
        name, source_name: Tell the prepared run and the appearances from others that are kept warm.
        output: What they are for, for messages.
        chunks: Index, a temporary path, and the segment's name in `folder`.
        keep_frames: Whether the next call may want the same driver's frames.
    Returns: Index and digest of each segment.
    Raises: InputError for a driver that is damaged or changed; RenderError; OutputError.
    """
    from motion_transfer.cores import core_count
    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.media.work import publish_piece
    from motion_transfer.render.engine import ContactSheet, Engine

    run: Prepared = WARM.get(f"run {name}", lambda: pickle.loads(prepared()))
    renderers: list[Renderer] = WARM.get(
        f"renderers {source_name} {run.recipe}",
        lambda: [run.recipe.renderer(each) for each in pickle.loads(appearances())],
    )
    backdrop: OpenBackdrop = WARM.get(f"backdrop {name}", run.backdrop.open)
    files = dict.fromkeys(actor.driver for actor in run.actors)
    readers: dict[DriverIuv, FrameReader] = {
        file: WARM.get(f"reader {file}", file.open) for file in files
    }
    if keep_frames and len(files) == 1:
        readers = {file: _SharedFrames(readers[file], file) for file in files}  # type: ignore
    digests: list[tuple[int, str]] = []
    pieces = {index: folder / piece for index, _, piece in chunks}

    def finish(chunk: Chunk, path: Path) -> None:
        digests.append((chunk.index, publish_piece(path, pieces[chunk.index])))

    engine = Engine(
        run,
        readers=[readers[actor.driver] for actor in run.actors],
        renderers=renderers,
        backdrop=backdrop,
        sheet=ContactSheet(folder, len(run.plan.frames)) if with_sheet else None,
    )
    with explain_disk_errors(output):
        wanted = [(run.plan.chunks[index], path) for index, path, _ in chunks]
        engine.render(wanted, core_count(), finish)
    return digests


class _SharedFrames:
    """A reader that keeps a chunk's frames, so that jobs that share a driver share its decoding."""

    def __init__(self, reader: IuvReader, file: DriverIuv) -> None:
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
