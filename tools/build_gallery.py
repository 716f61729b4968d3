"""Make the gallery's pictures by the commands of its page: `python tools/build_gallery.py WORK`.

Every block of commands in `docs/gallery.md` is run in the folder WORK, in order; what the page
shows out of `docs/gallery/` is taken from there. So the page cannot tell of a command that does not
work. Needs the extra `people` and the models.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
PAGE, PICTURES = DOCS / "gallery.md", DOCS / "gallery"
BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"\]\(gallery/([^)]+)\)")


def main(work: Path) -> None:
    words = PAGE.read_text()
    work.mkdir(parents=True, exist_ok=True)
    beside_python = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    for commands in BLOCK.findall(words):
        print(commands, flush=True)
        subprocess.run(
            ["bash", "-euo", "pipefail", "-c", commands],
            cwd=work,
            env=os.environ | {"PATH": beside_python},
            check=True,
        )
    PICTURES.mkdir(exist_ok=True)
    for name in PICTURE.findall(words):
        shutil.copyfile(work / name, PICTURES / name)
        print(f"{name}: {(PICTURES / name).stat().st_size >> 10} KiB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
