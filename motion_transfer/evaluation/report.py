"""What an evaluation found: as JSON, as CSV, as a table, and against another one."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.evaluation.measures import Column
from motion_transfer.evaluation.protocol import Protocol
from motion_transfer.evaluation.scoring import PairScores
from motion_transfer.evaluation.summary import Summary
from motion_transfer.media.image import read_bytes

FORMAT = "mt-eval-1"
ARROWS = {"higher": "↑", "lower": "↓"}
BEST = "*"


@dataclass(frozen=True)
class Method:
    """A candidate's line: what it is, and its numbers by column."""

    label: str
    description: Mapping[str, Any]
    scores: Mapping[str, Summary]


@dataclass(frozen=True)
class Results:
    """What a results file holds."""

    protocol: Protocol
    columns: tuple[Column, ...]
    methods: tuple[Method, ...]

    def to_json(self, made_with: Mapping[str, str]) -> str:
        """The file's text. Numbers that JSON lacks are null (unknown) and "inf"."""
        content = {
            "format": FORMAT,
            "made_with": dict(made_with),
            "protocol": self.protocol.to_dict(),
            "columns": [asdict(column) for column in self.columns],
            "methods": [
                {
                    **method.description,
                    "label": method.label,
                    "scores": {
                        name: {key: _to_plain(value) for key, value in asdict(summary).items()}
                        for name, summary in method.scores.items()
                    },
                }
                for method in self.methods
            ],
        }
        return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_results(path: Path) -> Results:
    """Read a results file. Raises: InputError if it is none, or damaged."""
    file = path / "results.json" if path.is_dir() else path
    try:
        content = json.loads(read_bytes(file, "results file"))
        if content["format"] != FORMAT:
            raise InputError(f"{file} has format {content['format']!r}, expected {FORMAT!r}")
        methods = []
        for entry in content["methods"]:
            scores = {
                name: Summary(**{key: _from_plain(value, key) for key, value in numbers.items()})
                for name, numbers in entry["scores"].items()
            }
            description = {k: v for k, v in entry.items() if k not in ("label", "scores")}
            methods.append(Method(entry["label"], description, scores))
        columns = tuple(Column(**column) for column in content["columns"])
        return Results(Protocol.from_dict(content["protocol"]), columns, tuple(methods))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file} is not a results file of `mt eval`: {error}") from error


def compare(paths: Sequence[Path]) -> str:
    """A table of the methods of several results files.

    Raises: InputError naming what differs, if they were not measured alike.
    """
    if len(paths) < 2:
        raise InputError("--compare needs two results files or more")
    read = [read_results(path) for path in paths]
    problems = []
    for path, results in zip(paths[1:], read[1:], strict=True):
        differences = read[0].protocol.differences(results.protocol)
        problems += [f"{paths[0]} / {path}: {line}" for line in differences]
    if problems:
        raise InputError(
            "\n  ".join(
                ["these results may not be compared, as they were measured differently", *problems]
            )
        )
    columns = {column.name: column for results in read for column in results.columns}
    methods = [
        Method(f"{_origin(path)}:{method.label}", method.description, method.scores)
        for path, results in zip(paths, read, strict=True)
        for method in results.methods
    ]
    return table(tuple(columns.values()), methods)


def table(columns: Sequence[Column], methods: Sequence[Method]) -> str:
    """Numbers as rows, methods as columns: mean ± standard error, the best of a row marked."""
    rows = [["", *(method.label for method in methods)]]
    for column in columns:
        best = _best(column, methods)
        cells = [f"{column.name} {ARROWS[column.better]}"]
        cells += [_cell(method, column, best) for method in methods]
        rows.append(cells)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    )


def scores_csv(
    scored: Sequence[PairScores], columns: Sequence[Column], methods: Sequence[str]
) -> str:
    """A line for each pair and method; empty where a pair does not have a number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [column.name for column in columns if column.name != "fid"]
    writer.writerow(["source", "target", "method", *names])
    for entry in scored:
        for method, scores in zip(methods, entry.scores, strict=True):
            values = [scores.get(name, math.nan) for name in names]
            cells = ["" if math.isnan(value) else repr(value) for value in values]
            writer.writerow([entry.pair.source.name, entry.pair.target.name, method, *cells])
    return text.getvalue()


def _best(column: Column, methods: Sequence[Method]) -> float | None:
    """The best mean as it is printed, so that what looks equal is marked equal; of rivals only."""
    means = [
        round(method.scores[column.name].mean, column.decimals)
        for method in methods
        if column.name in method.scores and method.description.get("kind") != "target"
    ]
    means = [mean for mean in means if not math.isnan(mean)]
    if len(means) < 2:
        return None
    return max(means) if column.better == "higher" else min(means)


def _cell(method: Method, column: Column, best: float | None) -> str:
    summary = method.scores.get(column.name)
    if summary is None or math.isnan(summary.mean):
        return "-"
    text = f"{summary.mean:.{column.decimals}f}"
    if summary.standard_error is not None:
        text += f" ±{summary.standard_error:.{column.decimals}f}"
    rival = method.description.get("kind") != "target"
    marked = rival and round(summary.mean, column.decimals) == best
    return text + (BEST if marked else " ")


def _origin(path: Path) -> str:
    file = path if path.name != "results.json" else path.resolve().parent
    return file.name.removesuffix(".json")


def _to_plain(value: float | int | None) -> float | int | str | None:
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else "inf"


def _from_plain(value: Any, key: str) -> Any:
    if value is None and key == "mean":
        return math.nan
    return math.inf if value == "inf" else value
