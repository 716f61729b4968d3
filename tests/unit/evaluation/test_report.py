"""Results files and tables."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.measures import Column
from motion_transfer.evaluation.protocol import Protocol
from motion_transfer.evaluation.report import Method, Results, compare, read_results, table
from motion_transfer.evaluation.summary import Summary

COLUMNS = (Column("ssim", "higher", 3, "SSIM"), Column("l1", "lower", 2, "l1"))
PROTOCOL = Protocol(
    resolution="256x256",
    resize_filter="area",
    padding="white",
    background="white",
    mask="alpha",
    pairs_name="pairs.csv",
    pairs_count=9,
    pairs_sha256="ab",
    metrics={column.name: column.definition for column in COLUMNS},
    packages={},
)


def method(label: str, ssim: float, l1: float, kind: str = "results") -> Method:
    scores = {"ssim": Summary(ssim, ssim, 0.01, 9), "l1": Summary(l1, None, None, 9)}
    return Method(label, {"kind": kind}, scores)


RESULTS = Results(PROTOCOL, COLUMNS, (method("a", 0.7, 20), method("b", 0.8, 20.001)))


def write(folder: Path, name: str, results: Results = RESULTS) -> Path:
    path = folder / name
    path.write_text(results.to_json({"torch": "2.13"}))
    return path


def test_a_results_file_reads_back(tmp_path: Path) -> None:
    found = read_results(write(tmp_path, "results.json"))
    assert found == RESULTS
    assert read_results(tmp_path) == RESULTS


def test_numbers_that_json_lacks_survive(tmp_path: Path) -> None:
    perfect = replace(RESULTS, methods=(method("real", math.inf, math.nan),))
    path = write(tmp_path, "a.json", perfect)
    assert "NaN" not in path.read_text()
    assert "Infinity" not in path.read_text()
    scores = read_results(path).methods[0].scores
    assert scores["ssim"].mean == math.inf
    assert math.isnan(scores["l1"].mean)


def test_the_table_marks_the_best_as_printed() -> None:
    lines = table(COLUMNS, RESULTS.methods).splitlines()
    assert lines[0].split() == ["a", "b"]
    assert lines[1].split() == ["ssim", "↑", "0.700", "±0.010", "0.800", "±0.010*"]
    assert lines[2].split() == ["l1", "↓", "20.00*", "20.00*"]  # equal as printed


def test_the_target_does_not_compete_and_gaps_are_dashes() -> None:
    real = method("real", 1.0, 0.0, kind="target")
    lines = table(COLUMNS, [method("a", 0.7, math.nan), real]).splitlines()
    assert "*" not in "".join(lines)
    assert lines[2].split() == ["l1", "↓", "-", "0.00"]
    rivals = [method("a", 0.7, 25), method("b", 0.6, 20), real]
    lines = table(COLUMNS, rivals).splitlines()
    assert lines[1].split() == [
        "ssim",
        "↑",
        "0.700",
        "±0.010*",
        "0.600",
        "±0.010",
        "1.000",
        "±0.010",
    ]
    assert lines[2].split() == ["l1", "↓", "25.00", "20.00*", "0.00"]


def test_comparable_results_share_a_table(tmp_path: Path) -> None:
    more = Column("fid", "lower", 1, "FID")
    fid = Method("c", {}, {"fid": Summary(12.34, None, None, 9)})
    other = Results(replace(PROTOCOL, metrics={"fid": "FID"}), (more,), (fid,))
    text = compare([write(tmp_path, "x.json"), write(tmp_path, "y.json", other)])
    lines = text.splitlines()
    assert lines[0].split() == ["x:a", "x:b", "y:c"]
    assert lines[3].split() == ["fid", "↓", "-", "-", "12.3"]


def test_other_protocols_are_refused_by_name(tmp_path: Path) -> None:
    small = replace(PROTOCOL, resolution="128x128", metrics={"ssim": "another"})
    paths = [
        write(tmp_path, "x.json"),
        write(tmp_path, "same.json"),
        write(tmp_path, "y.json", replace(RESULTS, protocol=small)),
    ]
    with pytest.raises(InputError) as caught:
        compare(paths)
    first, *lines = str(caught.value).splitlines()
    assert "may not be compared" in first
    assert [line.partition(".json: ")[2] for line in lines] == [
        "resolution: 256x256 / 128x128",
        "metrics.ssim: SSIM / another",
    ]
    assert all(f"{paths[0]} / {paths[2]}" in line for line in lines)


def test_what_cannot_be_compared(tmp_path: Path) -> None:
    path = write(tmp_path, "x.json")
    with pytest.raises(InputError, match="two results files or more"):
        compare([path])
    for text, reason in (
        ("words", "is not a results file"),
        ("[]", "is not a results file"),
        ('{"format": "mt-eval-9"}', "has format 'mt-eval-9', expected 'mt-eval-1'"),
        ('{"format": "mt-eval-1"}', "is not a results file"),
    ):
        other = tmp_path / "y.json"
        other.write_text(text)
        with pytest.raises(InputError, match=reason):
            compare([path, other])
    content = json.loads(path.read_text())
    del content["protocol"]["mask"]
    other.write_text(json.dumps(content))
    with pytest.raises(InputError, match="lacks, or should not have, mask"):
        compare([path, other])
