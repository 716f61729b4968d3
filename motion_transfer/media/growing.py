"""Folders that grow item by item, made by several processes, and known by their settings.

Such a folder can be completed by a later run, is never mixed with items of other settings, and
what it holds does not depend on how many processes made it.
"""

from __future__ import annotations

import json
import multiprocessing
import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from itertools import islice
from pathlib import Path
from typing import Any

from motion_transfer.cores import core_count
from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.publish import publish
from motion_transfer.media.structured import parse_json, read_text, shown

MakeItem = Callable[[int], object]
"""Makes the item of a number, whole or not at all."""


def claim_folder(settings_file: Path, settings: Mapping[str, Any], items: str) -> None:
    """Make the folder of a settings file ours, or see that it is.

    Args:
        settings: What decides the bytes of an item; plain values for JSON.
        items: What they are, for messages.
    Raises: OutputError where the folder holds something else, or items of other settings.
    """
    folder = settings_file.parent
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is a file; choose the name of a folder")
    if not folder.exists() or not any(folder.iterdir()):
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(settings_file, json.dumps(settings, indent=1) + "\n")
        return
    if not settings_file.exists():
        raise OutputError(f"{folder} holds other things than {items}; choose another folder")
    try:
        found = parse_json(read_text(settings_file, "settings"), str(settings_file))
        if not isinstance(found, dict):
            raise InputError(f"{settings_file}: {shown(found)} is no table of settings")
    except InputError as error:
        raise OutputError(f"{error}; choose another folder") from error
    other = [name for name, value in settings.items() if found.get(name) != value]
    if other:
        told = ", ".join(
            f"{name} {shown(found.get(name))}, not {shown(settings[name])}" for name in other
        )
        raise OutputError(
            f"{folder} holds {items} made with {told}; use the same settings to add to them, or"
            " choose another folder"
        )
    for left in folder.glob(".*.work-*"):  # of a run that was killed
        shutil.rmtree(left)


def make_items(
    numbers: list[int],
    open_maker: Callable[[], MakeItem],
    workers: int | None,
    done: Callable[[int], object],
) -> None:
    """Make the items of these numbers; what is done stays, whatever happens.

    Args:
        open_maker: Called once in each process; it is pickled to get there.
        workers: How many processes; None: one for each core. One means this process.
        done: Called with how many more items are finished.
    """
    workers = min(workers or core_count(), max(1, len(numbers)))
    if workers == 1:
        make = open_maker()
        for number in numbers:
            make(number)
            done(1)
        return
    context = multiprocessing.get_context("spawn")  # threads of torch do not survive a fork
    with ProcessPoolExecutor(workers, context, _start_worker, (open_maker,)) as pool:
        waiting, running = iter(numbers), set[Future[None]]()
        try:
            while True:
                # twice as many as workers: nobody waits, and a stop waits for few
                fresh = islice(waiting, 2 * workers - len(running))
                running |= {pool.submit(_make_item, number) for number in fresh}
                if not running:
                    return
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                done(len(finished))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def write_whole(file: Path, text: str) -> None:
    """Write a text file whole or not at all."""
    temporary = file.with_name(f".{file.name}.tmp")
    temporary.write_text(text, encoding="utf-8")
    publish(temporary, file)


_maker: MakeItem | None = None
"""The maker of a worker process."""


def _start_worker(open_maker: Callable[[], MakeItem]) -> None:
    import signal

    import cv2
    import torch

    global _maker
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    _maker = open_maker()


def _make_item(number: int) -> None:
    assert _maker is not None
    _maker(number)
