"""`mt verify`: whether an output is what its record says."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from motion_transfer.cli.options import FILE, SectionCommand, described_options, section
from motion_transfer.cli.progress import choose_listener
from motion_transfer.cli.terminal import note, tell
from motion_transfer.option import options_from_words
from motion_transfer.render.options.verified import VerifyOptions

if TYPE_CHECKING:
    from motion_transfer.render.verify import Rendered, Verification

result_option = section("Result")


@click.command(cls=SectionCommand)
@click.argument("output", type=FILE, metavar="OUTPUT")
@described_options(VerifyOptions)
@result_option("-q", "--quiet", is_flag=True, help="Say nothing: the exit code tells.")
@result_option("--json", "as_json", is_flag=True, help="Print JSON.")
def verify(output: Path, quiet: bool, as_json: bool, **words: Any) -> int:
    """Compare an output of `mt run` or `mt batch` with the record that it carries.

    Alone, it tells whether its pictures are those that were written. With the inputs: which of them
    changed; or else whether some segments, rendered again, are the same to the byte, or at least
    look the same. Exit code: 0 nothing speaks against it, 1 something differs.

    \b
    mt verify out.mp4
    mt verify out.mp4 --source me.png --driver dance_iuv/
    """
    from motion_transfer.render.verify import verify as compare

    options = options_from_words(VerifyOptions, words)
    found = compare(output, options, choose_listener(quiet=quiet or as_json, as_json=False))
    if as_json:
        click.echo(json.dumps(_facts(found), indent=2))
    elif not quiet:
        _tell(found)
    return 0 if found.verified else 1


def _facts(found: Verification) -> dict[str, Any]:
    rendered = [
        {
            **{key: value for key, value in asdict(each).items() if "psnr" not in key},
            # JSON knows no infinity
            "least_psnr_db": _finite(each.least_psnr_db),
            "mean_psnr_db": _finite(each.mean_psnr_db),
        }
        for each in found.rendered
    ]
    return {
        "output": str(found.output),
        "verified": found.verified,
        "edited": found.edited,
        "other_length": found.other_length,
        "inputs": [asdict(finding) for finding in found.inputs],
        "here": found.here,
        "seed": found.seed,
        "rendered": rendered,
    }


def _finite(level: float) -> float | None:
    return round(level, 2) if math.isfinite(level) else None


def _tell(found: Verification) -> None:
    record = found.record
    version = record.versions.get("motion-transfer", "")
    tell(
        f"{found.output}: {record.output.frames} frames by motion-transfer {version},"
        f" {record.renderer} renderer ({record.execution})"
    )
    if found.is_whole:
        _line("pictures", "as they were written")
    for start, stop in found.edited:
        _line("pictures", f"frames {start}:{stop} are not what was written")
    if found.other_length:
        _line("pictures", "there are more or fewer frames than were written")
    for finding in found.inputs:
        detail = f": {finding.detail}" if finding.detail else ""
        _line(finding.option, f"{finding.file}: {finding.state}{detail}")
    for difference in found.here:
        _line("here", difference)
    for each in found.rendered:
        _line("rendered", f"frames {each.start}:{each.stop}: {_describe(each)}")
    lacking = [finding.option for finding in found.inputs if finding.state == "not given"]
    if lacking:
        given = ", ".join(dict.fromkeys(lacking))
        note(f"nothing was rendered again; for that, give {given} as well")
    tell("verified" if found.verified else "differs")


def _describe(each: Rendered) -> str:
    if each.same_bytes:
        return "the same bytes"
    words = f"PSNR {each.least_psnr_db:.1f} dB at least, {each.mean_psnr_db:.1f} dB on average"
    if math.isinf(each.mean_psnr_db) and each.mean_psnr_db > 0:
        words = "the same pixels"
    return words if each.alike else f"other pictures, {words}"


def _line(what: str, words: str) -> None:
    tell(f"  {what:<17} {words}")
