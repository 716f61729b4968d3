"""What was used last, up to a number of bytes."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Kept(Generic[Value]):
    """Values by name; when they become too large, the one used longest ago goes."""

    def __init__(self, most_bytes: int, size: Callable[[Value], int]) -> None:
        """`size` is of a value, in bytes."""
        self._most, self._size = most_bytes, size
        self._held: OrderedDict[Hashable, Value] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()

    def get(self, name: Hashable) -> Value | None:
        """A value, if it is still there."""
        with self._lock:
            if name in self._held:
                self._held.move_to_end(name)
            return self._held.get(name)

    def put(self, name: Hashable, value: Value) -> None:
        """Keep a value, in the place of one of that name."""
        with self._lock:
            old = self._held.pop(name, None)
            self._bytes += self._size(value) - (0 if old is None else self._size(old))
            self._held[name] = value
            while self._bytes > self._most:
                _, dropped = self._held.popitem(last=False)
                self._bytes -= self._size(dropped)
