"""What makes a process train faster without changing what it computes."""

from __future__ import annotations

import ctypes
import os
import sys

import torch
from torch import nn

from motion_transfer.render.neural_renderer import choose_dtype
from motion_transfer.training.config import Precision

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
LARGEST_MMAP_THRESHOLD = 1 << 30
NEVER_TRIM = (1 << 31) - 1


def keep_memory() -> None:
    """Let glibc keep the memory of large tensors that are freed.

    By default it gives each back to the kernel, which then clears every page again: on a CPU that
    is a good part of a step. Does nothing on other systems.
    """
    if not sys.platform.startswith("linux"):
        return
    try:
        mallopt = ctypes.CDLL("libc.so.6").mallopt
    except (OSError, AttributeError):  # another C library
        return
    mallopt(M_MMAP_THRESHOLD, LARGEST_MMAP_THRESHOLD)
    mallopt(M_TRIM_THRESHOLD, NEVER_TRIM)


def choose_precision(precision: Precision, device: torch.device) -> torch.dtype:
    """bf16 or float32; on `auto`, bf16 where the hardware multiplies it."""
    if precision == "auto":
        return choose_dtype(device)
    return torch.bfloat16 if precision == "bf16" else torch.float32


def arrange(*networks: nn.Module | None) -> None:
    """Weights in channels-last order, which convolutions on CPUs and tensor cores read faster."""
    for network in networks:
        if network is not None:
            network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]


def choose_workers(workers: int) -> int:
    """How many processes read data; -1: half of the cores, at most 4."""
    if workers >= 0:
        return workers
    return min(4, max(1, len(os.sched_getaffinity(0)) // 2))
