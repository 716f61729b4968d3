"""Pages of the site that are files of the repository outside docs/, and links to them.

Run by mkdocs, which calls functions by their names.
"""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
FROM_REPOSITORY = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CITATION.cff": "citation.md",
    "CONTRIBUTING.md": "contributing.md",
    ".github/SECURITY.md": "security.md",
    "NOTICE": "notice.md",
    "benchmarks/README.md": "benchmarks.md",
    "jobs/README.md": "jobs.md",
}
"""Each file, and the page it becomes."""

LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#|/)([^)\s#]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files as pages; those that are no Markdown are shown as they are."""
    for name, page in FROM_REPOSITORY.items():
        words = (ROOT / name).read_text()
        if not name.endswith(".md"):
            words = f"# {name}\n\n```text\n{words}\n```"
        files.append(File.generated(config, page, content=words))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Turn links between files of the repository into links between pages.

    What leads to no page is left as it is: mkdocs then says so.
    """
    place = page.file.src_uri
    names = {page: name for name, page in FROM_REPOSITORY.items()}
    folder = PurePosixPath(names.get(place, f"docs/{place}")).parent

    def to_page(link: re.Match[str]) -> str:
        target = os.path.normpath(folder / link[1])
        if (ROOT / target).is_dir():
            target += "/README.md"
        inside = FROM_REPOSITORY.get(target) or target.removeprefix("docs/")
        known = files.get_file_from_path(inside) is not None
        return os.path.relpath(inside, PurePosixPath(place).parent) if known else link[1]

    return LINK.sub(to_page, markdown)
