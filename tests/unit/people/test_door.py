"""The door of synthetic people: light, and with everything that others use."""

from __future__ import annotations

import subprocess
import sys

import pytest

from motion_transfer import extras, people
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import find_iuv_format

HEAVY = {"anny", "cv2", "numpy", "scipy", "torch", "warp"}


def test_asking_whether_a_driver_is_a_motion_loads_nothing_heavy():
    code = (
        "import sys; from motion_transfer.people import is_motion;"
        " assert is_motion('people:walk') and not is_motion('walk.mkv'); print(*sys.modules)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not HEAVY & set(loaded.stdout.split())


@pytest.mark.parametrize("name", people.__all__)
def test_every_public_name_is_there(name):
    pytest.importorskip("warp", reason="needs the `people` extra")
    assert getattr(people, name) is not None


def test_another_name_is_not():
    with pytest.raises(AttributeError, match=r"motion_transfer\.people.* has no attribute 'Robot'"):
        people.Robot  # noqa: B018


def test_a_name_that_needs_the_extra_says_how_to_install_it(monkeypatch):
    def missing(name: str) -> None:
        raise ModuleNotFoundError(f"No module named 'warp', which {name} imports")

    monkeypatch.setattr(people, "import_module", missing)
    monkeypatch.setattr(extras, "find_spec", lambda _name: None)
    with pytest.raises(InputError, match=r"pip install 'motion-transfer\[people\]'"):
        people.write_album  # noqa: B018


def test_the_table_of_iuv_formats_knows_motions():
    row = find_iuv_format("people:walk,frames=4")
    assert row.scheme == people.SCHEME
    assert row.opener == "motion_transfer.people:open_motion"
