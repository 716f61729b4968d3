"""Where the time of a run goes."""

from __future__ import annotations

import time


class Clock:
    """Time spent in steps, and how much of it waiting for data; samples and saving do not count."""

    def __init__(self) -> None:
        self.seconds = self._waited = 0.0
        self._lap = (0, 0.0, 0.0)
        self._steps = 0
        self._began = 0.0

    def start(self) -> None:
        self._began = time.perf_counter()

    def stop(self) -> None:
        self.seconds += time.perf_counter() - self._began
        self._steps += 1

    def waiting(self) -> Waiting:
        """A block that waits for data."""
        return Waiting(self)

    def add_wait(self, seconds: float) -> None:
        self._waited += seconds

    @property
    def wait_share(self) -> float:
        return self._waited / self.seconds if self.seconds else 0.0

    def lap(self) -> tuple[int, float, float]:
        """Steps, seconds and share of waiting since the last lap."""
        steps, seconds, waited = self._lap
        self._lap = self._steps, self.seconds, self._waited
        took = self.seconds - seconds
        return self._steps - steps, took, (self._waited - waited) / took


class Waiting:
    """Measures a block for a clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock

    def __enter__(self) -> None:
        self._began = time.perf_counter()

    def __exit__(self, *_error: object) -> None:
        self._clock.add_wait(time.perf_counter() - self._began)
