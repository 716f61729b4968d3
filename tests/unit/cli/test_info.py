"""`mt info` and `mt inspect`: what they tell, for people and as JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from estimate_stubs import GREEN, RED, RectangleEstimator, scene
from PIL import Image

from motion_transfer import __version__
from motion_transfer.drawing.person import Box
from nhrr_core import PART_NAMES


def facts(mt, *arguments: object) -> dict:
    result = mt(*arguments, "--json")
    assert (result.code, result.err) == (0, "")
    return json.loads(result.out)


def test_info_tells_versions_renderers_and_sizes(mt) -> None:
    told = facts(mt, "info")
    assert told["motion-transfer"] == __version__
    assert set(told["renderers"]) == {"texture", "nhrr"}
    paper = told["presets"]["paper"]
    assert paper["RenderNet parameters"] == "31.5 M"
    assert paper["RenderNet GFLOP a frame at 256 x 256"] == pytest.approx(80.3, abs=0.1)
    assert told["presets"]["lite"]["RenderNet parameters"] == "7.9 M"


def test_info_for_people(mt) -> None:
    result = mt("info")
    assert result.code == 0
    assert f"motion-transfer                 {__version__}" in result.out
    assert "{" not in result.out


def test_info_lists_parts(mt) -> None:
    told = facts(mt, "info", "parts")
    assert told["parts"] == {name: part for part, name in enumerate(PART_NAMES) if part}
    assert told["groups"]["torso"] == ["torso-back", "torso-front"]
    assert "hand-left" in mt("info", "parts").out


DRIVERS: dict[str, Callable] = {
    "folder of IUV images": lambda studio: studio.driver(3),
    "IUV image": lambda studio: studio.image("pose.png", studio.iuv()),
    "IUV video (ffv1, bgr0)": lambda studio: studio.video(3),
    "IUV array": lambda studio: studio.array(3, name="driver.npz"),
}


@pytest.mark.parametrize("kind", DRIVERS)
def test_inspecting_a_driver(studio, mt, kind: str) -> None:
    told = facts(mt, "inspect", DRIVERS[kind](studio))
    count = 1 if kind == "IUV image" else 3
    assert told["what"] == kind
    assert told["channel order"].startswith("iuv ")
    assert told["size"] == "64 x 96"
    assert told["frames"] == count
    assert told["missing numbers"] == "none"
    assert told["people a frame"] == {"1 person": "1 frame" if count == 1 else "3 frames"}
    assert ("frame rate" in told) == ("video" in kind)
    assert "torso-back" in told["parts never seen"]
    shares = told["parts (share of the body's pixels)"]
    assert sum(float(share.rstrip("%")) for share in shares.values()) == pytest.approx(100, abs=1)
    assert max(shares, key=lambda part: float(shares[part].rstrip("%"))) == "torso-front"


def test_inspecting_tells_the_order_and_the_gaps(studio, mt) -> None:
    driver = studio.driver(5, order="vui")
    (driver / "frame_2_IUV.png").unlink()
    told = facts(mt, "inspect", driver)
    assert told["channel order"].startswith("vui ")
    assert told["missing numbers"] == [2]


def test_inspecting_with_a_given_order(studio, mt) -> None:
    path = studio.array(np.full((1, 8, 8, 3), 7, np.uint8))
    assert "cannot be told" in mt("inspect", path).err
    assert facts(mt, "inspect", path, "--iuv-order", "vui")["channel order"].startswith("vui")


@pytest.mark.parametrize("target", ["image", "folder"])
def test_inspecting_with_an_unknown_order(studio, mt, target: str) -> None:
    path = studio.driver(1) if target == "folder" else studio.image("pose.png", studio.iuv())
    result = mt("inspect", path, "--iuv-order", "bgr")
    assert (result.code, result.out) == (2, "")
    assert "supported are iuv, vui" in result.err


@pytest.mark.parametrize("name", ["photo.jpg", "photo.png"])
def test_inspecting_a_photo(studio, mt, name: str) -> None:
    Image.new("RGB", (30, 20), (99, 150, 200)).save(studio.folder / name)
    told = facts(mt, "inspect", studio.folder / name)
    assert (told["what"], told["size"], told["alpha"]) == ("picture", "30 x 20", "no")
    assert ("not IUV" in told) == name.endswith("png")


def test_inspecting_a_photo_tells_who_is_in_it(studio, mt) -> None:
    left, right = studio.iuv(parts=(2, 23, 24)), studio.iuv()
    wide = np.zeros((96, 160, 3), np.uint8)
    wide[:, :64], wide[:, 80:144] = left, right
    studio.image("two_IUV.png", wide)
    told = facts(mt, "inspect", studio.image("two.png", studio.dress(wide)))
    people = told["people by two_IUV.png, from the left"]
    assert list(people) == ["0", "1"]
    assert people["0"].endswith(
        "no hands, feet, upper-legs, lower-legs, upper-arms, lower-arms in sight"
    )
    assert people["1"].endswith("all parts in sight")
    assert "not IUV" not in told


@pytest.fixture
def rectangles(monkeypatch) -> None:
    """Whoever looks for people sees coloured rectangles."""
    monkeypatch.setattr(
        "motion_transfer.render.about_pictures.open_estimator",
        lambda *_, **__: RectangleEstimator(),
    )


def clip(studio, name: str) -> Path:
    """Two frames of nobody, then two people; the one to the right is larger."""
    empty = scene()
    two = scene((RED, Box(40, 5, 70, 55)), (GREEN, Box(4, 20, 20, 50)))
    frames = np.stack([empty, empty, two, two])
    if name.endswith(".mkv"):
        return studio.video(frames, name=name)
    for index, frame in enumerate(frames):
        studio.image(f"{name}/{index}.png", frame)
    return studio.folder / name


@pytest.mark.parametrize(
    ("name", "kind"), [("dance.mkv", "video of pictures"), ("dance", "folder of pictures")]
)
def test_inspecting_a_clip(studio, mt, rectangles, name: str, kind: str) -> None:
    told = facts(mt, "inspect", clip(studio, name))
    assert (told["what"], told["size"], told["frames"]) == (kind, "80 x 60", 4)
    assert ("frame rate" in told) == name.endswith(".mkv")
    people = told["people in frame 2, from the left"]
    assert people["0"].startswith("30 px high, at 4,20,20,50; no torso, feet")
    assert people["1"].startswith("50 px high, at 40,5,70,55; ")


def test_inspecting_a_clip_of_nobody(studio, mt, rectangles) -> None:
    told = facts(mt, "inspect", studio.video(np.stack([scene()] * 3), name="empty.mkv"))
    assert told["people"] == "nobody found in the first 3 frames"


def test_inspecting_a_clip_without_the_models(studio, mt, monkeypatch, tmp_path) -> None:
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "none"))
    told = facts(mt, "inspect", clip(studio, "dance.mkv"))
    assert told["frames"] == 4
    assert told["people"].startswith("not looked for: ") and "mt models fetch" in told["people"]


def test_a_clip_that_was_iuv_before_a_lossy_codec_is_still_refused(studio, mt) -> None:
    path = studio.video(4, name="lossy.mp4", codec="libx264", pixels="yuv420p")
    result = mt("inspect", path)
    assert (result.code, result.out) == (2, "")
    assert "destroys part indices" in result.err


def test_inspecting_weights(mt, checkpoint: Path) -> None:
    told = facts(mt, "inspect", checkpoint)
    assert told["what"] == "nhrr weights (safetensors)"
    assert told["configuration"]["image_size"] == 64
    assert told["notes"] == {"licence": "CC0"}
    assert "licence" in mt("inspect", checkpoint).out


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("none", "does not exist"),
        ("words.txt", "not a readable video"),
        ("words.png", "not a picture in a known format"),
        ("words.safetensors", "not a whole safetensors file"),
        ("empty", "holds no IUV images"),
    ],
)
def test_inspecting_nothing_known(studio, mt, name: str, reason: str) -> None:
    path = studio.folder / name
    if "words" in name:
        path.write_text("words")
    elif name == "empty":
        path.mkdir()
    result = mt("inspect", path)
    assert (result.code, result.out) == (2, "")
    (line,) = result.err.splitlines()
    assert line.startswith("mt: ")
    assert reason in line
