"""Pictures on demand: one thread draws what is asked for, the nearest first; some are kept."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Value = TypeVar("Value")

FIRST = -1
"""The place of what everything else waits for."""


class StaleError(Exception):
    """A picture was asked for as it would have been before something changed."""


@dataclass(frozen=True)
class _Task:
    future: Future
    place: int
    draft: bool
    call: Callable[[], Any]


class DrawQueue:
    """Calls that wait their turn in one thread.

    A call is dropped when its future is cancelled before its turn. What is asked for at a place
    moves the focus there: drafts come first, then whatever lies nearest to the focus.
    """

    def __init__(self) -> None:
        self._waiting: list[_Task] = []
        self._focus = 0
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="draw", daemon=True)
        self._thread.start()

    def ask(self, call: Callable[[], Any], *, place: int = FIRST, draft: bool = False) -> Future:
        """Queue a call; give the future of what it returns or raises.

        Args:
            place: The frame that it draws.
            draft: Whether it is quick, and to be drawn before others.
        """
        future: Future = Future()
        with self._changed:
            if self._closed:
                future.cancel()
                return future
            if place != FIRST:
                self._focus = place
            self._waiting.append(_Task(future, place, draft, call))
            self._changed.notify()
        return future

    def close(self) -> None:
        """Drop what waits; the call under way is finished."""
        with self._changed:
            self._closed = True
            for task in self._waiting:
                task.future.cancel()
            self._waiting.clear()
            self._changed.notify()
        self._thread.join()

    def _work(self) -> None:
        while (task := self._next()) is not None:
            if not task.future.set_running_or_notify_cancel():
                continue
            try:
                result = task.call()
            except BaseException as error:  # whoever asked hears of it, in its own thread
                task.future.set_exception(error)
            else:
                task.future.set_result(result)

    def _next(self) -> _Task | None:
        with self._changed:
            while not self._waiting and not self._closed:
                self._changed.wait()
            if self._closed:
                return None
            task = min(self._waiting, key=self._urgency)
            self._waiting.remove(task)
            return task

    def _urgency(self, task: _Task) -> tuple[bool, bool, int]:
        return task.place != FIRST, not task.draft, abs(task.place - self._focus)


class ByteCache(Generic[Value]):
    """Values by name, up to a number of bytes; then those go that were used longest ago."""

    def __init__(self, most_bytes: int, size: Callable[[Value], int]) -> None:
        """Make an empty cache; `size` tells how many bytes a value has."""
        self._most, self._size = most_bytes, size
        self._values: OrderedDict[Hashable, Value] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, name: Hashable) -> Value | None:
        """Give a value, if it is still there."""
        with self._lock:
            if name in self._values:
                self._values.move_to_end(name)
            return self._values.get(name)

    def put(self, name: Hashable, value: Value) -> None:
        """Keep a value, in the place of one of that name; a too large one is not kept."""
        with self._lock:
            old = self._values.pop(name, None)
            self._bytes += self._size(value) - (0 if old is None else self._size(old))
            self._values[name] = value
            while self._bytes > self._most:
                _, dropped = self._values.popitem(last=False)
                self._bytes -= self._size(dropped)
