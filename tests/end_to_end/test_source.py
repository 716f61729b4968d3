"""A person kept in one file: `mt source save`, and runs from what it wrote."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from decoded import decoded
from PIL import Image

from motion_transfer.api import render_video
from motion_transfer.render.source_pictures import first_picture

DIGITS = "0123456789abcdef"


def frames_of(folder: Path) -> np.ndarray:
    return np.stack([np.asarray(Image.open(file)) for file in sorted(folder.iterdir())])


@pytest.fixture
def kept(studio, mt, checkpoint: Path) -> Path:
    """A person who is kept, and whose photo is far away."""
    path = studio.folder / "me.mtsource"
    photo = studio.source()
    result = mt("source", "save", path, "--source", photo, "--weights", checkpoint)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"wrote {path}: ")
    return path


RUNS = {
    "the network": [],
    "the network, over the photo, with its panels": ["--background", "photo", "--compare"],
    "the draft": ["--renderer", "texture"],
    "the draft, as a video": ["--renderer", "texture", "--background", "photo"],
}


@pytest.mark.parametrize("name", RUNS)
def test_the_file_draws_what_the_photo_draws(studio, mt, checkpoint, kept, name: str) -> None:
    more = RUNS[name]
    weights = [] if "texture" in more else ["--weights", checkpoint]
    ending = ".mkv" if "video" in name else ""
    driver = studio.driver(3)
    made = []
    for label, source in (("photo", studio.folder / "person.png"), ("file", kept)):
        output = studio.folder / f"{label}{ending}"
        result = mt("run", "--source", source, "--driver", driver, "-o", output, *more, *weights)
        assert (result.code, result.err) == (0, "")
        made.append(output)
    assert decoded(made[0]) == decoded(made[1])


def test_the_file_is_enough(studio, mt, checkpoint, kept) -> None:
    """On another machine there is neither the photo nor its IUV, and the feature map is used."""
    expected, output = studio.folder / "expected", studio.folder / "out"
    driver = studio.driver(2)
    photo = studio.folder / "person.png"
    render_video(photo, driver, expected, weights=checkpoint)
    for name in ("person.png", "person_IUV.png"):
        (studio.folder / name).unlink()
    render_video(kept, driver, output, weights=checkpoint)
    np.testing.assert_array_equal(frames_of(expected), frames_of(output))


def test_no_iuv_is_looked_for_beside_the_file(studio, draft, kept) -> None:
    (studio.folder / "me_IUV.png").write_bytes(b"nothing that could be read")
    result = draft("--source", kept, "--driver", studio.driver(1), "-o", studio.folder / "out")
    assert (result.code, result.err) == (0, "")


def test_other_weights_encode_it_anew(studio, mt, kept, tmp_path: Path) -> None:
    import torch

    from motion_transfer.weights.checkpoint import save_checkpoint
    from nhrr_core import ModelConfig, NeuralReRenderer

    config = ModelConfig(
        feature_width=4, render_width=4, residual_blocks=1, image_size=64, texture_size=64
    )
    torch.manual_seed(5)
    save_checkpoint(tmp_path / "other.safetensors", NeuralReRenderer(config))
    for label, source in (("photo", studio.folder / "person.png"), ("file", kept)):
        arguments = ("--driver", studio.driver(2), "--weights", tmp_path / "other.safetensors")
        assert mt("run", "--source", source, *arguments, "-o", studio.folder / label).code == 0
    np.testing.assert_array_equal(
        frames_of(studio.folder / "photo"), frames_of(studio.folder / "file")
    )


def test_garments_are_laid_over_it(studio, draft, kept) -> None:
    """The garment's colours come, and nothing of the kept ones is left on its parts."""
    dress = studio.source("dress", colours={(2,): (10, 200, 220)})
    driver = studio.driver(1)
    made = []
    for label, source in (("photo", studio.folder / "person.png"), ("file", kept)):
        output = studio.folder / label
        garment = ("--garment", dress, "--garment-parts", "torso")
        result = draft("--source", source, "--driver", driver, *garment, "-o", output)
        assert (result.code, result.err) == (0, "")
        made.append(frames_of(output).astype(int))
    torso = studio.walk(1)[0, ..., 0] == 2
    np.testing.assert_allclose(np.median(made[1][0][torso], axis=0), (10, 200, 220), atol=1)
    assert np.abs(made[0] - made[1]).mean() < 0.5


def test_it_can_be_dressed_and_kept_again(studio, mt, draft, kept) -> None:
    dress = studio.source("dress", colours={(2,): (10, 200, 220)})
    dressed = studio.folder / "dressed.mtsource"
    garment = ("--garment", dress, "--garment-parts", "torso")
    result = mt("source", "save", dressed, "--source", kept, *garment, "-q")
    assert (result.code, result.out, result.err) == (0, "", "")
    made_of = json.loads(mt("inspect", dressed, "--json").out)["made of"]
    assert [entry["file"] for entry in made_of.values()] == ["me.mtsource", "dress.png"]
    assert made_of["2"]["parts"] == ["torso-back", "torso-front"]
    driver = studio.driver(1)
    assert draft("--source", dressed, "--driver", driver, "-o", studio.folder / "kept").code == 0
    more = ("--driver", driver, "-o", studio.folder / "worn")
    assert draft("--source", kept, *garment, *more).code == 0
    np.testing.assert_array_equal(
        frames_of(studio.folder / "kept"), frames_of(studio.folder / "worn")
    )


def test_a_batch_takes_it(studio, mt, kept) -> None:
    driver = studio.driver(2)
    manifest = studio.folder / "jobs.yaml"
    manifest.write_text(
        "version: 1\ndefaults: {renderer: texture}\n"
        f"matrix: [{{sources: ['*.mtsource', person.png], drivers: [{driver.name}],"
        " output: '{index}'}]\n"
    )
    assert mt("batch", "run", manifest).code == 0
    np.testing.assert_array_equal(frames_of(studio.folder / "1"), frames_of(studio.folder / "2"))


def test_the_preview_shows_it(studio, mt, kept) -> None:
    np.testing.assert_array_equal(first_picture(kept), first_picture(studio.folder / "person.png"))
    output = studio.folder / "frame.png"
    arguments = ("--driver", studio.driver(2), "--renderer", "texture")
    result = mt("preview", "--source", kept, *arguments, "--frame", "1", "-o", output)
    assert (result.code, result.err) == (0, "")
    assert mt("run", "--source", kept, *arguments, "-o", studio.folder / "run").code == 0
    np.testing.assert_array_equal(Image.open(output), frames_of(studio.folder / "run")[1])


def test_what_is_in_it(studio, mt, kept, checkpoint) -> None:
    told = json.loads(mt("inspect", kept, "--json").out)
    photo = told["made of"]["1"]
    assert photo["file"] == "person.png"
    digests = [photo["sha256"], photo["iuv"], told["weights"]["sha256"]]
    assert all(len(digest) == 64 and set(digest) <= set(DIGITS) for digest in digests)
    assert told["weights"]["file"] == checkpoint.name
    words = mt("inspect", kept).out
    assert words.startswith("what")
    assert "a kept source" in words
    assert str(studio.folder) not in words.replace(str(kept), "")  # folders are nobody's business


def test_the_same_photo_gives_the_same_bytes(studio, mt, checkpoint, kept) -> None:
    before = kept.read_bytes()
    arguments = ("source", "save", kept, "--source", studio.folder / "person.png")
    refused = mt(*arguments, "--weights", checkpoint)
    assert (refused.code, refused.out) == (2, "")
    assert "exists already; choose another name or add --force" in refused.err
    assert mt(*arguments, "--weights", checkpoint, "--force").code == 0
    assert kept.read_bytes() == before


REFUSED = {
    "another ending": (
        ["source", "save", "me.safetensors", "--source", "person.png"],
        "a kept source ends in .mtsource; name it so",
    ),
    "no such photo": (
        ["source", "save", "new.mtsource", "--source", "nobody.png"],
        "source nobody.png does not exist",
    ),
    "a photo beside it": (
        ["run", "--source", "me.mtsource", "--source", "person.png"],
        "is a kept source, which stands alone",
    ),
    "its IUV": (
        ["run", "--source", "me.mtsource", "--source-iuv", "person_IUV.png"],
        "is a kept source, which holds its IUV; leave out --source-iuv",
    ),
    "somebody in it": (
        ["run", "--source", "me.mtsource", "--person", "1"],
        "is a kept source, which holds one person; leave out --person",
    ),
    "as a garment": (
        ["run", "--source", "person.png", "--garment", "me.mtsource", "--garment-parts", "torso"],
        "garment me.mtsource",
    ),
    "as weights": (
        ["run", "--source", "person.png", "--weights", "me.mtsource"],
        "are not a checkpoint of this model",
    ),
    "weights as a source": (["run", "--source", "weights.mtsource"], "but no kept source"),
    "half of it": (["run", "--source", "half.mtsource"], "is not a whole safetensors file"),
    "nothing": (["run", "--source", "no.mtsource"], "source no.mtsource does not exist"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_said(
    studio, mt, kept, checkpoint, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    arguments, message = REFUSED[name]
    monkeypatch.chdir(studio.folder)
    shutil.copy(checkpoint, "weights.mtsource")
    Path("half.mtsource").write_bytes(kept.read_bytes()[:999])
    if arguments[0] == "run":
        arguments = [*arguments, "--driver", studio.driver(1), "-o", "out.mp4"]
    before = sorted(studio.folder.iterdir())
    result = mt(*arguments)
    assert (result.code, result.out) == (2, "")
    assert message in result.err
    assert len(result.err.splitlines()) == 1
    assert sorted(studio.folder.iterdir()) == before
