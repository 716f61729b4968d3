"""`mt batch`."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

if TYPE_CHECKING:
    from motion_transfer.batch.events import BatchEvent

MANIFEST = click.Path(path_type=Path)
manifest_argument = click.argument("manifest", metavar="FILE", type=MANIFEST)
set_option = click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="K=V",
    help="Over a field of the manifest, or an option of all its jobs; may be repeated.",
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


@click.group()
def batch() -> None:
    """Render a manifest of many jobs; go on where it was interrupted.

    \b
    mt batch validate jobs/shoot.yaml
    mt batch run jobs/shoot.yaml --workers 2 --set background=photo
    """


@batch.command()
@manifest_argument
@set_option
@click.option("--jobs", metavar="A:B", help="Only these jobs, counted from 0, B excluded.")
@click.option("--workers", type=int, help="Processes; default: one for each GPU, or each core.")
@click.option("--engine", default="local", metavar="local|ray", help="Where chunks are rendered.")
@click.option("--address", metavar="WHERE", help="Ray cluster: auto, or ray://HOST:PORT.")
@click.option(
    "--keep-going/--fail-fast",
    default=True,
    help="After a failed job: go on with the others (default), or stop.",
)
@click.option("--restart", is_flag=True, help="Forget what earlier runs finished.")
@click.option("-q", "--quiet", is_flag=True, help="Say only errors.")
@json_option
def run(jobs: str | None, quiet: bool, as_json: bool, **options: Any) -> int:
    """Render what is missing. Exit code: 0 all is done, 1 jobs failed, 130 interrupted."""
    from motion_transfer.batch.run import BatchOptions, run_batch
    from motion_transfer.render.options import parse_range

    chosen = parse_range(jobs, "jobs") if jobs else (None, None)
    printer = _Printer(quiet=quiet, as_json=as_json)
    try:
        tally = run_batch(BatchOptions(chosen=chosen, **options), printer)
    finally:
        printer.close()
    return 1 if tally.failed else 0


@batch.command()
@manifest_argument
@set_option
def validate(manifest: Path, settings: tuple[str, ...]) -> None:
    """Check a manifest and that its inputs are there; render nothing."""
    from motion_transfer.batch.run import read_batch
    from motion_transfer.batch.run import validate as check

    read = read_batch(manifest, settings)
    check(read)
    click.echo(f"{manifest}: {len(read.jobs)} jobs, all inputs are there")


@batch.command()
@manifest_argument
@set_option
@json_option
def status(manifest: Path, settings: tuple[str, ...], as_json: bool) -> None:
    """How many jobs are done, failed, to do."""
    from motion_transfer.batch.run import read_batch
    from motion_transfer.batch.run import status as count

    read = read_batch(manifest, settings)
    counts = count(read)
    if as_json:
        click.echo(json.dumps(counts))
        return
    click.echo(", ".join(f"{number} {word}" for word, number in counts.items()))
    for job in read.jobs:
        record = read.state.records.get(str(job.options.output), {})
        if record.get("status") == "failed":
            click.echo(f"failed: {job.name}: {record['error']}")


@batch.command()
@manifest_argument
@set_option
def report(manifest: Path, settings: tuple[str, ...]) -> None:
    """Write the report anew: a page and JSON, beside the outputs."""
    from motion_transfer.batch.report import write_report
    from motion_transfer.batch.run import read_batch

    read = read_batch(manifest, settings)
    click.echo(f"wrote {write_report(read.jobs, read.state)}")


@batch.command()
@manifest_argument
@set_option
def clean(manifest: Path, settings: tuple[str, ...]) -> None:
    """Remove what is kept between runs: journals and half-done work. Outputs stay."""
    from motion_transfer.batch.run import read_batch

    read = read_batch(manifest, settings)
    count = read.state.clean([job.options.output for job in read.jobs])
    click.echo(f"removed {count} work folders")


class _Printer:
    """Events as lines, or as JSON; a bar of frames on a terminal."""

    def __init__(self, *, quiet: bool, as_json: bool) -> None:
        self._quiet = quiet
        self._as_json = as_json
        self._bar: tqdm | None = None
        if sys.stderr.isatty() and not quiet and not as_json:
            self._bar = tqdm(total=0, unit="frame", leave=False, dynamic_ncols=True)

    def close(self) -> None:
        """Take the bar off the screen."""
        if self._bar is not None:
            self._bar.close()

    def __call__(self, event: BatchEvent) -> None:
        from motion_transfer.batch import events

        if self._as_json:
            fields = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(event).items()}
            click.echo(json.dumps({"event": type(event).__name__.lower(), **fields}))
            return
        match event:
            case events.JobPlanned() if self._bar is not None:
                self._bar.total = (self._bar.total or 0) + event.frame_count
                self._bar.update(event.done_count)
            case events.JobFrames() if self._bar is not None:
                self._bar.update(event.frame_count)
            case events.JobFailed():
                tqdm.write(f"mt: failed: {event.name}: {event.message}", file=sys.stderr)
            case _:
                self._say(_words(event))

    def _say(self, words: tuple[str, bool]) -> None:
        text, is_result = words
        if text and not self._quiet:
            tqdm.write(text, file=sys.stdout if is_result else sys.stderr)


def _words(event: BatchEvent) -> tuple[str, bool]:
    """A sentence, and whether it is a result (stdout) or news (stderr)."""
    from motion_transfer.batch import events

    match event:
        case events.JobNotice():
            return f"mt: note: {event.name}: {event.message}", False
        case events.JobDone():
            rate = event.frame_count / max(event.seconds, 1e-9)
            return f"wrote {event.output}: {event.frame_count} frames ({rate:.0f} frames/s)", True
        case events.BatchStopping():
            return (
                f"mt: finishing {event.running_count} running chunks; Ctrl-C now stops at once",
                False,
            )
        case events.BatchFinished():
            return (
                f"{event.done_count} done, {event.current_count} up to date,"
                f" {event.failed_count} failed, {event.left_count} left; {event.seconds:.1f} s,"
                f" {event.feature_maps} sources prepared",
                True,
            )
    return "", False
