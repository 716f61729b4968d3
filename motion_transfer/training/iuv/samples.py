"""What the IUV network learns from: synthetic people, as they are and as BlazePose sees them.

DATA/samples.json           the settings, by which the folder is known
DATA/000123_2.npz           person 123, photo 2: the arrays of a `Sample`
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.interface import LANDMARK_COUNT, Landmarks
from motion_transfer.estimate.models import MODEL_FILES, find_model
from motion_transfer.extras import require_extra
from motion_transfer.media.growing import MakeItem, claim_folder, make_items
from motion_transfer.media.publish import explain_disk_errors, publish
from motion_transfer.people import PeopleStream, Split, load_body_model
from motion_transfer.tracking.landmarks import exact_landmarks
from motion_transfer.version import __version__

SETTINGS_FILE = "samples.json"
WORST_ANSWER = 0.08
"""A body is BlazePose's answer to the photo if its seen landmarks are closer to the true ones than
this share of the body's height, in the median; otherwise it saw something else. Chosen by eye."""


@dataclass(frozen=True, kw_only=True)
class SampleOptions:
    """What to make.

    Attributes:
        out: The folder to write to; samples that are there stay.
        people: How many; each is photographed `views` times.
        size_px: The side of the square photos.
        workers: Processes; None: one for each core.
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
        iuv: The exact (I, U, V) of the bare body.
        alpha: The exact one, of the dressed person with hair.
        mask: BlazePose's, 0 where it saw nobody.
        exact: The true landmarks.
        seen: BlazePose's; None where it saw nobody or somebody else.
    """

    iuv: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"]
    mask: UInt8[np.ndarray, "H W"]
    exact: Landmarks
    seen: Landmarks | None


def make_samples(options: SampleOptions, done: Callable[[int], object] = int) -> int:
    """Photograph people and find them with BlazePose; stopped, it goes on where it was.

    Args:
        done: Called with how many more people are finished.
    Returns: How many people were added.
    Raises: InputError where an extra or the models are missing; OutputError where the folder
        holds something else or cannot be written.
    """
    require_extra("people")  # workers could only say that they broke
    for file in MODEL_FILES:
        find_model(file)
    with explain_disk_errors(options.out):
        claim_folder(options.out / SETTINGS_FILE, options.settings, "samples")
        missing = [number for number in range(options.people) if not _is_done(options, number)]
        done(options.people - len(missing))
        make_items(missing, partial(_open_maker, options), options.workers, done)
    return len(missing)


def list_samples(folder: Path) -> list[Path]:
    """List the samples in a folder, in order. Raises: InputError if there are none."""
    files = sorted(folder.glob("*_*.npz"))
    if not files:
        raise InputError(f"{folder} holds no samples; make some by `mt train iuv make`")
    return files


def read_sample(path: Path) -> Sample:
    """Read one sample. Raises: InputError if the file is damaged."""
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
    arrays = {name: getattr(sample, name) for name in ("iuv", "alpha", "mask")}
    temporary = path.with_name(f".{path.name}.part")
    with temporary.open("wb") as out:
        np.savez_compressed(out, **arrays, landmarks=np.stack(rows))
    publish(temporary, path)


def _open_maker(options: SampleOptions) -> MakeItem:
    side = options.size_px
    people = PeopleStream(seed=options.seed, split=options.split, size=(side, side))
    return partial(_make, options, people, BodyTracker(most_people=1, smooth=False))


def _make(options: SampleOptions, people: PeopleStream, tracker: BodyTracker, number: int) -> None:
    """Photograph one person from all views, and find the landmarks."""
    model = load_body_model()
    dressed = people.dress(number)
    for view in range(options.views):
        path = _file(options, number, view)
        if path.exists():
            continue
        shot = people.shot(number, view)
        photo = people.take(dressed, shot)
        exact = exact_landmarks(dressed.posed(shot.pose), model, photo.camera)
        seen, mask = find_body(photo.rgb, tracker, exact)
        write_sample(path, Sample(photo.iuv, photo.alpha, mask, exact, seen))


def find_body(
    rgb: UInt8[np.ndarray, "H W 3"], tracker: BodyTracker, exact: Landmarks
) -> tuple[Landmarks | None, UInt8[np.ndarray, "H W"]]:
    """Let BlazePose find somebody whose true landmarks are known: its landmarks and mask.

    Returns: None and an empty mask where it saw nobody or somebody else.
    """
    height, width = rgb.shape[:2]
    nobody = None, np.zeros((height, width), np.uint8)
    tracker.start_shot()
    found = tracker.follow(rgb)
    if not found:
        return nobody
    body = found[0][1]
    away = np.linalg.norm((body.landmarks.image - exact.image)[:, :2], axis=1)
    tall = float(np.ptp(exact.image[:, 1]))
    if np.median(away[exact.presence > 0.5]) > WORST_ANSWER * tall:
        return nobody
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
