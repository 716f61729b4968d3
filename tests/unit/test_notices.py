"""What ships besides code: NOTICE tells of each file where it came from."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
CODE = {".py", ".pyc", ".typed", ".j2", ".html", ".css", ".js", ".md"}


def shipped_data() -> set[str]:
    packages = (ROOT / "motion_transfer", ROOT / "nhrr_core")
    files = (file for package in packages for file in package.rglob("*") if file.is_file())
    return {file.relative_to(ROOT).as_posix() for file in files if file.suffix not in CODE}


def noticed() -> set[str]:
    """The names that begin a line; what is said of them is set in."""
    lines = (ROOT / "NOTICE").read_text(encoding="utf-8").splitlines()
    return {line for line in lines if line.startswith(("motion_transfer/", "nhrr_core/"))}


def test_each_file_of_data_is_in_the_notice() -> None:
    assert shipped_data() == noticed()


def test_the_demo_brings_its_rights_along() -> None:
    told = (ROOT / "motion_transfer" / "demo" / "LICENSE.md").read_text(encoding="utf-8")
    pictures = {file.name for file in (ROOT / "motion_transfer" / "demo").iterdir()}
    pictures -= {"LICENSE.md", "__init__.py", "__pycache__"}
    assert all(f"`{name}`" in told for name in pictures)
