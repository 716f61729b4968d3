"""From a manifest to its jobs: defaults laid under, globs and matrices spread, outputs checked."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice, product
from pathlib import Path
from string import Formatter
from typing import Any

from pydantic import BaseModel

from motion_transfer.batch.job import Job
from motion_transfer.batch.manifest import (
    PLACEHOLDERS,
    Manifest,
    ManifestError,
    ManifestText,
    Place,
    plain,
)
from motion_transfer.batch.remote import RemoteInputs
from motion_transfer.errors import InputError, MotionTransferError
from motion_transfer.media.files import check_readable
from motion_transfer.media.iuv.formats import names_file
from motion_transfer.media.remote import find_urls, name_of
from motion_transfer.media.structured import shown
from motion_transfer.option import is_url, list_options, parse_background
from motion_transfer.render.inputs import audio_files, driver_files
from motion_transfer.render.options import NO_AUDIO, RenderOptions
from motion_transfer.weights import find_weights, names_weights_file

OPTIONS = {entry.word: entry for entry in list_options(RenderOptions)}
MAY_BE_FOLDERS = ("source", "driver", "partner", "background")
BELOW_ROOT = ("output", "sheet")
GLOB_MARKS = "*?["
MOST_JOBS = 100_000  # what a gigabyte holds
FORMAT = re.compile(r"0?[0-9]{0,2}d?")  # of a placeholder, such as 04 in {index:04}
ANY_OUTPUT = "OUTPUT"
"""Stands for an output's name in a message that many jobs share."""


@dataclass(frozen=True)
class _Output:
    """A file that a job writes.

    Attributes:
        path: Where it is written.
        real: The same without links: no other job may write there.
        written: The manifest's words for it, its template filled in.
    """

    path: str
    real: str
    written: str


def find_output_root(manifest: Manifest, path: Path) -> Path:
    """Find the folder, absolute, below which the outputs of the manifest at `path` lie."""
    if is_url(manifest.output_root):  # outputs are made here, and sent there
        return path.absolute().with_name(f"{path.stem}.outputs")
    root = path.absolute().parent / manifest.output_root
    return root.resolve() if ".." in root.parts else root


def expand(manifest: Manifest, text: ManifestText, remote: RemoteInputs | None = None) -> list[Job]:
    """Lay out every job, in order.

    Args:
        remote: Notes inputs that are URLs, and says where they will lie.
    Raises: ManifestError for a glob without a match, a template that is none, two jobs with one
        output, an output outside the root, or options that do not go together.
    """
    remote = remote or RemoteInputs(find_output_root(manifest, text.path) / "remote")
    spread = _Spread(manifest, text, remote)
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
        raise ManifestError(f"{text.name}: no jobs; write some under jobs or matrix")
    _check_nesting(places, text)
    return jobs


def _check_nesting(places: dict[str, Place], text: ManifestText) -> None:
    """Raise ManifestError for an output inside another one, which is a folder of frames."""
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
    """Spreads one manifest; what many of its jobs share is found out once."""

    def __init__(self, manifest: Manifest, text: ManifestText, remote: RemoteInputs) -> None:
        self._remote = remote
        self._manifest = manifest
        self._text = text
        self._folder = text.path.absolute().parent
        self._root = find_output_root(manifest, text.path)
        self._real_root = self._root.resolve()
        self._real_folders: dict[str, tuple[str, bool]] = {}
        self._defaults = self._written(manifest.defaults)

    def pairs(self) -> Iterator[tuple[Place, tuple[str, ...], str, Any]]:
        """Yield where it stands, source, driver, and the entry, for each job."""
        for number, entry in enumerate(self._manifest.jobs):
            place: Place = ("jobs", number)
            for source in self._people((*place, "source"), [entry.source]):
                for driver in self._matches((*place, "driver"), [entry.driver], photos=False):
                    yield place, source, driver, entry
        for number, entry in enumerate(self._manifest.matrix):
            place = ("matrix", number)
            sources = self._people((*place, "sources"), entry.sources)
            drivers = self._matches((*place, "drivers"), entry.drivers, photos=False)
            if len(sources) * len(drivers) > MOST_JOBS:
                raise ManifestError(
                    f"{self._text.where(place)}: {len(sources):,} sources with {len(drivers):,}"
                    f" drivers are more than {MOST_JOBS:,} jobs; split them"
                )
            for source, driver in product(sources, drivers):
                yield place, source, driver, entry

    def options(
        self, place: Place, source: tuple[str, ...], driver: str, entry: Any, number: int
    ) -> tuple[RenderOptions, list[_Output]]:
        """Make the options of one job, and list what it writes, the output first."""
        words = {**self._defaults, **self._written(entry), "source": source, "driver": driver}
        names = {"source": _stem(source[0]), "driver": name_driver(driver), "index": number}
        outputs: list[_Output] = []
        for word in BELOW_ROOT:
            if words.get(word) is not None:
                outputs.append(self._output((*place, word), words[word], names))
                words[word] = outputs[-1].path
        try:
            given = {OPTIONS[word].name: self._value(word, value) for word, value in words.items()}
            options = RenderOptions(**given)
            reason = _unwritable(
                options.output.suffix,
                options.codec,
                options.crf,
                options.transparent,
                options.alpha,
                options.pix_fmt,
            )
        except InputError as error:
            raise ManifestError(f"{self._text.where(place)}: {error}") from None
        if reason:
            reason = reason.replace(ANY_OUTPUT, str(options.output.with_suffix("")), 1)
            raise ManifestError(f"{self._text.where(place)}: {reason}")
        return options, outputs

    @staticmethod
    def _written(entry: BaseModel) -> dict[str, Any]:
        """List what was written, and is an option of a run."""
        return {
            word: plain(getattr(entry, word))
            for word in entry.model_fields_set
            if word in OPTIONS and getattr(entry, word) is not None
        }

    def _value(self, word: str, value: Any) -> Any:
        """Read a value; paths are laid in the manifest's folder."""
        if OPTIONS[word].kind in ("garments", "partners"):
            value = [
                {**g, **{k: str(self._laid(k, g[k])) for k in ("photo", "iuv") if g.get(k)}}
                for g in value
            ]
        elif OPTIONS[word].kind == "background":
            if is_url(value) or isinstance(parse_background(value), Path):
                value = str(self._laid(word, value))
        elif OPTIONS[word].kind == "path" and word not in BELOW_ROOT:
            return self._laid(word, value)
        elif OPTIONS[word].kind == "paths":
            several = [value] if isinstance(value, str) else value
            return tuple(self._laid(word, path) for path in several)
        return OPTIONS[word].read(value)

    def _laid(self, word: str, value: str) -> Path:
        if is_url(value):
            return self._remote.place(value)
        named = (word, value) == ("audio", NO_AUDIO) or (
            word == "weights" and not names_weights_file(value)
        )
        fixed = named or Path(value).is_absolute() or not _names_file(value)
        return _path(value if fixed else f"{self._folder}/{value}")

    def _people(self, place: Place, written: Sequence[str | list[str]]) -> list[tuple[str, ...]]:
        """List the photos of each person: each match is one, a list within shows one together."""
        people: list[tuple[str, ...]] = []
        for patterns in written:
            if isinstance(patterns, str):
                people += [(match,) for match in self._matches(place, [patterns], photos=True)]
            else:
                people.append(tuple(self._matches(place, patterns, photos=True)))
        return people

    def _matches(self, place: Place, patterns: Sequence[str], *, photos: bool) -> list[str]:
        found: list[str] = []
        for pattern in patterns:
            if is_url(pattern):  # in which ? begins a query
                found += self._remote_matches(place, pattern, photos=photos)
                continue
            if not any(mark in pattern for mark in GLOB_MARKS) or not _names_file(pattern):
                found.append(pattern)
                continue
            base = Path(pattern).anchor
            start = Path(base) if base else self._folder
            try:
                matched = start.glob(pattern.removeprefix(base))
                matches = sorted(str(p) for p in islice(matched, MOST_JOBS + 1))
            except (ValueError, NotImplementedError, OSError) as error:
                raise ManifestError(
                    f"{self._text.where(place)}: {shown(pattern)} is no glob that can be used:"
                    f" {error}"
                ) from None
            if len(matches) > MOST_JOBS:
                raise ManifestError(
                    f"{self._text.where(place)}: {shown(pattern)} matches more than"
                    f" {MOST_JOBS:,} files"
                )
            if photos:  # the IUV of photos lie beside them
                matches = [m for m in matches if not Path(m).stem.lower().endswith("_iuv")]
            if not matches:
                raise ManifestError(f"{self._text.where(place)}: {shown(pattern)} matches nothing")
            found += matches
        return found

    def _remote_matches(self, place: Place, pattern: str, *, photos: bool) -> list[str]:
        if "*" not in pattern:
            return [pattern]
        try:
            matches = find_urls(pattern)
        except MotionTransferError as error:
            raise ManifestError(f"{self._text.where(place)}: {error}") from error
        if photos:
            matches = [m for m in matches if not Path(name_of(m)).stem.lower().endswith("_iuv")]
        if not matches or len(matches) > MOST_JOBS:
            count = f"more than {MOST_JOBS:,} files" if matches else "nothing"
            raise ManifestError(f"{self._text.where(place)}: {shown(pattern)} matches {count}")
        return matches

    def _output(self, place: Place, template: str, names: dict[str, Any]) -> _Output:
        if not _is_template(template):
            raise ManifestError(
                f"{self._text.where(place)}: {shown(template)} is no template; known are"
                f" {PLACEHOLDERS}"
            )
        if is_url(template):
            raise ManifestError(
                f"{self._text.where(place)}: {shown(template)} is a URL; write where it begins as"
                " output_root, and here what lies below it"
            )
        written = template.format(**names).replace(os.sep, "/")  # Windows takes either
        try:
            return self._find_output(place, written)
        except (OSError, RuntimeError) as error:  # too long a name; links that go in circles
            reason = error.strerror if isinstance(error, OSError) else "its links go in circles"
            raise ManifestError(
                f"{self._text.where(place)}: {shown(written)} cannot be an output: {reason}"
            ) from None

    def _find_output(self, place: Place, written: str) -> _Output:
        """Find where an output lies. Raises: ManifestError, OSError, RuntimeError."""
        # text, not paths, and one look at the disk a folder: ten thousand jobs are read in a second
        path = f"{self._root}/{written.rstrip('/')}"
        folder, _, name = path.rpartition("/")
        if folder not in self._real_folders:
            real = Path(folder).resolve()
            inside = real.is_relative_to(self._real_root) and ".." not in Path(written).parts
            self._real_folders[folder] = real.as_posix(), inside and not Path(written).anchor
        real_folder, inside = self._real_folders[folder]
        if self._manifest.outside_outputs:
            path = str(self._root / written)
            return _Output(path, Path(path).resolve().as_posix(), written)
        if not inside or name in ("", ".", "..") or Path(path).is_symlink():
            raise ManifestError(
                f"{self._text.where(place)}: {shown(written)} leaves the output root {self._root};"
                " write a path below it, or set outside_outputs: true"
            )
        return _Output(path, f"{real_folder}/{name}", written)


def _is_template(text: str) -> bool:
    """Tell whether a text holds no other placeholders than those that are known."""
    try:
        parts = list(Formatter().parse(text))
    except ValueError:
        return False
    return all(
        conversion is None
        and (
            (name == "index" and FORMAT.fullmatch(spec or ""))
            or (name in ("source", "driver") and not spec)
        )
        for _, name, spec, conversion in parts
        if name is not None
    )


def name_driver(driver: str) -> str:
    """Name a driver as part of a file name: `walk` of `walk.mkv` and `people:walk,frames=9`."""
    return _stem(driver if _names_file(driver) else driver.partition(":")[2].partition(",")[0])


def check_inputs(jobs: Sequence[Job], remote: RemoteInputs | None = None) -> Iterator[str]:
    """Say what cannot be read, once for each file; names are looked at, and nothing is opened."""
    known: set[Path] = set()
    for job in jobs:
        options = job.options
        paths = [("source", path) for path in options.source]
        paths += [("driver", path) for path in driver_files(options)]
        if options.weights is not None:
            paths.append(("weights", find_weights(options.weights)))
        if options.estimator_model is not None:
            paths.append(("estimator model", options.estimator_model))
        paths += [("garment", garment.photo) for garment in options.garments]
        paths += [("partner", partner.photo) for partner in options.partners]
        if options.background_file is not None:
            paths.append(("background", options.background_file))
        paths += [("audio", path) for path in audio_files(options)]
        for what, path in paths:
            if path in known:
                continue
            known.add(path)
            try:
                if remote is not None and remote.url_of(path) is not None:
                    remote.check(path, what)
                else:
                    check_readable(path, what, folder=what in MAY_BE_FOLDERS)
            except MotionTransferError as error:
                yield f"job {job.index} ({job.name}): {error}"


# ten thousand jobs share a few paths, and what follows from their names
_path = cache(Path)
_names_file = cache(names_file)


@cache
def _stem(path: str) -> str:
    return Path(name_of(path) if is_url(path) else path).stem


@cache
def _unwritable(
    suffix: str,
    codec: str | None,
    crf: int | None,
    transparent: bool,
    alpha: str,
    pix_fmt: str | None,
) -> str:
    """Say why no `ANY_OUTPUT` of that ending and codec can be written; nothing if it can."""
    from motion_transfer.media.output.formats import choose_format  # loads the libraries of codecs

    try:
        choose_format(
            Path(f"{ANY_OUTPUT}{suffix}"),
            codec=codec,
            crf=crf,
            transparent=transparent,
            alpha=alpha,
            pix_fmt=pix_fmt,
        )
    except InputError as error:
        return str(error)
    return ""
