"""A folder of assets as small as can be: a few triangles on the body, pictures of a few pixels."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

POINTS = 19158  # of hm08
SUITS = ("suit_a", "suit_b", "suit_c", "suit_d")


def triangle(name: str, kind: str, vertices: tuple[int, int, int], **changes) -> dict:
    """An item of one triangle, a centimetre in front of three vertices of the body."""
    arrays = {
        "index": np.array([[v, v, v] for v in vertices], np.int32),
        "weight": np.tile(np.array([1, 0, 0], np.float32), (3, 1)),
        "offset": np.tile(np.array([0, 0, 0.1], np.float32), (3, 1)),
        "scale_index": np.full((3, 2), -1, np.int32),
        "scale_length": np.ones(3, np.float32),
        "hidden": np.array(vertices, np.int32),
        "faces": np.array([[0, 1, 2]], np.int32),
        "uv": np.array([[0.1, 0.1], [0.8, 0.1], [0.1, 0.8]], np.float32),
        "face_uv": np.array([[0, 1, 2]], np.int32),
    }
    return {"name": name, "kind": kind, "arrays": arrays | changes.pop("arrays", {}), **changes}


def write_assets(folder: Path, items: list[dict], faces: np.ndarray) -> Path:
    """Write items, their files and hm08; an item without arrays has no geometry."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(0)
    entries = []
    for item in items:
        entry = {key: value for key, value in item.items() if key != "arrays"}
        if "arrays" in item:
            entry["geometry"] = f"{item['name']}.npz"
            np.savez(folder / entry["geometry"], **item["arrays"])
        mode = "RGBA" if entry.get("alpha") else "RGB"
        pixels = rng.integers(60, 200, (16, 16, len(mode)), np.uint8)
        Image.fromarray(pixels, mode).save(folder / f"{item['name']}.png")
        entry["textures"] = {"diffuse": {"file": f"{item['name']}.png", "side": 16}}
        entries.append(entry)
    (folder / "items.json").write_text(json.dumps(entries))
    index = np.arange(13718, dtype=np.int32)
    uv = rng.random((50, 2), np.float32)
    face_uv = rng.integers(0, 50, faces.shape).astype(np.int32)
    np.savez(folder / "hm08.npz", faces=faces, uv=uv, face_uv=face_uv, anny_to_hm08=index)
    return folder


def all_items() -> list[dict]:
    chest, foot, crown, eye = (3900, 3901, 3902), (12800, 12801, 12802), (800, 801, 802), (9, 8, 7)
    skins = [
        {"name": f"{sex}_{n}", "kind": "skin", "sex": sex, "age": "young", "origin": "asian"}
        for sex in ("female", "male")
        for n in range(3)
    ]
    return [
        *skins,
        *(triangle(name, "suit", chest, sex="any") for name in SUITS),
        triangle("shoes", "shoes", foot),
        triangle("curls", "hair", crown, alpha=True),
        triangle("brows", "eyebrows", eye, alpha=True),
        triangle("eyes", "eyes", eye),
        {"name": "brown_eye", "kind": "eye texture"},
    ]


@pytest.fixture(scope="session")
def assets(tmp_path_factory, body_model) -> Path:
    """A whole folder, on the body model's own triangles."""
    return write_assets(tmp_path_factory.mktemp("assets"), all_items(), body_model.faces)


@pytest.fixture(scope="session")
def real_assets(samples) -> Path:
    """MakeHuman's, where MT_SAMPLES has them."""
    folder = samples / "makehuman"
    if not folder.is_dir():
        pytest.skip("MT_SAMPLES has no folder makehuman with MakeHuman's assets")
    return folder
