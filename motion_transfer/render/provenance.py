"""The record that an output carries: what made it, so that anybody can try whether it did.

It follows from inputs, options, versions and the kind of machine alone: no clock, no host, no user
and no folder is in it, so that two runs of the same inputs write the same bytes.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from motion_transfer.drawing.renderers import RENDERERS
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import names_file
from motion_transfer.media.output.marks import MakeMark, Mark, SourceType
from motion_transfer.media.work import digest_file
from motion_transfer.option import Option
from motion_transfer.render.content import LIBRARIES, Contents, describe_machine
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.options.written import list_written, write_value
from motion_transfer.render.plan import CHUNK_FRAMES, DriverPlan
from motion_transfer.version import __version__, package_version

if TYPE_CHECKING:
    from motion_transfer.drawing.renderers.interface import Recipe
    from motion_transfer.media.output.audio import AudioCut
    from motion_transfer.media.output.formats import OutputFormat
    from motion_transfer.media.unchanged import Inputs

FORMAT = "mt-provenance-1"
NOT_TOLD = {
    *("output", "sheet", "force", "restart", "workers"),  # decide nothing of the output
    *("provenance", "credentials_cert", "credentials_key"),
    *("engine", "precision", "device"),  # `execution` says what became of the wish
}
"""Options that a record leaves out; it has all others that are not as by default."""

MOST_BYTES = 1 << 24  # of a record: hundreds of hours


@dataclass(frozen=True)
class FileFacts:
    """A file: its name without folders, and its SHA-256."""

    file: str
    sha256: str


@dataclass(frozen=True)
class PictureFacts:
    """A photo, folder, clip or kept source. `iuv`: the SHA-256 of its IUV, or what estimated it."""

    file: str
    sha256: str
    iuv: str | dict[str, Any] | None = None


@dataclass(frozen=True)
class DriverFacts:
    """A driver.

    Attributes:
        file: Its name, or the motion.
        content: Of the file or folder, see `Inputs.digest`.
        first, frames: Which of its frames were used.
        iuv: SHA-256 of those frames' digests, XXH3 of their IUV.
    """

    file: str
    content: str | None
    first: int
    frames: int
    iuv: str


@dataclass(frozen=True)
class OutputFacts:
    """What was written; `kind` and `codec` are names in this program's tables."""

    ending: str
    kind: str
    codec: str
    pixel_format: str
    crf: int | None
    width: int
    height: int
    frames: int
    frame_rate: str


@dataclass(frozen=True)
class SegmentFacts:
    """How frames were encoded: so many at once, each time with nothing of the others.

    Attributes:
        sha256_128: The first half of a SHA-256 of what each segment holds, or of all at once, see
            `digest_output`.
    """

    frames: int
    sha256_128: tuple[str, ...] = ()


@dataclass(frozen=True)
class Record:
    """Everything.

    Attributes:
        digital_source_type: The IPTC's term.
        versions: Of this program and of the packages that decide bytes.
        execution: Engine, precision and device of the network.
        machine: What decides how it rounds: instruction sets, or the GPU's name.
        sources: Of each person who is drawn, the pictures, then the garments.
        options: By their words in manifests, those that are not as by default; paths without
            folders.
    """

    format: str
    synthetic: bool
    digital_source_type: str
    versions: dict[str, str]
    renderer: str
    execution: str
    machine: tuple[str, ...]
    sources: tuple[tuple[PictureFacts, ...], ...]
    driver: DriverFacts
    weights: FileFacts | None
    background: FileFacts | None
    sound: FileFacts | None
    options: dict[str, Any]
    output: OutputFacts
    segments: SegmentFacts

    def to_json(self) -> str:
        """Write it: in ASCII, without blanks, always in the same order."""
        return json.dumps(asdict(self), separators=(",", ":"))

    def counts(self) -> list[int]:
        """Count the frames of each segment."""
        starts = range(0, self.output.frames, self.segments.frames)
        return [min(self.segments.frames, self.output.frames - start) for start in starts]


def parse_record(text: str, where: Path) -> Record:
    """Read a record. Raises: InputError for what is none, or is of a later program."""
    from pydantic import TypeAdapter, ValidationError  # which takes long to import

    if len(text) > MOST_BYTES:
        raise InputError(f"{where}: its record is too long to be one of this program")
    try:
        record = TypeAdapter(Record).validate_json(text)
        if record.format == FORMAT and record.output.frames > 0 and record.segments.frames > 0:
            return record
        reason = f"its format is {record.format[:60]!r}, and not {FORMAT}"
    except ValidationError as error:
        first = error.errors()[0]
        reason = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    raise InputError(
        f"{where}: its record cannot be used ({reason}); was it written by another version?"
    )


def source_type_of(options: RenderOptions) -> SourceType:
    """Choose the IPTC's term for what a run makes.

    A person drawn by a network is `trainedAlgorithmicMedia`; with anything of a camera beside or
    behind, a composite. Without a network nothing was trained.
    """
    if RENDERERS[options.renderer].default_weights is None:
        return "compositeSynthetic"
    filmed = options.background in ("photo", "driver") or options.background_file is not None
    if filmed or options.compare:
        return "compositeWithTrainedAlgorithmicMedia"
    return "trainedAlgorithmicMedia"


def describe_run(
    options: RenderOptions,
    contents: Contents,
    *,
    recipe: Recipe,
    output_format: OutputFormat,
    size: tuple[int, int],
    plan: DriverPlan,
    inputs: Inputs,
    audio: AudioCut | None,
) -> Record:
    """Put the record of a run together, all but the digests of its segments.

    Args:
        size: Of the output, (width, height), px.
        inputs: As they were noted before they were read.
    Raises: InputError if the sound is gone.
    """
    mark = Mark(source_type_of(options))
    weights = recipe.facts()
    behind = options.background_file
    has_file = names_file(options.driver)
    return Record(
        format=FORMAT,
        synthetic=True,
        digital_source_type=mark.term,
        versions=_versions(),
        renderer=recipe.name,
        execution=recipe.execution,
        machine=tuple(describe_machine(recipe.device)),
        sources=tuple(
            tuple(PictureFacts(path.name, **facts) for path, facts in pictures)
            for pictures in contents.pictures
        ),
        driver=DriverFacts(
            _driver_name(options.driver),
            inputs.digest(options.driver) if has_file else None,
            plan.first,
            len(plan.frames),
            _digest_frames(plan),
        ),
        weights=FileFacts(weights["file"], weights["sha256"]) if weights else None,
        background=FileFacts(behind.name, contents.background) if behind else None,
        sound=audio and FileFacts(audio.path.name, digest_file(audio.path, "audio")),
        options={
            entry.word: write_value(entry, value, _name_path)
            for entry, value in list_written(options)
            if entry.name not in NOT_TOLD
        },
        output=OutputFacts(
            options.output.suffix.lower(),
            output_format.kind,
            output_format.codec_name,
            output_format.pixel_format,
            output_format.crf,
            *size,
            len(plan.frames),
            str(plan.frame_rate),
        ),
        segments=SegmentFacts(CHUNK_FRAMES),
    )


def mark_with(record: Record, *, full: bool) -> MakeMark:
    """Make what gives an output its mark: with its record, or without."""
    source_type = Mark(record.digital_source_type.rpartition("/")[2])

    def mark(digests: Sequence[str]) -> Mark:
        whole = replace(record, segments=replace(record.segments, sha256_128=tuple(digests)))
        return replace(source_type, record=whole.to_json()) if full else source_type

    return mark


def _versions() -> dict[str, str]:
    found = {name: package_version(name) for name in LIBRARIES}
    return {
        "motion-transfer": __version__,
        **{name: version for name, version in found.items() if version != "unknown"},
    }


def _digest_frames(plan: DriverPlan) -> str:
    digest = hashlib.sha256()
    for frame in plan.frames:
        digest.update(bytes.fromhex(frame.digest))
    return digest.hexdigest()


def _name_path(entry: Option, path: Path) -> str:
    """Leave the folders out, which say whose machine it was."""
    return _driver_name(path) if entry.name == "driver" else path.name


def _driver_name(driver: Path) -> str:
    """Name a driver; a motion may be one that was captured in a file, `people:/home/me/x.bvh`."""
    if names_file(driver):
        return driver.name
    scheme, _, motion = str(driver).partition(":")
    captured, comma, more = motion.partition(",")
    return f"{scheme}:{Path(captured).name}{comma}{more}"
