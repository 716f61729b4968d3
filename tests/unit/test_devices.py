"""Devices: which names there are, and which of them are here."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from motion_transfer import devices
from motion_transfer.devices import count_cuda, find_device, name_device
from motion_transfer.errors import InputError


@pytest.fixture(autouse=True)
def nothing_is_remembered():
    caches = (devices.count_cuda, devices._has_mps)
    for cache in caches:
        cache.cache_clear()
    yield
    for cache in caches:
        cache.cache_clear()


@pytest.fixture
def have(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    def have(*, cuda: int = 0, mps: bool = False) -> None:
        monkeypatch.setattr(torch.cuda, "is_available", lambda: cuda > 0)
        monkeypatch.setattr(torch.cuda, "device_count", lambda: cuda)
        monkeypatch.setattr(torch.backends.mps, "is_available", lambda: mps)
        monkeypatch.setattr(sys, "platform", "darwin" if mps else "linux")

    return have


def test_the_fastest_is_taken_that_was_compared(have) -> None:
    have(cuda=2)
    assert find_device() == "cuda"
    have(mps=True)
    count_cuda.cache_clear()
    assert find_device() == "cpu"


@pytest.mark.parametrize("name", ["cpu", "cuda", "cuda:1"])
def test_what_is_here_may_be_chosen(have, name: str) -> None:
    have(cuda=2)
    assert find_device(name) == name


def test_apples_gpu_may_be_chosen(have) -> None:
    have(mps=True)
    assert find_device("mps") == "mps"
    assert name_device("mps") == "mps"


@pytest.mark.parametrize(
    ("wish", "cuda", "told"),
    [
        ("cuda", 0, r"--device cuda: torch finds none here; choose another, or cpu"),
        ("cuda:2", 2, r"--device cuda:2: torch finds 2; choose another, or cpu"),
        ("mps", 2, r"--device mps: torch finds none here; choose cpu"),
        ("tpu", 2, r"device 'tpu'; it is cpu, mps, or cuda, cuda:1 and so on"),
    ],
)
def test_what_is_not_here_is_told_of(have, wish: str, cuda: int, told: str) -> None:
    have(cuda=cuda)
    with pytest.raises(InputError, match=told):
        find_device(wish)


def test_torch_is_not_imported_where_there_is_no_driver(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(devices, "CUDA_FILES", (tmp_path / "absent",))
    monkeypatch.delitem(sys.modules, "torch")
    assert count_cuda() == 0
    assert "torch" not in sys.modules


@pytest.mark.parametrize("library", ["nvcuda.dll", None])
def test_windows_has_cuda_where_its_library_is(
    monkeypatch: pytest.MonkeyPatch, library: str | None
) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(devices, "find_library", lambda _name: library)
    assert devices._may_have_cuda() is (library is not None)
