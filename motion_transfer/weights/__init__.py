"""Checkpoints: those that ship (here; light), and reading and writing any (`checkpoint`)."""

from __future__ import annotations

from pathlib import Path

from motion_transfer.errors import WeightsError

SHIPPED = ("lite",)
DEFAULT_WEIGHTS = Path("lite")


def find_weights(name: Path) -> Path:
    """Find the file of a checkpoint that ships, by its name; return any other path as it is.

    Raises: WeightsError if it ships but is not there.
    """
    if str(name) not in SHIPPED:
        return name
    path = Path(__file__).with_name(f"{name}.safetensors")
    if not path.is_file():
        raise WeightsError(
            f"weights {name} should have come with the program, but {path} is not there; install"
            " motion-transfer again, or use --renderer texture"
        )
    return path
