"""What a folder of assets must hold, and what is said where it does not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from motion_transfer.errors import InputError

pytest.importorskip("warp", reason="needs the `people` extra")

from motion_transfer.people.free.assets import (
    Assets,
    check_share,
    find_assets,
    load_assets,
    load_mesh,
    read_arrays,
)

SKIN = {"name": "skin", "kind": "skin", "sex": "female"}


def folder_of(
    path: Path, entries: object, *, mesh: bool = True, files: tuple[str, ...] = ()
) -> Path:
    (path / "items.json").write_text(json.dumps(entries))
    if mesh:
        np.savez(path / "hm08.npz", faces=np.zeros((1, 3), np.int32))
    for name in files:
        (path / name).write_bytes(b"content")
    return path


def textured(file: str, **entry) -> dict:
    return {**SKIN, **entry, "textures": {"diffuse": {"file": file}}}


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({}, r"expected a list of items, not \{\}"),
        ([], "expected a list of items"),
        ([3], "item 0: 3 is no table"),
        ([{"kind": "skin"}], "item 0: name is ''; it must be a word"),
        ([SKIN], r"item 0 \(skin\) has no diffuse picture"),
        ([textured("gone.png")], r"item 0 \(skin\): gone.png is missing; copy the folder anew"),
        ([textured("../there.png")], "lies outside of the folder"),
        ([textured("a.png", kind="hair")], r"\(skin\) has no geometry"),
        ([{**SKIN, "textures": 4}], "textures are 4; they must be tables by role"),
        ([textured("a.png")], "list no eyes; people need one"),
    ],
)
def test_a_list_that_cannot_be_used_is_refused_with_the_item(tmp_path, entries, message):
    with pytest.raises(InputError, match=message):
        load_assets(folder_of(tmp_path, entries, files=("a.png",)))


def test_a_folder_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no such folder; give one that holds items.json"):
        load_assets(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no items.json; give the folder that does"):
        load_assets(tmp_path)
    with pytest.raises(InputError, match=r"hm08.npz is missing"):
        load_assets(folder_of(tmp_path, [textured("a.png")], mesh=False, files=("a.png",)))


def test_a_mesh_that_is_not_hm08_is_refused(tmp_path):
    folder_of(tmp_path, [], files=("a.png",))
    with pytest.raises(InputError, match=r"hm08.npz lacks uv; copy it anew"):
        load_mesh(Assets(tmp_path, {}, {}))


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros(3), "not 3 numbers"),
        (np.zeros((2, 2)), "not 3 numbers"),
        (np.full((2, 3), np.nan), "not 3 numbers"),
        (np.array([["a", "b", "c"]]), "not 3 numbers"),
        (np.array([[{}, 1, 2]], dtype=object), "is no whole npz"),  # would have to be unpickled
    ],
)
def test_arrays_of_another_kind_are_refused(tmp_path, array, message):
    np.savez(tmp_path / "a.npz", index=array)
    with pytest.raises(InputError, match=message):
        read_arrays(tmp_path / "a.npz", index=3)


def test_a_file_that_is_no_npz_is_refused(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(InputError, match="is no whole npz"):
        read_arrays(tmp_path / "a.npz", index=3)


def test_the_folder_is_the_one_named_or_the_environments(monkeypatch):
    monkeypatch.delenv("MT_ASSETS", raising=False)
    assert find_assets(None) is None and find_assets("") is None
    monkeypatch.setenv("MT_ASSETS", "there")
    assert find_assets(None) == Path("there") and find_assets("here") == Path("here")


def test_a_share_needs_assets_and_lies_between_none_and_all(tmp_path):
    assert check_share(None, None) == 0 and check_share(None, tmp_path) == 0.5
    assert check_share(1.0, tmp_path) == 1
    with pytest.raises(
        InputError, match="needs assets; name their folder with --assets DIR or MT_"
    ):
        check_share(0.3, None)
    with pytest.raises(InputError, match=r"it must lie in 0..1"):
        check_share(1.3, tmp_path)
