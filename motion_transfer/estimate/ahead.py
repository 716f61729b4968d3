"""Items that are made in other threads, a few ahead of whoever takes them, and given in order.

Close the generators (`contextlib.closing`) where they may not be read to their ends: that ends the
threads, and closes what is read if that is a generator.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing
from typing import TypeVar

POLL_SECONDS = 0.05  # waiting without end would not hear Ctrl-C everywhere
END = object()

T = TypeVar("T")


def read_ahead(items: Iterable[T], count: int) -> Generator[T, None, None]:
    """Make the items, in order, in a thread of their own; at most `count` wait.

    Raises: Whatever making an item raises, in its place.
    """
    iterator = iter(items)
    with ThreadPoolExecutor(1) as thread:
        coming = deque(thread.submit(next, iterator, END) for _ in range(count))
        try:
            while (item := _await(coming.popleft())) is not END:
                coming.append(thread.submit(next, iterator, END))
                yield item  # pyright: ignore[reportReturnType]
        finally:
            for future in coming:
                future.cancel()
            if isinstance(items, Generator):
                thread.submit(items.close)


def work_ahead(
    tasks: Iterable[Callable[[], T]], count: int, at_once: int
) -> Generator[T, None, None]:
    """Make tasks, in order, in a thread of their own, and do `at_once` of them at a time in others.

    Args:
        count: How many tasks wait at most to be done, or to have their results taken.
    Raises: Whatever making or doing a task raises, in its place.
    """
    with ThreadPoolExecutor(at_once) as threads:

        def submit() -> Generator[Future[T], None, None]:
            try:
                for task in tasks:
                    yield threads.submit(task)
            finally:
                if isinstance(tasks, Generator):
                    tasks.close()

        with closing(read_ahead(submit(), count)) as coming:
            yield from map(_await, coming)


def _await(future: Future[T]) -> T:
    while not future.done():
        wait([future], POLL_SECONDS)
    return future.result()
