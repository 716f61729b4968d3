"""Items made ahead by another thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial

import pytest

from motion_transfer.estimate.ahead import read_ahead, work_ahead


def test_items_come_in_order_from_another_thread() -> None:
    names: set[str] = set()

    def items() -> Iterator[int]:
        for number in range(50):
            names.add(threading.current_thread().name)
            yield number

    assert list(read_ahead(items(), 3)) == list(range(50))
    assert threading.current_thread().name not in names


def test_no_more_than_asked_for_are_made() -> None:
    made: list[int] = []

    def items() -> Iterator[int]:
        for number in range(100):
            made.append(number)
            yield number

    with closing(read_ahead(items(), 4)) as ahead:
        next(ahead)
        time.sleep(0.2)
        assert len(made) <= 4 + 2  # one was taken, one waits for room


def test_an_error_comes_in_its_place() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise ValueError("broken")

    ahead = read_ahead(items(), 3)
    assert next(ahead) == 1
    with pytest.raises(ValueError, match="broken"):
        next(ahead)


def test_closing_ends_the_thread_and_what_it_reads() -> None:
    closed = threading.Event()

    def items() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    before = threading.active_count()
    with closing(read_ahead(items(), 2)) as ahead:
        next(ahead)
    assert closed.is_set()
    assert threading.active_count() == before


def test_tasks_are_done_side_by_side_and_come_in_order() -> None:
    together = threading.Barrier(2, timeout=10)

    def task(number: int) -> int:
        together.wait()  # nobody passes alone
        time.sleep(0.02 if number % 2 else 0)
        return number

    tasks = (partial(task, number) for number in range(20))
    assert list(work_ahead(tasks, 4, 2)) == list(range(20))


def test_tasks_wait_where_nobody_takes_what_is_done() -> None:
    done: list[int] = []
    with closing(work_ahead((partial(done.append, number) for number in range(99)), 3, 2)) as ahead:
        next(ahead)
        time.sleep(0.2)
        assert len(done) <= 3 + 2  # one was taken, one waits for room


def test_an_error_of_a_task_comes_in_its_place() -> None:
    def fail() -> int:
        raise ValueError("broken")

    ahead = work_ahead([lambda: 1, fail, lambda: 3], 3, 2)
    assert next(ahead) == 1
    with pytest.raises(ValueError, match="broken"):
        next(ahead)


def test_closing_ends_the_threads_of_tasks_and_what_makes_them() -> None:
    closed = threading.Event()

    def tasks() -> Iterator[partial[int]]:
        try:
            while True:
                yield partial(int)
        finally:
            closed.set()

    before = threading.active_count()
    with closing(work_ahead(tasks(), 2, 2)) as ahead:
        next(ahead)
    assert closed.is_set()
    assert threading.active_count() == before
