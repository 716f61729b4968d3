"""What `torch.save` and `pickle.dump` write, read without running anything in it.

Classes and functions that dumps ask for are stood for by records, arrays and tensors of this
module's own. No state from a file reaches a class of NumPy's or torch's, so that no file can make
an array that lies.
"""

from __future__ import annotations

import io
import math
import os
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib.stride_tricks import as_strided

from motion_transfer.media.iuv.unpickling import Names, unpickle

ZIP_SIGNATURE = b"PK\x03\x04"
TORCH_SIGNATURE = b"\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."
"""What follows the protocol in files of torch before 1.6, which were no archives: a number."""

NUMBER_TYPES = frozenset(["b1", "u1", "u2", "u4", "u8", "i1", "i2", "i4", "i8", "f2", "f4", "f8"])
"""What NumPy's pickles call the types that an array may have here, without their byte order."""


class Record:
    """What stands for DensePose's result classes: attributes, without behaviour."""

    def __setstate__(self, state: object) -> None:
        if not isinstance(state, dict):
            raise pickle.UnpicklingError(f"a result's attributes are a {type(state).__name__}")
        vars(self).update(state)


class PickledType:
    """What stands for `numpy.dtype`: a type of plain numbers."""

    def __init__(self, name: object, *_: object) -> None:
        if not isinstance(name, str) or name not in NUMBER_TYPES:
            raise pickle.UnpicklingError("an array of other things than numbers")
        self.dtype = np.dtype(name)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self.dtype = self.dtype.newbyteorder(state[1])


class PickledArray:
    """What stands for `numpy.ndarray`.

    Attributes:
        array: Read-only.
    """

    def __init__(self) -> None:
        self.array = np.empty(0)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, shape, kind, fortran, data = state
        self.array = _make_array(data, kind, shape, "F" if fortran else "C")


@dataclass(frozen=True)
class PickledStorage:
    """Numbers of tensors, which stay in the file until they are looked at."""

    dtype: np.dtype
    count: int
    read: Callable[[], bytes]


@dataclass(frozen=True)
class PickledTensor:
    """What stands for `torch.Tensor`."""

    storage: PickledStorage
    offset: int
    size: tuple[int, ...]
    stride: tuple[int, ...]

    @property
    def array(self) -> np.ndarray:
        """Read its numbers. Raises: ValueError, OSError, BadZipFile where they are damaged."""
        numbers = np.frombuffer(self.storage.read(), self.storage.dtype)
        if len(numbers) != self.storage.count:
            raise ValueError("its numbers break off")
        if numbers.dtype == BFLOAT16:  # the upper half of a float, which NumPy has not got
            numbers = (numbers.view("<u2").astype("<u4") << 16).view("<f4")
        steps = [step * numbers.itemsize for step in self.stride]
        return as_strided(numbers[self.offset :], self.size, steps, writeable=False)


def read_dump_file(path: Path) -> Any:
    """Read what a file holds; tensors in archives of torch's stay there until they are looked at.

    Raises: pickle.UnpicklingError naming what it asks for beyond what dumps need; any other
        exception where it is damaged.
    """
    with path.open("rb") as file:
        beginning = file.read(64)
        file.seek(0)
        if beginning.startswith(ZIP_SIGNATURE):
            return _read_archive(zipfile.ZipFile(path))
        if TORCH_SIGNATURE in beginning:
            return _read_legacy(file)
        return unpickle(file, NAMES)


def _read_archive(archive: zipfile.ZipFile) -> Any:
    """Read a file of torch's since 1.6: a pickle, and beside it the numbers of each storage."""
    names = (name for name in archive.namelist() if name.count("/") == 1)
    name = next((name for name in names if name.endswith("/data.pkl")), None)
    if name is None:
        raise ValueError("there is no data.pkl in the archive")
    folder = name.removesuffix("data.pkl")
    if (
        f"{folder}byteorder" in archive.namelist()
        and _stored(archive, f"{folder}byteorder") == b"big"
    ):
        raise ValueError("its numbers are of a big-endian machine")

    def find(saved: Any) -> PickledStorage:
        _, dtype, key, _, count = saved
        member = archive.getinfo(f"{folder}data/{key}")
        if member.file_size != count * dtype.itemsize:
            raise ValueError(f"the numbers of storage {key!r:.40} are not as many as it says")
        return PickledStorage(dtype, count, partial(_stored, archive, member.filename))

    return unpickle(io.BytesIO(_stored(archive, name)), NAMES, find)


def _stored(archive: zipfile.ZipFile, name: str) -> bytes:
    """Read a member, its checksum compared. Raises: ValueError if it is packed: none of torch's is,
    and little may unpack to more than there is memory.
    """
    if archive.getinfo(name).compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{name:.40} is compressed, as torch never does it")
    return archive.read(name)


def _read_legacy(file: IO[bytes]) -> Any:
    """Read a file of torch's before 1.6: pickles of its kind and content, the storages' keys, and
    the numbers of each, after how many they are.
    """
    for _ in ("signature", "version", "machine"):
        unpickle(file, {})
    numbers: dict[str, bytes] = {}
    types: dict[str, tuple[np.dtype, int]] = {}

    def find(saved: Any) -> PickledStorage:
        _, dtype, key, _, count, view = saved
        if view is not None or types.setdefault(key, (dtype, count)) != (dtype, count):
            raise ValueError("a storage that is part of another one")
        return PickledStorage(dtype, count, lambda: numbers[key])

    content = unpickle(file, NAMES, find)
    for key in unpickle(file, {}):
        dtype, count = types[key]
        said = int.from_bytes(file.read(8), "little")
        begins, ends = file.tell(), file.seek(0, os.SEEK_END)
        if said != count or begins + count * dtype.itemsize > ends:
            raise ValueError(f"the numbers of storage {key!r:.40} are not as many as it says")
        file.seek(begins)
        numbers[key] = file.read(count * dtype.itemsize)
    return content


def _read_storage(data: bytes) -> PickledStorage:
    """Stand for `_load_from_bytes`: torch pickles numbers as a file of its own in the pickle."""
    storage = _read_legacy(io.BytesIO(data))
    if not isinstance(storage, PickledStorage):
        raise pickle.UnpicklingError(f"a {type(storage).__name__} in place of a tensor's numbers")
    return storage


def _make_array(data: object, kind: object, shape: object, order: Any) -> np.ndarray:
    if not isinstance(data, bytes | bytearray) or not isinstance(kind, PickledType):
        raise pickle.UnpicklingError("an array of other things than numbers")
    # a number may fill the whole file, and to multiply two such takes minutes
    if not isinstance(shape, tuple) or any(side.bit_length() > 63 for side in shape):
        raise ValueError("an array's shape is none")
    if math.prod(shape) * kind.dtype.itemsize != len(data):
        raise ValueError(f"an array of {len(data)} bytes with another shape")
    return np.ndarray(shape, kind.dtype, data, order=order)


def _begin_array(*_: object) -> PickledArray:
    """Stand for `_reconstruct`, whose array is empty until its state comes."""
    return PickledArray()


def _read_array(
    data: object, kind: object, shape: object, order: str, axes: Any = None
) -> PickledArray:
    """Stand for `_frombuffer`: an array of protocol 5, which has no state."""
    made = PickledArray()
    made.array = _make_array(data, kind, shape, "C" if order == "K" else order)
    if axes is not None:
        made.array = made.array.transpose(axes)
    return made


def _begin_dict() -> dict[str, Any]:
    """Stand for a dict's class, which could be called with what is no dict."""
    return {}


def _begin_bytes() -> bytes:
    """Stand for `bytes`, by which protocols 0 to 2 spell none, and which makes as many as asked."""
    return b""


def _read_scalar(kind: object, data: object) -> Any:
    return _make_array(data, kind, (), "C").item()


def _make_record(kind: object, *_: object) -> Record:
    """Stand for `copyreg._reconstructor`, which protocols 0 and 1 make every object with."""
    if kind is not Record:
        raise pickle.UnpicklingError("an object that is no result")
    return Record()


def _read_tensor(
    storage: object, offset: int, size: tuple[int, ...], stride: tuple[int, ...], *_: object
) -> PickledTensor:
    """Stand for `_rebuild_tensor_v2`. Raises: ValueError if it would reach beyond its storage."""
    if not isinstance(storage, PickledStorage):
        raise pickle.UnpicklingError("a tensor without numbers")
    sides = (offset, *size, *stride)
    if len(size) != len(stride) or any(not 0 <= side < 1 << 40 for side in sides):
        raise ValueError("a tensor's shape is none")
    last = offset + sum((n - 1) * step for n, step in zip(size, stride, strict=True))
    # nor may it repeat numbers: a shape costs nothing to write, and becomes memory
    if math.prod(size) > storage.count or (math.prod(size) and last >= storage.count):
        raise ValueError("a tensor reaches beyond its numbers")
    return PickledTensor(storage, offset, size, stride)


def _encode(text: str, codec: str) -> bytes:
    """Stand for `_codecs.encode`, by which protocols 0 to 2 spell bytes; other codecs unpack."""
    if codec not in ("latin1", "latin-1"):
        raise pickle.UnpicklingError(f"the codec {codec!r:.40}")
    return text.encode("latin-1")


RESULT_CLASSES = (
    "densepose.structures.chart_result.DensePoseChartResult",
    "densepose.structures.chart_result.DensePoseChartResultWithConfidences",
    "densepose.structures.chart_result.DensePoseChartResultQuantized",
    "densepose.structures.chart_result.DensePoseChartResultCompressed",
    "densepose.vis.extractor.DensePoseChartResultWithConfidences",
    "densepose.structures.DensePoseResult",  # until the middle of 2020
)

BFLOAT16 = np.dtype("V2")
STORAGES = {
    "Double": "<f8",
    "Float": "<f4",
    "Half": "<f2",
    "BFloat16": BFLOAT16,
    "Long": "<i8",
    "Int": "<i4",
    "Short": "<i2",
    "Char": "i1",
    "Byte": "u1",
    "Bool": "?",
    "ComplexFloat": "<c8",  # no dump has these, but a message tells what they are
    "ComplexDouble": "<c16",
}
"""torch's classes of storages, without their last word, and the types of their numbers."""

NAMES: Names = {
    **dict.fromkeys(RESULT_CLASSES, Record),
    "numpy.dtype": PickledType,
    "numpy.ndarray": PickledArray,
    "numpy.core.multiarray._reconstruct": _begin_array,
    "numpy.core.multiarray.scalar": _read_scalar,
    "numpy._core.multiarray._reconstruct": _begin_array,  # since NumPy 2
    "numpy._core.multiarray.scalar": _read_scalar,
    "torch._utils._rebuild_tensor_v2": _read_tensor,
    "collections.OrderedDict": _begin_dict,  # a tensor's hooks, of which there are none
    **{f"torch.{name}Storage": np.dtype(kind) for name, kind in STORAGES.items()},
    "numpy.core.numeric._frombuffer": _read_array,
    "numpy._core.numeric._frombuffer": _read_array,
    "torch.storage._load_from_bytes": _read_storage,
    "_codecs.encode": _encode,
    "builtins.bytes": _begin_bytes,
    "copyreg._reconstructor": _make_record,
    "builtins.object": object,
}
"""What stands for what."""
