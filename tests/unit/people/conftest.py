"""The body model, loaded once a test process."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def body_model():
    """The parametric body; skipped, with the reason, where the extra is not installed."""
    pytest.importorskip("anny", reason="needs the `people` extra")
    from motion_transfer.people.body import load_body_model

    return load_body_model()
