"""Weights as a folder for the Hub: written, found by name, and refused for what is wrong."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import huggingface_hub
import pytest
import yaml

from motion_transfer import MotionTransfer
from motion_transfer.errors import FetchError, InputError, OutputError, WeightsError
from motion_transfer.weights import find_pretrained, find_weights
from motion_transfer.weights.card import write_card
from motion_transfer.weights.checkpoint import digest_weights, inspect_checkpoint
from motion_transfer.weights.pretrained import CARD, CONFIG, TENSORS, fetch_folder, save_pretrained

ROOT = Path(__file__).parents[3]
LITE = find_weights(Path("lite"))


@pytest.fixture
def folder(checkpoint: Path, tmp_path: Path) -> Path:
    save_pretrained(checkpoint, tmp_path / "mine")
    return tmp_path / "mine"


@pytest.fixture
def hub(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A stand-in of the Hub, which has one model; lists what it was asked for and given."""
    asked: list[tuple] = []

    def download(place: str, *, revision: str | None, allow_patterns: list[str]) -> str:
        asked.append((place, revision, *allow_patterns))
        if place != "somebody/mine":
            raise OSError("404 Client Error.\nRepository Not Found")
        return str(folder)

    def create(place: str, *, exist_ok: bool) -> None:
        asked.append((place, exist_ok))

    def upload(*, repo_id: str, folder_path: Path) -> None:
        asked.append((repo_id, *sorted(path.name for path in folder_path.iterdir())))

    monkeypatch.setattr(huggingface_hub, "snapshot_download", download)
    monkeypatch.setattr(huggingface_hub, "create_repo", create)
    monkeypatch.setattr(huggingface_hub, "upload_folder", upload)
    monkeypatch.chdir(tmp_path)
    fetch_folder.cache_clear()
    yield asked
    fetch_folder.cache_clear()


def test_a_folder_holds_the_same_weights(checkpoint: Path, folder: Path, tmp_path: Path) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted([CARD, CONFIG, TENSORS])
    assert find_pretrained(folder) == folder / TENSORS
    model = MotionTransfer.from_pretrained(folder)
    assert model.recipe.content == digest_weights(checkpoint)
    model.save_pretrained(tmp_path / "again")
    for name in (CONFIG, TENSORS):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes()
    told = json.loads((folder / CONFIG).read_text())
    assert told["model_type"] == "nhrr"
    assert told["image_size"] == inspect_checkpoint(checkpoint).config.image_size


def test_the_command_line_takes_it(studio, mt, checkpoint: Path, folder: Path) -> None:
    words = ("--source", studio.source(), "--driver", studio.driver(2), "--provenance", "mark")
    for name, weights in (("one.png", checkpoint), ("other.png", folder)):
        out = studio.folder / name
        result = mt("run", *words, "--frames", "0", "--weights", weights, "-o", out)
        assert result.code == 0, result.err
    assert (studio.folder / "one.png").read_bytes() == (studio.folder / "other.png").read_bytes()


def test_names_on_the_hub(hub: list, folder: Path) -> None:
    wanted = (CONFIG, TENSORS, CARD)
    assert find_pretrained("somebody/mine") == folder / TENSORS
    assert find_weights(Path("hf:somebody/mine")) == folder / TENSORS
    assert hub == [("somebody/mine", None, *wanted)]  # once for both
    assert find_pretrained("somebody/mine", "v2") == folder / TENSORS
    assert find_weights(Path("hf:somebody/mine@v2")) == folder / TENSORS
    assert hub[1:] == [("somebody/mine", "v2", *wanted)]


def test_files_that_are_here_are_not_looked_for_there(hub: list, tmp_path: Path, folder) -> None:
    (tmp_path / "somebody").mkdir()
    shutil.copytree(folder, tmp_path / "somebody" / "mine")
    assert find_pretrained("somebody/mine") == Path("somebody/mine") / TENSORS
    assert find_pretrained("lite") == LITE
    assert find_pretrained("./a/b.safetensors") == Path("a/b.safetensors")
    assert hub == []


def test_what_the_hub_says_is_told(hub: list, mt, studio) -> None:
    with pytest.raises(FetchError, match=r"weights nobody/none cannot .* 404 Client Error"):
        MotionTransfer.from_pretrained("nobody/none")
    words = ("--source", studio.source(), "--driver", studio.driver(2), "-o", "out.mp4")
    result = mt("run", *words, "--weights", "hf:nobody/none")
    assert result.code == 1
    assert result.err.count("\n") == 1


def test_a_manifest_may_name_the_hub(hub: list, mt, studio) -> None:
    studio.source()
    studio.driver(2)
    job = {"source": "person.png", "driver": "driver", "weights": "hf:somebody/mine"}
    manifest = {"version": 1, "jobs": [{**job, "output": "out.mp4"}]}
    (studio.folder / "jobs.yaml").write_text(yaml.safe_dump(manifest))
    result = mt("batch", "validate", studio.folder / "jobs.yaml")
    assert result.code == 0, result.err
    assert hub[0][0] == "somebody/mine"


def test_uploading(hub: list, checkpoint: Path, tmp_path: Path) -> None:
    MotionTransfer(checkpoint).save_pretrained(tmp_path / "up", push="me/dancer")
    assert hub == [("me/dancer", True), ("me/dancer", *sorted([CARD, CONFIG, TENSORS]))]
    card = (tmp_path / "up" / CARD).read_text()
    assert 'from_pretrained("me/dancer")' in card
    assert card.startswith("---\n")


def test_nothing_is_replaced(checkpoint: Path, folder: Path) -> None:
    with pytest.raises(OutputError, match="exists already"):
        save_pretrained(checkpoint, folder)
    with pytest.raises(InputError, match="texture renderer has no weights"):
        MotionTransfer(renderer="texture").save_pretrained(folder)


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=f"a folder without {TENSORS}"):
        find_pretrained(tmp_path)
    (tmp_path / "pytorch_model.bin").write_bytes(b"\x80\x04.")
    with pytest.raises(WeightsError, match=f"a folder without {TENSORS}"):
        MotionTransfer.from_pretrained(tmp_path)


@pytest.mark.parametrize(
    ("written", "said"),
    [('{"image_size": 512}', "says image_size 512, and .* 64"), ("{", "config.json")],
)
def test_two_stories_are_refused(folder: Path, written: str, said: str) -> None:
    (folder / CONFIG).write_text(written)
    with pytest.raises(WeightsError, match=said):
        find_pretrained(folder)


def test_the_card_tells_what_the_checkpoint_says(checkpoint: Path) -> None:
    card = write_card(checkpoint, "mine")
    front = yaml.safe_load(card.split("---\n")[1])
    assert front["license"] == "other"
    assert front["license_name"] == "CC0"
    assert digest_weights(checkpoint) in card
    for title in ("Data", "Measurements", "Limits", "Use and misuse"):
        assert f"\n## {title}\n" in card
    assert "consent" in card
    assert "None are known" in card


def test_the_card_of_what_ships() -> None:
    card = write_card(LITE, "lite")
    assert yaml.safe_load(card.split("---\n")[1])["license"] == "cc0-1.0"
    assert "11.5 million" in card
    assert "MakeHuman" in card
    measured = (ROOT / "docs" / "quality.md").read_text().replace("*", "")
    table = card.partition("## Measurements")[2].partition("## Limits")[0]
    numbers = re.findall(r"0\.\d{3}", table)
    assert len(numbers) == 18
    assert all(number in measured for number in numbers)
    assert "{{" not in card
