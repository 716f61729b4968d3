"""What is said of a release in several places is the same in all of them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from motion_transfer.cli.main import cli
from motion_transfer.extras import EXTRAS, INSTALLED_BY
from motion_transfer.version import __version__

pytest.importorskip("packaging")
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
CONDA = {
    "opencv-contrib-python-headless": "py-opencv",
    "openvino": "python-openvino",
    "torch": "pytorch",
    "xxhash": "python-xxhash",
}
NOT_IN_ALL = {"all", "dev", "cluster"}


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def recipe() -> dict:
    text = (ROOT / "tools/packaging/recipe.yaml").read_text(encoding="utf-8")
    return yaml.safe_load(text)


def test_the_version_is_told_once() -> None:
    assert CliRunner().invoke(cli, ["--version"]).output == f"motion-transfer {__version__}\n"
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert yaml.safe_load(citation)["version"] == __version__
    assert recipe()["context"]["version"] == __version__


def test_the_changelog_tells_of_the_version_and_its_day() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    found = re.findall(r"^## (.+)$", changelog, re.MULTILINE)
    assert found[0] == "Unreleased"
    assert re.fullmatch(rf"{re.escape(__version__)} - \d{{4}}-\d\d-\d\d", found[1])


def test_conda_installs_what_pip_does() -> None:
    asked = [Requirement(line) for line in project()["dependencies"]]
    wanted = {CONDA.get(one.name, one.name): one.specifier for one in asked}
    run = [Requirement(line.replace(" ", "")) for line in recipe()["requirements"]["run"]]
    assert {one.name: one.specifier for one in run if one.name != "python"} == wanted


def test_all_is_all_extras_that_run_anywhere() -> None:
    extras = project()["optional-dependencies"]
    (everything,) = map(Requirement, extras["all"])
    assert everything.extras == extras.keys() - NOT_IN_ALL


@pytest.mark.parametrize("name", EXTRAS)
def test_an_extra_brings_what_is_asked_for(name: str) -> None:
    brought = project()["optional-dependencies"][INSTALLED_BY.get(name, name)]
    assert set(EXTRAS[name].packages.values()) <= {Requirement(line).name for line in brought}
