"""`mt preview`: a run before it is rendered, in the browser or as one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from motion_transfer.cli.options import FILE, SectionCommand, described_options, pair_words, section
from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.serving import serve_page
from motion_transfer.cli.terminal import tell
from motion_transfer.errors import InputError
from motion_transfer.extras import require_extra
from motion_transfer.option import list_options, options_from_words
from motion_transfer.render.options import RenderOptions

preview_option = section("Preview")


@click.command(cls=SectionCommand)
@click.argument("manifest", required=False, type=FILE)
@preview_option("--job", type=int, default=0, help="Of the manifest, counted from 0.")
@preview_option(
    "--frame",
    type=int,
    help="No page: write this frame of the driver to -o FILE.png, as the video will show it.",
)
@preview_option(
    "--job-file",
    type=FILE,
    default=Path("preview.yaml"),
    show_default=True,
    help='Where "Save job" writes.',
)
@preview_option(
    "--folder",
    type=FILE,
    default=Path("~/motion-transfer"),
    show_default=True,
    help="For what the page is given, and what it makes.",
)
@preview_option("--port", type=int, default=0, help="Default: any that is free.")
@preview_option("--no-open", is_flag=True, help="Print the link, and open no browser.")
@described_options(RenderOptions, required=False)
@click.pass_context
def preview(
    context: click.Context,
    manifest: Path | None,
    job: int,
    frame: int | None,
    job_file: Path,
    folder: Path,
    port: int,
    no_open: bool,
    garments: tuple[str, ...],
    garment_parts: tuple[str, ...],
    partners: tuple[str, ...],
    partner_person: tuple[str, ...],
    **words: Any,
) -> None:
    """See a run frame by frame in the browser, and render it there.

    Without options it begins empty: photo and motion are dropped on the page, or chosen there.
    The page listens on this machine only. Elsewhere, bring it here by a tunnel:
    ssh -L 8000:127.0.0.1:8000 HOST, and --port 8000 --no-open there. Ctrl-C ends it.

    \b
    mt preview
    mt preview --source photo.png --driver iuv_frames/
    mt preview jobs/shoot.yaml --job 3
    mt preview --source photo.png --driver iuv_frames/ --frame 12 -o frame.png
    """
    words["partners"] = pair_words(partners, partner_person, "partner", "person")
    words["garments"] = pair_words(garments, garment_parts, "garment", "parts")
    if manifest is not None:
        _refuse_others(context, manifest)
        options, is_empty, names_output = _options_of_job(manifest, job), False, True
    else:
        is_empty, names_output = not words["source"], bool(words["output"])
        if frame is not None:
            _refuse_without(words)
        options = _options_of_words(words)
    if options.adapt:
        from motion_transfer.render.composition import settle_weights

        options = settle_weights(options, choose_listener(quiet=False, as_json=False))
    if frame is not None:
        from motion_transfer.preview.views import write_frame

        if words["output"] is None:
            raise InputError("--frame needs -o FILE.png")
        write_frame(options, frame, Path(words["output"]))
        tell(f"{words['output']}: frame {frame}, {options.renderer} renderer")
        return
    begin = {"is_empty": is_empty, "names_output": names_output}
    _serve(options, folder.expanduser(), job_file, begin, port, open_browser=not no_open)


def _refuse_others(context: click.Context, manifest: Path) -> None:
    """Raise InputError for options of a run beside a manifest, which has its own."""
    # --frame needs -o of its own: a job's output is a video
    own = {entry.name for entry in list_options(RenderOptions)} - {"output", "force"}
    for name in own & context.params.keys():
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            raise InputError(f"{manifest} says what its jobs do; leave out --{name}")


def _options_of_job(manifest: Path, number: int) -> RenderOptions:
    from motion_transfer.batch.run import read_batch

    jobs = read_batch(manifest).jobs
    if not 0 <= number < len(jobs):
        raise InputError(f"job {number} asked for, but {manifest} has {len(jobs)}, from 0")
    return jobs[number].options


def _refuse_without(words: dict[str, Any]) -> None:
    """Raise InputError unless a frame can be written at once."""
    for name in ("source", "driver"):
        if not words[name]:
            raise InputError(f"--{name} is missing; give a source and a driver, or a manifest")


def _options_of_words(words: dict[str, Any]) -> RenderOptions:
    """Read options; what is chosen on the page later has something in its place until then."""
    from motion_transfer.preview.choices import FIRST_MOTION, FIRST_PERSON

    given = {
        **words,
        "source": words["source"] or (FIRST_PERSON,),
        "driver": words["driver"] or FIRST_MOTION,
        "output": words["output"] or "video.mp4",
    }
    return options_from_words(RenderOptions, given)


def _serve(
    options: RenderOptions,
    folder: Path,
    job_file: Path,
    begin: dict[str, bool],
    port: int,
    *,
    open_browser: bool,
) -> None:
    require_extra("preview")
    from motion_transfer.preview.server import PreviewServer

    def open_session() -> Any:
        from motion_transfer.preview.session import Session  # loads what draws: seconds

        return Session(options, folder, job_file, **begin)

    server = PreviewServer(port)
    serve_page(server.link, lambda: server.serve(open_session), open_browser=open_browser)
