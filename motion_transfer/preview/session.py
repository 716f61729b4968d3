"""A preview as it stands: who is drawn, whose motion it is, options, plan, what is rendered."""

from __future__ import annotations

import hashlib
import tempfile
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.source import Source
from motion_transfer.errors import InputError
from motion_transfer.events import Event, FramesDone, Stage
from motion_transfer.extras import missing_packages
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.option import part_of
from motion_transfer.people import is_motion
from motion_transfer.preview.changes import SCENE, SEEN, change_options
from motion_transfer.preview.choices import Choices
from motion_transfer.preview.driver import FramePlans, PreviewedDriver, plan_frames
from motion_transfer.preview.dropped import DroppedFiles, clean_name
from motion_transfer.preview.export import manifest_text
from motion_transfer.preview.opening import Opening
from motion_transfer.preview.pictures import NOBODY, Looked, Pictures, draft_of
from motion_transfer.preview.progress import Progress, explain
from motion_transfer.preview.renders import RenderQueue
from motion_transfer.preview.thumbs import draw_background, draw_motion, shrink
from motion_transfer.preview.views import Views, count_people
from motion_transfer.render.backdrop import no_pictures, open_background
from motion_transfer.render.composition import cast_files
from motion_transfer.render.inputs import is_clip
from motion_transfer.render.options import RenderOptions, SourceOptions, is_kept
from motion_transfer.render.source_pictures import first_picture


class Session:
    """A preview; its methods may be called from several threads.

    What takes long happens in threads of its own: one opens the driver and looks through it, one
    draws, one renders. `revision` rises with every change that the page should hear of.
    """

    def __init__(
        self,
        options: RenderOptions,
        folder: Path,
        job_file: Path,
        *,
        is_empty: bool = False,
        names_output: bool = True,
    ) -> None:
        """Begin to look.

        Args:
            folder: Of the user's, for what the page sends and what is made.
            job_file: Where a job is saved.
            is_empty: Whether nobody has chosen a source yet; that of the options then stands in its
                place, and is not shown.
            names_output: Whether the user has said where the output goes. Else it is called after
                source and driver, as long as nobody gives it a name, and replaces nothing.
        """
        self.options = options
        self._weights = options.weights
        self.folder, self.job_file = folder, job_file
        self.revision = 0
        self._counting = threading.Lock()
        self.lock = threading.RLock()
        """Held by whoever reads several things that have to belong together."""
        self.plans: FramePlans | None = None
        self.source: Source | None = None
        self.source_people = 0
        self.source_work: Progress | None = None
        self.views = Views(self._hear_source)
        self.pictures = Pictures(self.views, self._note_broken)
        self.dropped = DroppedFiles(folder / "inputs")
        self.choices = Choices(options, is_empty=is_empty)
        self.numbers = list(range(self.choices.examples.start))
        self.garments = list(range(self.choices.examples.stop, len(self.choices.photos)))
        self.motion = self.choices.know_motion(options.driver)
        self.azimuth = options.azimuth or 0.0
        self._before = 0, 0.0
        self._named = names_output
        self._inputs = Inputs()
        self._errors: dict[str, str] = {}
        self._closing = threading.Event()
        self._scratch = tempfile.TemporaryDirectory(prefix="mt-preview-")
        self._openings: list[Opening] = []
        self.renders = RenderQueue(folder / "renders", self._estimates, self._touch)
        self._name_output()
        if not is_empty:
            self.pictures.queue.ask(self._find_source)
        with self.lock:  # until it has its name here
            self.opening = self._open()

    def close(self) -> None:
        """Stop everything; what was sent, saved or rendered stays."""
        self._closing.set()
        for opening in self._openings:
            opening.give_up()
        self.renders.close()
        self.pictures.queue.close()
        for opening in self._openings:
            opening.wait()
        self._scratch.cleanup()

    @property
    def driver(self) -> PreviewedDriver | None:
        """The driver, when its frames can be read."""
        return self.opening.driver

    @property
    def error(self) -> str | None:
        """Why there is nothing to show; None where there is."""
        return "; ".join({**self._errors, **self.opening.errors}.values()) or None

    @property
    def is_empty(self) -> bool:
        """Whether nobody has chosen a source yet."""
        return not self.numbers

    def wait_for_plan(self) -> None:
        """Wait until the driver was looked through. Raises: InputError if it cannot be used."""
        self.opening.wait()
        if error := self.error:
            raise InputError(error)

    # pictures

    @property
    def key(self) -> str:
        """A digest of what pictures of frames depend on: it changes whenever one of them would."""
        o, plans = self.options, self.plans
        scene = [getattr(o, name) for name in SCENE]
        who = (part_of(o, SourceOptions), o.driver, o.driver_person)
        planned = plans and (plans.shots, plans.exact, plans.chosen)
        drawn = (o.renderer, scene, o.size, who, o.missing, planned)
        return hashlib.sha256(repr(drawn).encode()).hexdigest()[:12]

    def ask_frame(self, index: int, view: str, key: str, *, draft: bool = False) -> Future[bytes]:
        """Ask for a picture of a frame, see `Pictures.frame`."""
        with self.lock:
            driver, plans = self.driver, self.plans
            if driver is None or plans is None:
                doing = "opened" if driver is None else "looked at"
                raise InputError(self.error or f"the driver is being {doing}")
            proxies, is_empty = self.opening.proxies, self.is_empty
            looked = Looked(self.options, driver, plans, self.key, proxies, is_empty)
        self._check_inputs(driver)
        return self.pictures.frame(looked, index, view, key, draft=draft)

    def ask_still(self, view: str) -> Future[bytes]:
        """Ask for a picture of the source, see `Pictures.still`."""
        if self.is_empty:
            raise InputError(NOBODY)
        return self.pictures.still(self.options, view)

    def ask_source_picture(self, number: int, *, small: bool = False) -> Future[bytes]:
        """Ask for a picture of a known source or garment, small for the list of them.

        The source that leads shows what is taken from it; of others that are clips it is the first
        picture.
        """
        with self.lock:
            options, leads = self.options, self.numbers[:1] == [number]
        path = self.choices.photo(number).path

        def call() -> UInt8[np.ndarray, "H W 3"]:
            if (leads and is_clip(path)) or is_kept(path):
                shown = self.views.source(draft_of(options)).photo.on_white()
            else:
                shown = first_picture(path)
            return shrink(shown) if small else shown

        return self.pictures.ask((number, leads, options.person, small), call, "source")

    def ask_background(self, number: int) -> Future[bytes]:
        """Ask for a small picture of a background that can be chosen."""
        backgrounds = self.backgrounds()
        if not 0 <= number < len(backgrounds):
            raise InputError(f"there is no background {number}")
        plain = {"size": "driver", "match_colours": False}  # whatever the background is
        options = replace(self.options, background=backgrounds[number], **plain)
        name = ("background", options.background, options.source, options.driver, options.person)
        return self.pictures.ask(name, lambda: draw_background(options, self.source), "background")

    def ask_motion_picture(self, number: int) -> Future[bytes]:
        """Ask for a small picture of a motion that can be chosen."""
        path = self.choices.motion(number).path
        return self.pictures.ask(("motion", path), lambda: draw_motion(path), "motion")

    def _note_broken(self, driver: PreviewedDriver, index: int) -> None:
        if index in driver.broken:
            self._touch()

    # options

    def change(self, words: Mapping[str, Any]) -> None:
        """Set options, as a manifest would write them; all of them or none.

        Raises: InputError for an option that is none, a value that it cannot have, or one that does
            not fit this source and driver.
        """
        driver = self.driver
        changed = change_options(
            self.options,
            words,
            frame_count=driver and driver.frame_count,
            weights=self._weights,
        )
        if "background" in words:
            self._check_background(changed)
        if driver is not None and driver.opened.pictures and "driver_person" in words:
            raise InputError(
                "whom to follow in raw pictures is decided when they are read; start again with"
                f" --driver-person {changed.driver_person}"
            )
        source = None
        if not words.keys().isdisjoint(SEEN) and not self.is_empty:
            source = self.pictures.queue.ask(lambda: self.views.source(draft_of(changed))).result()
        inputs = Inputs(cast_files(changed)) if "background" in words else None
        with self.lock:  # the driver may have been looked through meanwhile
            if inputs is not None:
                self._inputs = inputs
                self._errors.pop("inputs", None)
            if self.driver is not None:
                self.plans = plan_frames(self.driver, changed)
            reopens = changed.missing != self.options.missing  # which a folder is read by
            self.options = changed
            if reopens:
                self._reopen()
            self._named = self._named or "name" in words
            self.opening.errors.pop("plan", None)
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
            self.choices.know_background(path)

    def backgrounds(self) -> list[str]:
        """List the backgrounds that can be chosen, see `Choices.backgrounds`."""
        pictures = self.driver is not None and self.driver.opened.pictures is not None
        return self.choices.backgrounds(driver=pictures, photo=not self.is_empty)

    def _name_output(self) -> None:
        """Call the output after source and driver, where nobody has named it."""
        if self._named:
            return
        o = self.options
        folder, suffix = self.folder / "videos", o.output.suffix or ".mp4"
        motion = Path(self.choices.motion(self.motion).name).stem
        stem = Path(clean_name(f"{o.source[0].stem}_{motion}{suffix}")).stem
        asked_for = {render.options.output for render in self.renders.all}
        output, number = folder / f"{stem}{suffix}", 1
        while output.exists() or output in asked_for:
            number += 1
            output = folder / f"{stem}-{number}{suffix}"
        self.options = replace(o, output=output)

    # who is drawn

    def choose_sources(self, numbers: Sequence[int]) -> None:
        """Take some of the known sources, the one that leads first; IUV among them is no source.

        Raises: InputError for one that does not exist or shows nobody; all stays as it was then.
        """
        if self.options.fit_body:
            raise InputError(
                "the driver was fitted to the body of this source; start again with another"
                " --source, or without --fit-body"
            )
        known = self.choices.sources(numbers)
        paths = tuple(each.path for each in known.values())
        iuv = tuple(each.iuv for each in known.values() if each.iuv)
        changes: dict[str, Any] = {"source": paths, "source_iuv": iuv}
        if self.is_empty or paths[0] != self.options.source[0]:
            changes["person"] = "largest"  # another photo's people are others
        self._take(changes, list(known), self.garments)

    def choose_garments(self, chosen: Sequence[tuple[int, str]]) -> None:
        """Take parts from other photos: the number of each, and its parts or groups of them.

        Raises: InputError for one that does not exist or does not show them; all stays as it was.
        """
        found = self.choices.garments(chosen)
        garments = tuple(garment for _, garment in found)
        self._take({"garments": garments}, self.numbers, [number for number, _ in found])

    def _take(self, changes: dict[str, Any], numbers: list[int], garments: list[int]) -> None:
        """Draw somebody else, or in other clothes. Raises: InputError; all stays as it was then."""
        changed = replace(self.options, **changes)
        if not numbers:
            raise InputError(NOBODY)
        inputs = Inputs(cast_files(changed))

        def read() -> tuple[Source, int]:
            source = self.views.source(draft_of(changed))
            return source, count_people(source, changed)

        try:
            source, people = self.pictures.queue.ask(read).result()
        finally:
            self.source_work = None
            self._touch()
        with self.lock:  # other options may have changed meanwhile
            self.options = replace(self.options, **changes)
            self._inputs, self.numbers, self.garments = inputs, numbers, garments
            self.source, self.source_people = source, people
            for cause in ("source", "inputs"):
                self._errors.pop(cause, None)
            self._name_output()
        self._touch()

    def _find_source(self) -> None:
        try:
            self._inputs = Inputs(cast_files(self.options))
            self.source = self.views.source(draft_of(self.options))
            self.source_people = count_people(self.source, self.options)
        except Exception as error:  # the page has to say so, whatever it was
            self._errors["source"] = explain(error)
        self.source_work = None
        self._touch()

    def _hear_source(self, event: Event) -> None:
        if self._closing.is_set():
            raise _ClosingError
        match event:
            case Stage():
                self.source_work = Progress(event.name, 0, event.frame_count)
            case FramesDone() if (work := self.source_work) is not None:
                work = work.after(event.frame_count)
                self.source_work = work if work.done < work.total else None
        self._touch()

    # whose motion it is

    def choose_motion(self, numbers: Sequence[int], azimuth: float = 0.0) -> None:
        """Take a known motion, or several frames that were sent together as one.

        What is drawn of the one before is given up; its range, window and rate go with it.

        Args:
            azimuth: From where it is seen, degrees towards the left hand of who moves; 0: as it is.
        Raises: InputError if there is none of these numbers, or it cannot be seen from there.
        """
        with self.lock:
            number = self.choices.join_motions(numbers)
            path, background = self.choices.motion(number).path, self.options.background
            turned = azimuth or None
            if turned and is_motion(path):  # of settings that are given twice, the last one counts
                path, turned = Path(f"{path},azimuth={azimuth:g}"), None
            options = replace(
                self.options,
                driver=path,
                azimuth=turned,
                driver_kind=None,
                iuv_order=None,
                driver_person="largest",
                window="auto",
                frames=(None, None),
                frame_rate=None,
                partners=(),
                background="white" if background == "driver" else background,
            )
            if self.driver is not None and self.error is None:
                self._before = self.motion, self.azimuth
            self.options, self.motion, self.azimuth = options, number, azimuth
            self.plans = None
            self._errors.pop("inputs", None)
            self._name_output()
            self._reopen()
        self._touch()

    def cancel_motion(self) -> None:
        """Give up a driver that is still being estimated, and go back to the one before."""
        number, azimuth = self._before
        self.choose_motion([number], azimuth)

    @property
    def can_turn(self) -> bool:
        """Whether the motion can be seen from elsewhere: IUV is what one camera saw."""
        with self.lock:
            path, driver = self.choices.motion(self.motion).path, self.driver
        if missing_packages("people"):
            return False
        return is_motion(path) or (driver is not None and driver.opened.pictures is not None)

    @property
    def _estimates(self) -> Path:
        return self.folder / "estimates"

    def _open(self) -> Opening:
        scratch = Path(self._scratch.name) / f"proxies-{len(self._openings)}"
        opening = Opening(self.options, self._estimates, scratch, self._plan, self._touch)
        self._openings.append(opening)
        return opening

    def _reopen(self) -> None:
        self.opening.give_up()
        self.opening = self._open()

    def _plan(self, opening: Opening) -> None:
        """Plan from what is known. Raises: InputError."""
        with self.lock:  # options may be changing
            if self.opening is opening and opening.driver is not None:
                self.plans = plan_frames(opening.driver, self.options)
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

    def render(self, *, replace_output: bool) -> int:
        """Queue the real run; returns its number. Raises: OutputError if its output is in the way.

        InputError if there is nobody to draw, or the output is on its way already.
        """
        if self.is_empty:
            raise InputError(NOBODY)
        options = replace(self.options, force=self.options.force or replace_output)
        check_destination(options.output, force=options.force)
        number = self.renders.add(options).number
        with self.lock:
            self._name_output()
        self._touch()
        return number

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

    def _touch(self) -> None:
        # a lock of its own: who calls may hold another, such as the renders', which is asked for
        # while `lock` is held
        with self._counting:
            self.revision += 1


class _ClosingError(Exception):
    """The preview ends while a source is being read."""
