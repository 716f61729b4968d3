"""`mt eval --protocol deepfashion`, with stand-in people under the names of DeepFashion In-shop."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer.evaluation.in_shop import spell_names

OUTFITS = [("WOMEN", "Dresses", 2, 1), ("WOMEN", "Blouses_Shirts", 35, 4), ("MEN", "Denim", 80, 1)]
VIEWS = ["1_front", "2_side", "3_back"]
COMMON = ("--metrics", "ssim", "l1", "--size", "64x96")


class Shop:
    """Photos of three outfits, each in three poses, in one of the benchmark's layouts."""

    def __init__(self, studio, layout: str) -> None:
        self.studio, self.layout = studio, layout
        self.folder: Path = studio.folder / "shop"
        for number, outfit in enumerate(OUTFITS):
            for step, view in enumerate(VIEWS):
                iuv = studio.iuv(4 * step - 4, number)
                stem = self.stem(outfit, view)
                ending = "jpg" if layout == "In-shop" else "png"
                studio.image(f"shop/{stem}.{ending}", studio.dress(iuv))
                studio.image(f"shop/{stem}_IUV.png", iuv)
        if layout == "In-shop":
            lines = [
                f"{self.stem(outfit, view)}.jpg id_{outfit[2]:08d} {'gallery' if i else 'query'}"
                for outfit in OUTFITS
                for i, view in enumerate(VIEWS)
            ]
            text = "\n".join(["9", "image_name item_id evaluation_status", *lines])
            (self.folder / "Eval").mkdir()
            (self.folder / "Eval/list_eval_partition.txt").write_text(text)

    def stem(self, outfit: tuple[str, str, int, int], view: str) -> str:
        gender, category, item, number = outfit
        if self.layout == "In-shop":
            return f"img/{gender}/{category}/id_{item:08d}/{number:02d}_{view}"
        view = view.replace("_", "")
        return f"test/fashion{gender}{category}id{item:08d}{number:02d}_{view}"


@pytest.fixture
def shop(studio, request) -> Shop:
    return Shop(studio, getattr(request, "param", "In-shop"))


@pytest.fixture
def run(mt, shop: Shop):
    """The command on the stand-in's three pairs."""

    def call(*arguments, limit: int = 3):
        return mt(
            *("eval", "--protocol", "deepfashion", "--images", shop.folder, "--limit", limit),
            *arguments,
        )

    return call


def listed(run) -> list[dict[str, str]]:
    result = run("--list-pairs")
    assert (result.code, result.err) == (0, "")
    return list(csv.DictReader(result.out.splitlines()))


@pytest.mark.parametrize("shop", ["In-shop", "flattened"], indirect=True)
def test_one_command_gives_the_papers_table(run, shop: Shop) -> None:
    out = shop.studio.folder / "out"
    result = run("--renderer", "texture", "-o", out, *COMMON)
    assert result.code == 0, result.err
    assert "mt: note: the paper's 176 pairs are not published: these are drawn from" in result.err
    assert "mt: note: lpips, which the paper's table has, is not measured: it needs" in result.err
    content = json.loads((out / "results.json").read_text())
    (texture,) = content["methods"]
    assert content["published"]["scores"]["CBI"] == {"ssim": 0.766, "lpips": 0.178}
    assert "Table 1" in content["published"]["source"]
    choices = content["protocol"]["choices"]
    assert {"pairs", "size", "background", "iuv", "ssim", "lpips", "results"} <= choices.keys()
    assert all("the paper" in words and "; here" in words for words in choices.values())
    split = {"In-shop": "query and gallery", "flattened": "folders named test"}[shop.layout]
    assert split in choices["pairs"]
    lines = result.out.splitlines()
    start = lines.index("measured here | published: Sarkar et al., ECCV 2020, Table 1")
    labels, ssim, lpips = (line.split() for line in lines[start + 1 : start + 4])
    assert labels == ["texture", "|", "CBI", "DSC", "VUnet", "DPT", "NHRR", "GT"]
    mean = f"{texture['scores']['ssim']['mean']:.3f}"
    assert ssim[:3] == ["ssim", "↑", mean]
    assert ssim[-6:] == ["0.766", "0.750", "0.739", "0.759", "0.768", "1.000"]
    assert lpips == ["lpips", "↓", "-", "|", "0.178", "0.214", "0.202", "0.206", "0.164", "0.000"]
    # what was published is shown beside the measured table, never in it
    assert not any("0.766" in line for line in lines[:start])


def test_both_layouts_are_the_same_pairs(studio, mt) -> None:
    names = []
    for layout in ("In-shop", "flattened"):
        Shop(studio, layout).folder.rename(studio.folder / layout)
        out = studio.folder / f"{layout}.out"
        pairs = studio.folder / "pairs.csv"
        pairs.write_text(
            "from,to\nfasionMENDenimid0000008001_1front.jpg,img/MEN/Denim/id_00000080/01_3_back.jpg\n"
            "fasionWOMENBlousesShirtsid0000003504_2side.jpg,"
            "fashionWOMENBlouses_Shirtsid0000003504_3back.jpg\n"
        )
        result = mt(
            *("eval", "--protocol", "deepfashion", "--images", studio.folder / layout),
            *("--pairs", pairs, "--renderer", "texture", "-o", out, *COMMON),
        )
        assert result.code == 0, result.err
        assert "are drawn from" not in result.err
        with (out / "scores.csv").open() as file:
            names.append([(row["source"], row["target"]) for row in csv.DictReader(file)])
    assert (
        names[0]
        == names[1]
        == [
            ("fashionMENDenimid0000008001_1front.jpg", "fashionMENDenimid0000008001_3back.jpg"),
            (
                "fashionWOMENBlousesShirtsid0000003504_2side.jpg",
                "fashionWOMENBlousesShirtsid0000003504_3back.jpg",
            ),
        ]
    )


def test_the_partitions_training_photos_are_left_out(studio, mt) -> None:
    shop = Shop(studio, "In-shop")
    partition = shop.folder / "Eval/list_eval_partition.txt"
    common = ("eval", "--protocol", "deepfashion", "--images", shop.folder, "--list-pairs")
    drawn = mt(*common, "--limit", 1).out.splitlines()[1]
    lines = [
        line.rpartition(" ")[0] + " train" if line.split()[0] in drawn else line
        for line in partition.read_text().splitlines()
    ]
    partition.write_text("\n".join(lines))
    result = mt(*common, "--limit", 2)
    assert result.code == 0, result.err
    assert not set(drawn.split(",")) & set(result.out.replace("\n", ",").split(","))


def test_the_list_of_pairs_needs_no_iuv_and_gives_the_same_pairs(run, shop: Shop) -> None:
    out = shop.studio.folder / "out"
    assert run("--renderer", "texture", "-o", out, *COMMON).code == 0
    first = json.loads((out / "results.json").read_text())["protocol"]
    path = shop.studio.folder / "pairs.csv"
    path.write_text(run("--list-pairs").out)
    again = shop.studio.folder / "again"
    result = run("--pairs", path, "--renderer", "texture", "-o", again, *COMMON)
    assert result.code == 0, result.err
    second = json.loads((again / "results.json").read_text())["protocol"]
    assert first["pairs_sha256"] == second["pairs_sha256"]
    assert first["choices"]["pairs"] != second["choices"]["pairs"]
    for iuv in shop.folder.rglob("*_IUV.png"):
        iuv.unlink()
    assert run("--list-pairs").out == path.read_text()


def test_missing_iuv_is_listed_with_the_way_to_make_it(run, shop: Shop) -> None:
    for iuv in shop.folder.rglob("*_IUV.png"):
        iuv.unlink()
    out = shop.studio.folder / "out"
    result = run("--renderer", "texture", "-o", out, *COMMON)
    assert (result.code, result.out) == (2, "")
    assert "6 problems" in result.err
    assert "6 of 6 photos lack IUV" in result.err
    assert "or `mt iuv PHOTO -o STEM_IUV.png`; --list-pairs tells of which" in result.err
    assert not out.exists()


def test_what_is_no_in_shop_or_too_little_of_it(run, mt, shop: Shop) -> None:
    out = shop.studio.folder / "out"
    methods = ("--renderer", "texture", "-o", out, *COMMON)
    result = run(*methods, limit=4)
    assert (result.code, "has 3 outfits with two photos among" in result.err) == (2, True)
    assert result.err.rstrip().endswith("--limit 3")
    elsewhere = shop.studio.folder / "elsewhere"
    elsewhere.mkdir()
    shop.studio.source("elsewhere/holiday")
    result = mt("eval", "--protocol", "deepfashion", "--images", elsewhere, *methods)
    assert (result.code, "holds no photo of DeepFashion In-shop" in result.err) == (2, True)
    result = mt("eval", "--protocol", "deepfashion", *methods)
    assert (result.code, "needs the photos; name the benchmark's folder" in result.err) == (2, True)
    result = mt("eval", "--pairs", "x.csv", "--list-pairs")
    assert (result.code, "--list-pairs needs --protocol deepfashion" in result.err) == (2, True)


def test_other_pairs_are_not_compared(run, mt, shop: Shop) -> None:
    outs = [shop.studio.folder / name for name in ("x", "y")]
    for out, limit in zip(outs, (2, 3), strict=True):
        assert run("--renderer", "texture", "-o", out, *COMMON, limit=limit).code == 0
    result = mt("eval", "--compare", *outs)
    assert (result.code, "pairs_count: 2 / 3" in result.err) == (2, True)
    assert mt("eval", "--compare", outs[0], outs[0]).code == 0


# --- other methods' pictures, as their published code writes them


def target_of(shop: Shop, row: dict[str, str]) -> np.ndarray:
    return np.array(Image.open(shop.folder / row["to"]))


def flat(name: str) -> str:
    """As Siarohin et al. flatten a name: the category without its underscore, too."""
    stem = spell_names(name.rpartition(".")[0].rpartition("test/")[2])
    return stem.replace("fashion", "fasion") + ".jpg"


@pytest.mark.parametrize("shop", ["In-shop", "flattened"], indirect=True)
def test_dsc_is_scored_from_the_strips_that_its_code_writes(run, shop: Shop) -> None:
    """`FROM.jpg_TO.jpg.png`: source, target and result side by side, of which the result counts."""
    for row in listed(run):
        real = target_of(shop, row)
        strip = np.hstack([np.zeros_like(real), np.full_like(real, 9), real])
        shop.studio.image(f"DSC/{flat(row['from'])}_{flat(row['to'])}.png", strip)
        shop.studio.image(f"alone/{flat(row['from'])}_{flat(row['to'])}.png", real)
    out = shop.studio.folder / "out"
    folders = (shop.studio.folder / "DSC", shop.studio.folder / "alone")
    result = run("--results", *folders, "-o", out, *COMMON)
    assert result.code == 0, result.err
    for method in json.loads((out / "results.json").read_text())["methods"]:
        assert (method["kind"], method["names"]) == ("results", "SOURCE.jpg_TARGET.jpg")
        assert method["scores"]["ssim"]["mean"] == 1
        assert method["scores"]["l1"]["mean"] == 0


def test_vunets_grids_name_no_pairs_so_its_pictures_are_named_first(run, shop: Shop) -> None:
    """`transfer_N.png` tiles a shuffled batch; cut out and named, a picture is like any other."""
    for step in range(3):
        shop.studio.image(f"VUnet/transfer_{step}.png", np.zeros((96, 64, 3), np.uint8))
    out = shop.studio.folder / "out"
    result = run("--results", shop.studio.folder / "VUnet", "-o", out, *COMMON)
    assert result.code == 2
    assert "none of its 3 pictures belongs to a pair; the first should be called" in result.err
    for row in listed(run):
        name = f"{flat(row['from'])[:-4]}__{flat(row['to'])[:-4]}"
        shop.studio.image(f"VUnet/{name}.png", target_of(shop, row))
    result = run("--results", shop.studio.folder / "VUnet", "-o", out, *COMMON)
    assert result.code == 0, result.err
    (method,) = json.loads((out / "results.json").read_text())["methods"]
    assert (method["label"], method["scores"]["ssim"]["mean"]) == ("VUnet", 1)
