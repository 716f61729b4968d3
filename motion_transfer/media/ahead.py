"""Work of one thread, done ahead of the thread that wants it."""

from __future__ import annotations

import threading
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from queue import Empty, Full, Queue
from typing import Any, TypeVar

T = TypeVar("T")

POLL_SECONDS = 0.05


@dataclass(frozen=True)
class _End:
    """The last thing in a queue: nothing more comes, or an error does."""

    error: BaseException | None = None


def read_ahead(items: Iterable[T], count: int) -> Generator[T, None, None]:
    """The items, in order, made by a thread of their own; at most `count` wait.

    Close the generator (`contextlib.closing`) where it may not be read to its end: that ends the
    thread, and closes `items` there if that is a generator.

    Raises: whatever making an item raises, in its place.
    """
    queue: Queue[Any] = Queue(count)
    stop = threading.Event()

    def put(item: Any) -> bool:
        while not stop.is_set():
            try:
                queue.put(item, timeout=POLL_SECONDS)
                return True
            except Full:
                continue
        return False

    def fill() -> None:
        error = None
        try:
            for item in items:
                if not put(item):
                    break
        except BaseException as caught:
            error = caught
        finally:
            if isinstance(items, Generator):
                items.close()
        put(_End(error))

    thread = threading.Thread(target=fill, daemon=True)
    thread.start()
    try:
        while True:
            try:
                item = queue.get(timeout=POLL_SECONDS)
            except Empty:  # waiting without end would not hear Ctrl-C everywhere
                continue
            if isinstance(item, _End):
                if item.error is not None:
                    raise item.error
                return
            yield item
    finally:
        stop.set()
        thread.join()
