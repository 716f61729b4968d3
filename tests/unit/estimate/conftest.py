"""BlazePose's models are fetched once a machine; what needs them is skipped where they are not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from motion_transfer.errors import InputError
from motion_transfer.estimate.extra import require_estimate
from motion_transfer.estimate.model_files import MODEL_FILES, find_model

REFERENCE = Path(__file__).parents[2] / "reference/blazepose_landmarks.json"


@pytest.fixture(scope="session")
def models() -> dict[str, Path]:
    """The two model files by name."""
    try:
        require_estimate()
        return {file.name: find_model(file) for file in MODEL_FILES}
    except InputError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def mediapipe_results() -> dict[str, dict]:
    """What MediaPipe found, written by tools/build_blazepose_reference.py."""
    return json.loads(REFERENCE.read_text())
