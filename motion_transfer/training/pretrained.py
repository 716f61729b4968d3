"""Frozen networks with weights that somebody else trained: read, check, freeze."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn

from motion_transfer.errors import WeightsError
from motion_transfer.weights.checkpoint import list_misfits


class FrozenNetwork(nn.Module):
    """A network whose weights never change; gradients pass through it to its input.

    `train()` leaves it in evaluation mode, so a trainer that holds it cannot wake its batch norms.
    """

    def freeze(self) -> None:
        """To be called once the weights are in."""
        self.requires_grad_(False)
        self.eval()

    def train(self, mode: bool = True) -> FrozenNetwork:  # noqa: ARG002 - torch's interface
        super().train(False)
        return self


def load_weights(
    network: nn.Module,
    path: Path,
    *,
    what: str,
    remedy: str,
    rename: Callable[[str], str | None] = lambda name: name,
) -> None:
    """Fill a network from a file, every tensor of it and nothing else.

    Args:
        what: the network's name, and `remedy` the options to give or drop, for messages.
        rename: the name in the network of a tensor in the file; None where it is not wanted.
    Raises: WeightsError if the file is missing, unreadable, or does not fit.
    """
    state = {}
    for name, tensor in read_tensors(path, what=what, remedy=remedy).items():
        wanted_name = rename(name)
        if wanted_name is not None:
            state[wanted_name] = tensor
    if listed := list_misfits(network, state):
        raise WeightsError(f"{path} does not hold {what}: {listed}; {remedy}")
    network.load_state_dict(state)


def read_tensors(path: Path, *, what: str, remedy: str) -> dict[str, Tensor]:
    """The state dict in a `.safetensors` file, or in one written by `torch.save`, on the CPU.

    Nothing but tensors is unpickled. Raises: WeightsError.
    """
    if not path.is_file():
        raise WeightsError(f"{what}: {path} does not exist; {remedy}")
    try:
        if path.suffix == ".safetensors":
            return load_file(path)
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (SafetensorError, OSError, RuntimeError, EOFError, ValueError, KeyError) as error:
        raise _unreadable(path, what, remedy) from error
    except pickle.UnpicklingError as error:
        raise _unreadable(path, what, remedy) from error
    if not isinstance(state, dict) or not all(isinstance(t, Tensor) for t in state.values()):
        raise WeightsError(f"{what}: {path} holds no state dict; {remedy}")
    return state


def _unreadable(path: Path, what: str, remedy: str) -> WeightsError:
    return WeightsError(
        f"{what}: {path} is neither a whole .safetensors file nor tensors saved by torch; {remedy}"
    )
