"""The packages of the `people` extra, asked for before they are needed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec

from motion_transfer.errors import InputError

PEOPLE_EXTRA = "motion-transfer[people]"


def missing_packages() -> list[str]:
    """What synthetic people need and is not installed."""
    return [name for name in ("anny", "warp") if find_spec(name) is None]


def require_people() -> None:
    """Raises: InputError with the command that installs what synthetic people need."""
    if missing := missing_packages():
        raise InputError(
            f"synthetic people need {' and '.join(missing)}, which is not installed;"
            f" pip install '{PEOPLE_EXTRA}'"
        )


@cache
def start_warp() -> None:
    """Initialise `warp` without its banner, and without its remark that there is no GPU.

    The remark comes from native code, so that only the file descriptor can be kept from it.
    """
    import warp

    warp.config.log_level = warp.LOG_ERROR
    stderr, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        warp.init()
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep OpenCV and torch to one thread: their sums depend on how work is shared among several.

    What is computed here is small; several people are made in parallel by several processes.
    """
    import cv2
    import torch

    before = cv2.getNumThreads(), torch.get_num_threads()
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before[0])
        torch.set_num_threads(before[1])
