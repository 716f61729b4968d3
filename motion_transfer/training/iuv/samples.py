"""What the IUV network learns from: synthetic people, as they are and as BlazePose sees them.

DATA/samples.json           the settings, by which the folder is known
DATA/000123_2.npz           person 123, photo 2: the arrays of a `Sample`
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, astuple, dataclass, replace
from functools import partial
from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.networks import BodyFeatures, SeenBody
from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.interface import LANDMARK_COUNT, Landmarks
from motion_transfer.estimate.models import find_model, wanted_files
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

CUT = 0.2  # the share of the photos to train on that end somewhere in the body
CUT_SIDES = ("bottom", "bottom", "bottom", "left", "right", "top")  # photos mostly end below
CUT_BELOW, CUT_ELSEWHERE = (0.1, 0.6), (0.05, 0.3)  # the share of the body that is cut off
FEATURES = ("coarse", "fine")


@dataclass(frozen=True, kw_only=True)
class SampleOptions:
    """What to make.

    Attributes:
        out: The folder to write to; samples that are there stay.
        people: How many; each is photographed `views` times.
        size_px: The side of the square photos.
        heavy: Whether to see them as blazepose-heavy does.
        assets: Folder of MakeHuman's assets, by which half of the people are free people.
        workers: Processes; None: one for each core.
    """

    out: Path
    people: int
    views: int = 4
    seed: int = 0
    split: Split = "train"
    size_px: int = 256
    heavy: bool = False
    assets: Path | None = None
    workers: int | None = None

    @property
    def settings(self) -> dict:
        """What decides a sample's bytes."""
        kept = asdict(self)
        for name in ("out", "people", "views", "workers", "assets"):
            del kept[name]
        return {"motion-transfer": __version__, **kept, "free": self.assets is not None}


@dataclass(frozen=True)
class Sample:
    """One photo of one person.

    Attributes:
        iuv: The exact (I, U, V) of the bare body.
        alpha: The exact one, of the dressed person with hair.
        mask: BlazePose's, 0 where it saw nobody.
        exact: The true landmarks.
        seen: BlazePose's; None where it saw nobody or somebody else.
        features: BlazePose's; None where `seen` is.
    """

    iuv: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"]
    mask: UInt8[np.ndarray, "H W"]
    exact: Landmarks
    seen: Landmarks | None
    features: BodyFeatures | None


def make_samples(options: SampleOptions, done: Callable[[int], object] = int) -> int:
    """Photograph people and find them with BlazePose; stopped, it goes on where it was.

    Args:
        done: Called with how many more people are finished.
    Returns: How many people were added.
    Raises: InputError where an extra or the models are missing; OutputError where the folder
        holds something else or cannot be written.
    """
    require_extra("people")  # workers could only say that they broke
    for file in wanted_files(heavy=options.heavy):
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
            seen = len(rows) > 1
            return Sample(
                iuv=arrays["iuv"],
                alpha=arrays["alpha"],
                mask=arrays["mask"],
                exact=_unpacked(rows[0]),
                seen=_unpacked(rows[1]) if seen else None,
                features=_read_features(arrays) if seen else None,
            )
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(f"{path} is damaged ({error}); remove it and make it anew") from error


def write_sample(path: Path, sample: Sample) -> None:
    """Write a sample under a temporary name, then give it its own."""
    rows = [_packed(sample.exact)] + ([_packed(sample.seen)] if sample.seen else [])
    arrays = {name: getattr(sample, name) for name in ("iuv", "alpha", "mask")}
    if sample.features is not None:
        # in half precision: they are most of the file
        maps = {name: getattr(sample.features, name).astype(np.float16) for name in FEATURES}
        arrays |= {**maps, "region": np.array(astuple(sample.features.region))}
    temporary = path.with_name(f".{path.name}.part")
    with temporary.open("wb") as out:
        np.savez(out, **arrays, landmarks=np.stack(rows))
    publish(temporary, path)


def _open_maker(options: SampleOptions) -> MakeItem:
    side = options.size_px
    people = PeopleStream(
        seed=options.seed, split=options.split, size=(side, side), assets=options.assets
    )
    tracker = BodyTracker(heavy=options.heavy, most_people=1, smooth=False)
    return partial(_make, options, people, tracker)


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
        rng = np.random.default_rng((options.seed, number, view))
        cut = options.split == "train" and rng.random() < CUT
        kept = choose_cut(photo.alpha, rng) if cut else Box(0, 0, *photo.alpha.shape[::-1])
        rgb, iuv, alpha = (image[kept.slices] for image in (photo.rgb, photo.iuv, photo.alpha))
        exact = cut_landmarks(exact, kept)
        body = find_body(rgb, tracker, exact)
        mask = np.zeros_like(alpha)
        if body is not None:
            seen = np.rint(body.mask * 255).astype(np.uint8)
            mask = body.region.paste(seen, Box(0, 0, kept.width, kept.height))
        found = (body.landmarks, body.features) if body else (None, None)
        write_sample(path, Sample(iuv, alpha, mask, exact, *found))


def choose_cut(alpha: UInt8[np.ndarray, "H W"], rng: np.random.Generator) -> Box:
    """Choose a photo's part that ends somewhere in the body."""
    height, width = alpha.shape
    left, top, across, down = cv2.boundingRect((alpha > 127).view(np.uint8))
    side = rng.choice(CUT_SIDES)
    share = rng.uniform(*(CUT_BELOW if side == "bottom" else CUT_ELSEWHERE))
    ends = {"left": 0, "top": 0, "right": width, "bottom": height}
    ends[side] = {
        "left": left + round(share * across),
        "top": top + round(share * down),
        "right": left + across - round(share * across),
        "bottom": top + down - round(share * down),
    }[side]
    return Box(**ends) if across else Box(0, 0, width, height)


def cut_landmarks(landmarks: Landmarks, kept: Box) -> Landmarks:
    """Tell where landmarks lie in a part of their photo."""
    image = landmarks.image.copy()
    image[:, :2] -= (kept.left, kept.top)
    inside = (image[:, :2] >= 0).all(1) & (image[:, :2] < (kept.width, kept.height)).all(1)
    return replace(
        landmarks,
        image=image,
        visibility=landmarks.visibility * inside,
        presence=landmarks.presence * inside,
    )


def find_body(
    rgb: UInt8[np.ndarray, "H W 3"], tracker: BodyTracker, exact: Landmarks
) -> SeenBody | None:
    """Let BlazePose find somebody whose true landmarks are known.

    Returns: None where it saw nobody or somebody else.
    """
    tracker.start_shot()
    found = tracker.follow(np.ascontiguousarray(rgb))
    if not found:
        return None
    body = found[0][1]
    away = np.linalg.norm((body.landmarks.image - exact.image)[:, :2], axis=1)
    tall = float(np.ptp(exact.image[:, 1]))
    is_it = np.median(away[exact.presence > 0.5]) <= WORST_ANSWER * tall
    return body if is_it else None


def _read_features(arrays: Mapping[str, np.ndarray]) -> BodyFeatures:
    coarse, fine = (arrays[name].astype(np.float32) for name in FEATURES)
    return BodyFeatures(coarse, fine, Region(*map(float, arrays["region"])))


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
