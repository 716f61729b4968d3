"""The cores: how many this process may keep busy, and what they can multiply."""

from __future__ import annotations

import os
import platform
import re
import sys
from functools import cache
from pathlib import Path

CPU_FACTS = Path("/proc/cpuinfo")
SUMS_OF_BYTES = re.compile(r"\b(?:avx512_vnni|avx_vnni|amx_int8|asimddp)\b")

_share: int | None = None


def core_count() -> int:
    """Tell how many threads are worth having here: one for each core that may be used."""
    return _share or _allowed_cores()


def _allowed_cores() -> int:
    if hasattr(os, "sched_getaffinity"):  # Linux tells what it allows, others what there is
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def sums_bytes() -> bool:
    """Tell whether the CPU adds products of bytes in 32 bits, exactly.

    Without such an instruction, x86 adds two of them in 16 bits (AVX2's `vpmaddubsw`), which
    overflow: 8 bits are then wrong where numbers are large, and not faster. Measured on an AMD EPYC
    with AVX2 alone: `lite` differs from 32 bits by 43 dB, not 54, and takes as long. Where no
    system tells, it is taken for one without; Apple's own have had one since the first, the M1.
    """
    if CPU_FACTS.exists():
        return bool(SUMS_OF_BYTES.search(CPU_FACTS.read_text(encoding="utf-8")))
    return sys.platform == "darwin" and platform.machine() == "arm64"


def take_share(count: int) -> None:
    """Let this process, which has others beside it, keep so many cores busy."""
    global _share
    _share = count
    os.environ["OMP_NUM_THREADS"] = str(count)  # for torch, where it is imported later
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(count)
    import cv2

    cv2.setNumThreads(count)
