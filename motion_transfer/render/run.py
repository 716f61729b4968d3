"""One run from options to a finished output: what `mt run` and `render_video` both call."""

from __future__ import annotations

import logging
import pickle
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

from motion_transfer.drawing.renderers import DRAFT
from motion_transfer.errors import OutputError
from motion_transfer.events import (
    Finished,
    FramesDone,
    Listener,
    Notice,
    Stage,
    Started,
    ignore,
)
from motion_transfer.media.credentials import sign
from motion_transfer.media.output.segments import join_segments, read_mark, segment_path
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import (
    check_destination,
    explain_disk_errors,
    publish,
    work_folder,
)
from motion_transfer.media.work import WorkFolder, key_of, publish_piece, was_published
from motion_transfer.render.chunks import PICKLE_PROTOCOL, render
from motion_transfer.render.composition import Composed, Prepared, compose, read_format
from motion_transfer.render.crew import Crew, result_of
from motion_transfer.render.driver import DriverScan
from motion_transfer.render.engine import ContactSheet, Engine
from motion_transfer.render.options import OutputOptions, RenderOptions
from motion_transfer.render.plan import Chunk, describe_missing
from motion_transfer.render.provenance import mark_with

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RenderReport:
    """What a run made.

    Attributes:
        output: The finished file or folder.
        renderer: The one that drew it.
        wall_seconds: The whole run.
        render_seconds: Without planning and loading.
        missing: Half-open ranges of driver frames in which nobody was found.
    """

    output: Path
    renderer: str
    frame_count: int
    width: int
    height: int
    frame_rate: Fraction
    wall_seconds: float
    render_seconds: float
    missing: tuple[tuple[int, int], ...] = ()

    @property
    def duration_seconds(self) -> float:
        return float(self.frame_count / self.frame_rate)


def run(options: RenderOptions, listener: Listener = ignore) -> RenderReport:
    """Render a source with a driver's motion; go on where an interrupted run of it stopped.

    Raises: InputError and its kinds for anything the caller gave that cannot be used, before
        rendering where it can be known; KeyboardInterrupt is passed on. In every case of failure an
        existing output is untouched, and what stays behind is a hidden folder beside the output
        with the chunks that were finished, if any were.
    """
    began = time.perf_counter()
    read_format(options)  # before anything is made beside an output that cannot be
    check_destinations(options)
    with (
        WorkFolder(options.output, restart=options.restart) as work,
        # a network's calls take long, and leave the lock of Python's threads alone
        Crew(work.temporary("crew") if options.renderer == DRAFT else None) as crew,
    ):
        composed = prepare(options, work, listener, crew)
        prepared = composed.prepared
        render_began = time.perf_counter()
        log.debug("prepared in %.2f s", render_began - began)
        _render(options, composed, work, listener, crew)
    ended = time.perf_counter()
    log.debug("rendered and written in %.2f s", ended - render_began)
    plan, (width, height) = prepared.plan, prepared.canvas.size
    report = RenderReport(
        output=options.output,
        renderer=prepared.recipe.name,
        frame_count=len(plan.frames),
        width=width,
        height=height,
        frame_rate=plan.frame_rate,
        wall_seconds=ended - began,
        render_seconds=ended - render_began,
        missing=tuple(plan.missing),
    )
    if note := describe_missing(plan.frames, plan.first, plan.frame_rate):
        listener(Notice(note))
    listener(
        Finished(
            report.output,
            report.frame_count,
            report.duration_seconds,
            report.renderer,
            report.wall_seconds,
            report.render_seconds,
        )
    )
    return report


def check_destinations(options: OutputOptions) -> None:
    """Refuse an output that exists, unless it may be replaced or a stopped run just published it.

    Raises: OutputError.
    """
    ours = not options.restart and was_published(options.output)
    for path in filter(None, (options.output, options.sheet)):
        check_destination(path, force=options.force or ours)


def prepare(
    options: RenderOptions, work: WorkFolder, listener: Listener, crew: Crew | None = None
) -> Composed:
    """Do everything that comes before the first frame. Raises: InputError and its kinds."""

    def keep(scan: DriverScan) -> None:
        if scan.pictures is not None:  # so that their folder stays if the run is stopped
            work.note(scan.pictures.iuv.name, scan.pictures.digest, scan.pictures.key)

    return compose(options, work.path, listener, scanned=keep, crew=crew)


def missing_chunks(prepared: Prepared, work: WorkFolder) -> list[Chunk]:
    """List the chunks that no earlier run of the same content has finished."""
    return [
        chunk
        for chunk in prepared.plan.chunks
        if not work.has(piece_of(prepared, chunk), prepared.chunk_keys[chunk.index])
    ]


def piece_of(prepared: Prepared, chunk: Chunk) -> str:
    """Name a chunk's segment in the work folder."""
    return segment_path(Path(), chunk.index, prepared.output_format).name


def output_key(options: OutputOptions, prepared: Prepared) -> str:
    """Compute the key of the whole output."""
    return key_of(
        {
            "chunks": prepared.chunk_keys,
            "audio": prepared.audio,
            "record": asdict(prepared.record),
            "told": [options.provenance, options.credentials_cert, options.credentials_key],
        }
    )


def assemble(
    options: RenderOptions, prepared: Prepared, folder: Path, sheet: ContactSheet | None
) -> Path:
    """Join the segments in a work folder to an output without its name yet; write the sheet.

    Raises: InputError if an input has changed since the run began.
    """
    finished = folder / f"finished.part-0{options.output.suffix.lower()}"
    segments = [
        (folder / piece_of(prepared, chunk), chunk.stop - chunk.start)
        for chunk in prepared.plan.chunks
    ]
    join_segments(
        segments,
        finished,
        prepared.output_format,
        prepared.plan.frame_rate,
        prepared.audio,
        mark_with(prepared.record, full=options.provenance == "full"),
    )
    if options.credentials_cert is not None and options.credentials_key is not None:
        finished = _sign(options, finished)
    prepared.inputs.check()
    if sheet is not None and options.sheet is not None:
        with work_folder(options.sheet) as place:
            mark = prepared.output_format.mark
            write_png(place / "sheet.png", sheet.picture(), mark and mark.xmp())
            publish(place / "sheet.png", options.sheet)
    return finished


def _sign(options: RenderOptions, finished: Path) -> Path:
    """Sign a finished output. Returns: The signed one. Raises: InputError."""
    mark = read_mark(finished)
    assert mark and options.credentials_cert and options.credentials_key
    signed = finished.with_name(f"signed.part-0{finished.suffix}")
    sign(
        finished,
        signed,
        title=options.output.name,
        source_type=mark.term,
        record=mark.record,
        ingredients=options.source if mark.record else (),
        certificate=options.credentials_cert,
        key=options.credentials_key,
    )
    finished.unlink()
    return signed


def open_engine(composed: Composed, **more: Any) -> Engine:
    """Open the engine of a run. Args: more: What else an `Engine` takes. Raises: InputError."""
    prepared = composed.prepared
    return Engine(
        prepared,
        readers=prepared.open_people(),
        renderers=[prepared.recipe.renderer(each) for each in composed.appearances],
        backdrop=prepared.backdrop.open(),
        **more,
    )


class _ChunkTasks:
    """Chunks of one run as tasks of its crew."""

    def __init__(
        self,
        options: OutputOptions,
        composed: Composed,
        work: WorkFolder,
        crew: Crew,
        note: Callable[[Chunk, str], None],
    ) -> None:
        """Hand out what they need. Args: note: Told of a finished chunk and its digest."""
        self._options = options
        self._note = note
        self._prepared = composed.prepared
        self._work = work
        self._crew = crew
        blobs = {"run": composed.prepared, "appearances": composed.appearances}
        self._blobs = [
            crew.share(name, partial(pickle.dumps, blob, PICKLE_PROTOCOL))
            for name, blob in blobs.items()
        ]

    def begin(self, chunk: Chunk) -> Future[Any] | None:
        run, appearances = self._blobs
        piece = piece_of(self._prepared, chunk)
        return self._crew.offer(
            render,
            *("", run, "", appearances, self._work.path, self._options.output),
            [(chunk.index, self._work.temporary(piece), piece)],
            self._options.sheet is not None,
            False,
        )

    def finish(self, chunk: Chunk, future: Future[Any]) -> None:
        [(_, digest)] = result_of(future)
        self._note(chunk, digest)


def _render(
    options: RenderOptions, composed: Composed, work: WorkFolder, listener: Listener, crew: Crew
) -> None:
    prepared = composed.prepared
    key = output_key(options, prepared)
    if work.published(key):
        work.clear()
        return
    check_destination(options.output, force=options.force)
    frame_count = len(prepared.plan.frames)
    width, height = prepared.canvas.size
    rate = str(prepared.plan.frame_rate)
    listener(Started(prepared.recipe.name, frame_count, width, height, rate))
    sheet = ContactSheet(work.path, frame_count) if options.sheet else None
    missing = missing_chunks(prepared, work)
    count = len(prepared.plan.chunks)
    log.debug(
        "%d of %d chunks of %s to render with %s on %d threads, %s",
        *(len(missing), count, options.driver, prepared.recipe.name, options.worker_count),
        prepared.output_format.codec_name,
    )
    done = frame_count - sum(chunk.stop - chunk.start for chunk in missing)
    if done:
        listener(Notice(f"{done} of {frame_count} frames were finished before; going on there"))
    listener(Stage("render", frame_count))
    listener(FramesDone(done))

    def note(chunk: Chunk, digest: str) -> None:
        nonlocal done
        work.note(piece_of(prepared, chunk), digest, prepared.chunk_keys[chunk.index])
        done += chunk.stop - chunk.start

    def finish(chunk: Chunk, path: Path) -> None:
        note(chunk, publish_piece(path, work.path / piece_of(prepared, chunk)))

    chunks = [(chunk, work.temporary(piece_of(prepared, chunk))) for chunk in missing]
    try:
        with explain_disk_errors(options.output):
            helpers = _ChunkTasks(options, composed, work, crew, note)
            engine = open_engine(composed, sheet=sheet, listener=listener, helpers=helpers)
            engine.render(chunks, options.worker_count, finish)
            finished = assemble(options, prepared, work.path, sheet)
            work.publish(finished, key)
    except BaseException as error:
        # whatever it was that failed for want of it
        if isinstance(error, Exception) and not work.path.exists():
            raise OutputError(
                f"cannot write {options.output}: a folder was removed that it is written in; start"
                " again"
            ) from error
        if done:
            listener(
                Notice(
                    f"{done} of {frame_count} frames are kept; the same command goes on from there,"
                    " and --restart begins anew"
                )
            )
        raise
    work.clear()
