"""Versions of packages, however they are installed."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from motion_transfer.version import package_version


def test_a_package_has_the_version_it_is_installed_in() -> None:
    assert package_version("torch") == importlib.metadata.version("torch")
    assert package_version("nothing-of-this-name") == "unknown"


def test_an_installation_without_metadata_is_unknown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    info = tmp_path / "broken_thing-1.0.dist-info"
    info.mkdir()
    for text in ("", "Name: broken-thing\n"):
        (info / "METADATA").write_text(text)
        (info / "top_level.txt").write_text("broken_thing\n")
        monkeypatch.syspath_prepend(tmp_path)
        assert package_version("broken-thing") == "unknown"
        assert package_version("broken_thing") == "unknown"
