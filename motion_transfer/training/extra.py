"""The packages of the `train` extra, asked for before they are needed."""

from __future__ import annotations

from importlib.util import find_spec

from motion_transfer.errors import InputError


def require_training(*, tensorboard: bool) -> None:
    """Raises: InputError with the command that installs what training needs."""
    wanted = ["accelerate", *(["tensorboard"] if tensorboard else [])]
    missing = [name for name in wanted if find_spec(name) is None]
    if missing:
        raise InputError(
            f"training needs {' and '.join(missing)}, which is not installed;"
            " pip install 'motion-transfer[train]'"
        )
