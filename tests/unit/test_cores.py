"""The cores of a process, on systems that tell and on those that do not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from motion_transfer import cores


def test_only_cores_that_may_be_used_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _process: {1, 5, 6}, raising=False)
    assert cores.core_count() == 3


@pytest.mark.parametrize(("told", "counted"), [(8, 8), (None, 1)])
def test_systems_that_do_not_tell_are_taken_whole(
    monkeypatch: pytest.MonkeyPatch, told: int | None, counted: int
) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: told)
    assert cores.core_count() == counted


@pytest.mark.parametrize(
    ("system", "machine", "fast"),
    [
        ("darwin", "arm64", True),
        ("darwin", "x86_64", True),
        ("win32", "AMD64", True),
        ("win32", "ARM64", False),
    ],
)
def test_eight_bits_where_nothing_lists_what_cpus_can(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, system: str, machine: str, fast: bool
) -> None:
    monkeypatch.setattr(cores, "CPU_FACTS", tmp_path / "absent")
    monkeypatch.setattr("sys.platform", system)
    monkeypatch.setattr("platform.machine", lambda: machine)
    assert cores.multiplies_bytes.__wrapped__() is fast


@pytest.mark.parametrize(
    ("flags", "fast"),
    [
        ("flags\t: sse4_2 avx avx2 fma", True),
        ("flags\t: sse4_2 avx", False),
        ("Features\t: fp asimd asimddp", True),
        ("Features\t: fp asimd", False),
    ],
)
def test_eight_bits_where_the_cpu_is_fast_in_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flags: str, fast: bool
) -> None:
    (tmp_path / "cpuinfo").write_text(flags)
    monkeypatch.setattr(cores, "CPU_FACTS", tmp_path / "cpuinfo")
    assert cores.multiplies_bytes.__wrapped__() is fast
