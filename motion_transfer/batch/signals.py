"""Ctrl-C and SIGTERM, kept until there is a good moment for them."""

from __future__ import annotations

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class Signals:
    """Notes signals as they come; whoever works asks for them between two steps.

    Raised in a handler, an exception strikes anywhere, also where a lock has just been taken: it
    would never be given back, and a thread that needs it would wait without end.

    Attributes:
        interrupted: Whether a Ctrl-C was heard.
    """

    def __init__(self) -> None:
        self.interrupted = False
        self._heard: deque[int] = deque()  # a handler may append while another call pops
        self._before: dict[int, Callable[[int, FrameType | None], Any]] = {}

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Note signals while the block runs; in any other thread than the main one, do nothing."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {signal.SIGINT: signal.getsignal(signal.SIGINT)}
        if callable(terminate := signal.getsignal(signal.SIGTERM)):
            before[signal.SIGTERM] = self._before[signal.SIGTERM] = terminate
        for number in before:
            signal.signal(number, self._note)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        self.heed(lambda: True)  # what came when nobody asked any more

    def heed(self, halt: Callable[[], bool]) -> None:
        """Act on what was noted.

        Args:
            halt: Does what a Ctrl-C asks for at first; gives False where that has happened already,
                so that it means to stop now.
        Raises: KeyboardInterrupt, or what SIGTERM's own handler raises.
        """
        while self._heard:
            number = self._heard.popleft()
            if number != signal.SIGINT:
                self._before[number](number, None)
            elif not halt():
                raise KeyboardInterrupt

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self.interrupted |= number == signal.SIGINT
        self._heard.append(number)
