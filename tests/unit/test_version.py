"""Versions of packages, however they are installed."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from motion_transfer.render.about_setup import _describe_opencv
from motion_transfer.version import holders_of, package_version


def test_a_package_has_the_version_it_is_installed_in() -> None:
    assert package_version("torch") == importlib.metadata.version("torch")
    assert package_version("nothing-of-this-name") == "unknown"


def test_a_build_without_metadata_tells_its_version_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_build.py").write_text('__version__ = "4.2"\n', encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    assert package_version("own_build") == "4.2"


def test_two_distributions_of_opencv_are_told_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (one,) = holders_of("cv2")
    assert set(_describe_opencv()) == {one}
    info = tmp_path / "opencv_python-4.12.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: opencv-python\nVersion: 4.12\n", encoding="utf-8")
    (info / "top_level.txt").write_text("cv2\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    told = _describe_opencv()["opencv"]
    assert told.startswith(f"{one} and opencv-python overwrite each other")


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
