"""Whether an output is what its record says: untouched, of these inputs, and drawn so again."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from motion_transfer.errors import InputError
from motion_transfer.events import Listener, Stage, ignore
from motion_transfer.media.iuv.formats import names_file
from motion_transfer.media.output.segments import (
    Segments,
    digest_output,
    join_segments,
    read_mark,
)
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.unchanged import Inputs
from motion_transfer.media.work import digest_file
from motion_transfer.render.composition import Composed, compose
from motion_transfer.render.content import picture_facts
from motion_transfer.render.inputs import CAPTURED
from motion_transfer.render.options import NO_AUDIO, RenderOptions, SourceOptions
from motion_transfer.render.options.verified import VerifyOptions
from motion_transfer.render.options.written import read_written
from motion_transfer.render.plan import CHUNK_FRAMES, Chunk
from motion_transfer.render.provenance import (
    FileFacts,
    PictureFacts,
    Record,
    parse_record,
)
from motion_transfer.render.run import open_engine
from motion_transfer.weights import SHIPPED, find_weights

LEAST_PSNR_DB = 30.0
"""Of every frame, where bytes are not the same. Measured (docs/provenance.md): another engine or
precision stays above 43 dB at the default crf.
"""

SAME, CHANGED, NOT_GIVEN = "same", "changed", "not given"


@dataclass(frozen=True)
class Finding:
    """What became of one input.

    Attributes:
        option: Its flag.
        file: Its name in the record.
        state: `same`, `changed` or `not given`.
        detail: What differs, in words.
    """

    option: str
    file: str
    state: str
    detail: str = ""


@dataclass(frozen=True)
class Rendered:
    """A segment that was rendered again, compared with that of the output.

    Attributes:
        same_bytes: None where segments have no bytes of their own, because one encoder went over
            all of them.
        least_psnr_db: Of its frames; infinite where every pixel is the same.
    """

    start: int
    stop: int
    same_bytes: bool | None
    least_psnr_db: float
    mean_psnr_db: float

    @property
    def alike(self) -> bool:
        return bool(self.same_bytes) or self.least_psnr_db >= LEAST_PSNR_DB


@dataclass(frozen=True)
class Verification:
    """What was found.

    Attributes:
        edited: Half-open ranges of frames that are not what was written.
        other_length: Whether there are more or fewer frames than were written.
        here: What is different on this machine, in words.
        rendered: Segments that were rendered again; empty unless all inputs are the same.
        seed: Which chooses these segments again.
    """

    output: Path
    record: Record
    edited: tuple[tuple[int, int], ...]
    other_length: bool
    inputs: tuple[Finding, ...]
    here: tuple[str, ...] = ()
    rendered: tuple[Rendered, ...] = ()
    seed: int | None = None

    @property
    def is_whole(self) -> bool:
        """Whether it shows what was written, and nothing else."""
        return not self.edited and not self.other_length

    @property
    def verified(self) -> bool:
        """Whether nothing speaks against it."""
        return (
            self.is_whole
            and all(finding.state != CHANGED for finding in self.inputs)
            and all(each.alike for each in self.rendered)
        )


def read_record(output: Path) -> Record:
    """Read the record of an output. Raises: InputError if it has none."""
    if not output.exists():
        raise InputError(f"{output} does not exist")
    mark = read_mark(output)
    if mark is None:
        raise InputError(
            f"{output} says nothing of what made it: it is not of this program, or was encoded"
            " again by one that leaves that out"
        )
    if mark.record is None:
        raise InputError(
            f"{output} says that it is synthetic and no more, as --provenance mark has it; there is"
            " nothing to compare it with"
        )
    return parse_record(mark.record, output)


def verify(output: Path, options: VerifyOptions, listener: Listener = ignore) -> Verification:
    """Compare an output with its record, its inputs with theirs, and some segments with themselves.

    Raises: InputError for an output without a record, or inputs that cannot be used.
    """
    record = read_record(output)
    content = digest_output(output, record.counts())
    written = record.segments.sha256_128
    starts = range(0, record.output.frames, record.segments.frames)
    if len(written) == len(starts):
        ranges = [
            (start, start + count) for start, count in zip(starts, record.counts(), strict=True)
        ]
    else:  # one encoder went over all frames
        ranges = [(0, record.output.frames)]
    # more or fewer frames are told apart
    edited = [
        where for where, was, now in zip(ranges, written, content, strict=False) if was != now
    ]
    told = Verification(
        output, record, tuple(edited), len(content) != len(written), tuple(_look(record, options))
    )
    changed = [finding.option for finding in told.inputs if finding.state == CHANGED]
    lacking = any(finding.state == NOT_GIVEN for finding in told.inputs)
    if lacking or not options.segments or changed not in ([], ["--driver"]):
        return told
    return _render(told, content, options, listener)


def _look(record: Record, options: VerifyOptions) -> Iterator[Finding]:
    """Compare each input, as a file, with what the record says of it."""
    words = record.options
    sources = record.sources[0]
    garments = len(words.get("garments", ()))
    yield from _look_at_pictures(
        "--source", sources[: len(sources) - garments], _people(record, options)
    )
    yield from _look_at_pictures(
        "--garment",
        sources[-garments:] if garments else (),
        [person for each in options.garments for person in _people(record, options, each)],
    )
    yield from _look_at_pictures(
        "--partner",
        [picture for pictures in record.sources[1:] for picture in pictures],
        [person for each in options.partners for person in _people(record, options, each)],
    )
    yield _look_at_driver(record, options)
    if record.weights is not None:
        ships = words.get("weights", SHIPPED[0]) in SHIPPED
        given = options.weights or (Path(words.get("weights", SHIPPED[0])) if ships else None)
        yield _look_at_file("--weights", record.weights, given and find_weights(given))
    if record.background is not None:
        yield _look_at_file("--background", record.background, options.background)
    if record.sound is not None and words.get("audio", NO_AUDIO) != NO_AUDIO:
        yield _look_at_file("--audio", record.sound, options.audio)
    if "estimator_model" in words and options.estimator_model is None:
        yield Finding("--estimator-model", words["estimator_model"], NOT_GIVEN)


def _people(
    record: Record, options: VerifyOptions, words: str | None = None
) -> list[tuple[PictureFacts, Path]]:
    """Tell what the given pictures hold, the sources or one that is written `PHOTO[,IUV]`.

    IUV is estimated as it was, as far as the models are given.
    """
    photos, iuv = options.source, options.source_iuv
    if words is not None:
        photo, comma, beside = words.partition(",")
        photos, iuv = (Path(photo),), (Path(beside),) if comma else ()
    if not photos:
        return []
    model = options.estimator_model
    estimator: dict[str, Any] = {}
    if model is not None:
        estimator = {"estimator": "densepose", "estimator_model": model}
    elif "estimator" in record.options and "estimator_model" not in record.options:
        estimator = {"estimator": record.options["estimator"]}
    person = SourceOptions(source=photos, source_iuv=iuv, **estimator)
    return [(PictureFacts(path.name, **facts), path) for path, facts in picture_facts(person)]


def _look_at_pictures(
    option: str, recorded: Sequence[PictureFacts], given: Sequence[tuple[PictureFacts, Path]]
) -> Iterator[Finding]:
    if given and len(given) != len(recorded):
        raise InputError(f"{len(given)} {option} given, and the record tells of {len(recorded)}")
    for number, was in enumerate(recorded):
        if not given:
            yield Finding(option, was.file, NOT_GIVEN)
            continue
        now, path = given[number]
        if now.sha256 != was.sha256:
            yield Finding(option, was.file, CHANGED, f"{path} is another picture")
        elif now.iuv != was.iuv:
            yield Finding(option, was.file, CHANGED, f"the IUV of {path} {_compare_iuv(was, now)}")
        else:
            yield Finding(option, was.file, SAME)


def _compare_iuv(was: PictureFacts, now: PictureFacts) -> str:
    if isinstance(was.iuv, str) and isinstance(now.iuv, str):
        return "is another file"
    if isinstance(was.iuv, str):
        return "was a file, which is not beside it; name it by --source-iuv"
    if isinstance(now.iuv, str):
        return "was estimated, and here is a file"
    return "is estimated by another version or model"


def _look_at_driver(record: Record, options: VerifyOptions) -> Finding:
    was, given = record.driver, options.driver
    is_file = was.content is not None or was.file.partition(",")[0].endswith(CAPTURED)
    if given is None and is_file:
        return Finding("--driver", was.file, NOT_GIVEN)
    if given is None or not names_file(given):
        return Finding("--driver", was.file, SAME)  # a motion: its frames will tell
    if not given.exists():
        raise InputError(f"driver {given} does not exist")
    if Inputs([given]).digest(given) != was.content:
        return Finding("--driver", was.file, CHANGED, f"{given} holds something else")
    return Finding("--driver", was.file, SAME)


def _look_at_file(option: str, was: FileFacts, given: Path | None) -> Finding:
    if given is None:
        return Finding(option, was.file, NOT_GIVEN)
    if digest_file(given, option.removeprefix("--")) != was.sha256:
        return Finding(option, was.file, CHANGED, f"{given} is another file")
    return Finding(option, was.file, SAME)


def _rebuild(record: Record, options: VerifyOptions, folder: Path) -> RenderOptions:
    """Make the options of the run again, with the files that were given."""
    words: dict[str, Any] = dict(record.options)
    words["output"] = str(folder / f"again{record.output.ending}")
    words["source"] = [str(path) for path in options.source]
    words["audio"] = NO_AUDIO  # what is heard has no part in what is drawn
    words.pop("audio_track", None)
    words.pop("source_iuv", None)
    if options.source_iuv:
        words["source_iuv"] = [str(path) for path in options.source_iuv]
    for name, given in (("garments", options.garments), ("partners", options.partners)):
        if name in words:
            words[name] = [_with_files(*each) for each in zip(words[name], given, strict=True)]
    for name in ("driver", "background", "weights", "estimator_model"):
        if (path := getattr(options, name)) is not None:
            words[name] = str(path)
    for name in ("engine", "precision", "device", "workers"):
        words[name] = getattr(options, name)
    return read_written(words)


def _with_files(entry: dict[str, str], given: str) -> dict[str, str]:
    photo, comma, iuv = given.partition(",")
    kept = {word: value for word, value in entry.items() if word not in ("photo", "iuv")}
    return kept | {"photo": photo} | ({"iuv": iuv} if comma else {})


def _render(
    told: Verification, content: Sequence[str], options: VerifyOptions, listener: Listener
) -> Verification:
    """Compose the run again, and render some of its segments, if it is of the same frames."""
    with TemporaryDirectory(prefix="mt-verify-") as name:
        folder = Path(name)
        run = _rebuild(told.record, options, folder)
        composed = compose(run, folder, listener)
        told = _compare_runs(told, composed)
        if any(finding.state == CHANGED for finding in told.inputs):
            return told
        chunks = composed.prepared.plan.chunks
        seed = random.randrange(2**31) if options.seed is None else options.seed
        count = min(options.segments, len(chunks))
        chosen = sorted(random.Random(seed).sample(range(len(chunks)), count))
        work = [(chunks[index], folder / f"{index:06d}") for index in chosen]
        listener(Stage("render", sum(chunk.stop - chunk.start for chunk, _ in work)))
        engine = open_engine(composed, listener=listener)
        engine.render(work, run.worker_count, lambda *_: None)
        cut_alike = told.record.segments.frames == CHUNK_FRAMES and len(content) >= len(chunks)
        own = content if cut_alike else None
        rendered = tuple(
            _compare(told.output, composed, chunk, path, own[chunk.index] if own else None)
            for chunk, path in work
        )
    return replace(told, rendered=rendered, seed=seed)


def _compare_runs(told: Verification, composed: Composed) -> Verification:
    """Compare what the record says of the run with what it would say now."""
    was, now = told.record, composed.prepared.record
    same_frames = (was.driver.iuv, was.output.frames) == (now.driver.iuv, now.output.frames)
    here = [
        f"{name} {now.versions.get(name, 'is not installed')}, not {version}"
        for name, version in was.versions.items()
        if now.versions.get(name) != version
    ]
    here += [f"{now.execution}, not {was.execution}"] * (now.execution != was.execution)
    here += ["another kind of machine"] * (now.machine != was.machine)
    findings = list(told.inputs)
    index = next(i for i, finding in enumerate(findings) if finding.option == "--driver")
    if findings[index].state == CHANGED and same_frames:
        detail = "another file with the same frames"
        findings[index] = replace(findings[index], state=SAME, detail=detail)
    elif findings[index].state == SAME and not same_frames:
        if was.driver.content is None or was.output.frames != now.output.frames:
            findings[index] = replace(findings[index], state=CHANGED, detail="other frames")
        else:
            here.append("the driver's person is found otherwise")
    return replace(told, inputs=tuple(findings), here=tuple(here))


def _compare(
    output: Path, composed: Composed, chunk: Chunk, path: Path, digest: str | None
) -> Rendered:
    """Compare a segment with the output's frames."""
    prepared = composed.prepared
    count = chunk.stop - chunk.start
    segments: Segments = [(path, count)]
    again = path.with_name(f"{path.stem}-again{prepared.record.output.ending}")
    join_segments(segments, again, prepared.output_format, prepared.plan.frame_rate)
    same = None if digest is None else digest_output(again, [count]) == [digest]
    if same:
        return Rendered(chunk.start, chunk.stop, same, math.inf, math.inf)
    levels = list(_levels(output, chunk.start, again, count))
    return Rendered(chunk.start, chunk.stop, same, min(levels), float(np.mean(levels)))


def _levels(output: Path, start: int, again: Path, count: int) -> Iterator[float]:
    """Compute the PSNR, dB, of each frame; nothing is like a frame that is not there."""
    shown = islice(open_pictures(output).play(start), count)
    for rgb in open_pictures(again).read():
        other = next(shown, None)
        frame = other and other()
        if frame is None or frame.shape != rgb.shape:
            yield -math.inf
            continue
        error = np.square(rgb.astype(np.float32) - frame).mean()
        yield 10 * math.log10(255**2 / error) if error else math.inf
