"""Checkpoints: those that ship (here; light), and reading and writing any (`checkpoint`)."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path

from motion_transfer.errors import WeightsError

SHIPPED = ("lite",)
DEFAULT_WEIGHTS = Path("lite")
HUB = "hf:"
"""What weights on the Hugging Face Hub begin with, where files may be named as well."""

ON_THE_HUB = re.compile(r"[\w.-]+/[\w.-]+")


def find_weights(name: Path) -> Path:
    """Find the file of a checkpoint.

    Args:
        name: One that ships; a folder that `save_pretrained` wrote; `hf:owner/name`, or
            `hf:owner/name@revision`, on the Hugging Face Hub; any other path is returned as it is.
    Raises: WeightsError if it should be there and is not; FetchError if the Hub cannot be reached.
    """
    if str(name).startswith(HUB):
        from motion_transfer.weights.pretrained import fetch_folder

        place, _, revision = str(name).removeprefix(HUB).partition("@")
        name = fetch_folder(place, revision or None)
    if name.is_dir():
        from motion_transfer.weights.pretrained import check_folder

        return check_folder(name)
    if str(name) not in SHIPPED:
        return name
    path = Path(__file__).with_name(f"{name}.safetensors")
    if not path.is_file():
        raise WeightsError(
            f"weights {name} should have come with the program, but {path} is not there; install"
            " motion-transfer again, or use --renderer texture"
        )
    return path


def names_weights_file(name: str) -> bool:
    """Tell whether weights are named by where they lie here, and by nothing else."""
    return name not in SHIPPED and not name.startswith(HUB)


def find_pretrained(name: str | PathLike[str], revision: str | None = None) -> Path:
    """Find the file of a checkpoint, see `find_weights`; `owner/name` means the Hub as well.

    It does where there is no such file here, or a revision is named.
    """
    words = str(name).removeprefix(HUB)
    if revision is not None:
        return find_weights(Path(f"{HUB}{words}@{revision}"))
    if ON_THE_HUB.fullmatch(words) and not Path(words).exists() and not words.startswith("."):
        return find_weights(Path(f"{HUB}{words}"))
    return find_weights(Path(name))
