"""BlazePose's models are fetched once a machine; what needs them is skipped where they are not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from estimate_stubs import find_models

REFERENCE = Path(__file__).parents[2] / "reference/blazepose_landmarks.json"


@pytest.fixture(scope="session")
def models() -> dict[str, Path]:
    """The model files by name."""
    return find_models()


@pytest.fixture(scope="session")
def mediapipe_results() -> dict[str, dict]:
    """What MediaPipe found, written by tools/build_blazepose_reference.py."""
    return json.loads(REFERENCE.read_text())
