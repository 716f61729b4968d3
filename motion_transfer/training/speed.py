"""What makes a process train faster without changing what it computes, and where its time goes."""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import nn

from motion_transfer.drawing.engines.torch_engine import choose_dtype
from motion_transfer.training.settings import Precision

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
LARGEST_MMAP_THRESHOLD = 1 << 30  # bytes: no tensor of a step is larger
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
    """Choose bf16 or float32; on `auto`, bf16 where the hardware multiplies it."""
    if precision == "auto":
        return choose_dtype(device)
    return torch.bfloat16 if precision == "bf16" else torch.float32


def arrange(*networks: nn.Module | None) -> None:
    """Put weights in channels-last order, which CPUs and tensor cores convolve faster."""
    for network in networks:
        if network is not None:
            network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]


class Clock:
    """Measures the time spent in steps, and how much of it passes in waiting for data.

    Attributes:
        seconds: In steps so far; sample grids and checkpoints do not count.
    """

    def __init__(self) -> None:
        self.seconds = self._waited = 0.0
        self._steps = 0
        self._lap = (0, 0.0, 0.0)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Measure a block that is one step."""
        began = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - began
        self._steps += 1

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Measure a block, inside a step, that waits for data."""
        began = time.perf_counter()
        yield
        self._waited += time.perf_counter() - began

    @property
    def wait_share(self) -> float:
        """The share of the time that was spent waiting; 0 before the first step."""
        return self._waited / self.seconds if self.seconds else 0.0

    def lap(self) -> tuple[float, float]:
        """Tell the steps per second, and the share of waiting, since the last lap."""
        steps, seconds, waited = self._lap
        self._lap = self._steps, self.seconds, self._waited
        took = self.seconds - seconds
        return (self._steps - steps) / took, (self._waited - waited) / took
