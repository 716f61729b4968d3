"""`mt batch`: a manifest's jobs rendered, checked, counted, reported, and cleaned up after."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from motion_transfer.cli.event_lines import VERSION
from motion_transfer.cli.options import FILE, CommandGroup, add_options, events_option
from motion_transfer.cli.progress import CountBar, JsonPrinter
from motion_transfer.cli.terminal import counted, printable, tell

if TYPE_CHECKING:
    from motion_transfer.batch.events import BatchEvent, BatchListener

SETTINGS = "Over a field of the manifest, or an option of all its jobs; may be repeated."
manifest_options = add_options(
    [
        click.argument("manifest", metavar="FILE|-", type=FILE),
        click.option("--set", "settings", multiple=True, metavar="K=V", help=SETTINGS),
    ]
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON.")


@click.group(cls=CommandGroup)
def batch() -> None:
    """Render a manifest of many jobs; go on where it was interrupted.

    \b
    mt batch validate jobs/shoot.yaml
    mt batch run jobs/shoot.yaml --workers 2 --set background=photo
    make_jobs | mt batch run -
    """


@batch.command()
@manifest_options
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
@events_option()
def run(jobs: str | None, quiet: bool, as_json: bool, **options: Any) -> int:
    """Render what is missing. Exit code: 0 all is done, 1 jobs failed, 130 interrupted."""
    from motion_transfer.batch.run import BatchOptions, run_batch
    from motion_transfer.option import parse_range

    chosen = parse_range(jobs, "jobs") if jobs else (None, None)
    with CountBar("", unit="frame", quiet=quiet or as_json) as bar:
        listener = JsonPrinter() if as_json else _reporter(bar, quiet=quiet)
        tally = run_batch(BatchOptions(chosen=chosen, **options), listener)
    return 1 if tally.failed else 0


@batch.command()
@manifest_options
def validate(manifest: Path, settings: tuple[str, ...]) -> None:
    """Check a manifest and that its inputs are there; render nothing."""
    from motion_transfer.batch.run import check_batch, read_batch

    read = read_batch(manifest, settings)
    check_batch(read)
    tell(f"{read.name}: {counted(len(read.jobs), 'job')}, all inputs are there")


@batch.command()
@manifest_options
@json_option
def status(manifest: Path, settings: tuple[str, ...], as_json: bool) -> None:
    """How many jobs are done, failed, to do."""
    from motion_transfer.batch.run import count_jobs, read_batch

    read = read_batch(manifest, settings)
    counts = count_jobs(read)
    if as_json:
        words = {word.replace(" ", "_"): number for word, number in counts.items()}
        click.echo(json.dumps({"version": VERSION, **words}))
        return
    click.echo(", ".join(f"{number} {word}" for word, number in counts.items()))
    for job in read.jobs:
        record = read.state.records.get(str(job.options.output), {})
        if record.get("status") == "failed":
            tell(f"failed: {job.name}: {record['error']}")


@batch.command()
@manifest_options
def report(manifest: Path, settings: tuple[str, ...]) -> None:
    """Write the report anew: a page and JSON, beside the outputs."""
    from motion_transfer.batch.report import write_report
    from motion_transfer.batch.run import read_batch

    read = read_batch(manifest, settings)
    tell(f"wrote {write_report(read.jobs, read.state)}")


@batch.command()
@manifest_options
def clean(manifest: Path, settings: tuple[str, ...]) -> None:
    """Remove what is kept between runs: journals and half-done work. Outputs stay."""
    from motion_transfer.batch.run import read_batch

    read = read_batch(manifest, settings)
    count = read.state.clean([job.options.output for job in read.jobs])
    click.echo(f"removed {counted(count, 'work folder')}")


def _reporter(bar: CountBar, *, quiet: bool) -> BatchListener:
    """Make a listener that says what a person should read, beside the bar of all jobs' frames."""
    from motion_transfer.batch import events

    frame_count = 0

    def say(words: str, *, err: bool = True) -> None:  # a plain print would tear the bar
        tqdm.write(printable(words), file=sys.stderr if err else sys.stdout)

    def report(event: BatchEvent) -> None:
        nonlocal frame_count
        match event:
            case events.JobPlanned():
                frame_count += event.frame_count
                bar.advance(event.done_count, frame_count)
            case events.JobFrames():
                bar.advance(event.frame_count)
            case events.JobFailed():
                say(f"mt: failed: {event.name}: {event.message}")
            case _ if quiet:
                pass
            case events.JobNotice():
                say(f"mt: note: {event.name}: {event.message}")
            case events.JobDone():
                frames = counted(event.frame_count, "frame")
                say(f"wrote {event.output}: {frames} ({event.seconds:.1f} s of work)", err=False)
            case events.BatchStopping():
                chunks = counted(event.running_count, "running chunk")
                say(f"mt: finishing {chunks}; Ctrl-C now stops at once")
            case events.BatchFinished():
                result = (
                    f"{event.done_count} done, {event.current_count} up to date,"
                    f" {event.failed_count} failed, {event.left_count} left; {event.seconds:.1f} s,"
                    f" {counted(event.feature_maps, 'source')} prepared"
                )
                say(result, err=False)

    return report
