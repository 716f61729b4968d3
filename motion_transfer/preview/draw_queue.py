"""Pictures on demand: one thread draws what is looked at, the nearest first."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

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
        """A future of what the call returns or raises."""
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
