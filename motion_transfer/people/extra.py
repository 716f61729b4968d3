"""The packages of the `people` extra, asked for before they are needed."""

from __future__ import annotations

from importlib.util import find_spec

from motion_transfer.errors import InputError


def require_people() -> None:
    """Raises: InputError with the command that installs what synthetic people need."""
    missing = [name for name in ("anny", "warp") if find_spec(name) is None]
    if missing:
        raise InputError(
            f"synthetic people need {' and '.join(missing)}, which is not installed;"
            " pip install 'motion-transfer[people]'"
        )
