"""Options of a run in parts: each is read where it is needed, and checked when it is made."""

from __future__ import annotations

from motion_transfer.option import check_choices


class Part:
    """Some options; checked when they are made."""

    def __post_init__(self) -> None:
        check_choices(self)
