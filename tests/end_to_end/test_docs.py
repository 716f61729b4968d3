"""The site of the documentation: every link is whole, and its reference lacks nothing."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import click
import pytest

from motion_transfer.cli.main import cli

ROOT = Path(__file__).parents[2]
CONFIGURATION = ROOT / "tools" / "docs" / "mkdocs.yml"
MOST_BYTES = 5 << 20
"""Of what one clones for the documentation: pictures are small, or they are somewhere else."""

pytest.importorskip("mkdocs", reason="needs mkdocs-material and mkdocstrings")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    build = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    built = subprocess.run(
        [*build, "--config-file", str(CONFIGURATION), "--site-dir", str(folder)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    return folder


def test_every_command_and_option_is_in_the_reference(site):
    described = _described_options((site / "reference" / "commands.html").read_text())
    commands = dict(_commands(cli, "mt"))
    assert set(commands) <= set(described)
    for path, command in commands.items():
        names = {
            name
            for each in command.params
            for name in [*each.opts, *each.secondary_opts]
            if name.startswith("--")
        }
        assert names - {"--debug"} == described[path], path


@pytest.mark.parametrize("package", ["motion_transfer", "nhrr_core"])
def test_every_public_name_is_in_the_reference(site, package):
    page = (site / "reference" / f"{package}.html").read_text()
    names = {f"{package}.{name}" for name in importlib.import_module(package).__all__}
    assert names - {f"{package}.__version__"} <= set(re.findall(r'id="([\w.]+)"', page))


def test_nothing_is_fetched_from_elsewhere(site):
    fetched = re.compile(r'<(?:script|img|iframe|link)\b[^>]*?(?:src|href)="(?:https?:)?//')
    pages = list(site.rglob("*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if fetched.search(page.read_text())] == []


def test_the_package_describes_itself_without_the_repository():
    """An index of packages shows neither its pictures nor what its links lead to."""
    words = (ROOT / "docs" / "package.md").read_text()
    assert 'readme = "docs/package.md"' in (ROOT / "pyproject.toml").read_text()
    assert all(link.startswith("https://") for link in re.findall(r"\]\(([^)]+)\)", words))
    assert "![" not in words


def test_the_readme_is_a_page_that_names_what_make_does():
    words = (ROOT / "README.md").read_text()
    assert len(words.split()) <= 600
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {"demo", "test", "docs"} <= set(re.findall(r"\bmake ([a-z]+)", words)) <= set(targets)


def test_the_pictures_are_small():
    files = [file for file in (ROOT / "docs").rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < MOST_BYTES


def _commands(command: click.Command, path: str) -> Iterator[tuple[str, click.Command]]:
    context = click.Context(command)
    for name in command.list_commands(context) if isinstance(command, click.Group) else []:
        inner = command.get_command(context, name)
        assert inner is not None
        yield f"{path} {name}", inner
        yield from _commands(inner, f"{path} {name}")


def _described_options(page: str) -> dict[str, set[str]]:
    """The long options that are described under each heading of a page."""
    _, *parts = re.split(r"<h[2-5] id=", page)
    found = {}
    for part in parts:
        heading = unescape(re.sub("<[^>]+>", "", part.partition(">")[2].partition("</h")[0]))
        terms = " ".join(re.findall("<dt>(.*?)</dt>", part, re.DOTALL))
        found[heading.removesuffix("¶").strip()] = set(re.findall(r"(?<![\w-])--[\w-]+", terms))
    return found
