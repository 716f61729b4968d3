"""How far work is whose length is known, how long it may still take, and why it failed."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

from motion_transfer.errors import MotionTransferError

TOLD_AFTER_SECONDS = 1.0
"""Of work: what is measured in less swings too much to be told."""


@dataclass(frozen=True)
class Progress:
    """A stage of work, some frames of which are done.

    Attributes:
        stage: The name of the `Stage` that is under way.
        found: How many of them were finished before, and took no time now.
        began: When it began, s, on the monotonic clock.
    """

    stage: str
    done: int
    total: int
    found: int = 0
    began: float = field(default_factory=time.monotonic)

    def after(self, count: int) -> Progress:
        """So many more frames later; what comes at once was there before."""
        at_once = self.done == 0 and time.monotonic() - self.began < 0.02
        return replace(self, done=self.done + count, found=self.found + count * at_once)

    @property
    def seconds_left(self) -> float | None:
        """How long the rest takes at the pace so far; None where that cannot be told yet."""
        passed, made = time.monotonic() - self.began, self.done - self.found
        if made <= 0 or passed < TOLD_AFTER_SECONDS:
            return None
        return round(passed / made * max(0, self.total - self.done), 1)

    def told(self) -> dict[str, str | int | float | None]:
        """Tell it in words and numbers, for JSON."""
        return {
            "stage": self.stage,
            "done": self.done,
            "total": self.total,
            "seconds_left": self.seconds_left,
        }


def explain(error: Exception) -> str:
    """Put an error into words, its type included if it is none of ours."""
    known = isinstance(error, MotionTransferError)
    return str(error) if known else f"{type(error).__name__}: {error}"
