"""The packages of the `estimate` extra, asked for before they are needed."""

from __future__ import annotations

from importlib.util import find_spec

from motion_transfer.errors import InputError

ESTIMATE_EXTRA = "motion-transfer[estimate]"


def missing_packages() -> list[str]:
    """What estimating from raw pictures needs and is not installed."""
    return ["ai-edge-litert"] if find_spec("ai_edge_litert") is None else []


def require_estimate() -> None:
    """Raises: InputError with the command that installs what raw pictures need."""
    if missing := missing_packages():
        raise InputError(
            f"raw pictures need {' and '.join(missing)}, which is not installed;"
            f" pip install '{ESTIMATE_EXTRA}'"
        )
