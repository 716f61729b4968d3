"""What an export is: which files, of which numbers. Light, so that help is instant."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.drawing.engines import PRECISIONS
from motion_transfer.errors import InputError
from motion_transfer.option import REQUIRED, option

PLAIN = "f32"


@dataclass(frozen=True)
class FormatRow:
    """One format of files.

    Attributes:
        package: The library that has to be installed to write it.
        precisions: What it can hold.
        writer: `module:function`, which writes a `formats.Network` to a path.
        ending: Of the file.
        signed: Whether all 8-bit numbers have to have a sign.
        run_here: Whether what was written can be run without more than the format's package.
    """

    package: str
    precisions: tuple[str, ...]
    writer: str
    ending: str
    signed: bool = False
    run_here: bool = True

    @property
    def installed(self) -> bool:
        return importlib.util.find_spec(self.package) is not None


HOME = "motion_transfer.drawing.export"

FORMATS = {
    "onnx": FormatRow("onnx", ("int8", PLAIN), f"{HOME}.formats:write_onnx", ".onnx"),
    "openvino": FormatRow("openvino", PRECISIONS, f"{HOME}.formats:write_openvino", ".xml"),
    # version 11 multiplies in what the graph says and takes no wish for bf16 any more
    "tensorrt": FormatRow(
        "tensorrt",
        ("int8", PLAIN),
        f"{HOME}.tensorrt_plan:write_plan",
        ".plan",
        signed=True,
        run_here=False,
    ),
}


def _words(
    known: Collection[str], what: str, default: str
) -> Callable[[Iterable[str]], tuple[str, ...]]:
    """Make a parser of words, also of several between commas, each of them once."""
    listed = ", ".join(known)

    def parse(written: Iterable[str]) -> tuple[str, ...]:
        words = [word for text in written for word in text.split(",")]
        for word in words:
            if word not in known:
                raise InputError(f"{what} is {word!r}; supported are {listed}")
        return tuple(dict.fromkeys(words or [default]))

    return parse


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Which files an export writes, and where."""

    output: Path = option("-o --output", "Output", "A new folder.", kind="path", default=REQUIRED)
    formats: tuple[str, ...] = option(
        "--format",
        "Output",
        "onnx (default), openvino, or tensorrt (where TensorRT is installed; for this machine's"
        " GPU); several between commas.",
        kind="words",
        default=("onnx",),
        metavar="NAME[,NAME]",
        parse=_words(FORMATS, "format", "onnx"),
    )
    precisions: tuple[str, ...] = option(
        "--precision",
        "Output",
        "What the painter multiplies: f32 (default), int8 (a third of the size; where the weights"
        " tell their ranges), or, of openvino, bf16 (half); several between commas.",
        kind="words",
        default=(PLAIN,),
        metavar="NAME[,NAME]",
        parse=_words(PRECISIONS, "precision", PLAIN),
    )
    force: bool = option(
        "--force", "Output", "Replace what an earlier export wrote.", kind="flag", default=False
    )

    def __post_init__(self) -> None:
        for name in self.formats:
            row = FORMATS[name]
            if not row.installed:
                raise InputError(
                    f"--format {name} needs {row.package}; pip install {row.package}, or choose"
                    " another"
                )
            for precision in self.precisions:
                if precision not in row.precisions:
                    others = ", ".join(row.precisions)
                    raise InputError(
                        f"--precision {precision}: {name} has {others}; choose one of them"
                    )
