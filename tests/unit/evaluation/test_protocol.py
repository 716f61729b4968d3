"""Protocols: whatever changes a number makes a difference, and it is named."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import pytest

from motion_transfer.errors import InputError
from motion_transfer.evaluation.protocol import Protocol, package_versions


def protocol(**changes: Any) -> Protocol:
    values: dict[str, Any] = {
        "resolution": "256x256",
        "resize_filter": "area",
        "padding": "white",
        "background": "white",
        "mask": "alpha",
        "pairs_name": "pairs.csv",
        "pairs_count": 4,
        "pairs_sha256": "ab12",
        "metrics": {"ssim": "SSIM", "lpips": "weights 1"},
        "packages": {"torch": "2.13"},
    }
    return Protocol(**{**values, **changes})


def test_equal_protocols_have_no_differences() -> None:
    assert protocol() == protocol()
    assert hash(protocol()) == hash(protocol())
    assert protocol().differences(protocol()) == []
    assert Protocol.from_dict(protocol().to_dict()) == protocol()


CHANGES = {
    "resolution": "512x512",
    "resize_filter": "nearest",
    "padding": "black",
    "background": "photo",
    "mask": "none",
    "pairs_count": 3,
    "pairs_sha256": "cd34",
    "metrics": {"ssim": "another SSIM", "lpips": "weights 1"},
    "packages": {"torch": "2.14"},
}


@pytest.mark.parametrize("name", CHANGES)
def test_every_field_counts_and_is_named(name: str) -> None:
    other = replace(protocol(), **{name: CHANGES[name]})
    assert other != protocol()
    (line,) = protocol().differences(other)
    assert line.startswith(name)
    assert " / " in line


def test_the_table_of_changes_is_complete() -> None:
    assert {item.name for item in fields(Protocol)} == {*CHANGES, "pairs_name"}
    assert protocol(pairs_name="other.csv").differences(protocol()) == []


def test_other_weights_are_a_difference_and_missing_metrics_are_none() -> None:
    other = protocol(metrics={"lpips": "weights 2", "fid": "weights 3"})
    assert protocol().differences(other) == ["metrics.lpips: weights 1 / weights 2"]
    assert protocol().differences(protocol(metrics={"fid": "weights 3"})) == []


def test_what_is_no_protocol() -> None:
    values = protocol().to_dict()
    with pytest.raises(InputError, match="lacks, or should not have, mask, masks"):
        Protocol.from_dict({**{k: v for k, v in values.items() if k != "mask"}, "masks": ""})
    with pytest.raises(InputError, match="are not tables"):
        Protocol.from_dict({**values, "metrics": "ssim"})


def test_package_versions_leave_patches_out() -> None:
    import torch

    found = package_versions(("torch", "no-such-package"))
    assert found["no-such-package"] == "unknown"
    assert torch.__version__.startswith(found["torch"] + ".")
    assert found["torch"].count(".") == 1
