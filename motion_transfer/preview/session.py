"""A preview as it stands: options, driver, plan, pictures, the run, and all of it as JSON."""

from __future__ import annotations

import hashlib
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.canvas import show_alpha
from motion_transfer.drawing.renderers import DRAFT, RENDERERS
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.window import Window
from motion_transfer.errors import InputError
from motion_transfer.events import Event, FramesDone, Notice, Stage
from motion_transfer.media.pictures.photo import encode_jpeg, encode_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.option import SCENES, list_options, parse_background
from motion_transfer.preview.driver import FramePlans, PreviewedDriver, plan_frames
from motion_transfer.preview.dropped import DroppedFiles
from motion_transfer.preview.export import command_line, manifest_text
from motion_transfer.preview.queue import ByteCache, DrawQueue, StaleError
from motion_transfer.preview.rendering import Rendering, explain
from motion_transfer.preview.scenes import draw_thumb
from motion_transfer.preview.views import (
    Views,
    count_people,
    read_proxy,
    shrink,
    write_proxies,
)
from motion_transfer.render.backdrop import no_pictures, open_background
from motion_transfer.render.composition import cast_files
from motion_transfer.render.driver import open_driver
from motion_transfer.render.inputs import (
    find_source_iuv,
    is_clip,
    iuv_names,
    photo_files,
)
from motion_transfer.render.options import (
    DEFAULT_RATE,
    SIZES,
    RenderOptions,
    SceneOptions,
    is_kept,
    parse_window,
)
from motion_transfer.render.scene import frame_size
from motion_transfer.render.source_pictures import first_picture

CACHED_BYTES = 128 * 2**20  # of encoded pictures: some thousand of a small driver's
SCENE = tuple(entry.name for entry in list_options(SceneOptions) if entry.name != "partners")
SHOWN_AS_IS = ("renderer", *SCENE, "person", "driver_person", "size")
CHANGEABLE = (*SHOWN_AS_IS, "window", "frames", "frame_rate")
SHARP_VIEWS = ("iuv", "texture", "map", "features")
"""Edges in them mean something: they are sent without loss."""

MOST_BROKEN = 1000  # messages that are sent; a driver with more has other problems


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
        self.driver: PreviewedDriver | None = None
        self.plans: FramePlans | None = None
        self.source: Source | None = None
        self.source_people = 0
        self.rendering = Rendering(self._touch)
        self.views = Views(self._hear_source)
        self.dropped = DroppedFiles(job_file)
        self._known = list(options.sources)
        self._numbers = list(range(len(self._known)))
        self._named: set[Path] = set()
        self._backgrounds = [str(path)] if (path := options.background_file) else []
        self._source_work: dict[str, Any] | None = None
        self._inputs = Inputs()
        self._notices: list[str] = []
        self._errors: dict[str, str] = {}
        self._work: dict[str, Any] | None = None
        self._queue, self._encoded = DrawQueue(), ByteCache[bytes](CACHED_BYTES, len)
        self._lock = threading.RLock()
        self._closing = threading.Event()
        self._folder = tempfile.TemporaryDirectory(prefix="mt-preview-")
        self._proxies: Path | None = None
        self._queue.ask(self._find_source)
        self._opener = threading.Thread(target=self._open, name="driver")
        self._opener.start()

    def close(self) -> None:
        """Stop everything, and leave nothing behind but what was saved or rendered."""
        self._closing.set()
        self.rendering.close()
        self._queue.close()
        self._opener.join()
        self._folder.cleanup()
        # the command that the page shows, and that somebody has copied, names the present ones
        self.dropped.clean(self._named | set(_named_files(self.options)))

    @property
    def error(self) -> str | None:
        """Why there is nothing to show; None where there is."""
        return "; ".join(self._errors.values()) or None

    def wait_for_plan(self) -> None:
        """Wait until the driver was looked through. Raises: InputError if it cannot be used."""
        self._opener.join()
        if error := self.error:
            raise InputError(error)

    # pictures

    @property
    def key(self) -> str:
        """A digest of what pictures of frames depend on: it changes whenever one of them would."""
        o, plans = self.options, self.plans
        scene = [getattr(o, name) for name in SCENE]
        drawn = (o.renderer, scene, o.size, o.sources, o.person, o.driver_person)
        planned = plans and (plans.shots, plans.exact, plans.chosen)
        return hashlib.sha256(repr((drawn, planned)).encode()).hexdigest()[:12]

    def ask_frame(self, index: int, view: str, key: str, *, draft: bool = False) -> Future[bytes]:
        """Ask for a picture of a frame, encoded; cancel the future if it is not wanted any more.

        Raises: StaleError; InputError if there is no such view or frame.
        """
        with self._lock:
            options, driver, plans, current = self.options, self.driver, self.plans, self.key
        if driver is None or plans is None:
            doing = "opened" if driver is None else "looked at"
            raise InputError(self.error or f"the driver is being {doing}")
        if draft:
            options = draft_of(options)
        calls: dict[str, Callable[[], np.ndarray]] = {
            "result": lambda: show_alpha(self.views.result(options, driver, plans, index)),
            "iuv": lambda: self.views.iuv(driver, index),
            "features": lambda: self.views.feature_image(options, driver, plans, index),
            "pictures": lambda: self._proxy(index),
        }
        if view not in calls:
            raise InputError(f"view {view!r}; supported are {', '.join(calls)}")
        if not 0 <= index < driver.frame_count:
            raise InputError(f"frame {index}; the driver has {driver.frame_count}, from 0")
        if key != current:
            raise StaleError("something has changed since; ask again with the new key")
        self._check_inputs(driver)
        draft = options.renderer == DRAFT  # asked for as one, or drawn as one anyway
        return self._ask((key, view, index, draft), calls[view], view, index, draft)

    def ask_still(self, view: str) -> Future[bytes]:
        """Ask for a picture of the source, see `ask_frame`."""
        options = self.options
        calls: dict[str, Callable[[], np.ndarray]] = {
            "source": lambda: self.views.source(options).photo.on_white(),
            "texture": lambda: self.views.texture(options),
            "map": lambda: self.views.feature_map(options),
        }
        if view not in calls:
            raise InputError(f"view {view!r}; supported are {', '.join(calls)}")
        name = options.renderer, tuple(options.sources), options.person, view
        return self._ask(name, calls[view], view)

    def ask_source_picture(self, number: int, *, small: bool = False) -> Future[bytes]:
        """Ask for a picture of a known source, small for the list of them; see `ask_frame`.

        The source that leads shows what is taken from it; of others that are clips it is the first
        picture.
        """
        with self._lock:
            if not 0 <= number < len(self._known):
                raise InputError(f"there is no source {number}")
            options, leads = self.options, number == self._numbers[0]
            path, _ = self._known[number]

        def call() -> UInt8[np.ndarray, "H W 3"]:
            if (leads and is_clip(path)) or is_kept(path):
                shown = self.views.source(draft_of(options)).photo.on_white()
            else:
                shown = first_picture(path)
            return shrink(shown) if small else shown

        return self._ask((number, leads, options.person, small), call, "source")

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
            data = self._encoded.get(name)  # somebody else may have asked meanwhile
            if data is None:
                data = encode(call())
                self._encoded.put(name, data)
            return data

        kept = self._encoded.get(name)
        if kept is not None:
            future: Future[bytes] = Future()
            future.set_result(kept)
            return future
        future = self._queue.ask(draw, place=index, draft=draft)
        if index >= 0:
            future.add_done_callback(lambda _: self._note_broken(index))
        return future

    def _note_broken(self, index: int) -> None:
        if self.driver is not None and index in self.driver.broken:
            self._touch()

    def _proxy(self, index: int) -> UInt8[np.ndarray, "H W 3"]:
        if self.driver is None or self.driver.opened.pictures is None:
            raise InputError("the driver is IUV; it has no pictures")
        if self._proxies is None:
            raise InputError("the driver's pictures are being read; try again in a moment")
        return read_proxy(self._proxies, index)

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
        parsed = {name: entries[name].read(value) for name, value in words.items()}
        if "renderer" in parsed:  # weights go with the network, and come back with it
            row = RENDERERS.get(parsed["renderer"])  # an unknown one is refused with the others
            parsed["weights"] = self._weights if row and row.default_weights else None
        if "background" in parsed:
            parsed = {**_that_goes_with(parsed["background"], self.options), **parsed}
        changed = replace(self.options, **parsed)
        if "background" in words:
            self._check_background(changed)
        if self.driver is not None and self.driver.opened.pictures and "driver_person" in words:
            raise InputError(
                "whom to follow in raw pictures is decided when they are read; start again with"
                f" --driver-person {changed.driver_person}"
            )
        source = None
        if "person" in words:
            source = self._queue.ask(lambda: self.views.source(draft_of(changed))).result()
        inputs = Inputs(cast_files(changed)) if "background" in words else None
        with self._lock:  # the driver may have been looked through meanwhile
            if inputs is not None:
                self._inputs = inputs
                self._errors.pop("inputs", None)
            if self.driver is not None:
                self.plans = plan_frames(self.driver, changed)
            self.options = changed
            self._errors.pop("plan", None)
            if source is not None:
                self.source = source
                self._errors.pop("source", None)
        self._touch()

    def _check_background(self, options: RenderOptions) -> None:
        """Raise InputError for a background that cannot be shown; know a new one."""
        pictures = self.driver is None or self.driver.opened.pictures is not None
        if options.background == "driver" and not pictures:
            raise InputError(no_pictures(options.driver))
        if (path := options.background_file) is not None:
            open_background(path)
            self.know_background(path)

    def know_background(self, path: Path) -> str:
        """Take a file as a background that can be chosen; returns how it is called as an option."""
        with self._lock:
            if str(path) not in self._backgrounds:
                self._backgrounds.append(str(path))
        return str(path)

    def ask_background(self, number: int) -> Future[bytes]:
        """Ask for a small picture of a background that can be chosen, see `ask_frame`."""
        backgrounds = self.backgrounds()
        if not 0 <= number < len(backgrounds):
            raise InputError(f"there is no background {number}")
        plain = {"size": "driver", "match_colours": False}  # whatever the background is
        options = replace(self.options, background=backgrounds[number], **plain)
        leads = self._numbers[0]
        return self._ask(
            ("background", options.background, leads, options.person),
            lambda: draw_thumb(options, self.source),
            "background",
        )

    def backgrounds(self) -> list[str]:
        """List the backgrounds that can be chosen; colours can be any."""
        pictures = self.driver is not None and self.driver.opened.pictures is not None
        words = ["white", "black", *(w for w in SCENES if w != "driver" or pictures)]
        return [*words, *self._backgrounds]

    def know_source(self, path: Path) -> int:
        """Take a dropped file as one that can be chosen; returns its number."""
        with self._lock:
            self._known.append((path, None))
            return len(self._known) - 1

    def choose_sources(self, numbers: Sequence[int]) -> None:
        """Take some of the known sources, the one that leads first; IUV among them is no source.

        Raises: InputError for one that does not exist or shows nobody; all stays as it was then.
        """
        with self._lock:
            if not numbers or not all(0 <= number < len(self._known) for number in numbers):
                raise InputError("no such source; choose one at least of those that are there")
            known = {number: self._known[number] for number in numbers}
        if self.options.fit_body:
            raise InputError(
                "the driver was fitted to the body of this source; start again with another"
                " --source, or without --fit-body"
            )
        iuv = {name for path, _ in known.values() for name in iuv_names(path)}
        known = {number: each for number, each in known.items() if each[0] not in iuv}
        paths, named = zip(*known.values(), strict=True)
        if any(named) and not all(named):
            named = tuple(given or find_source_iuv(path) for path, given in known.values())
            if not all(named):
                raise InputError(
                    "the IUV of one source was named, and there is none of another; drop that of"
                    f" {paths[named.index(None)].name} together with it, called STEM_IUV.png, or"
                    " start again without --source-iuv"
                )
        changes: dict[str, Any] = {"source": paths, "source_iuv": named if all(named) else ()}
        if paths[0] != self.options.source[0]:
            changes["person"] = "largest"  # another photo's people are others
        changed = replace(self.options, **changes)
        inputs = Inputs(cast_files(changed))

        def read() -> tuple[Source, int]:
            source = self.views.source(draft_of(changed))
            return source, count_people(source, changed)

        try:
            source, people = self._queue.ask(read).result()
        finally:
            self._source_work = None
            self._touch()
        with self._lock:  # other options may have changed meanwhile
            self.options = replace(self.options, **changes)
            self._inputs, self._numbers = inputs, list(known)
            self.source, self.source_people = source, people
            for cause in ("source", "inputs"):
                self._errors.pop(cause, None)
        self._touch()

    def _check_inputs(self, driver: PreviewedDriver) -> None:
        """Raise InputError if a file is not what it was; from then on the page says so."""
        try:
            self._inputs.glance()
            driver.opened.inputs.glance()
        except InputError as error:
            self._errors["inputs"] = str(error)
            self._touch()
            raise

    # results

    def render(self, *, replace_output: bool) -> None:
        """Begin the real run. Raises: OutputError if its output is in the way."""
        options = replace(self.options, force=self.options.force or replace_output)
        check_destination(options.output, force=options.force)
        self._named.update(_named_files(options))  # a stopped run goes on from them
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
        self._named.update(_named_files(self.options))
        return text

    def state(self) -> dict[str, Any]:
        """Describe everything that the page shows, for JSON."""
        with self._lock:
            options, driver, plans, source = self.options, self.driver, self.plans, self.source
            opened = driver and driver.opened
            broken = dict(driver.broken) if driver else {}  # a copy: others are writing to it
            window, behind = parse_window(options.window), options.background_file
            rate = options.frame_rate or (opened and opened.frame_rate) or DEFAULT_RATE
            # of raw pictures one person is left
            in_driver = driver.most_people if driver and not driver.opened.pictures else 0
            return {
                "revision": self.revision,
                "key": self.key,
                "options": {
                    **{name: getattr(options, name) for name in SHOWN_AS_IS},
                    "frames": [plans.chosen.start, plans.chosen.stop] if plans else [0, 0],
                    "frame_rate": str(rate),
                    "window": asdict(Window(*window)) if window else None,
                },
                "choices": {
                    "renderer": list(RENDERERS),
                    "person": _whom(self.source_people, options.person),
                    "driver_person": _whom(in_driver, options.driver_person),
                    "size": [each for each in SIZES if each != "background" or behind],
                },
                "backgrounds": [
                    {"value": value, "name": Path(value).name} for value in self.backgrounds()
                ],
                "sources": [
                    {"number": number, "name": self._known[number][0].name}
                    for number in self._numbers
                ],
                "dropped_in": str(self.dropped.folder),
                "source_work": self._source_work,
                "source": source
                and {
                    "name": _name_some([path.name for path in options.source]),
                    "width": source.photo.rgb.shape[1],
                    "height": source.photo.rgb.shape[0],
                },
                "driver": opened
                and {
                    "name": opened.path.name,
                    "frame_count": opened.frame_count,
                    "width": opened.reader.width,
                    "height": opened.reader.height,
                    "frame_rate": str(opened.frame_rate or DEFAULT_RATE),
                    "pictures": self._proxies is not None,
                },
                "work": self._work,
                "planned": plans is not None and plans.exact,
                "shots": [
                    {"start": shot.start, "stop": shot.stop, **asdict(shot.window)}
                    for shot in (plans.shots if plans else ())
                ],
                "size": self._output_size(),
                "broken": dict(sorted(broken.items())[:MOST_BROKEN]),
                "missing": plans.missing if plans else [],
                "notices": list(dict.fromkeys([*self._notices, *(source.notes if source else ())])),
                "error": self.error,
                "render": {**asdict(self.rendering.progress), "output": str(options.output)},
                "command": command_line(options),
                "job_file": str(self.job_file),
                "output": str(options.output),
            }

    def _output_size(self) -> dict[str, int] | None:
        if self.driver is None or self.plans is None:
            return None
        crop = 0
        if self.options.size == "crop":
            crop = self.views.working_size(self.options, self.plans.largest_side)
        reader = self.driver.opened.reader
        height, width = frame_size(self.options, reader.height, reader.width, crop)
        return {"width": width, "height": height}

    # the thread that looks through the driver

    def _open(self) -> None:
        try:
            opened = open_driver(self.options, Path(self._folder.name), self._hear)
            self.driver = driver = PreviewedDriver(opened)
            with suppress(InputError):  # a few frames may show nobody where others do
                self._plan()
            self._hear(Stage("scan", driver.frame_count))
            driver.see_all(self._closing, lambda count: self._hear(FramesDone(count)))
            if self._closing.is_set():
                return
            try:
                self._plan()
            except InputError as error:
                self._errors["plan"] = str(error)
            if opened.pictures is not None:
                folder = Path(self._folder.name) / "proxies"
                write_proxies(self.options.driver, folder, self._closing)
                self._proxies = folder
        except _ClosingError:
            return
        except Exception as error:  # the page has to say so, whatever it was
            self._errors["driver"] = explain(error)
        self._work = None
        self._touch()

    def _plan(self) -> None:
        """Plan from what is known. Raises: InputError."""
        assert self.driver is not None
        with self._lock:  # options may be changing
            self.plans = plan_frames(self.driver, self.options)
        self._touch()

    def _find_source(self) -> None:
        try:
            self._inputs = Inputs(cast_files(self.options))
            self.source = self.views.source(draft_of(self.options))
            self.source_people = count_people(self.source, self.options)
        except Exception as error:  # the page has to say so, whatever it was
            self._errors["source"] = explain(error)
        self._source_work = None
        self._touch()

    def _hear_source(self, event: Event) -> None:
        if self._closing.is_set():
            raise _ClosingError
        match event:
            case Stage():
                self._source_work = {"done": 0, "total": event.frame_count}
            case FramesDone() if (work := self._source_work) is not None:
                done = work["done"] + event.frame_count
                self._source_work = {**work, "done": done} if done < work["total"] else None
        self._touch()

    def _hear(self, event: Event) -> None:
        if self._closing.is_set():
            raise _ClosingError  # the only way out of an estimate, which takes minutes
        with self._lock:
            match event:
                case Stage():
                    self._work = {"stage": event.name, "done": 0, "total": event.frame_count}
                case FramesDone() if (work := self._work) is not None:
                    self._work = {**work, "done": work["done"] + event.frame_count}
                case Notice():
                    self._notices.append(event.message)
        self._touch()

    def _touch(self) -> None:
        with self._lock:
            self.revision += 1


def draft_of(options: RenderOptions) -> RenderOptions:
    """Take the draft renderer: at hand within a second, and the source's texture with it."""
    return replace(options, renderer=DRAFT, weights=None)


class _ClosingError(Exception):
    """The preview ends while the driver is being read."""


def _name_some(names: list[str]) -> str:
    """Name one or two, and count more."""
    return ", ".join(names) if len(names) < 3 else f"{names[0]} and {len(names) - 1} more"


def _whom(count: int, current: str) -> list[str]:
    """List whom one can choose: the largest, each of some people, and the present choice."""
    return list(dict.fromkeys(["largest", *map(str, range(count)), current]))


def _that_goes_with(background: str, options: RenderOptions) -> dict[str, Any]:
    """Give up what another background cannot have."""
    given_up: dict[str, Any] = {}
    if options.size == "background" and not isinstance(parse_background(background), Path):
        given_up["size"] = "driver"
    if background == "transparent":
        given_up["match_colours"] = False
    return given_up


def _named_files(options: RenderOptions) -> list[Path]:
    """List what options name of the files that may have been dropped."""
    behind = options.background_file
    return [*photo_files(options), *([behind] if behind else [])]
