"""Devices that torch computes on: their names, which of them are here, and which is fastest.

Torch is not imported where there can be none but the CPU.
"""

from __future__ import annotations

import re
import sys
from ctypes.util import find_library
from functools import cache
from pathlib import Path

from motion_transfer.errors import InputError

DEVICES = re.compile(r"cpu|mps|cuda(:\d+)?")
CUDA_FILES = ("/dev/nvidiactl", "/dev/dxg")  # Linux's driver, and that of Windows below it
CUDA_LIBRARY = "nvcuda"  # Windows' driver


def check_device(name: str) -> None:
    """Refuse what is no name of a device. Raises: InputError."""
    if not DEVICES.fullmatch(name):
        raise InputError(f"device {name!r}; it is cpu, mps, or cuda, cuda:1 and so on")


def find_device(wish: str | None = None) -> str:
    """Find the device that is wished for; or else a CUDA device where there is one, or the CPU.

    Apple's GPUs (`mps`) are taken only when asked for: what torch computes there was never
    compared with the rest.

    Raises: InputError if it is no name of a device, or not here.
    """
    if wish is None:
        return "cuda" if count_cuda() else "cpu"
    check_device(wish)
    kind, _, number = wish.partition(":")
    if kind == "cuda" and int(number or 0) >= count_cuda():
        found = f"torch finds {count_cuda()}" if count_cuda() else "torch finds none here"
        raise InputError(f"--device {wish}: {found}; choose another, or cpu")
    if kind == "mps" and not _has_mps():
        raise InputError(f"--device {wish}: torch finds none here; choose cpu")
    return wish


def name_device(device: str) -> str:
    """Name what computes, as its maker does; the CPU is just `cpu`."""
    if not device.startswith("cuda"):
        return device
    import torch

    return torch.cuda.get_device_name(device)


@cache
def count_cuda() -> int:
    """Count the CUDA devices that torch may use."""
    if "torch" not in sys.modules and not _may_have_cuda():
        return 0
    import torch

    return torch.cuda.device_count() if torch.cuda.is_available() else 0


def _may_have_cuda() -> bool:
    if sys.platform == "win32":
        return find_library(CUDA_LIBRARY) is not None
    return any(Path(file).exists() for file in CUDA_FILES)


@cache
def _has_mps() -> bool:
    if sys.platform != "darwin":
        return False
    import torch

    return torch.backends.mps.is_available()
