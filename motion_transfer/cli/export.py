"""`mt export`: a checkpoint as files that other programs run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import FILE, SectionCommand, described_options, section
from motion_transfer.cli.progress import long_wait
from motion_transfer.cli.terminal import counted, tell
from motion_transfer.drawing.export.options import ExportOptions
from motion_transfer.option import options_from_words
from motion_transfer.weights import DEFAULT_WEIGHTS

output_option = section("Output")


@click.command(cls=SectionCommand)
@click.argument("weights", type=FILE, default=DEFAULT_WEIGHTS)
@described_options(ExportOptions)
@output_option("-q", "--quiet", is_flag=True, help="Say only errors.")
def export(weights: Path, quiet: bool, **words: Any) -> None:
    """Write the networks of WEIGHTS (lite, which ships, if none are named) for other programs.

    The encoder makes a feature map of a person's texture, once; the painter draws a frame of the
    feature map and of target IUV. The sampler gives what the painter looks up. README.md and
    model.json in the folder tell their inputs and outputs, docs/export.md how to run them from
    Python, C++ and browsers.

    \b
    mt export -o networks/
    mt export mine.safetensors -o networks/ --format onnx,openvino --precision f32,int8
    """
    from motion_transfer.drawing.export.run import export_model

    options = options_from_words(ExportOptions, words)
    with long_wait("writing the networks", quiet=quiet):
        files = export_model(weights, options)
    if not quiet:
        size = sum(file.stat().st_size for file in files)
        tell(f"wrote {options.output}: {counted(len(files), 'file')}, {size / 1e6:.1f} MB")
