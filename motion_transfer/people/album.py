"""Folders of photos of synthetic people, with their IUV, alpha and description.

OUT/people.json             the settings, by which the folder is known
OUT/pairs.csv               source,target: pictures of one person, relative to OUT
OUT/000000/person.json      who it is, and each shot
OUT/000000/0.png            a photo; 0_IUV.png its IUV (file RGB = V, U, I), 0_alpha.png
"""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import cv2

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.image import write_png
from motion_transfer.media.publish import explain_disk_errors, publish
from motion_transfer.people.dataset import SPLITS, PeopleStream, Split
from motion_transfer.people.extra import require_people
from motion_transfer.people.figure.framing import Framing
from motion_transfer.people.picture.iuv_noise import IuvNoise
from motion_transfer.version import __version__

SETTINGS_FILE = "people.json"
LONGEST_SIDE = 2048


@dataclass(frozen=True, kw_only=True)
class AlbumOptions:
    """What to photograph.

    Attributes:
        out: folder to write to. One that holds people of the same settings is completed.
        count: how many people.
        views: photos of each.
        size: (width, height) in px.
        noise: share of the photos whose IUV gets DensePose's faults, 0 to 1.
        framing: None: mixed.
        workers: processes; None: one for each core. Never changes what is written.
    """

    out: Path
    count: int
    views: int = 2
    seed: int = 0
    split: Split = "train"
    size: tuple[int, int] = (256, 256)
    noise: float = 0.0
    framing: Framing | None = None
    workers: int | None = None

    def __post_init__(self) -> None:
        for name in ("count", "views"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} is {getattr(self, name)}; it must be at least 1")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"workers is {self.workers}; it must be at least 1")
        if self.split not in SPLITS:
            raise InputError(f"split {self.split!r}; supported are {', '.join(SPLITS)}")
        if not 0 <= self.noise <= 1:
            raise InputError(f"noise is {self.noise}; it is a share of the photos, 0 to 1")
        if self.seed < 0:
            raise InputError(f"seed is {self.seed}; it must be 0 or more")
        if not all(32 <= side <= LONGEST_SIDE for side in self.size):
            raise InputError(
                f"size {self.size[0]}x{self.size[1]}; each side must lie in 32..{LONGEST_SIDE} px"
            )

    @property
    def settings(self) -> dict[str, Any]:
        """What decides a person's bytes."""
        kept = asdict(self)
        for name in ("out", "count", "workers"):
            del kept[name]
        return {"motion-transfer": __version__, **kept, "size": list(self.size)}

    def stream(self) -> PeopleStream:
        """The people."""
        return PeopleStream(
            seed=self.seed,
            split=self.split,
            size=self.size,
            noise=IuvNoise.densepose() if self.noise else None,
            noisy_share=self.noise,
            framing=self.framing,
        )


def write_album(options: AlbumOptions, done: Callable[[int], object] = int) -> int:
    """Photograph people into a folder; people who are there already stay as they are.

    Args:
        done: called with how many more people are finished.
    Returns: how many people were added.
    Raises: OutputError if the folder holds something else or cannot be written. Whatever happens,
        each person's folder is whole or absent.
    """
    require_people()
    with explain_disk_errors(options.out):
        _claim(options)
        missing = [n for n in range(options.count) if not _folder(options.out, n).exists()]
        done(options.count - len(missing))
        workers = min(options.workers or len(os.sched_getaffinity(0)), max(1, len(missing)))
        if workers == 1:
            _start_worker(options, own_process=False)
            for number in missing:
                _photograph(number)
                done(1)
        else:
            _photograph_in_parallel(options, missing, workers, done)
        _write_pairs(options)
    return len(missing)


def _photograph_in_parallel(
    options: AlbumOptions, missing: list[int], workers: int, done: Callable[[int], object]
) -> None:
    context = multiprocessing.get_context("spawn")  # threads of torch do not survive a fork
    with ProcessPoolExecutor(workers, context, _start_worker, (options,)) as pool:
        numbers: Iterator[int] = iter(missing)
        running: set[Future[None]] = set()
        try:
            while True:
                fresh = islice(numbers, 2 * workers - len(running))
                running |= {pool.submit(_photograph, number) for number in fresh}
                if not running:
                    return
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    future.result()
                done(len(finished))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


_worker: tuple[AlbumOptions, PeopleStream] | None = None


def _start_worker(options: AlbumOptions, own_process: bool = True) -> None:
    global _worker
    if own_process:
        import signal

        import torch

        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
        torch.set_num_threads(1)
        cv2.setNumThreads(1)
    _worker = options, options.stream()


def _photograph(number: int) -> None:
    """Write one person's folder."""
    assert _worker is not None
    options, people = _worker
    dressed = people.dress(number)
    final = _folder(options.out, number)
    folder = Path(tempfile.mkdtemp(prefix=f".{final.name}.work-", dir=options.out))
    try:
        shots = []
        for view in range(options.views):
            shot = people.shot(number, view)
            photo = people.take(dressed, shot)
            write_png(folder / f"{view}.png", photo.rgb)
            write_png(folder / f"{view}_IUV.png", photo.iuv[..., ::-1])
            write_png(folder / f"{view}_alpha.png", photo.alpha)
            shots.append({**shot.description(), "camera": asdict(photo.camera)})
        description = {"number": number, "person": dressed.person.description(), "shots": shots}
        (folder / "person.json").write_text(json.dumps(description, indent=1) + "\n")
        folder.chmod(0o755)
        publish(folder, final)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _claim(options: AlbumOptions) -> None:
    """Make the folder ours, or see that it is."""
    out, file = options.out, options.out / SETTINGS_FILE
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out} is a file; choose the name of a folder")
    if not out.exists() or not any(out.iterdir()):
        out.mkdir(parents=True, exist_ok=True)
        temporary = out / f".{SETTINGS_FILE}.tmp"
        temporary.write_text(json.dumps(options.settings, indent=1) + "\n")
        publish(temporary, file)
        return
    if not file.exists():
        raise OutputError(f"{out} holds other things than people; choose another folder")
    try:
        found = json.loads(file.read_text())
    except ValueError as error:
        raise OutputError(f"{file} is damaged ({error}); choose another folder") from error
    other = [name for name, value in options.settings.items() if found.get(name) != value]
    if other:
        told = ", ".join(f"{name} {found.get(name)}" for name in other)
        raise OutputError(
            f"{out} holds people made with {told}; use the same settings to add to them, or"
            " choose another folder"
        )
    for left in out.glob(".*.work-*"):  # of a run that was killed
        shutil.rmtree(left)


def _write_pairs(options: AlbumOptions) -> None:
    """List ordered pairs of different photos of one person, everybody's in the folder."""
    lines = ["source,target"]
    for folder in sorted(path for path in options.out.iterdir() if path.name.isdigit()):
        names = [f"{folder.name}/{view}.png" for view in range(options.views)]
        lines += [f"{a},{b}" for a in names for b in names if a != b]
    temporary = options.out / ".pairs.csv.tmp"
    temporary.write_text("\n".join(lines) + "\n")
    publish(temporary, options.out / "pairs.csv")


def _folder(out: Path, number: int) -> Path:
    return out / f"{number:06d}"
