"""Reading a dump's pickle without running anything in it.

A pickle is a program that may call any function of any module. Here it finds nothing but what this
module lists: makers of records, which stand for DensePose's result classes, of arrays and of
tensors; and it is written in nothing but the opcodes that this takes. No state from a file reaches
a class of NumPy's, so that no file can make an array that lies.
"""

from __future__ import annotations

import io
import math
import pickle
import pickletools
from collections.abc import Callable
from typing import IO, Any

import numpy as np
import torch

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


def unpickle(file: IO[bytes]) -> Any:
    """Read the pickle that begins where the file stands.

    Raises: pickle.UnpicklingError naming what it asks for beyond what dumps need; any other
        exception where opcodes do not fit each other, or the file ends among them.
    """
    stack: list[Any] = []
    marks: list[int] = []
    memo: dict[int, Any] = {}
    argument: Any

    def pop_to_mark() -> list[Any]:
        start = marks.pop()
        items = stack[start:]
        del stack[start:]
        return items

    for opcode, argument, _ in pickletools.genops(file):
        match opcode.name:
            case "PROTO" | "FRAME":
                pass
            case "STOP":
                return stack.pop()
            case "MARK":
                marks.append(len(stack))
            case name if name in CONSTANTS:
                stack.append(CONSTANTS[name])
            case name if name in LITERALS:
                stack.append(argument)
            case "EMPTY_LIST":
                stack.append([])
            case "EMPTY_DICT":
                stack.append({})
            case "LIST":
                stack.append(pop_to_mark())
            case "DICT":
                stack.append(_fill({}, pop_to_mark()))
            case "TUPLE":
                stack.append(tuple(pop_to_mark()))
            case "TUPLE1" | "TUPLE2" | "TUPLE3" as name:
                count = int(name[-1])
                stack[-count:] = [tuple(stack[-count:])]
            case "APPEND":
                item = stack.pop()
                _extend(stack[-1], [item])
            case "APPENDS":
                items = pop_to_mark()
                _extend(stack[-1], items)
            case "SETITEM":
                value, key = stack.pop(), stack.pop()
                _fill(stack[-1], [key, value])
            case "SETITEMS":
                items = pop_to_mark()
                _fill(stack[-1], items)
            case "MEMOIZE":
                memo[len(memo)] = stack[-1]
            case "PUT" | "BINPUT" | "LONG_BINPUT":
                memo[argument] = stack[-1]
            case "GET" | "BINGET" | "LONG_BINGET":
                stack.append(memo[argument])
            case "GLOBAL":
                stack.append(_find(*argument.split(" ", 1)))
            case "STACK_GLOBAL":
                name, module = stack.pop(), stack.pop()
                stack.append(_find(module, name))
            case "REDUCE" | "NEWOBJ":
                arguments, called = stack.pop(), stack.pop()
                stack.append(_call(called, arguments))
            case "BUILD":
                state = stack.pop()
                _set_state(stack[-1], state)
            case other:
                raise pickle.UnpicklingError(f"the opcode {other}")
    raise EOFError


CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_TUPLE": ()}
# fmt: off
LITERALS = frozenset([
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "FLOAT", "BINFLOAT",
    "UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8",
    "SHORT_BINBYTES", "BINBYTES", "BINBYTES8", "BYTEARRAY8",
])
# fmt: on
"""Opcodes whose argument is the value; texts of Python 2 are not among them."""


def _extend(target: object, items: list[Any]) -> None:
    if type(target) is not list:
        raise pickle.UnpicklingError(f"items for a {type(target).__name__}")
    target.extend(items)


def _fill(target: object, items: list[Any]) -> object:
    """Fill a dict. Its keys are names: to hash tuples of tuples may take for ever, or crash."""
    keys = items[::2]
    if type(target) is not dict or not all(type(key) is str for key in keys):
        raise pickle.UnpicklingError("a dict whose keys are no names")
    target.update(zip(keys, items[1::2], strict=True))
    return target


def _find(module: object, name: object) -> Callable[..., Any]:
    # protocols 0 to 2 keep to what modules were called in Python 2
    modules = {"__builtin__": "builtins", "copy_reg": "copyreg"}
    if not isinstance(module, str) or not isinstance(name, str):
        raise pickle.UnpicklingError("a name that is no text")
    full_name = f"{modules.get(module, module)}.{name}"
    if full_name not in _GLOBALS:
        raise pickle.UnpicklingError(f"it asks for {full_name}")
    return _GLOBALS[full_name]


def _call(called: object, arguments: object) -> Any:
    if not any(called is known for known in _GLOBALS.values()) or not isinstance(arguments, tuple):
        raise pickle.UnpicklingError(f"a call of a {type(called).__name__}")
    return called(*arguments)  # pyright: ignore[reportCallIssue] (one of the table)


def _set_state(target: object, state: Any) -> None:
    if not isinstance(target, Record | PickledArray | PickledType):
        raise pickle.UnpicklingError(f"state for a {type(target).__name__}")
    target.__setstate__(state)


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


def _read_scalar(kind: object, data: object) -> Any:
    return _make_array(data, kind, (), "C").item()


def _make_record(kind: object, *_: object) -> Record:
    """Stand for `copyreg._reconstructor`, which protocols 0 and 1 make every object with."""
    if kind is not Record:
        raise pickle.UnpicklingError("an object that is no result")
    return Record()


def _read_storage(data: bytes) -> torch.storage.TypedStorage:
    """Stand for `_load_from_bytes`: torch pickles numbers as a file of its own inside the pickle,
    which the function itself reads with everything allowed.
    """
    storage = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    if not isinstance(storage, torch.storage.TypedStorage):
        raise pickle.UnpicklingError(f"a {type(storage).__name__} in place of a tensor's numbers")
    return storage


def _read_tensor(
    storage: object, offset: int, size: tuple[int, ...], stride: tuple[int, ...], *_: object
) -> torch.Tensor:
    """Stand for `_rebuild_tensor_v2`. Raises: RuntimeError if it would reach beyond its storage."""
    if not isinstance(storage, torch.storage.TypedStorage):
        raise pickle.UnpicklingError("a tensor without numbers")
    numbers = torch.empty(0, dtype=storage.dtype)
    return numbers.set_(storage._untyped_storage, offset, size, stride)


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

RECORDS_AND_ARRAYS: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(RESULT_CLASSES, Record),
    "numpy.dtype": PickledType,
    "numpy.ndarray": PickledArray,
    "numpy.core.multiarray._reconstruct": _begin_array,
    "numpy.core.multiarray.scalar": _read_scalar,
    "numpy._core.multiarray._reconstruct": _begin_array,  # since NumPy 2
    "numpy._core.multiarray.scalar": _read_scalar,
}
"""What stands for what in every dump, by its full name."""

_GLOBALS: dict[str, Callable[..., Any]] = {
    **RECORDS_AND_ARRAYS,
    "numpy.core.numeric._frombuffer": _read_array,
    "numpy._core.numeric._frombuffer": _read_array,
    "torch._utils._rebuild_tensor_v2": _read_tensor,
    "torch.storage._load_from_bytes": _read_storage,
    "collections.OrderedDict": dict,  # a tensor's hooks, of which there are none
    "_codecs.encode": _encode,
    "builtins.bytes": bytes,
    "copyreg._reconstructor": _make_record,
    "builtins.object": object,
}
"""The same for pickles that are no files of torch's."""
