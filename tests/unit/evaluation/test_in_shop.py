"""DeepFashion In-shop: one photo has one name, however a copy of the benchmark spells it."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.in_shop import choose_held_out, find_photos, spell_names

SPELLINGS = {
    "fashionWOMENDressesid0000000202_1front": (
        "img/WOMEN/Dresses/id_00000002/02_1_front",
        "img_highres/WOMEN/Dresses/id_00000002/02_1_front",
        "img_highres/WOMEN/Dresses/id_00000002/id_00000002_02_1_front",
        "WOMEN/Dresses/id_00000002/02_1_front",
        "WOMEN-Dresses-id_00000002-02_1_front",
        "fashionWOMENDressesid0000000202_1front",
        "fasionWOMENDressesid0000000202_1front",
    ),
    "fashionMENTeesTanksid0000730105_3back": (
        "img/MEN/Tees_Tanks/id_00007301/05_3_back",
        "fashionMENTees_Tanksid0000730105_3back",
        "fasionMENTeesTanksid0000730105_3back",
    ),
}


def touch(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()


@pytest.mark.parametrize("name", SPELLINGS)
def test_all_spellings_of_a_photo_are_one(name: str) -> None:
    assert {spell_names(spelled) for spelled in SPELLINGS[name]} == {name}


def test_names_within_words_are_spelled_and_others_left_alone() -> None:
    pair = "fasionWOMENDressesid0000000202_1front.jpg_fasionMENTeesTanksid0000730105_3back.jpg"
    first, second = SPELLINGS
    assert spell_names(pair) == f"{first}.jpg_{second}.jpg"
    assert spell_names("7-0__7-1") == "7-0__7-1"


@pytest.mark.parametrize("spelling", range(4))
def test_photos_are_found_wherever_they_lie_and_nothing_else(tmp_path, spelling: int) -> None:
    name, spellings = next(iter(SPELLINGS.items()))
    stem = spellings[spelling]
    touch(tmp_path, f"{stem}.jpg", f"{stem}_IUV.png", f"{stem}_alpha.png", "Anno/notes.txt")
    assert {key: str(path) for key, path in find_photos(tmp_path).items()} == {name: f"{stem}.jpg"}


def test_of_several_copies_the_one_with_iuv_counts_then_img(tmp_path) -> None:
    small, large = (f"{img}/WOMEN/Dresses/id_00000002/02_1_front" for img in ("img", "img_highres"))
    touch(tmp_path, f"{small}.jpg", f"{large}.jpg")
    assert [str(path) for path in find_photos(tmp_path).values()] == [f"{small}.jpg"]
    touch(tmp_path, f"{large}_iuv.png")
    assert [str(path) for path in find_photos(tmp_path).values()] == [f"{large}.jpg"]


def test_a_part_of_the_benchmark_will_do(tmp_path) -> None:
    touch(tmp_path, "img/WOMEN/Dresses/id_00000002/02_1_front.jpg")
    (path,) = find_photos(tmp_path / "img/WOMEN").values()
    assert str(path) == "Dresses/id_00000002/02_1_front.jpg"


def test_a_folder_of_something_else(tmp_path) -> None:
    touch(tmp_path, "holiday.jpg", "img/cat.png")
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(
            InputError, match=r"holds no photo of DeepFashion In-shop, such as img/"
        ):
            find_photos(folder)


@pytest.mark.parametrize("place", ["Eval/", "", "Anno/../Eval/"])
def test_the_partition_tells_what_is_held_out(tmp_path, place: str) -> None:
    status = {"02_1_front": "query", "02_2_side": "gallery", "04_1_front": "train"}
    names = {stem: f"img/WOMEN/Dresses/id_00000002/{stem}.jpg" for stem in status}
    touch(tmp_path, *names.values(), "Anno/x")
    lines = [f"{names[stem]} id_00000002 {word}" for stem, word in status.items()]
    partition = tmp_path / place / "list_eval_partition.txt"
    partition.parent.mkdir(exist_ok=True)
    partition.write_text("\n".join(["3", "image_name item_id evaluation_status", *lines]))
    for folder in (tmp_path, tmp_path / "img"):
        held_out, words = choose_held_out(folder, find_photos(folder))
        assert set(held_out) == {spell_names(names[s][:-4]) for s in ("02_1_front", "02_2_side")}
        assert words == "query and gallery of list_eval_partition.txt"


def test_without_it_a_folder_called_test_does_and_then_all_photos(tmp_path) -> None:
    first, second = SPELLINGS
    touch(tmp_path, f"train/{first}.jpg", f"test/{second}.jpg")
    held_out, words = choose_held_out(tmp_path, find_photos(tmp_path))
    assert (list(held_out), words) == ([second], "those in folders named test...")
    held_out, words = choose_held_out(tmp_path / "train", find_photos(tmp_path / "train"))
    assert (list(held_out), words) == ([first], "all photos")


def test_another_benchmarks_partition_is_no_partition(tmp_path) -> None:
    first, _ = SPELLINGS
    touch(tmp_path, f"{first}.jpg")
    (tmp_path / "list_eval_partition.txt").write_text("000001.jpg 0\n000002.jpg 2\n")
    assert choose_held_out(tmp_path, find_photos(tmp_path))[1] == "all photos"
