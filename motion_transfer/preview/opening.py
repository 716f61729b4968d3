"""A driver on its way to the page, in a thread of its own: opened, looked through, copied small."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.events import Event, FramesDone, Notice, Stage
from motion_transfer.preview.driver import PreviewedDriver
from motion_transfer.preview.progress import Progress, explain
from motion_transfer.preview.views import write_proxies
from motion_transfer.render.driver import open_driver
from motion_transfer.render.options import RenderOptions


class Opening:
    """One driver, from its name to all that can be known of it; it may be given up meanwhile.

    Attributes:
        driver: As soon as its frames can be read; of raw pictures that is when all are estimated.
        proxies: The folder with small copies of its pictures, when they are all there.
        work: What is under way.
        notices: What the user should know of it.
        errors: Why it cannot be used, by what failed.
    """

    def __init__(
        self,
        options: RenderOptions,
        estimates: Path,
        scratch: Path,
        plan: Callable[[Opening], object],
        changed: Callable[[], object],
    ) -> None:
        """Begin.

        Args:
            estimates: Where the IUV of pictures is kept, and taken from if it is there already.
            scratch: Where small copies of pictures go; it does not exist yet.
            plan: Plans from what is known of the driver; raises InputError where it shows nobody.
            changed: Called whenever there is something new.
        """
        self.options = options
        self.driver: PreviewedDriver | None = None
        self.proxies: Path | None = None
        self.work: Progress | None = None
        self.notices: list[str] = []
        self.errors: dict[str, str] = {}
        self._estimates, self._scratch = estimates, scratch
        self._plan, self._changed = plan, changed
        self._given_up = threading.Event()
        self._thread = threading.Thread(target=self._open, name="driver")
        self._thread.start()

    def give_up(self) -> None:
        """Ask it to end, without waiting until it has."""
        self._given_up.set()

    def wait(self) -> None:
        """Wait until everything is known, or it has ended."""
        self._thread.join()

    def _open(self) -> None:
        try:
            opened = open_driver(self.options, self._estimates, self._hear)
            self.driver = driver = PreviewedDriver(opened)
            with suppress(InputError):  # a few frames may show nobody where others do
                self._plan(self)
            self._hear(Stage("scan", driver.frame_count))
            driver.see_all(self._given_up, lambda count: self._hear(FramesDone(count)))
            if self._given_up.is_set():
                return
            try:
                self._plan(self)
            except InputError as error:
                self.errors["plan"] = str(error)
            if opened.pictures is not None:
                write_proxies(self.options.driver, self._scratch, self._given_up)
                self.proxies = self._scratch
        except _GivenUpError:
            return
        except Exception as error:  # the page has to say so, whatever it was
            self.errors["driver"] = explain(error)
        self.work = None
        self._changed()

    def _hear(self, event: Event) -> None:
        if self._given_up.is_set():
            raise _GivenUpError  # the only way out of an estimate, which takes minutes
        match event:
            case Stage():
                self.work = Progress(event.name, 0, event.frame_count)
            case FramesDone() if self.work is not None:
                self.work = self.work.after(event.frame_count)
            case Notice():
                self.notices.append(event.message)
        self._changed()


class _GivenUpError(Exception):
    """Nobody wants this driver any more."""
