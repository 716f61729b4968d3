"""The cores: how many this process may keep busy, and what they can multiply."""

from __future__ import annotations

import os
import platform
import re
import sys
from functools import cache
from pathlib import Path

CPU_FACTS = Path("/proc/cpuinfo")
VECTOR_UNITS = re.compile(r"\b(?:avx|amx|asimd|sve)\w*")
PRODUCTS_OF_BYTES = re.compile(r"\b(?:avx2|asimddp)\b")

_share: int | None = None


def core_count() -> int:
    """Tell how many threads are worth having here: one for each core that may be used."""
    return _share or _allowed_cores()


def _allowed_cores() -> int:
    if hasattr(os, "sched_getaffinity"):  # Linux tells what it allows, others what there is
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def multiplies_bytes() -> bool:
    """Tell whether the CPU multiplies bytes faster than floats: x86 with AVX2, ARM's dot products.

    Where no system tells, x86 is taken for one that does, and of ARM Apple's, since the first, M1.
    """
    if CPU_FACTS.exists():
        return bool(PRODUCTS_OF_BYTES.search(CPU_FACTS.read_text(encoding="utf-8")))
    machine = platform.machine().lower()
    return machine in ("x86_64", "amd64") or (sys.platform == "darwin" and machine == "arm64")


@cache
def name_processor() -> tuple[str, ...]:
    """Tell the processor's kind, and what it multiplies with: another one may round otherwise."""
    flags = CPU_FACTS.read_text(encoding="utf-8") if CPU_FACTS.exists() else platform.processor()
    return platform.machine(), *sorted(set(VECTOR_UNITS.findall(flags)))


def take_share(count: int) -> None:
    """Let this process, which has others beside it, keep so many cores busy."""
    global _share
    _share = count
    os.environ["OMP_NUM_THREADS"] = str(count)  # for torch, where it is imported later
    if torch := sys.modules.get("torch"):
        torch.set_num_threads(count)
    import cv2

    cv2.setNumThreads(count)
