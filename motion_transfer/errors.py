"""What can go wrong, as types; the command line turns each into one line and an exit code.

    MotionTransferError                 exit code
    ├── InputError                      2   something the user gave cannot be used
    │   ├── IuvFileError                2   a file or frame that is not an IUV image
    │   ├── WeightsError                2   a file that is not a whole checkpoint
    │   └── OutputError                 2   a place or format that cannot be written
    ├── RenderError                     1   work that failed though its input was accepted
    ├── TrainingError                   1   a run whose losses are no numbers any more
    └── FetchError                      1   something to be downloaded that cannot be had

Messages say what was wrong, where, and what to do next.
"""

from __future__ import annotations

from collections.abc import Iterable


class MotionTransferError(Exception):
    """The base of everything that this package raises on purpose.

    Its arguments are its lines: one, but for an error that lists everything wrong with a file.
    """

    exit_code = 1

    @property
    def lines(self) -> tuple[str, ...]:
        """What to tell the user, a line each."""
        return tuple(map(str, self.args))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class InputError(MotionTransferError):
    """An argument, or a file that an argument names, cannot be used."""

    exit_code = 2


class IuvFileError(InputError):
    """A file, or one frame of a driver, is not an IUV image."""


class WeightsError(InputError):
    """A weights file is missing, truncated, or not a checkpoint of this model."""


class OutputError(InputError):
    """The output's place, format or codec cannot be written."""


class RenderError(MotionTransferError):
    """Rendering failed after its input had been accepted."""


class TrainingError(MotionTransferError):
    """Training failed after its input had been accepted."""


class FetchError(MotionTransferError):
    """Something that has to be downloaded cannot be had."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Continue a message about a name that is none by the one that is most like it, if any is."""
    from difflib import get_close_matches

    near = get_close_matches(name[:40], known, 1)  # of a long one, the search takes long
    return f"; did you mean {near[0]}?" if near else ""


def first_line(error: Exception) -> str:
    """Tell a library's reason in one line, or its kind where it gives none."""
    return next((line.strip() for line in str(error).splitlines() if line.strip()), repr(error))
