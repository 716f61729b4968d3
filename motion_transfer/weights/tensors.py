"""Files of tensors: what they say of themselves, and the network that they fill exactly.

Two kinds are read: safetensors, which is data and lies open to a look before anything is read, and
what `torch.save` wrote, of which nothing but tensors and plain values is unpickled. Everything
that the program writes to be rendered with is the former.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import torch
from safetensors import safe_open
from safetensors.torch import load_file
from torch import Tensor, nn

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.media.files import check_readable

PICKLES = (".pt", ".pth", ".ckpt", ".bin", ".pkl")
FLOATS = ("F64", "F32", "F16", "BF16")

N = TypeVar("N", bound=nn.Module)


class Header(NamedTuple):
    """What stands before the tensors of a safetensors file.

    Attributes:
        state: By name, tensors without content: their shapes, and whether they are floating.
    """

    metadata: dict[str, str]
    state: dict[str, Tensor]


def read_header(path: Path, what: str) -> Header:
    """Read the header of a safetensors file, and nothing else.

    Args:
        what: What the file is wanted for, in the plural, such as `weights`, for messages.
    Raises: WeightsError if the file cannot be read, or is not a whole one of that kind.
    """
    check_weights(path, what)
    try:
        with safe_open(path, framework="pt") as file:
            state = {}
            for name in file.keys():  # noqa: SIM118 - it is no mapping
                part = file.get_slice(name)
                kind = torch.float32 if part.get_dtype() in FLOATS else torch.int64
                state[name] = torch.empty(part.get_shape(), dtype=kind, device="meta")
            return Header(dict(file.metadata() or {}), state)
    except Exception as error:  # of a lying header they have no common base
        other = path.suffix.lower() in PICKLES
        remedy = "only .safetensors is read; save its tensors as that" if other else ""
        raise WeightsError(
            f"{what} {path} are not a whole safetensors file ({first_line(error)});"
            f" {remedy or 'download or export again'}"
        ) from error


def load_network(make: Callable[[], N], state: Mapping[str, Tensor], path: Path, what: str) -> N:
    """Make a network and fill it from a safetensors file: all of its tensors, and no others.

    Whether they fit is found out before any memory is taken for the network or for them.

    Args:
        make: Makes the network that the file's configuration describes.
        state: Of the file's header.
        what: See `read_header`.
    Raises: WeightsError if the tensors do not fit, or hold values that are no numbers.
    """
    with torch.device("meta"):
        wanted = make()
    if listed := list_misfits(wanted, state):
        raise WeightsError(f"{what} {path} do not fit their own configuration: {listed}")
    try:
        tensors = load_file(path)
    except Exception as error:
        raise WeightsError(f"{what} {path} cannot be read: {first_line(error)}") from error
    for name, tensor in tensors.items():
        if not tensor.isfinite().all():
            raise WeightsError(
                f"{what} {path} are damaged: {name} holds values that are no finite numbers;"
                " download or export again"
            )
    network = make()
    network.load_state_dict(tensors)
    return network


def list_misfits(network: nn.Module, state: Mapping[str, Tensor]) -> str:
    """List up to three things that keep tensors from being exactly those of a network; else ""."""
    wanted = network.state_dict()
    problems = [f"{name} is missing" for name in wanted if name not in state]
    problems += [f"{name} is unknown" for name in state if name not in wanted]
    for name, tensor in wanted.items():
        if name not in state:
            continue
        found = state[name]
        if found.shape != tensor.shape:
            problems.append(f"{name} is {list(found.shape)}, not {list(tensor.shape)}")
        elif found.is_floating_point() != tensor.is_floating_point():
            problems.append(f"{name} holds another kind of numbers")
    return "; ".join(problems[:3]) + ("; ..." if len(problems) > 3 else "")


def load_pickled(path: Path, what: str) -> Any:
    """Load onto the CPU what `torch.save` wrote: tensors and plain values only.

    Raises: WeightsError.
    """
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


def first_line(error: Exception) -> str:
    """Tell a library's reason in one line, or its kind where it gives none."""
    return next((line.strip() for line in str(error).splitlines() if line.strip()), repr(error))
