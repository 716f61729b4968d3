"""A source in one file: what is read equals what was saved, and damage is told in one line."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors import safe_open
from safetensors.numpy import load_file, save_file

from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.kept_source import (
    FACTS,
    FORMAT,
    inspect_source,
    load_features,
    load_source,
    save_source,
)
from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.drawing.source import Source, undress
from motion_transfer.errors import InputError
from motion_transfer.media.pictures.photo import Photo
from nhrr_core import ModelConfig, load_uv_tables
from nhrr_core.config import DETAIL_FACTOR

SIZE, COARSE, HEIGHT, WIDTH = 64, 16, 30, 20
DIGEST = "ab" * 32
CONFIG = ModelConfig(feature_channels=5, texture_size=SIZE // DETAIL_FACTOR, colour_shortcut=True)
MADE_OF = [{"file": "me.jpg", "sha256": "cd" * 32}]


def make_source(size: int = SIZE, *, alpha: bool = True) -> Source:
    """Noise, since nothing of it may be lost."""
    noise = np.random.default_rng(0)
    rgb, iuv = noise.integers(0, 256, (2, HEIGHT, WIDTH, 3), dtype=np.uint8)
    iuv[..., 0] %= 25
    opacity = noise.integers(0, 256, (2, HEIGHT, WIDTH), dtype=np.uint8)
    photo_alpha, own_alpha = opacity if alpha else (None, None)
    noise = np.random.default_rng(size)
    visibility = noise.integers(0, 2, (1, size, size)).astype(np.float32)
    texture = noise.uniform(-1, 1, (3, size, size)).astype(np.float32) * visibility
    clearance = noise.standard_normal((2, 128, 128), np.float32)
    clearance[1] = clearance[1] > 0
    photo = Photo(Path("me.jpg"), rgb, photo_alpha, turned=True, profile="P3")
    return Source(
        photo, iuv, Path("me_IUV.png"), texture, visibility, own_alpha, clearance, ("a note",)
    )


def make_maps(config: ModelConfig = CONFIG) -> dict[str, FeatureMap]:
    noise, side = np.random.default_rng(1), config.texture_size
    features = noise.standard_normal((1, 5, side, side), np.float32)
    detail = noise.standard_normal((1, 3, SIZE, SIZE), np.float32) if config.has_detail else None
    return {DIGEST: FeatureMap(features, detail)}


def assert_equal(one: FeatureMap | None, other: FeatureMap) -> None:
    assert one is not None
    np.testing.assert_array_equal(one.features, other.features)
    if other.detail is None:
        assert one.detail is None
    else:
        np.testing.assert_array_equal(one.detail, other.detail)


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    path = tmp_path / "me.mtsource"
    save_source(path, [make_source(), make_source(COARSE)], make_maps(), {"made of": MADE_OF})
    return path


@pytest.mark.parametrize("size", [SIZE, COARSE])
@pytest.mark.parametrize("alpha", [True, False])
def test_nothing_is_lost(tmp_path: Path, size: int, alpha: bool) -> None:
    path = tmp_path / "me.mtsource"
    sources = [make_source(size=each, alpha=alpha) for each in (SIZE, COARSE)]
    save_source(path, sources, make_maps(), {})
    wanted, found = make_source(size, alpha=alpha), load_source(path, size)
    pairs = [
        (wanted.photo.rgb, found.photo.rgb),
        (wanted.photo.alpha, found.photo.alpha),
        (wanted.iuv, found.iuv),
        (wanted.alpha, found.alpha),
        (wanted.texture, found.texture),
        (wanted.visibility, found.visibility),
        (sources[0].clearance, found.clearance),  # one person has one
    ]
    for before, after in pairs:
        np.testing.assert_array_equal(before, after)
    assert (found.notes, found.iuv_path, found.kept) == (("a note",), None, path)


def test_features_are_those_of_the_very_weights(kept: Path) -> None:
    assert_equal(load_features(kept, DIGEST, CONFIG), make_maps()[DIGEST])
    assert load_features(kept, "cd" * 32, CONFIG) is None
    with pytest.raises(InputError, match=r"map/ab.* is F32 \[5, 16, 16\], where F32 6 x 16"):
        load_features(kept, DIGEST, replace(CONFIG, feature_channels=6))


def test_a_map_without_detail_is_kept_so(tmp_path: Path) -> None:
    path, plain = tmp_path / "me.mtsource", replace(CONFIG, colour_shortcut=False)
    save_source(path, [make_source()], make_maps(plain), {})
    assert_equal(load_features(path, DIGEST, plain), make_maps(plain)[DIGEST])
    with pytest.raises(InputError, match=r"is damaged: detail/ab.* is missing"):
        load_features(path, DIGEST, CONFIG)


def test_maps_of_other_programs_are_computed_again(kept: Path) -> None:
    """What they drew from the photos may differ."""
    change(kept, {"program": "0.2.0"})
    assert load_features(kept, DIGEST, CONFIG) is None


def test_a_kept_feature_map_is_not_computed_again(tmp_path: Path, checkpoint: Path) -> None:
    """But where garments, or parts taken away, have changed the source."""
    recipe = RENDERERS["nhrr"].recipe(checkpoint)
    source = make_source()
    marked = FeatureMap(np.full_like(recipe.appearance_of(source).features, 7))
    path = tmp_path / "me.mtsource"
    save_source(path, [source], {recipe.content: marked}, {})
    kept = load_source(path, SIZE)
    assert_equal(recipe.appearance_of(kept), marked)
    bare = undress(kept, [2])
    again = recipe.appearance_of(bare)
    assert (again.features != 7).any()
    assert_equal(again, recipe.appearance_of(undress(source, [2])))
    torso = load_uv_tables().part[2::4, 2::4] == 2  # the middles of texels of SIZE
    assert kept.visibility[0][torso].any()
    assert not bare.visibility[0][torso].any()
    np.testing.assert_array_equal(bare.texture[:, ~torso], kept.texture[:, ~torso])


def test_the_same_source_gives_the_same_bytes(kept: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.mtsource"
    save_source(again, [make_source(), make_source(COARSE)], make_maps(), {"made of": MADE_OF})
    assert again.read_bytes() == kept.read_bytes()
    assert kept.stat().st_mode & 0o777 == 0o644


def test_another_size_is_made_from_the_finest(kept: Path) -> None:
    finest = make_source()
    half = load_source(kept, SIZE // 2)
    places = finest.visibility.reshape(1, SIZE // 2, 2, SIZE // 2, 2).max((2, 4))
    np.testing.assert_array_equal(half.visibility, places)
    assert half.notes == ("a note",)
    double = load_source(kept, SIZE * 2)
    np.testing.assert_array_equal(double.texture[..., ::2, ::2], finest.texture)
    assert "saved with 64 texels a side, and these weights use 128" in double.notes[1]
    odd = load_source(kept, 48)
    assert odd.texture.shape == (3, 48, 48)
    assert not (odd.texture * (1 - odd.visibility)).any()


def test_what_it_says_of_itself(kept: Path) -> None:
    told = inspect_source(kept)
    assert told["made of"] == MADE_OF
    assert told["format"] == FORMAT
    assert told["tensors"]["texture/64"] == "F32 [3, 64, 64]"


def change(path: Path, facts: dict | None = None, **tensors: np.ndarray | None) -> None:
    """Write the file again with other tensors (None: without one) or facts."""
    before = load_file(path)
    held = {name: tensors.get(name.replace("/", "_"), tensor) for name, tensor in before.items()}
    with safe_open(path, "np") as file:
        told = json.loads(file.metadata()[FACTS])
    held = {name: tensor for name, tensor in held.items() if tensor is not None}
    save_file(held, path, metadata={FACTS: json.dumps({**told, **(facts or {})})})


def floats(value: float, shape: tuple[int, ...]) -> np.ndarray:
    return np.full(shape, value, np.float32)


def bytes_of(text: bytes) -> np.ndarray:
    return np.frombuffer(text, np.uint8)


SHAPE = (3, SIZE, SIZE)
DAMAGE = {
    "no photo": ({"photo": None}, "photo is missing"),
    "no texture": ({"texture_64": None, "texture_16": None}, "it has no texture"),
    "no visibility": ({"visibility_64": None}, "visibility/64 is missing"),
    "half the colours": (
        {"texture_64": floats(0, (2, SIZE, SIZE))},
        "texture/64 is F32",
    ),
    "other numbers": ({"texture_64": np.zeros(SHAPE, np.float16)}, "texture/64 is F16"),
    "no numbers": (
        {"texture_64": floats(np.nan, SHAPE)},
        "texture/64 holds values that are no finite",
    ),
    "too bright": (
        {"texture_64": floats(2, SHAPE)},
        "beyond black or white",
    ),
    "unseen colours": (
        {"texture_64": floats(1, SHAPE)},
        "colours where nothing is seen",
    ),
    "half seen": (
        {"visibility_64": np.full((1, SIZE, SIZE), 2, np.uint8)},
        "neither 0 nor 1",
    ),
    "a clearance of another size": (
        {"clearance": floats(0, (2, 64, 64))},
        "clearance is F32",
    ),
    "a photo that is none": ({"photo": bytes_of(b"GIF89a")}, "a picture that is no PNG"),
    "a photo of floats": ({"photo": floats(0, (9,))}, "photo is F32"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_told(kept: Path, name: str) -> None:
    tensors, message = DAMAGE[name]
    change(kept, **tensors)
    with pytest.raises(InputError, match=rf"source {kept} is damaged: .*{message}") as caught:
        load_source(kept, SIZE)
    assert len(str(caught.value).splitlines()) == 1


def test_a_person_that_fits_no_photo_is_told(kept: Path, tmp_path: Path) -> None:
    for iuv, message in [
        (np.zeros((HEIGHT, WIDTH, 3), np.uint8), "it shows nobody"),
        (np.full((HEIGHT, WIDTH, 3), 25, np.uint8), "parts that no body has"),
        (np.ones((WIDTH, HEIGHT, 3), np.uint8), "its person and its photo differ in size"),
    ]:
        save_source(kept, [replace(make_source(alpha=False), iuv=iuv)], {}, {})
        with pytest.raises(InputError, match=message):
            load_source(kept, SIZE)


def test_files_of_other_kinds_and_times_are_told(kept: Path, checkpoint: Path) -> None:
    with pytest.raises(InputError, match="no kept source; make one with `mt source save`"):
        load_source(checkpoint, SIZE)
    change(kept, {"format": FORMAT + 1, "program": "9.0"})
    with pytest.raises(InputError, match=r"saved by a newer motion-transfer \('9.0'; this is"):
        load_source(kept, SIZE)
    for facts, message in [
        ({"format": "1"}, "its format is '1'"),
        ({"notes": "none"}, "its notes are 'none'"),
        ({"notes": [1]}, r"its notes are \[1\]"),
    ]:
        change(kept, {"format": FORMAT, **facts})
        with pytest.raises(InputError, match=message):
            load_source(kept, SIZE)
    save_file({}, kept, metadata={FACTS: "[" * 9000})
    with pytest.raises(InputError, match=r"source .*me\.mtsource:1: lists"):
        load_source(kept, SIZE)
    for content in (b"", b"photo", kept.read_bytes()[:-1]):
        kept.write_bytes(content)
        with pytest.raises(InputError, match="is not a whole safetensors file"):
            load_source(kept, SIZE)
    kept.unlink()
    with pytest.raises(InputError, match="does not exist"):
        load_source(kept, SIZE)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.data())
def test_no_damage_does_more_than_raise(kept: Path, data: st.DataObject) -> None:
    """Bytes are changed, or the file ends early: it is read, or refused in one line."""
    whole = kept.read_bytes()
    header = 8 + struct.unpack("<Q", whole[:8])[0]
    cut = data.draw(st.one_of(st.just(len(whole)), st.integers(0, len(whole))))
    changed = bytearray(whole[:cut])
    places = st.one_of(st.integers(0, header + 64), st.integers(0, len(whole)))
    for place, value in data.draw(st.lists(st.tuples(places, st.integers(0, 255)), max_size=4)):
        if place < cut:
            changed[place] = value
    path = kept.with_name("changed.mtsource")
    path.write_bytes(changed)
    try:
        load_source(path, SIZE)
        load_features(path, DIGEST, CONFIG)
        inspect_source(path)
    except InputError as error:
        assert len(str(error).splitlines()) == 1
        assert str(path) in str(error)
