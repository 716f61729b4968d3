"""OpenVINO's graphs, made ready for this machine, and kept.

To read and compile a graph takes as long as to draw several frames with it, and the result depends
on nothing but the graph, how it is to be run, OpenVINO and the processor. So it is kept by these.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import openvino
import xxhash

from motion_transfer.cores import name_processor
from motion_transfer.errors import OutputError
from motion_transfer.media.files import cache_folder
from motion_transfer.media.publish import work_folder

FOLDER, SUFFIX = "compiled", ".blob"

MOST_BYTES = 1 << 28
"""Of all that is kept; what was used longest ago goes first."""

WORTH_SECONDS = 0.1  # to compile; what takes less is not kept
DIGEST_BYTES = 16


def compile_graph(
    content: bytes,
    read: Callable[[], openvino.Model],
    precision: str,
    at_once: int,
    *,
    threads: int,
    how: object = None,
) -> openvino.CompiledModel:
    """Make a graph ready on this CPU, or find it as it was kept.

    Args:
        content: What the graph is read from.
        read: Reads it, if it was not kept.
        at_once: How many calls may run at the same time; more take turns.
        threads: Of all of them together.
        how: Whatever else decides what `read` gives.
    Raises: what `read` raises.
    """
    settings = {
        "INFERENCE_PRECISION_HINT": precision,
        "NUM_STREAMS": at_once,
        "INFERENCE_NUM_THREADS": threads,
        # or several graphs, or processes, which know nothing of each other, sit on the same core
        "ENABLE_CPU_PINNING": False,
    }
    facts = (openvino.__version__, name_processor(), sorted(settings.items()), how)
    key = xxhash.xxh3_128(content)
    key.update(repr(facts).encode())
    kept = cache_folder() / FOLDER / f"{key.hexdigest()}{SUFFIX}"
    if (found := _find(kept, settings)) is not None:
        return found
    began = time.perf_counter()
    compiled = open_core().compile_model(read(), "CPU", settings)
    if time.perf_counter() - began > WORTH_SECONDS:
        with suppress(OSError, OutputError):  # where nothing can be kept, it is compiled every time
            _keep(compiled, kept)
    return compiled


@cache
def open_core() -> openvino.Core:
    """Open OpenVINO, once for the whole process."""
    return openvino.Core()


def _find(kept: Path, settings: dict[str, object]) -> openvino.CompiledModel | None:
    """Load what was kept; None if it was not, or has changed since."""
    try:
        data = kept.read_bytes()
    except OSError:
        return None
    with suppress(OSError):  # a folder that may only be read
        os.utime(kept)
    blob = data[DIGEST_BYTES:]
    if xxhash.xxh3_128_digest(blob) != data[:DIGEST_BYTES]:
        return None
    try:
        return open_core().import_model(blob, "CPU", settings)
    except RuntimeError:  # whatever OpenVINO dislikes of it: it is made again
        return None


def _keep(compiled: openvino.CompiledModel, kept: Path) -> None:
    """Write it under its name, whole or not at all. Raises: OSError, OutputError."""
    blob = compiled.export_model().getvalue()
    with work_folder(kept) as work:
        whole = work / kept.name
        whole.write_bytes(xxhash.xxh3_128_digest(blob) + blob)
        whole.replace(kept)
    _make_room(kept.parent)


def _make_room(folder: Path) -> None:
    """Remove what was used longest ago, or left half-written, beyond what may be kept."""
    used = sorted(
        ((file.stat(), file) for file in folder.rglob(f"*{SUFFIX}")),
        key=lambda each: -each[0].st_mtime,
    )
    total = 0
    for facts, file in used:
        total += facts.st_size
        if total > MOST_BYTES:
            file.unlink(missing_ok=True)
