"""Folders of synthetic people: whole, resumable, never mixed."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import pytest

from motion_transfer.errors import InputError, OutputError

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people import album  # noqa: E402
from motion_transfer.people.album import AlbumOptions, write_album  # noqa: E402


def options(out: Path, **changes) -> AlbumOptions:
    settings = {"out": out, "count": 2, "size": (64, 64), "workers": 1} | changes
    return AlbumOptions(**settings)


def content(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_a_folder_holds_photos_iuv_alpha_and_who_it_is(tmp_path):
    assert write_album(options(tmp_path / "people")) == 2
    out = tmp_path / "people"
    assert sorted(path.name for path in (out / "000001").iterdir()) == sorted(
        [f"{v}{kind}.png" for v in (0, 1) for kind in ("", "_IUV", "_alpha")] + ["person.json"]
    )
    iuv = cv2.imread(str(out / "000001" / "0_IUV.png"))  # BGR of the file: I, U, V
    assert 0 < iuv[..., 0].max() <= 24 < iuv[..., 1].max()
    assert cv2.imread(str(out / "000001" / "0_alpha.png"), cv2.IMREAD_UNCHANGED).ndim == 2
    described = json.loads((out / "000001" / "person.json").read_text())
    assert described["number"] == 1 and len(described["shots"]) == 2
    pairs = list(csv.DictReader((out / "pairs.csv").read_text().splitlines()))
    assert len(pairs) == 4 and pairs[0] == {"source": "000000/0.png", "target": "000000/1.png"}
    assert all((out / pair["target"]).exists() for pair in pairs)


def test_a_run_that_broke_off_goes_on_and_ends_as_if_it_had_not(tmp_path, monkeypatch):
    write_album(options(tmp_path / "whole", count=3))
    real = album._photograph

    def fail_at_two(options, people, number: int) -> None:
        if number == 2:
            raise KeyboardInterrupt
        real(options, people, number)

    monkeypatch.setattr(album, "_photograph", fail_at_two)
    with pytest.raises(KeyboardInterrupt):
        write_album(options(tmp_path / "broken", count=3))
    monkeypatch.undo()
    kept = (tmp_path / "broken" / "000000" / "0.png").stat().st_mtime_ns
    assert write_album(options(tmp_path / "broken", count=3)) == 1
    assert (tmp_path / "broken" / "000000" / "0.png").stat().st_mtime_ns == kept
    assert content(tmp_path / "broken") == content(tmp_path / "whole")


def test_half_a_person_is_never_left(tmp_path, monkeypatch):
    def full_disk(*_arguments) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(album, "write_png", full_disk)
    with pytest.raises(OutputError, match="disk is full"):
        write_album(options(tmp_path / "people"))
    assert [path.name for path in (tmp_path / "people").iterdir()] == ["people.json"]


def test_several_workers_write_the_same(tmp_path):
    done = []
    write_album(options(tmp_path / "one"))
    write_album(options(tmp_path / "two", workers=2), done.append)
    assert content(tmp_path / "one") == content(tmp_path / "two")
    assert sum(done) == 2


def test_people_of_other_settings_are_not_mixed_in(tmp_path):
    write_album(options(tmp_path, count=1))
    with pytest.raises(OutputError, match="people made with seed 0, not 1; use the same settings"):
        write_album(options(tmp_path, count=1, seed=1))


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="holds other things than people"):
        write_album(options(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 0}, "count is 0"),
        ({"views": 0}, "views is 0"),
        ({"size": (8, 64)}, "size 8x64"),
        ({"workers": 0}, "workers is 0"),
        ({"split": "dev"}, "supported are train, held-out"),
        ({"seed": -5}, "seed is -5"),
    ],
)
def test_bad_options_are_refused(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        options(tmp_path, **changes)
