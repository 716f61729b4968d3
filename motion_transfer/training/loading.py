"""Batches of a run, read by other processes while the networks work."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor
from torch.utils.data import DataLoader

from motion_transfer.errors import InputError
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.samples import RunSampler, TrainingSamples
from motion_transfer.training.speed import choose_workers

ORIGIN = re.compile(r"motion_transfer\.errors\.\w+: ")


def load_batches(
    samples: TrainingSamples,
    config: TrainConfig,
    steps: range,
    *,
    process: int,
    processes: int,
    pin_memory: bool,
) -> Iterator[dict[str, Tensor]]:
    """The batches of some steps, always the same ones.

    Args:
        process, processes: which of how many devices' share.
    Raises: InputError, while iterating, for a file that broke meanwhile.
    """
    sampler = RunSampler(
        batch_size=config.optimiser.batch_size,
        accumulation=config.optimiser.accumulation,
        steps=steps,
        process=process,
        processes=processes,
    )
    workers = choose_workers(config.speed.workers)
    more: dict[str, Any] = {}
    if workers:
        # spawned: neither torch's threads nor signal handlers survive a fork
        more = {"multiprocessing_context": "spawn", "worker_init_fn": _start_worker}
    loader = DataLoader(
        samples,
        batch_sampler=sampler,
        num_workers=workers,
        pin_memory=pin_memory,
        generator=torch.Generator(),  # or it would draw from the random state that is kept
        **more,
    )
    try:
        yield from loader
    except InputError as error:
        # from another process it comes with that one's traceback as its message
        raise InputError(ORIGIN.split(str(error).rstrip())[-1]) from error


def _start_worker(_worker: int) -> None:
    import cv2

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
    cv2.setNumThreads(1)
