"""What is previewed, as it stands: options, driver, plan, pictures, and the run."""

from __future__ import annotations

import hashlib
import tempfile
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.errors import InputError, MotionTransferError
from motion_transfer.media.image import encode_jpeg, encode_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.preview.draw_queue import DrawQueue, StaleError
from motion_transfer.preview.driver_look import DriverLook, open_look
from motion_transfer.preview.frame_plans import FramePlans, plan_frames
from motion_transfer.preview.kept import Kept
from motion_transfer.preview.pictures import Pictures, count_people
from motion_transfer.preview.proxies import Proxies
from motion_transfer.preview.rendering import Rendering
from motion_transfer.preview.words import manifest_text
from motion_transfer.render.events import Event, FramesDone, Notice, Stage
from motion_transfer.render.option import list_options
from motion_transfer.render.options import RenderOptions, parse_word
from motion_transfer.render.source import Source

KEPT_BYTES = 128 * 2**20
CHANGEABLE = ("renderer", "background", "person", "driver_person", "window", "frames", "frame_rate")
FRAME_VIEWS = ("result", "iuv", "features", "pictures")
STILL_VIEWS = ("source", "texture", "map")
SHARP_VIEWS = ("iuv", "texture", "map", "features")
"""Edges in them mean something: they are sent without loss."""


class Session:
    """A preview; its methods may be called from several threads.

    What takes long happens in threads of its own: one opens the driver and looks through it, one
    draws. `revision` rises with every change that the page should hear of.
    """

    def __init__(self, options: RenderOptions, job_file: Path) -> None:
        self.options = options
        self._weights = options.weights
        self.job_file = job_file
        self.revision = 0
        self.look: DriverLook | None = None
        self.plans: FramePlans | None = None
        self.source: Source | None = None
        self.source_people = 0
        self.rendering = Rendering(self._touch)
        self.pictures = Pictures()
        self._notices: list[str] = []
        self._errors: dict[str, str] = {}
        self._work: dict[str, Any] | None = None
        self._queue, self._kept = DrawQueue(), Kept[bytes](KEPT_BYTES, len)
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._folder = tempfile.TemporaryDirectory(prefix="mt-preview-")
        self._proxies: Proxies | None = None
        self._queue.ask(self._find_source)
        self._opener = threading.Thread(target=self._open, name="look")
        self._opener.start()

    def close(self) -> None:
        """Stop everything, and leave nothing behind but what was saved or rendered."""
        self._closing.set()
        self.rendering.close()
        self._queue.close()
        self._opener.join()
        self._folder.cleanup()

    @property
    def error(self) -> str | None:
        """Why there is nothing to show; None where there is."""
        return "; ".join(self._errors.values()) or None

    def wait_for_plan(self) -> None:
        """Until the driver has been looked through. Raises: InputError if it cannot be used."""
        self._opener.join()
        if error := self.error:
            raise InputError(error)

    # pictures

    @property
    def has_pictures(self) -> bool:
        """Whether the driver's own pictures can be shown."""
        return self._proxies is not None

    @property
    def key(self) -> str:
        """Changes whenever a picture would."""
        o, plans = self.options, self.plans
        drawn = (o.renderer, o.background, o.person, o.driver_person)
        planned = plans and (plans.shots, plans.exact, plans.chosen)
        return hashlib.sha256(repr((drawn, planned)).encode()).hexdigest()[:12]

    def ask_frame(self, index: int, view: str, key: str, *, draft: bool = False) -> Future[bytes]:
        """A picture of a frame, encoded, in the future; cancel it if it is not wanted any more.

        Raises: StaleError; InputError if there is no such view or frame.
        """
        with self._lock:
            options, look, plans = self.options, self._opened(), self._planned()
            if view not in FRAME_VIEWS:
                raise InputError(f"view {view!r}; supported are {', '.join(FRAME_VIEWS)}")
            if not 0 <= index < look.frame_count:
                raise InputError(f"frame {index}; the driver has {look.frame_count}, from 0")
            if key != self.key:
                raise StaleError
        if draft:
            options = draft_of(options)
        draft = options.renderer == "texture"
        calls: dict[str, Callable[[], np.ndarray]] = {
            "result": lambda: self.pictures.result(options, look, plans, index),
            "iuv": lambda: self.pictures.iuv(look, index),
            "features": lambda: self.pictures.feature_image(options, look, plans, index),
            "pictures": lambda: self._proxy(index),
        }
        return self._ask((key, view, index, draft), calls[view], view, index, draft)

    def ask_still(self, view: str) -> Future[bytes]:
        """A picture of the source, as `ask_frame`."""
        options = self.options
        if view not in STILL_VIEWS:
            raise InputError(f"view {view!r}; supported are {', '.join(STILL_VIEWS)}")
        calls: dict[str, Callable[[], np.ndarray]] = {
            "source": lambda: self.pictures.source(options).photo.on_white(),
            "texture": lambda: self.pictures.texture(options),
            "map": lambda: self.pictures.feature_map(options),
        }
        return self._ask((options.renderer, options.person, view), calls[view], view)

    def _ask(
        self,
        name: tuple,
        call: Callable[[], UInt8[np.ndarray, "H W 3"]],
        view: str,
        index: int = -1,
        draft: bool = False,
    ) -> Future[bytes]:
        encode = encode_png if view in SHARP_VIEWS else encode_jpeg

        def draw() -> bytes:
            data = self._kept.get(name)  # somebody else may have asked meanwhile
            if data is None:
                data = encode(call())
                self._kept.put(name, data)
            return data

        kept = self._kept.get(name)
        if kept is not None:
            future: Future[bytes] = Future()
            future.set_result(kept)
            return future
        future = self._queue.ask(draw, place=index, draft=draft)
        if index >= 0:
            future.add_done_callback(partial(self._note_broken, index))
        return future

    def _note_broken(self, index: int, _future: Future) -> None:
        if self.look is not None and index in self.look.broken:
            self._touch()

    def _proxy(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        if self.look is None or self.look.pictures is None:
            raise InputError("the driver is IUV; it has no pictures")
        if self._proxies is None:
            raise InputError("the driver's pictures are being read; try again in a moment")
        return self._proxies.read(index)

    # options

    def change(self, words: Mapping[str, Any]) -> None:
        """Set options, as a manifest would write them; all of them or none.

        Raises: InputError for an option that is none, a value that it cannot have, or one that does
            not fit this source and driver.
        """
        unknown = [word for word in words if word not in CHANGEABLE]
        if unknown:
            raise InputError(f"option {unknown[0]!r}; here one can set {', '.join(CHANGEABLE)}")
        entries = {entry.name: entry for entry in list_options(RenderOptions)}
        parsed = {name: parse_word(entries[name], value) for name, value in words.items()}
        if "renderer" in parsed:  # weights go with the network, and come back with it
            parsed["weights"] = None if parsed["renderer"] == "texture" else self._weights
        changed = replace(self.options, **parsed)
        if self.look is not None and self.look.pictures and "driver_person" in words:
            raise InputError(
                "whom to follow in raw pictures is decided when they are read; start again with"
                f" --driver-person {changed.driver_person}"
            )
        source = None
        if "person" in words:
            source = self._queue.ask(lambda: self.pictures.source(draft_of(changed))).result()
        with self._lock:  # the driver may have been looked through meanwhile
            if self.look is not None:
                self.plans = plan_frames(self.look, changed)
            self.options = changed
            self._errors.pop("plan", None)
            if source is not None:
                self.source = source
                self._errors.pop("source", None)
        self._touch()

    # results

    def render(self, *, replace_output: bool) -> None:
        """Begin the real run. Raises: OutputError if its output is in the way."""
        options = replace(self.options, force=self.options.force or replace_output)
        check_destination(options.output, force=options.force)
        if not self.rendering.begin(options):
            raise InputError("a run is under way; stop it, or wait until it is done")

    def save_job(self, *, replace_file: bool) -> str:
        """Write a manifest of the run, and return its text.

        Raises: OutputError if there is one already, or it cannot be written.
        """
        check_destination(self.job_file, force=replace_file)
        text = manifest_text(self.options, self.job_file)
        with work_folder(self.job_file) as folder:
            written = folder / self.job_file.name
            written.write_text(text, encoding="utf-8")
            publish(written, self.job_file)
        return text

    def state(self) -> dict[str, Any]:
        """Everything the page shows, for JSON."""
        from motion_transfer.preview.state import describe

        with self._lock:
            return describe(self, self._work, self._notices)

    # the thread that looks

    def _open(self) -> None:
        try:
            self.look = look = open_look(self.options, Path(self._folder.name), self._hear)
            with suppress(InputError):  # a few frames may show nobody where others do
                self._plan()
            self._hear(Stage("scan", look.frame_count))
            look.look_through(self._closing, self._looked)
            if self._closing.is_set():
                return
            try:
                self._plan()
            except InputError as error:
                self._errors["plan"] = str(error)
            if look.pictures is not None:
                folder = Path(self._folder.name) / "proxies"
                self._proxies = Proxies.make(self.options.driver, folder, self._closing)
        except _ClosingError:
            return
        except Exception as error:  # the page has to say so, whatever it was
            self._errors["driver"] = _in_words(error)
        self._work = None
        self._touch()

    def _plan(self) -> None:
        """Plan from what is known. Raises: InputError."""
        assert self.look is not None
        with self._lock:  # options may be changing
            self.plans = plan_frames(self.look, self.options)
        self._touch()

    def _find_source(self) -> None:
        try:
            self.source = self.pictures.source(draft_of(self.options))
            self.source_people = count_people(self.source, self.options)
        except Exception as error:  # the page has to say so, whatever it was
            self._errors["source"] = _in_words(error)
        self._touch()

    def _looked(self, count: int) -> None:
        with self._lock:
            if self._work is not None:
                self._work = {**self._work, "done": count}
        self._touch()

    def _hear(self, event: Event) -> None:
        if self._closing.is_set():
            raise _ClosingError
        with self._lock:
            match event:
                case Stage():
                    self._work = {"stage": event.name, "done": 0, "total": event.frame_count}
                case FramesDone() if self._work is not None:
                    self._work["done"] += event.frame_count
                case Notice():
                    self._notices.append(event.message)
        self._touch()

    def _opened(self) -> DriverLook:
        if self.look is None:
            raise InputError(self.error or "the driver is being opened")
        return self.look

    def _planned(self) -> FramePlans:
        if self.plans is None:
            raise InputError(self.error or "the driver is being looked at")
        return self.plans

    def _touch(self) -> None:
        with self._lock:
            self.revision += 1


def draft_of(options: RenderOptions) -> RenderOptions:
    """The same without the network: at hand within a second, and the source's texture with it."""
    return replace(options, renderer="texture", weights=None)


class _ClosingError(Exception):
    """The preview ends while the driver is being read."""


def _in_words(error: Exception) -> str:
    known = isinstance(error, MotionTransferError)
    return str(error) if known else f"{type(error).__name__}: {error}"
