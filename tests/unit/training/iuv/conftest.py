"""BlazePose's models are fetched once a machine; what needs them is skipped where they are not."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.estimate.models import MODEL_FILES, find_model


@pytest.fixture(scope="session")
def models() -> dict[str, Path]:
    """The model files by name."""
    try:
        return {file.name: find_model(file) for file in MODEL_FILES}
    except InputError as error:
        pytest.skip(str(error))
