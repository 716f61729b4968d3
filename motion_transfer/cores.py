"""How many cores this process may keep busy: all that it sees, or its share of them."""

from __future__ import annotations

import os
import sys

_share: int | None = None


def core_count() -> int:
    """Tell how many threads are worth having here."""
    return _share or len(os.sched_getaffinity(0))


def take_share(count: int) -> None:
    """Let this process, which has others beside it, keep so many cores busy."""
    global _share
    _share = count
    os.environ["OMP_NUM_THREADS"] = str(count)  # for torch, where it is imported later
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(count)
    import cv2

    cv2.setNumThreads(count)
