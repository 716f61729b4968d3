"""`drawing.engines.compiling`: graphs that are kept compiled, and give the same bits."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import openvino
import pytest

from motion_transfer.drawing.engines import Execution, compiling
from motion_transfer.drawing.engines.compiling import compile_graph, open_core
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.openvino_engine import OpenVinoEngine
from motion_transfer.drawing.export.run import make_noise
from motion_transfer.drawing.graphs.graph import FLOAT, Graph
from motion_transfer.weights.checkpoint import inspect_checkpoint


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where everything is kept, however small."""
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compiling, "WORTH_SECONDS", 0)
    return tmp_path / "compiled"


class Doubling:
    """A graph that multiplies by a number, and how often it was read."""

    def __init__(self, factor: float = 2) -> None:
        graph = Graph()
        x = graph.input("x", FLOAT, (1, 4))
        graph.output("y", graph("Mul", x, factor), FLOAT, (1, 4))
        self.content = graph.build("doubling").SerializeToString()
        self.times = 0

    def read(self) -> openvino.Model:
        self.times += 1
        return open_core().read_model(self.content)

    def __call__(self, precision: str = "f32", how: object = None) -> list[float]:
        compiled = compile_graph(self.content, self.read, precision, 1, threads=1, how=how)
        return compiled([np.arange(4, dtype=np.float32)[None]])[0][0].tolist()


def test_a_graph_is_compiled_once(folder: Path) -> None:
    doubling = Doubling()
    assert [doubling(), doubling()] == [[0, 2, 4, 6]] * 2
    assert doubling.times == 1
    assert Doubling(3)() == [0, 3, 6, 9]
    doubling(how="otherwise")
    assert doubling.times == 2
    assert len(list(folder.iterdir())) == 3


@pytest.mark.parametrize("harm", ["cut", "changed", "emptied"])
def test_what_was_damaged_is_compiled_again(folder: Path, harm: str) -> None:
    doubling = Doubling()
    doubling()
    (kept,) = folder.iterdir()
    whole = kept.read_bytes()
    changed = whole[:-9] + bytes([whole[-9] ^ 1]) + whole[-8:]
    kept.write_bytes({"cut": whole[: len(whole) // 2], "changed": changed, "emptied": b""}[harm])
    assert doubling() == [0, 2, 4, 6]
    assert doubling.times == 2
    doubling()
    assert doubling.times == 2


def test_what_openvino_cannot_load_is_compiled_again(folder: Path) -> None:
    doubling = Doubling()
    doubling()
    (kept,) = folder.iterdir()
    nonsense = b"of another program"
    kept.write_bytes(compiling.xxhash.xxh3_128_digest(nonsense) + nonsense)
    assert doubling() == [0, 2, 4, 6]
    assert doubling.times == 2


def test_what_was_used_longest_ago_goes_first(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    doublings = [Doubling(factor) for factor in (2, 3, 4)]
    for age, doubling in zip((30, 20), doublings, strict=False):
        doubling()
        newest = max(folder.iterdir(), key=lambda file: file.stat().st_mtime)
        os.utime(newest, (1e9 - age, 1e9 - age))
    doublings[0]()  # used again
    size = next(folder.iterdir()).stat().st_size
    monkeypatch.setattr(compiling, "MOST_BYTES", 2.5 * size)
    doublings[2]()
    assert len(list(folder.iterdir())) == 2
    for number in (0, 2, 1):
        doublings[number]()
    assert [doubling.times for doubling in doublings] == [1, 2, 1]


def test_a_folder_that_cannot_be_written_is_done_without(folder: Path) -> None:
    folder.write_text("in the way")
    doubling = Doubling()
    assert [doubling(), doubling()] == [[0, 2, 4, 6]] * 2
    assert doubling.times == 2


def test_a_full_disk_holds_nothing_half_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fill(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", fill)
    assert Doubling()() == [0, 2, 4, 6]
    assert not folder.exists()


def test_what_is_soon_compiled_is_not_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "WORTH_SECONDS", 60)
    Doubling()()
    assert not folder.exists()


def test_a_network_draws_the_same_bits(folder: Path, checkpoint: Path) -> None:
    noise = make_noise(inspect_checkpoint(checkpoint).config)
    drawn = []
    for _ in range(2):
        engine = OpenVinoEngine(checkpoint, Execution("openvino", "f32", "cpu"))
        drawn.append(engine.draw(engine.take(FeatureMap(noise["feature_map"])), noise["iuv"]))
    (kept,) = folder.iterdir()
    assert kept.stat().st_size > 10_000
    np.testing.assert_array_equal(*drawn)
