"""What an evaluation found: its protocol, a summary of each number; as JSON, as CSV, as a table."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from motion_transfer.errors import InputError
from motion_transfer.evaluation.candidates import Candidate
from motion_transfer.evaluation.framing import MASK_RULE, RESIZE_FILTER, Framing
from motion_transfer.evaluation.measures import Column, Measures
from motion_transfer.evaluation.scoring import PairScores
from motion_transfer.media.structured import parse_json, read_text
from motion_transfer.training.pairs import PairList
from motion_transfer.version import package_version

RESULTS_FILE = "results.json"
FORMAT = "mt-eval-1"
ARROWS = {"higher": "↑", "lower": "↓"}
BEST = "*"


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """How numbers were measured. Where two have `differences`, their numbers are not compared.

    Attributes:
        resolution: WIDTHxHEIGHT, px.
        resize_filter, padding, background, mask: See `motion_transfer.evaluation.framing`.
        pairs_name: For people; the same pairs may go by another name.
        pairs_count, pairs_sha256: Of what was scored: names, order and pixels.
        metrics: Each number's definition, with the SHA-256 of the weights behind it.
        packages: MAJOR.MINOR of the libraries that resize pictures and compute numbers.
        choices: What the protocol that was followed leaves open, and what was done about it.
    """

    resolution: str
    resize_filter: str
    padding: str
    background: str
    mask: str
    pairs_name: str = field(compare=False)
    pairs_count: int
    pairs_sha256: str
    metrics: Mapping[str, str]
    packages: Mapping[str, str]
    choices: Mapping[str, str] = field(default_factory=dict)

    def differences(self, other: Protocol) -> list[str]:
        """List why numbers of the two may not be compared, a line for each; none if they may.

        A number that only one of them has is no difference.
        """
        lines = []
        for name in (item.name for item in fields(self) if item.compare):
            ours, theirs = getattr(self, name), getattr(other, name)
            if isinstance(ours, Mapping):
                lines += [
                    f"{name}.{key}: {ours[key]} / {theirs[key]}"
                    for key in ours
                    if key in theirs and ours[key] != theirs[key]
                ]
            elif ours != theirs:
                lines.append(f"{name}: {ours} / {theirs}")
        return lines

    @classmethod
    def of(
        cls,
        framing: Framing,
        pairs: PairList,
        measures: Measures,
        choices: Mapping[str, str],
    ) -> Protocol:
        """Tell how these measures find the numbers of these pairs."""
        return cls(
            resolution=f"{framing.width}x{framing.height}",
            resize_filter=RESIZE_FILTER,
            padding="centred, #{:02x}{:02x}{:02x}".format(*framing.padding),
            background=framing.background_rule,
            mask=MASK_RULE,
            pairs_name=pairs.name,
            pairs_count=len(pairs),
            pairs_sha256=pairs.digest,
            metrics={column.name: column.definition for column in measures.columns},
            packages=package_versions(measures.packages),
            choices=choices,
        )

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Protocol:
        """Invert `asdict`. Raises: InputError if fields are missing or unknown."""
        values = {"choices": {}, **values}  # files from before there were any have none
        wrong = sorted({item.name for item in fields(cls)} ^ set(values))
        if wrong:
            raise InputError(f"the protocol lacks, or should not have, {', '.join(wrong)}")
        if not all(
            isinstance(values[name], Mapping) for name in ("metrics", "packages", "choices")
        ):
            raise InputError("the protocol's metrics, packages and choices are not all tables")
        return cls(**values)


def package_versions(names: Sequence[str]) -> dict[str, str]:
    """Tell MAJOR.MINOR of packages; patch releases do not change what they compute."""
    return {name: ".".join(package_version(name).split(".")[:2]) for name in names}


@dataclass(frozen=True)
class Summary:
    """One number over all pairs.

    Attributes:
        mean, median: Over the pairs that have it; NaN where none has.
        standard_error: Of the mean; None where it cannot be told (one group only, infinite values,
            a number of the whole set).
        count: How many pairs have it.
    """

    mean: float
    median: float | None
    standard_error: float | None
    count: int


def summarise(values: Sequence[float], groups: Sequence[str]) -> Summary:
    """Compute mean, median and standard error; NaN means that a pair does not have the number.

    Pairs of one group (of one source, of one clip) are not independent, so the error is that of a
    mean of G clusters: sqrt(G / (G - 1) * sum over groups of (sum of deviations)^2) / n. Where
    each pair is a group of its own this is the usual standard deviation / sqrt(n).
    Source: Liang and Zeger, Biometrika 1986, for a mean.
    """
    array = np.asarray(values, np.float64)
    known = ~np.isnan(array)
    array = array[known]
    if not len(array):
        return Summary(math.nan, None, None, 0)
    mean, median = float(array.mean()), float(np.median(array))
    _, member = np.unique(np.asarray(groups)[known], return_inverse=True)
    count = int(member.max()) + 1
    if count < 2 or not np.isfinite(array).all():
        return Summary(mean, median, None, len(array))
    sums = np.bincount(member, weights=array - mean)
    error = float(np.sqrt(count / (count - 1) * (sums**2).sum()) / len(array))
    return Summary(mean, median, error, len(array))


@dataclass(frozen=True)
class Method:
    """A candidate's line: what it is, and its numbers by column."""

    label: str
    description: Mapping[str, Any]
    scores: Mapping[str, Summary]


def summarise_methods(
    candidates: Sequence[Candidate], measures: Measures, scored: Sequence[PairScores]
) -> tuple[Method, ...]:
    """Make each candidate's line of the scores of all pairs."""
    groups = [entry.pair.group for entry in scored]
    methods = []
    for number, candidate in enumerate(candidates):
        scores = {}
        for column in measures.columns:
            values = [entry.scores[number].get(column.name, math.nan) for entry in scored]
            scores[column.name] = summarise(values, groups)
        for place, measure in enumerate(measures.sets):
            kept = [entry.features[place] for entry in scored]
            results, targets = [each[number + 1] for each in kept], [each[0] for each in kept]
            distance = measure.distance(results, targets)
            scores[measure.columns[0].name] = Summary(distance, None, None, len(scored))
        methods.append(Method(candidate.label, candidate.describe(), scores))
    return tuple(methods)


@dataclass(frozen=True)
class Published:
    """Numbers that a paper printed. They are shown, and never taken for measured ones.

    Attributes:
        source: Where they stand.
        remark: How they came about.
        better: For each number, which end is good, `higher` or `lower`.
        scores: For each method its numbers.
    """

    source: str
    remark: str
    better: Mapping[str, str]
    scores: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Results:
    """What a results file holds; what was published is written into it, but not read from it."""

    protocol: Protocol
    columns: tuple[Column, ...]
    methods: tuple[Method, ...]
    published: Published | None = None

    def to_json(self, made_with: Mapping[str, str]) -> str:
        """Write the file's text. Numbers that JSON lacks are null (NaN) and "inf"."""

        def plain(value: float | None) -> float | str | None:
            if value is None or math.isnan(value):
                return None
            return "inf" if math.isinf(value) else value

        methods = [
            {
                **method.description,
                "label": method.label,
                "scores": {
                    name: {key: plain(value) for key, value in asdict(summary).items()}
                    for name, summary in method.scores.items()
                },
            }
            for method in self.methods
        ]
        content: dict[str, Any] = {
            "format": FORMAT,
            "made_with": dict(made_with),
            "protocol": asdict(self.protocol),
            "columns": [asdict(column) for column in self.columns],
            "methods": methods,
        }
        if self.published is not None:
            content["published"] = asdict(self.published)
        return json.dumps(content, indent=1, allow_nan=False) + "\n"


def read_results(path: Path) -> Results:
    """Read a results file, or the one in a folder.

    Raises: InputError if it is none, or damaged.
    """
    file = path / RESULTS_FILE if path.is_dir() else path
    try:
        content = parse_json(read_text(file, "results file"), str(file))
        if content["format"] != FORMAT:
            raise InputError(f"{file} has format {content['format']!r}, expected {FORMAT!r}")
        return Results(
            Protocol.from_dict(content["protocol"]),
            tuple(Column(**column) for column in content["columns"]),
            tuple(_read_method(entry) for entry in content["methods"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{file} is not a results file of `mt eval`: {error}") from error


def _read_method(entry: dict[str, Any]) -> Method:
    scores = {}
    for name, written in entry.pop("scores").items():
        numbers: dict[str, Any] = {k: math.inf if v == "inf" else v for k, v in written.items()}
        if numbers["mean"] is None:
            numbers["mean"] = math.nan
        scores[name] = Summary(**numbers)
    return Method(entry.pop("label"), entry, scores)


def compare(paths: Sequence[Path]) -> str:
    """Draw a table of the methods of several results files.

    Raises: InputError naming what differs, if they were not measured alike.
    """
    if len(paths) < 2:
        raise InputError("--compare needs two results files or more")
    read = [read_results(path) for path in paths]
    problems = [
        f"{paths[0]} / {path}: {line}"
        for path, results in zip(paths[1:], read[1:], strict=True)
        for line in read[0].protocol.differences(results.protocol)
    ]
    if problems:
        first = "these results may not be compared, as they were measured differently"
        raise InputError(first, *(f"  {problem}" for problem in problems))
    columns = {column.name: column for results in read for column in results.columns}
    methods = [
        Method(f"{_origin(path)}:{method.label}", method.description, method.scores)
        for path, results in zip(paths, read, strict=True)
        for method in results.methods
    ]
    return table(tuple(columns.values()), methods, read[0].protocol.pairs_count)


def describe_results(results: Results) -> str:
    """Write what an evaluation found: its table, and that of published numbers."""
    protocol = results.protocol
    count = protocol.pairs_count
    lines = [
        table(results.columns, results.methods, count),
        f"{count} pairs of {protocol.pairs_name} at {protocol.resolution};"
        " mean ± standard error, * best",
    ]
    if results.published is not None:
        beside = table_beside(results.published, results.columns, results.methods, count)
        choices = (
            "what the paper leaves open, and what holds here: protocol.choices in results.json"
        )
        lines += ["", beside, results.published.remark, choices]
    return "\n".join(lines)


def table(columns: Sequence[Column], methods: Sequence[Method], pairs_count: int) -> str:
    """Draw numbers as rows, methods as columns: mean ± standard error, the best of a row marked.

    A number that not all pairs have says of how many it is the mean.
    """
    rows = [["", *(method.label for method in methods)]]
    rows += [[_head(column, methods, pairs_count), *_cells(column, methods)] for column in columns]
    return _align(rows)


def table_beside(
    published: Published, columns: Sequence[Column], methods: Sequence[Method], pairs_count: int
) -> str:
    """Draw the published numbers right of a bar, and left of it the measured ones of their kinds.

    A number that was not measured has its row all the same.
    """
    measured = {column.name: column for column in columns}
    rows = [["", *(method.label for method in methods), "|", *published.scores]]
    for name, better in published.better.items():
        if name in measured:
            row = [_head(measured[name], methods, pairs_count), *_cells(measured[name], methods)]
        else:
            row = [f"{name} {ARROWS[better]}", *("- " for _ in methods)]
        rows.append([*row, "|", *(f"{each[name]:.3f}" for each in published.scores.values())])
    return f"measured here | published: {published.source}\n{_align(rows)}"


def _align(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
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
    """Write a line for each pair and method; empty where a pair does not have a number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [column.name for column in columns]
    writer.writerow(["source", "target", "method", *names])
    for entry in scored:
        for method, scores in zip(methods, entry.scores, strict=True):
            values = [scores[name] for name in names]
            cells = ["" if math.isnan(value) else repr(float(value)) for value in values]
            writer.writerow([entry.pair.source.name, entry.pair.target.name, method, *cells])
    return text.getvalue()


def _head(column: Column, methods: Sequence[Method], pairs_count: int) -> str:
    """What begins a row: its number, which end is good, and of how many pairs it is."""
    name = f"{column.name} {ARROWS[column.better]}"
    counts = {m.scores[column.name].count for m in methods if column.name in m.scores}
    if counts <= {pairs_count}:
        return name
    low, high = min(counts), max(counts)
    return f"{name} of {low}" if low == high else f"{name} of {low}-{high}"


def _cells(column: Column, methods: Sequence[Method]) -> list[str]:
    """A row of the table. What looks equal is marked equal; the real frames are no rival."""
    cells: list[str] = []
    rivals: dict[int, float] = {}
    for number, method in enumerate(methods):
        summary = method.scores.get(column.name)
        if summary is None or math.isnan(summary.mean):
            cells.append("-")
            continue
        text = f"{summary.mean:.{column.decimals}f}"
        if summary.standard_error is not None:
            text += f" ±{summary.standard_error:.{column.decimals}f}"
        cells.append(f"{text} ")
        if method.description.get("kind") != "target":
            rivals[number] = round(summary.mean, column.decimals)
    if len(rivals) > 1:
        best = max(rivals.values()) if column.better == "higher" else min(rivals.values())
        for number, mean in rivals.items():
            if mean == best:
                cells[number] = cells[number][:-1] + BEST
    return cells


def _origin(path: Path) -> str:
    file = path if path.name != RESULTS_FILE else path.resolve().parent
    return file.name.removesuffix(".json")
