"""What is pinned can be installed wherever the program says it runs."""

from __future__ import annotations

import importlib.metadata
import re
import tomllib
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.mark.parametrize("lock", ["requirements.lock", "requirements-dev.lock"])
def test_every_pin_runs_on_the_oldest_python(lock: str) -> None:
    """Distributions of Linux stay at an early patch of a Python, such as Debian 12 at 3.11.2."""
    oldest = PROJECT["requires-python"].removeprefix(">=") + ".0"
    pins = re.findall(r"^([\w.-]+)==(\S+)", (ROOT / lock).read_text(encoding="utf-8"), re.M)
    assert len(pins) > 30
    for name, version in pins:
        try:
            installed = importlib.metadata.distribution(name)
        except importlib.metadata.PackageNotFoundError:
            continue
        if installed.version.partition("+")[0] == version:
            needed = SpecifierSet(installed.metadata["Requires-Python"] or "")
            assert needed.contains(oldest), f"{name} {version} needs Python {needed}"
