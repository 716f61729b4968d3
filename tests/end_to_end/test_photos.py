"""Photos through every door of the program: their colours, and what is said of them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from colour_profiles import ADOBE_RGB, DISPLAY_P3
from PIL import Image

ORANGE = (200, 60, 40)


def write(path: Path, pixels: np.ndarray, profile: bytes) -> Path:
    Image.fromarray(pixels).save(path, icc_profile=profile)
    return path


@pytest.mark.parametrize(
    ("profile", "shown"), [(DISPLAY_P3, (217, 42, 23)), (ADOBE_RGB, (231, 57, 34))]
)
def test_colours_of_a_source_become_srgb(studio, draft, profile: bytes, shown) -> None:
    """Its backdrop, and what is painted from its texture."""
    photo = studio.source(colours={(2,): ORANGE})
    pixels = np.array(Image.open(photo))
    pixels[:32, :32] = ORANGE
    write(photo, pixels, profile)
    output = studio.folder / "out.png"
    driver = photo.with_name("person_IUV.png")
    result = draft(*("--source", photo, "--driver", driver, "--background", "photo", "-o", output))
    assert (result.code, "profile" in result.err) == (0, False), result.err
    drawn = np.array(Image.open(output))
    torso = drawn[(studio.iuv(scale=2, size=drawn.shape[:2])[..., 0] == 2)]
    assert drawn[8, 8].tolist() == pytest.approx(list(shown), abs=2)
    assert np.median(torso, axis=0).tolist() == pytest.approx(list(shown), abs=2)


def test_a_garment_becomes_srgb_too(studio, draft) -> None:
    photo = studio.source()
    garment = studio.source("shirt", colours={(2,): ORANGE})
    write(garment, np.array(Image.open(garment)), ADOBE_RGB)
    output = studio.folder / "out.png"
    result = draft(
        *("--source", photo, "--garment", garment, "--garment-parts", "torso"),
        *("--driver", photo.with_name("person_IUV.png"), "-o", output),
    )
    assert result.code == 0, result.err
    drawn = np.array(Image.open(output))
    counts = np.abs(drawn.astype(int) - (231, 57, 34)).max(-1) <= 2
    assert counts.mean() > 0.02


def test_a_damaged_profile_is_told(studio, mt, draft) -> None:
    """In a run of every kind, and where the file is looked at."""
    photo = studio.source()
    write(photo, np.array(Image.open(photo)), b"no profile at all")
    said = f"the colour profile of {photo} cannot be used (it is damaged); its colours are taken as"
    driver = studio.driver(2)
    result = draft("--source", photo, "--driver", driver, "-o", studio.folder / "out.mp4")
    assert result.code == 0
    assert result.err.count(said) == 1
    assert said in json.loads(mt("inspect", photo, "--json").out)["note"]
    manifest = studio.folder / "jobs.yaml"
    manifest.write_text(
        "version: 1\ndefaults: {renderer: texture}\njobs:\n"
        f"  - {{name: a, source: {photo}, driver: {driver}, output: a.mp4}}\n"
    )
    result = mt("batch", "run", manifest, "--workers", "1")
    assert result.code == 0, result.err
    assert said in re.sub(r"\s+", " ", result.err + result.out)


def test_inspecting_tells_the_profile(studio, mt) -> None:
    path = write(studio.folder / "a.jpg", np.full((8, 8, 3), 99, np.uint8), DISPLAY_P3)
    told = json.loads(mt("inspect", path, "--json").out)
    assert told["colours"] == "converted from Display P3 to sRGB"
    assert "note" not in told


@pytest.mark.parametrize("command", ["run", "garment", "iuv", "inspect", "preview"])
def test_every_door_refuses_the_same(studio, mt, command: str) -> None:
    photo = studio.source()
    path = studio.folder / "deep.tif"
    Image.new("F", (128, 192), 0.5).save(path)
    iuv, output = photo.with_name("person_IUV.png"), studio.folder / "out.mkv"
    rest = ("--driver", studio.driver(2), "--renderer", "texture", "-o", output)
    arguments = {
        "run": ("run", "--source", path, "--source-iuv", iuv, *rest),
        "garment": ("run", "--source", photo, "--garment", path, "--garment-parts", "torso", *rest),
        "iuv": ("iuv", path, "-o", output),
        "inspect": ("inspect", path),
        "preview": (
            *("preview", "--source", path, "--source-iuv", iuv, *rest[:4]),
            *("--frame", "0", "-o", studio.folder / "frame.png"),
        ),
    }[command]
    result = mt(*arguments)
    assert result.code == 2
    assert result.err.count("\n") == 1
    assert "deep.tif holds floating-point numbers" in result.err
    assert "with 8 or 16 bits a channel" in result.err
