"""Files of tensors: what they say of themselves, and the network that they fill exactly.

Two kinds are read: safetensors, which is data and lies open to a look before anything is read, and
what `torch.save` wrote, of which nothing but tensors and plain values is unpickled. Everything
that the program writes to be rendered with is the former.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Shaped
from safetensors import deserialize, safe_open

from motion_transfer.errors import InputError, WeightsError, first_line
from motion_transfer.media.files import check_readable

if TYPE_CHECKING:
    from torch import Tensor, nn

PICKLES = (".pt", ".pth", ".ckpt", ".bin", ".pkl")
FLOATS = {"F64": np.float64, "F32": np.float32, "F16": np.float16, "BF16": np.uint16}
INTEGERS = {"I64": np.int64, "I32": np.int32, "I16": np.int16, "I8": np.int8, "U8": np.uint8}

Array = Shaped[np.ndarray, "..."]

N = TypeVar("N", bound="nn.Module")


class Entry(NamedTuple):
    """What a tensor is, without its content."""

    shape: tuple[int, ...]
    floating: bool


class Header(NamedTuple):
    """What stands before the tensors of a safetensors file; `state` lists those by name."""

    metadata: dict[str, str]
    state: dict[str, Entry]


def read_header(path: Path, what: str) -> Header:
    """Read the header of a safetensors file, and nothing else.

    Args:
        what: What the file is wanted for, in the plural, such as `weights`, for messages.
    Raises: WeightsError if the file cannot be read, or is not a whole one of that kind.
    """
    check_weights(path, what)
    try:
        with safe_open(path, framework="np") as file:
            state = {}
            for name in file.keys():  # noqa: SIM118 - it is no mapping
                part = file.get_slice(name)
                state[name] = Entry(tuple(part.get_shape()), part.get_dtype() in FLOATS)
            return Header(dict(file.metadata() or {}), state)
    except Exception as error:  # of a lying header they have no common base
        other = path.suffix.lower() in PICKLES
        remedy = "only .safetensors is read; save its tensors as that" if other else ""
        raise WeightsError(
            f"{what} {path} are not a whole safetensors file ({first_line(error)});"
            f" {remedy or 'download or export again'}"
        ) from error


def read_tensors(
    path: Path, wanted: Mapping[str, Entry], state: Mapping[str, Entry], what: str
) -> dict[str, Array]:
    """Read the tensors of a safetensors file: all that are wanted, and no others.

    Whether they fit is found out before any memory is taken for them.

    Args:
        state: Of the file's header.
        what: See `read_header`.
    Returns: By name, float32 for all that are floating.
    Raises: WeightsError if the tensors do not fit, or hold values that are no numbers.
    """
    if listed := list_misfits(wanted, state):
        raise WeightsError(f"{what} {path} do not fit their own configuration: {listed}")
    try:
        stored = deserialize(path.read_bytes())
        tensors = {name: _decode(**told) for name, told in stored}
    except Exception as error:
        raise WeightsError(f"{what} {path} cannot be read: {first_line(error)}") from error
    for name, tensor in tensors.items():
        if not np.isfinite(tensor).all():
            raise WeightsError(
                f"{what} {path} are damaged: {name} holds values that are no finite numbers;"
                " download or export again"
            )
    return tensors


def _decode(dtype: str, shape: list[int], data: bytearray) -> Array:
    values = np.frombuffer(data, {**FLOATS, **INTEGERS}[dtype]).reshape(shape)
    if dtype == "BF16":  # the upper half of a float32
        return (values.astype(np.uint32) << 16).view(np.float32)
    return values.astype(np.float32, copy=False) if dtype in FLOATS else values


def load_network(make: Callable[[], N], state: Mapping[str, Entry], path: Path, what: str) -> N:
    """Make a network and fill it from a safetensors file, see `read_tensors`.

    Args:
        make: Makes the network that the file's configuration describes.
    Raises: WeightsError if the tensors do not fit, or hold values that are no numbers.
    """
    import torch

    with torch.device("meta"):
        wanted = list_entries(make().state_dict())
    tensors = read_tensors(path, wanted, state, what)
    network = make()
    network.load_state_dict({name: torch.tensor(values) for name, values in tensors.items()})
    return network


def list_entries(state: Mapping[str, Tensor]) -> dict[str, Entry]:
    """Tell what tensors are."""
    return {
        name: Entry(tuple(tensor.shape), tensor.is_floating_point())
        for name, tensor in state.items()
    }


def list_misfits(wanted: Mapping[str, Entry], found: Mapping[str, Entry]) -> str:
    """List up to three things that keep tensors from being exactly those wanted; else ""."""
    problems = [f"{name} is missing" for name in wanted if name not in found]
    problems += [f"{name} is unknown" for name in found if name not in wanted]
    for name in (name for name in wanted if name in found):
        if found[name].shape != wanted[name].shape:
            shapes = list(found[name].shape), list(wanted[name].shape)
            problems.append(f"{name} is {shapes[0]}, not {shapes[1]}")
        elif found[name].floating != wanted[name].floating:
            problems.append(f"{name} holds another kind of numbers")
    return "; ".join(problems[:3]) + ("; ..." if len(problems) > 3 else "")


def load_pickled(path: Path, what: str) -> Any:
    """Load onto the CPU what `torch.save` wrote: tensors and plain values only.

    Raises: WeightsError.
    """
    import torch

    check_weights(path, what)
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # of a damaged pickle they have no common base
        raise WeightsError(f"{what} {path} cannot be read: {first_line(error)}") from error


def check_weights(path: Path, what: str) -> None:
    """Refuse what is no file, see `check_readable`. Raises: WeightsError."""
    try:
        check_readable(path, what)
    except InputError as error:
        raise WeightsError(str(error)) from None
