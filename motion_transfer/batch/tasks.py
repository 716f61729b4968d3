"""What workers do for a batch besides rendering: functions of plain arguments.

A task takes and gives blobs: what one worker computed (a driver's scan, a source's appearance, a
prepared run) goes to the others as bytes, which the scheduler hands around and never opens.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from motion_transfer.batch.state import Files
from motion_transfer.media.unchanged import Inputs
from motion_transfer.render.chunks import PICKLE_PROTOCOL
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.workers import Fetch

if TYPE_CHECKING:  # the scheduler imports this module, and has no need of the libraries below
    from motion_transfer.events import Listener
    from motion_transfer.render.composition import Prepared


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


def _hear() -> tuple[dict[str, None], Listener]:
    """Make a listener, and what it collects: notices, each once, in their order."""
    from motion_transfer.events import Event, Notice

    notices: dict[str, None] = {}

    def listen(event: Event) -> None:
        if isinstance(event, Notice):
            notices[event.message] = None

    return notices, listen


def scan(options: RenderOptions, folder: Path) -> tuple[bytes, list[str]]:
    """Look through a driver, for each of the cast.

    Args:
        folder: Where the IUV of drivers is kept that are raw pictures.
    Returns: The scans, and what is worth saying.
    Raises: InputError, IuvFileError.
    """
    from motion_transfer.render.composition import scan_cast

    notices, listen = _hear()
    scanned = scan_cast(options, folder, listen, workers=1)
    return pickle.dumps(scanned, PICKLE_PROTOCOL), list(notices)


def encode(options: RenderOptions) -> tuple[bytes, bytes, tuple[str, ...]]:
    """Read the source of each of the cast and compute its appearance, the feature map.

    Returns: The sources with what they were read from, their appearances, and what is worth saying.
    Raises: InputError, WeightsError.
    """
    from motion_transfer.events import ignore
    from motion_transfer.render.composition import (
        cast_files,
        open_recipe,
        read_cast,
        settle_weights,
    )

    options = settle_weights(options, ignore)
    inputs = Inputs(cast_files(options))
    recipe = open_recipe(options)
    sources = read_cast(options, recipe, ignore)
    appearances = tuple(recipe.appearance_of(source) for source in sources)
    told = pickle.dumps((sources, inputs), PICKLE_PROTOCOL)
    notes = tuple(dict.fromkeys(note for source in sources for note in source.notes))
    return told, pickle.dumps(appearances, PICKLE_PROTOCOL), notes


def prepare(
    options: RenderOptions, scanned: Fetch, encoded: Fetch, folder: Path
) -> tuple[bytes, Outline]:
    """Plan a run and put its parts together.

    Args:
        folder: Where what is found in raw pictures is kept.
    Raises: InputError and its kinds, also if a source is no longer what its appearance was made
        from.
    """
    from motion_transfer.render.composition import (
        check_early,
        open_recipe,
        plan_cast,
        prepare_run,
        settle_weights,
    )
    from motion_transfer.render.engine import CHUNKS_AT_ONCE
    from motion_transfer.render.plan import describe_missing
    from motion_transfer.render.run import output_key, piece_of

    notices, listen = _hear()
    check_early(options)
    scans = pickle.loads(scanned())
    plans = plan_cast(options, scans)
    options = settle_weights(options, listen)  # in the cache by now
    recipe = open_recipe(options)
    sources, inputs = pickle.loads(encoded())
    run = prepare_run(options, scans, plans, recipe, sources, inputs, folder, listen)
    plan = run.plan
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
        output_key(options, run),
        "; ".join(filter(None, [*notices, missing])),
        run.inputs.keys(),
    )
    return pickle.dumps(run, PICKLE_PROTOCOL), outline


def assemble(
    options: RenderOptions, prepared: Fetch, folder: Path, pictures: Path
) -> tuple[Path, bool]:
    """Join finished segments, and make the report's pictures.

    Args:
        pictures: What their names begin with, see `write_posters`.
    Returns: The output without its name yet, and whether it has pictures.
    """
    from motion_transfer.batch.report import write_posters
    from motion_transfer.drawing.canvas import colour_iuv
    from motion_transfer.media.publish import explain_disk_errors
    from motion_transfer.render.engine import ContactSheet
    from motion_transfer.render.run import assemble as join

    run: Prepared = pickle.loads(prepared())
    sheet = ContactSheet(folder, len(run.plan.frames)) if options.sheet else None
    with explain_disk_errors(options.output):
        finished = join(options, run, folder, sheet)
    middle = run.plan.first + len(run.plan.frames) // 2
    driver = colour_iuv(next(run.open_people()[0].read(middle, middle + 1)))
    posters = write_posters(options.source[0], driver, finished, pictures)
    return finished, posters
