"""Protocols, summaries, results files and tables."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.measures import Column
from motion_transfer.evaluation.report import (
    Method,
    Protocol,
    Published,
    Results,
    Summary,
    compare,
    package_versions,
    read_results,
    scores_csv,
    summarise,
    table,
    table_beside,
)
from motion_transfer.evaluation.scoring import PairScores
from motion_transfer.training.pairs import Pair
from motion_transfer.training.pictures import PhotoFile

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
    packages={"torch": "2.13"},
    choices={"pairs": "drawn"},
)
CHANGES = {
    "resolution": "512x512",
    "resize_filter": "nearest",
    "padding": "black",
    "background": "photo",
    "mask": "none",
    "pairs_count": 3,
    "pairs_sha256": "cd34",
    "metrics": {"ssim": "another SSIM", "l1": "l1"},
    "packages": {"torch": "2.14"},
    "choices": {"pairs": "listed"},
}


def method(label: str, ssim: float, l1: float, kind: str = "results") -> Method:
    scores = {"ssim": Summary(ssim, ssim, 0.01, 9), "l1": Summary(l1, None, None, 9)}
    return Method(label, {"kind": kind}, scores)


RESULTS = Results(PROTOCOL, COLUMNS, (method("a", 0.7, 20), method("b", 0.8, 20.001)))


def write(folder: Path, name: str, results: Results = RESULTS) -> Path:
    path = folder / name
    path.write_text(results.to_json({"torch": "2.13"}))
    return path


# --- protocols: whatever changes a number makes a difference, and it is named


def test_equal_protocols_have_no_differences() -> None:
    same = replace(PROTOCOL)
    assert same == PROTOCOL
    assert PROTOCOL.differences(same) == []
    assert Protocol.from_dict(asdict(PROTOCOL)) == PROTOCOL


@pytest.mark.parametrize("name", CHANGES)
def test_every_field_counts_and_is_named(name: str) -> None:
    other = replace(PROTOCOL, **{name: CHANGES[name]})
    assert other != PROTOCOL
    (line,) = PROTOCOL.differences(other)
    assert line.startswith(name)
    assert " / " in line


def test_the_table_of_changes_is_complete() -> None:
    assert {item.name for item in fields(Protocol)} == {*CHANGES, "pairs_name"}
    assert replace(PROTOCOL, pairs_name="other.csv").differences(PROTOCOL) == []


def test_other_weights_are_a_difference_and_missing_metrics_are_none() -> None:
    other = replace(PROTOCOL, metrics={"l1": "weights 2", "fid": "weights 3"})
    assert PROTOCOL.differences(other) == ["metrics.l1: l1 / weights 2"]
    assert PROTOCOL.differences(replace(PROTOCOL, metrics={"fid": "weights 3"})) == []


def test_what_is_no_protocol() -> None:
    values = asdict(PROTOCOL)
    with pytest.raises(InputError, match="lacks, or should not have, mask, masks"):
        Protocol.from_dict({**{k: v for k, v in values.items() if k != "mask"}, "masks": ""})
    with pytest.raises(InputError, match="are not all tables"):
        Protocol.from_dict({**values, "metrics": "ssim"})


def test_a_file_from_before_there_were_choices_is_read() -> None:
    values = {name: value for name, value in asdict(PROTOCOL).items() if name != "choices"}
    assert Protocol.from_dict(values) == replace(PROTOCOL, choices={})


def test_package_versions_leave_patches_out() -> None:
    import torch

    found = package_versions(("torch", "no-such-package"))
    assert found["no-such-package"] == "unknown"
    assert torch.__version__.startswith(found["torch"] + ".")
    assert found["torch"].count(".") == 1


# --- summaries: means and their errors


def test_independent_pairs_have_the_usual_error() -> None:
    values = np.random.default_rng(0).normal(size=20)
    found = summarise(list(values), [str(n) for n in range(20)])
    assert found.mean == pytest.approx(values.mean())
    assert found.median == pytest.approx(np.median(values))
    assert found.standard_error == pytest.approx(values.std(ddof=1) / math.sqrt(20))
    assert found.count == 20


def test_repeating_a_pair_adds_no_certainty() -> None:
    values = np.random.default_rng(0).normal(size=10)
    groups = [str(n) for n in range(10)]
    once = summarise(list(values), groups)
    thrice = summarise(list(values) * 3, groups * 3)
    assert thrice.standard_error == pytest.approx(once.standard_error)


def test_pairs_without_the_number_are_left_out() -> None:
    found = summarise([1.0, math.nan, 3.0], ["a", "b", "c"])
    assert (found.mean, found.median, found.count) == (2, 2, 2)
    nothing = summarise([math.nan], ["a"])
    assert math.isnan(nothing.mean)
    assert (nothing.median, nothing.standard_error, nothing.count) == (None, None, 0)


def test_where_the_error_cannot_be_told() -> None:
    assert summarise([1.0, 2.0], ["a", "a"]) == Summary(1.5, 1.5, None, 2)
    found = summarise([1.0, math.inf], ["a", "b"])
    assert (found.mean, found.standard_error) == (math.inf, None)


# --- files


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


def test_a_line_for_each_pair_and_method(tmp_path: Path) -> None:
    pair = Pair(PhotoFile("a.png", tmp_path), PhotoFile("b, c.png", tmp_path), group="a")
    scores = [{"ssim": 0.1, "l1": math.nan}, {"ssim": math.inf, "l1": np.float64(1 / 3)}]
    assert scores_csv([PairScores(pair, scores, [])], COLUMNS, ["x", "y"]).splitlines() == [
        "source,target,method,ssim,l1",
        'a.png,"b, c.png",x,0.1,',
        'a.png,"b, c.png",y,inf,0.3333333333333333',
    ]


# --- tables


def test_the_table_marks_the_best_as_printed() -> None:
    lines = table(COLUMNS, RESULTS.methods, 9).splitlines()
    assert lines[0].split() == ["a", "b"]
    assert lines[1].split() == ["ssim", "↑", "0.700", "±0.010", "0.800", "±0.010*"]
    assert lines[2].split() == ["l1", "↓", "20.00*", "20.00*"]  # equal as printed


def test_the_target_does_not_compete_and_gaps_are_dashes() -> None:
    real = method("real", 1.0, 0.0, kind="target")
    lines = table(COLUMNS, [method("a", 0.7, math.nan), real], 9).splitlines()
    assert "*" not in "".join(lines)
    assert lines[2].split() == ["l1", "↓", "-", "0.00"]
    rivals = [method("a", 0.7, 25), method("b", 0.6, 20), real]
    lines = table(COLUMNS, rivals, 9).splitlines()
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


def test_the_table_says_of_how_many_pairs_a_number_is(tmp_path: Path) -> None:
    few = Summary(0.5, 0.5, None, 3)
    methods = [method("a", 0.7, 2.0), method("b", 0.8, 1.0)]
    name = COLUMNS[1].name
    some = [replace(each, scores={**each.scores, name: few}) for each in methods]
    lines = table(COLUMNS, some, 9).splitlines()
    assert f"{name} ↓ of 3 " in lines[2]
    assert " of " not in lines[1]
    one = [some[0], methods[1]]
    assert " of 3-9 " in table(COLUMNS, one, 9)


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
        ("words", r"y\.json:1: Expecting value"),
        ("[" * 50000, r"y\.json:1: lists and mappings lie in each other more"),
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


# --- what a paper printed stands beside what was measured, and apart from it

PUBLISHED = Published(
    "A Table", "ten pairs", {"ssim": "higher", "lpips": "lower"}, {"X": {"ssim": 0.9, "lpips": 0.1}}
)


def test_published_numbers_have_a_side_of_their_own() -> None:
    head, labels, ssim, lpips = table_beside(PUBLISHED, COLUMNS, RESULTS.methods, 9).splitlines()
    assert head == "measured here | published: A Table"
    assert labels.split() == ["a", "b", "|", "X"]
    # the best of those measured: the published one is no rival
    assert ssim.split() == ["ssim", "↑", "0.700", "±0.010", "0.800", "±0.010*", "|", "0.900"]
    assert lpips.split() == ["lpips", "↓", "-", "-", "|", "0.100"]
    assert labels.index("|") == ssim.index("|") == lpips.index("|")


def test_they_are_in_the_file_and_never_among_its_methods(tmp_path) -> None:
    path = write(tmp_path, "one.json", replace(RESULTS, published=PUBLISHED))
    assert json.loads(path.read_text())["published"] == asdict(PUBLISHED)
    assert read_results(path) == RESULTS
    assert "0.9" not in compare([path, path])
