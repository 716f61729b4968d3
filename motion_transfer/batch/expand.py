"""From a manifest to its jobs: defaults laid under, globs and matrices spread, outputs checked."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from motion_transfer.batch.manifest import PLACEHOLDERS, Manifest, plain
from motion_transfer.batch.manifest_file import ManifestError, ManifestText, Place
from motion_transfer.errors import InputError
from motion_transfer.people.motion_name import is_motion
from motion_transfer.render.option import list_options
from motion_transfer.render.options import NO_AUDIO, RenderOptions, parse_word
from motion_transfer.weights.shipped import SHIPPED, find_weights

OPTIONS = {entry.word: entry for entry in list_options(RenderOptions)}
BELOW_ROOT = ("output", "sheet")
GLOB_MARKS = "*?["
ANY_OUTPUT = "OUTPUT"


@dataclass(frozen=True)
class Job:
    """One run of a manifest.

    Attributes:
        index: from 0, in the manifest's order.
        name: for the report.
        options: with absolute paths.
    """

    index: int
    name: str
    priority: int
    options: RenderOptions


@dataclass(frozen=True)
class _Output:
    """A file that a job writes: its path, what no other job may write, and its manifest's word."""

    path: str
    real: str
    written: str


def find_output_root(manifest: Manifest, path: Path) -> Path:
    """The folder below which the outputs of the manifest at `path` lie; absolute."""
    root = path.absolute().parent / manifest.output_root
    return root.resolve() if ".." in root.parts else root


def expand(manifest: Manifest, text: ManifestText) -> list[Job]:
    """Every job, in order.

    Raises: ManifestError for a glob without a match, a template that is none, two jobs with one
        output, an output outside the root, or options that do not go together.
    """
    spread = _Spread(manifest, text)
    jobs: list[Job] = []
    places: dict[str, Place] = {}
    for place, source, driver, entry in spread.pairs():
        options, outputs = spread.options(place, source, driver, entry, len(jobs) + 1)
        for output in outputs:
            if output.real in places:
                raise ManifestError(
                    f"{text.where((*place, 'output'))}: {output.path} is also the output of"
                    f" {text.where(places[output.real])}; use a template such as"
                    " {source}_{driver}.mp4"
                )
            places[output.real] = place
        name = getattr(entry, "name", None) or outputs[0].written
        jobs.append(Job(len(jobs), name, entry.priority, options))
    if not jobs:
        raise ManifestError(f"{text.path}: no jobs; write some under jobs or matrix")
    _check_nesting(places, text)
    return jobs


def _check_nesting(places: dict[str, Place], text: ManifestText) -> None:
    """Raises: ManifestError for an output inside another one, which is a folder of frames."""
    folders = {output.rpartition("/")[0]: place for output, place in places.items()}
    for folder, place in folders.items():
        parts = folder.split("/")
        above = ("/".join(parts[:count]) for count in range(2, len(parts) + 1))
        outer = next((path for path in above if path in places), None)
        if outer is not None:
            raise ManifestError(
                f"{text.where((*place, 'output'))}: lies in {outer}, the output of"
                f" {text.where(places[outer])}; choose another folder"
            )


class _Spread:
    def __init__(self, manifest: Manifest, text: ManifestText) -> None:
        self._manifest = manifest
        self._text = text
        self._folder = text.path.absolute().parent
        self._root = find_output_root(manifest, text.path)
        self._real_root = self._root.resolve()
        self._real_folders: dict[str, tuple[str, bool]] = {}
        self._defaults = self._written(manifest.defaults)

    def pairs(self) -> Iterator[tuple[Place, str, str, Any]]:
        """Where it stands, source, driver, and the entry, for each job."""
        for number, entry in enumerate(self._manifest.jobs):
            place: Place = ("jobs", number)
            for source in self._matches((*place, "source"), [entry.source], photos=True):
                for driver in self._matches((*place, "driver"), [entry.driver], photos=False):
                    yield place, source, driver, entry
        for number, entry in enumerate(self._manifest.matrix):
            place = ("matrix", number)
            drivers = self._matches((*place, "drivers"), entry.drivers, photos=False)
            for source in self._matches((*place, "sources"), entry.sources, photos=True):
                for driver in drivers:
                    yield place, source, driver, entry

    def options(
        self, place: Place, source: str, driver: str, entry: Any, number: int
    ) -> tuple[RenderOptions, list[_Output]]:
        """The options of one job, and what it writes, the output first."""
        words = {**self._defaults, **self._written(entry), "source": source, "driver": driver}
        names = {"source": _stem(source), "driver": _driver_name(driver), "index": number}
        outputs: list[_Output] = []
        for word in BELOW_ROOT:
            if words.get(word) is not None:
                outputs.append(self._output((*place, word), words[word], names))
                words[word] = outputs[-1].path
        try:
            options = RenderOptions(
                **{
                    OPTIONS[word].name: _parsed(word, self._located(word, value))
                    for word, value in words.items()
                    if word in OPTIONS
                }
            )
            reason = _unwritable(options.output.suffix, options.codec, options.crf)
        except InputError as error:
            raise ManifestError(f"{self._text.where(place)}: {error}") from None
        if reason:
            reason = reason.replace(ANY_OUTPUT, str(options.output.with_suffix("")), 1)
            raise ManifestError(f"{self._text.where(place)}: {reason}")
        return options, outputs

    @staticmethod
    def _written(entry: BaseModel) -> dict[str, Any]:
        """What was written, and is an option of a run."""
        return {
            word: plain(getattr(entry, word))
            for word in entry.model_fields_set
            if word in OPTIONS and getattr(entry, word) is not None
        }

    def _located(self, word: str, value: Any) -> Any:
        """Paths, from the manifest's folder."""
        if word == "garments":
            return [
                {**g, **{k: str(self._folder / g[k]) for k in ("photo", "iuv") if g.get(k)}}
                for g in value
            ]
        fixed = word in BELOW_ROOT or (word, value) == ("audio", NO_AUDIO)
        fixed = fixed or (word == "weights" and value in SHIPPED)
        if OPTIONS[word].kind != "path" or fixed or is_motion(value):
            return value
        return value if value.startswith("/") else f"{self._folder}/{value}"

    def _matches(self, place: Place, patterns: Sequence[str], *, photos: bool) -> list[str]:
        found: list[str] = []
        for pattern in patterns:
            if is_motion(pattern) or not any(mark in pattern for mark in GLOB_MARKS):
                found.append(pattern)
                continue
            base = Path(pattern).anchor
            start = Path(base) if base else self._folder
            matches = sorted(str(p) for p in start.glob(pattern.removeprefix(base)))
            if photos:
                matches = [m for m in matches if not Path(m).stem.lower().endswith("_iuv")]
            if not matches:
                raise ManifestError(f"{self._text.where(place)}: {pattern!r} matches nothing")
            found += matches
        return found

    def _output(self, place: Place, template: str, names: dict[str, Any]) -> _Output:
        try:
            written = template.format(**names)
        except (KeyError, IndexError, ValueError, AttributeError):
            raise ManifestError(
                f"{self._text.where(place)}: {template!r} is no template; known are {PLACEHOLDERS}"
            ) from None
        path = f"{self._root}/{written.rstrip('/')}"
        folder, _, name = path.rpartition("/")
        if folder not in self._real_folders:
            real = Path(folder).resolve()
            inside = real.is_relative_to(self._real_root) and ".." not in Path(written).parts
            self._real_folders[folder] = str(real), inside and not written.startswith("/")
        real_folder, inside = self._real_folders[folder]
        if self._manifest.outside_outputs:
            path = str(self._root / written)
            return _Output(path, str(Path(path).resolve()), written)
        if not inside or name in ("", ".", "..") or Path(path).is_symlink():
            raise ManifestError(
                f"{self._text.where(place)}: {written!r} leaves the output root {self._root}; write"
                " a path below it, or set outside_outputs: true"
            )
        return _Output(path, f"{real_folder}/{name}", written)


def _parsed(word: str, value: Any) -> Any:
    """A value as options hold it; paths that many jobs share are one object."""
    if OPTIONS[word].kind == "path" and word not in BELOW_ROOT:
        return _path(value)
    return parse_word(OPTIONS[word], value)


@cache
def _path(value: str) -> Path:
    return Path(value)


@cache
def _unwritable(suffix: str, codec: str | None, crf: int | None) -> str:
    """Why no `ANY_OUTPUT` of that ending and codec can be written; empty if it can."""
    from motion_transfer.media.formats import choose_format  # loads the libraries of codecs

    try:
        choose_format(Path(f"{ANY_OUTPUT}{suffix}"), codec=codec, crf=crf)
    except InputError as error:
        return str(error)
    return ""


@cache
def _stem(path: str) -> str:
    return Path(path).stem


@cache
def _driver_name(driver: str) -> str:
    """A file name's worth of a driver: `walk` of `walk.mkv`, `walk/` and `people:walk,frames=9`."""
    if is_motion(driver):
        return Path(driver.partition(":")[2].partition(",")[0]).stem
    return Path(driver).stem


def check_inputs(jobs: Sequence[Job]) -> Iterator[str]:
    """What is missing, in words, once for each file; looks at names, opens nothing."""
    known: dict[Path, bool] = {}
    for job in jobs:
        options = job.options
        paths = [("source", options.source), ("driver", options.driver)]
        if options.weights is not None:
            paths.append(("weights", find_weights(options.weights)))
        if options.estimator_model is not None:
            paths.append(("estimator model", options.estimator_model))
        paths += [("garment", garment.photo) for garment in options.garments]
        if options.audio is not None and str(options.audio) != NO_AUDIO:
            paths.append(("audio", options.audio))
        for what, path in paths:
            if path not in known and not is_motion(path):
                known[path] = path.exists()
                if not known[path]:
                    yield f"job {job.index} ({job.name}): {what} {path} does not exist"
