"""What the IUV network learns from: synthetic people, as they are and as BlazePose sees them.

DATA/samples.json           the settings, by which the folder is known
DATA/000123_2.npz           person 123, photo 2: the arrays of a `Sample`
"""

from __future__ import annotations

import json
import multiprocessing
import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose_tracker import BodyTracker
from motion_transfer.estimate.body_landmarks import exact_landmarks
from motion_transfer.estimate.interface import LANDMARK_COUNT, Box, Landmarks
from motion_transfer.media.publish import explain_disk_errors, publish
from motion_transfer.people.dataset import PeopleStream, Split
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.version import __version__

SETTINGS_FILE = "samples.json"
WORST_ANSWER = 0.08
"""A body is BlazePose's answer to the photo if its seen landmarks are closer to the true ones than
this share of the body's height, in the median; otherwise it saw something else."""


@dataclass(frozen=True, kw_only=True)
class SampleOptions:
    """What to make.

    Attributes:
        out: folder to write to; samples that are there stay.
        people: how many; each is photographed `views` times.
        size_px: of the square photos.
        workers: processes; None: one for each core.
    """

    out: Path
    people: int
    views: int = 4
    seed: int = 0
    split: Split = "train"
    size_px: int = 256
    workers: int | None = None

    @property
    def settings(self) -> dict:
        """What decides a sample's bytes."""
        kept = asdict(self)
        for name in ("out", "people", "views", "workers"):
            del kept[name]
        return {"motion-transfer": __version__, **kept}


@dataclass(frozen=True)
class Sample:
    """One photo of one person.

    Attributes:
        iuv: exact (I, U, V) of the bare body.
        alpha: exact, of the dressed person with hair.
        mask: BlazePose's, 0 where it saw nobody.
        exact: the true landmarks.
        seen: BlazePose's; None where it saw nobody or somebody else.
    """

    iuv: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"]
    mask: UInt8[np.ndarray, "H W"]
    exact: Landmarks
    seen: Landmarks | None


def make_samples(options: SampleOptions, done: Callable[[int], object] = int) -> int:
    """Photograph people and look at them with BlazePose; a stopped run goes on where it was.

    Args:
        done: called with how many more people are finished.
    Returns: how many people were added.
    Raises: InputError where an extra or the models are missing, or the folder holds something
        else; OutputError where it cannot be written.
    """
    with explain_disk_errors(options.out):
        _claim(options)
        missing = [number for number in range(options.people) if not _is_done(options, number)]
        done(options.people - len(missing))
        workers = min(options.workers or len(os.sched_getaffinity(0)), max(1, len(missing)))
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, context, _start_worker, (options,)) as pool:
            try:
                for future in as_completed([pool.submit(_make, number) for number in missing]):
                    future.result()
                    done(1)
            except BaseException:
                pool.shutdown(wait=True, cancel_futures=True)
                raise
    return len(missing)


def list_samples(folder: Path) -> list[Path]:
    """The samples in a folder, in order. Raises: InputError if there are none."""
    files = sorted(folder.glob("*_*.npz"))
    if not files:
        raise InputError(f"{folder} holds no samples; make some, see estimate/samples.py")
    return files


def read_sample(path: Path) -> Sample:
    """One sample. Raises: InputError if the file is damaged."""
    try:
        with np.load(path) as arrays:
            rows = arrays["landmarks"]
            return Sample(
                iuv=arrays["iuv"],
                alpha=arrays["alpha"],
                mask=arrays["mask"],
                exact=_unpacked(rows[0]),
                seen=_unpacked(rows[1]) if len(rows) > 1 else None,
            )
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(f"{path} is damaged ({error}); remove it and make it anew") from error


def write_sample(path: Path, sample: Sample) -> None:
    """Write a sample under a temporary name, then give it its own."""
    rows = [_packed(sample.exact)] + ([_packed(sample.seen)] if sample.seen else [])
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as out:
        np.savez_compressed(
            out,
            iuv=sample.iuv,
            alpha=sample.alpha,
            mask=sample.mask,
            landmarks=np.stack(rows),
        )
    Path(out.name).chmod(0o644)
    publish(Path(out.name), path)


_worker: tuple[SampleOptions, PeopleStream, BodyTracker] | None = None


def _start_worker(options: SampleOptions) -> None:
    import signal

    import cv2
    import torch

    global _worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    side = options.size_px
    people = PeopleStream(seed=options.seed, split=options.split, size=(side, side))
    _worker = options, people, BodyTracker(most_people=1, smooth=False)


def _make(number: int) -> None:
    """All photos of one person."""
    assert _worker is not None
    options, people, tracker = _worker
    model = load_body_model()
    dressed = people.dress(number)
    for view in range(options.views):
        path = _file(options, number, view)
        if path.exists():
            continue
        shot = people.shot(number, view)
        photo = people.take(dressed, shot)
        exact = exact_landmarks(dressed.posed(shot.pose), model, photo.camera)
        seen, mask = look_at(photo.rgb, tracker, exact)
        write_sample(path, Sample(photo.iuv, photo.alpha, mask, exact, seen))


def look_at(
    rgb: UInt8[np.ndarray, "H W 3"], tracker: BodyTracker, exact: Landmarks
) -> tuple[Landmarks | None, UInt8[np.ndarray, "H W"]]:
    """BlazePose's landmarks and mask of somebody whose true landmarks are known."""
    height, width = rgb.shape[:2]
    tracker.start_shot()
    found = tracker.follow(rgb)
    if not found:
        return None, np.zeros((height, width), np.uint8)
    body = found[0][1]
    away = np.linalg.norm((body.landmarks.image - exact.image)[:, :2], axis=1)
    tall = float(np.ptp(exact.image[:, 1]))
    if np.median(away[exact.presence > 0.5]) > WORST_ANSWER * tall:
        return None, np.zeros((height, width), np.uint8)
    mask = np.rint(body.mask * 255).astype(np.uint8)
    return body.landmarks, body.region.paste(mask, Box(0, 0, width, height))


def _packed(landmarks: Landmarks) -> Float32[np.ndarray, "33 8"]:
    chances = np.stack([landmarks.visibility, landmarks.presence], 1)
    return np.concatenate([landmarks.image, landmarks.world, chances], 1).astype(np.float32)


def _unpacked(rows: Float32[np.ndarray, "33 8"]) -> Landmarks:
    if rows.shape != (LANDMARK_COUNT, 8):
        raise ValueError(f"landmarks of shape {rows.shape}")
    return Landmarks(rows[:, :3], rows[:, 3:6], rows[:, 6], rows[:, 7])


def _file(options: SampleOptions, number: int, view: int) -> Path:
    return options.out / f"{number:06d}_{view}.npz"


def _is_done(options: SampleOptions, number: int) -> bool:
    return all(_file(options, number, view).exists() for view in range(options.views))


def _claim(options: SampleOptions) -> None:
    """Make the folder ours, or see that it is."""
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / SETTINGS_FILE
    wanted = json.dumps(options.settings, indent=1) + "\n"
    if file.exists():
        if file.read_text() != wanted:
            raise InputError(f"{options.out} holds samples of other settings; choose another")
        return
    if any(options.out.iterdir()):
        raise InputError(f"{options.out} holds other things than samples; choose another folder")
    temporary = options.out / f".{SETTINGS_FILE}.tmp"
    temporary.write_text(wanted)
    publish(temporary, file)
