"""`mt inspect`."""

from __future__ import annotations

import json
from pathlib import Path

import click

from motion_transfer.cli.info import layout


@click.command()
@click.argument("path", type=click.Path(path_type=Path))
@click.option("--iuv-order", metavar="ORDER", help="Take the channels as iuv or vui.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def inspect(path: Path, iuv_order: str | None, as_json: bool) -> None:
    """Say what PATH holds: IUV (order, size, parts, gaps, people), photo, or weights."""
    from motion_transfer.render.about import describe_path

    facts = describe_path(path, iuv_order)
    click.echo(json.dumps(facts, indent=2) if as_json else layout(facts))
