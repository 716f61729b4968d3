"""`mt preview`."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from motion_transfer.cli.run import pair_garments
from motion_transfer.cli.sections import SectionCommand, SectionOption, loose_run_options
from motion_transfer.errors import InputError
from motion_transfer.render.option import list_options
from motion_transfer.render.options import RenderOptions

PREVIEW: dict[str, Any] = {"cls": SectionOption, "section": "Preview"}


@click.command(cls=SectionCommand)
@click.argument("manifest", required=False, type=click.Path(path_type=Path))
@click.option("--job", type=int, default=0, help="Of the manifest, counted from 0.", **PREVIEW)
@click.option(
    "--frame",
    type=int,
    help="No page: write this frame of the driver to -o FILE.png, as the video will show it.",
    **PREVIEW,
)
@click.option(
    "--job-file",
    type=click.Path(path_type=Path),
    default=Path("preview.yaml"),
    show_default=True,
    help='Where "Save job" writes.',
    **PREVIEW,
)
@click.option("--port", type=int, default=0, help="Default: any that is free.", **PREVIEW)
@click.option("--no-open", is_flag=True, help="Print the link, and open no browser.", **PREVIEW)
@loose_run_options
@click.pass_context
def preview(
    context: click.Context,
    manifest: Path | None,
    job: int,
    frame: int | None,
    job_file: Path,
    port: int,
    no_open: bool,
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    **words: Any,
) -> None:
    """See a run frame by frame in the browser, before it is rendered.

    The page listens on this machine only. Elsewhere, bring it here by a tunnel:
    ssh -L 8000:127.0.0.1:8000 HOST, and --port 8000 --no-open there. Ctrl-C ends it.

    \b
    mt preview --source photo.png --driver iuv_frames/
    mt preview jobs/shoot.yaml --job 3
    mt preview --source photo.png --driver iuv_frames/ --frame 12 -o frame.png
    """
    from motion_transfer.preview.opening import options_of_job, options_of_words

    words["garments"] = pair_garments(garments, garment_parts)
    if manifest is not None:
        _refuse_others(context, manifest)
        options = options_of_job(manifest, job)
    else:
        options = options_of_words(words)
    if frame is not None:
        from motion_transfer.preview.single import write_frame

        if words["output"] is None:
            raise InputError("--frame needs -o FILE.png")
        write_frame(options, frame, Path(words["output"]))
        click.echo(f"{words['output']}: frame {frame}, {options.renderer} renderer")
        return
    _serve(options, job_file, port, open_browser=not no_open)


def _refuse_others(context: click.Context, manifest: Path) -> None:
    """Raises: InputError for options of a run beside a manifest, which has its own."""
    own = {entry.name for entry in list_options(RenderOptions)} - {"output", "force"}
    for name in own & context.params.keys():
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise InputError(f"{manifest} says what its jobs do; leave out --{name}")


def _serve(options: RenderOptions, job_file: Path, port: int, *, open_browser: bool) -> None:
    from motion_transfer.preview.opening import open_server, open_session

    server = open_server(port)
    click.echo(server.link)
    sys.stdout.flush()
    if open_browser:
        click.launch(server.link)
    with contextlib.suppress(KeyboardInterrupt):  # the way to end it
        server.serve(lambda: open_session(options, job_file))
