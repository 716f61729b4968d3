"""What the IUV network learns from: synthetic people, as they are and as BlazePose sees them.

DATA/samples.json           the settings, by which the folder is known
DATA/000123_2.npz           person 123, photo 2: the arrays of a `Sample`

Where BlazePose's 33 landmarks lie on a synthetic body is known exactly. Each is a place at rest (a
joint, or a place on the skin) that moves with one bone, plus a systematic offset between that place
and what BlazePose calls the landmark. The offsets were fitted by tools/fit_body_landmarks.py to
BlazePose's own answers on photos of synthetic people.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.tracker import BodyTracker
from motion_transfer.estimate.interface import LANDMARK_COUNT, LANDMARK_NAMES, Landmarks
from motion_transfer.estimate.models import MODEL_FILES, find_model
from motion_transfer.extras import require_extra
from motion_transfer.media.growing import MakeItem, claim_folder, make_items
from motion_transfer.media.publish import explain_disk_errors, publish
from motion_transfer.people import (
    Body,
    BodyModel,
    Camera,
    PeopleStream,
    PosedBody,
    Split,
    Triangles,
    depths,
    load_body_model,
    rasterise,
)
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


COVERED_BEHIND_METRES = 0.15
"""A point this far behind the surface that its pixel shows is covered: joints lie up to a hip's
half depth inside."""


@dataclass(frozen=True)
class Anchor:
    """What a landmark is fixed to.

    Attributes:
        bone: Carries it; without the side.
        place: A bone's name, whose beginning it is, or `skin:` and a name in `skin_places`.
        offset: From there, in shares of the body's height, in the axes of the rest pose (x to the
            left hand, y to the back, z up), for the left side.
    """

    bone: str
    place: str
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


# The places follow BlazePose's list of key points; hips, shoulders and so on are joints, fingers
# the first knuckles of little finger and index and the second of the thumb.
ANCHORS: dict[str, Anchor] = {
    "nose": Anchor("head", "skin:nose", (0.0, 0.0076, 0.0068)),
    "eye-inner": Anchor("head", "skin:eye-inner", (0.0016, 0.0039, 0.0038)),
    "eye-middle": Anchor("head", "skin:eye-middle", (-0.001, 0.0079, 0.0021)),
    "eye-outer": Anchor("head", "skin:eye-outer", (-0.0032, 0.0073, 0.0036)),
    "ear": Anchor("head", "skin:ear", (-0.0171, -0.0221, -0.002)),
    "mouth": Anchor("head", "skin:mouth", (-0.0022, 0.0044, 0.007)),
    "shoulder": Anchor("shoulder01", "upperarm01", (-0.001, 0.001, 0.0144)),
    "elbow": Anchor("upperarm02", "lowerarm01", (-0.0071, 0.0003, 0.0054)),
    "wrist": Anchor("lowerarm02", "wrist", (0.0002, -0.0038, -0.0014)),
    "pinky": Anchor("finger5-1", "finger5-1", (-0.0145, -0.0064, 0.008)),
    "index": Anchor("finger2-1", "finger2-1", (-0.0079, 0.0147, -0.0045)),
    "thumb": Anchor("finger1-2", "finger1-2", (0.0123, 0.004, -0.0073)),
    "hip": Anchor("root", "upperleg01", (-0.0078, -0.0174, -0.0033)),
    "knee": Anchor("upperleg02", "lowerleg01", (-0.0029, 0.0004, 0.0016)),
    "ankle": Anchor("lowerleg02", "foot", (-0.0016, -0.0021, 0.0143)),
    "heel": Anchor("foot", "skin:heel", (-0.0045, -0.0108, 0.0083)),
    "foot-index": Anchor("toe2-1", "skin:toe", (-0.0034, 0.0151, 0.0068)),
}


def anchor_of(landmark: str) -> tuple[str, str]:
    """Name a landmark's anchor and side: `left-elbow` -> (`elbow`, `L`); the nose has no side."""
    if landmark.startswith("mouth-"):
        return "mouth", landmark[len("mouth-")].upper()
    side, _, kind = landmark.partition("-")
    return (kind, side[0].upper()) if kind else (landmark, "")


@lru_cache(maxsize=1)
def skin_places(model: BodyModel) -> dict[str, int]:
    """Find vertices of the skin by name, on the template; `.L` and `.R` are the person's.

    Distances are in metres, chosen by eye on that body.
    """
    body = model.template
    x, y, z = body.points.T
    head = model.weights.matrix[:, [body.skeleton.index["head"]]]
    on_head = np.asarray(head.toarray())[:, 0] > 0.5
    places: dict[str, int] = {}
    for side, sign in (("L", 1), ("R", -1)):
        eye = body.joint(f"eye.{side}")
        # ears are as high as the eyes, and nothing of the head is farther out
        level = on_head & (np.abs(z - eye[2]) < 0.03) & (sign * x > 0)
        places[f"ear.{side}"] = _best(sign * x, level)
        for name, across, up in (
            ("eye-inner", -0.016, 0.0),
            ("eye-middle", 0.0, 0.0),
            ("eye-outer", 0.016, 0.0),
            ("mouth", -0.006, -0.077),
        ):
            wanted = eye + np.array([sign * across, 0.0, up])
            away = np.hypot(x - wanted[0], z - wanted[2])
            # foremost of the vertices there, seen from the front: aside counts 20 times as much
            places[f"{name}.{side}"] = _best(-y - 20 * away, on_head & (y < eye[1] + 0.03))
        foot = body.joint(f"foot.{side}")
        near = (z < foot[2]) & (sign * x > 0)
        # the hindmost, preferably at a third of the ankle's height: not the edge of the sole
        places[f"heel.{side}"] = _best(y - 2 * np.abs(z - 0.3 * foot[2]), near)
        toe = body.joint(f"toe2-3.{side}")
        places[f"toe.{side}"] = _best(-y - np.abs(x - toe[0]), near)
    # below the eyes and above the mouth, the nose stands out farthest
    middle = on_head & (np.abs(x) < 0.01) & (z < eye[2] - 0.015) & (z > eye[2] - 0.06)
    places["nose."] = _best(-y, middle)
    return places


def _best(value: np.ndarray, allowed: np.ndarray) -> int:
    return int(np.where(allowed, value, -np.inf).argmax())


def rest_places(body: Body, model: BodyModel) -> Float64[np.ndarray, "33 3"]:
    """Place the landmarks on the body at rest, metres."""
    rows = []
    for name in LANDMARK_NAMES:
        kind, side = anchor_of(name)
        anchor = ANCHORS[kind]
        if anchor.place.startswith("skin:"):
            vertex = skin_places(model)[f"{anchor.place.removeprefix('skin:')}.{side}"]
            place = body.points[vertex].astype(np.float64)
        else:
            place = body.joint(f"{anchor.place}.{side}")
        mirror = np.array([-1.0 if side == "R" else 1.0, 1.0, 1.0])
        rows.append(place + mirror * np.array(anchor.offset) * body.height)
    return np.stack(rows)


def carrying_bones(body: Body) -> list[int]:
    """List the bone that each landmark moves with."""
    kinds = [anchor_of(name) for name in LANDMARK_NAMES]
    index = body.skeleton.index
    bones = [(ANCHORS[kind].bone, side) for kind, side in kinds]
    return [index[bone] if bone in index else index[f"{bone}.{side}"] for bone, side in bones]


def posed_places(posed: PosedBody, model: BodyModel) -> Float32[np.ndarray, "33 3"]:
    """Place the landmarks on a posed body, world, metres."""
    matrices = posed.transforms[carrying_bones(posed.body)]
    rest = rest_places(posed.body, model)
    return (np.einsum("lij,lj->li", matrices[..., :3], rest) + matrices[..., 3]).astype(np.float32)


def exact_landmarks(posed: PosedBody, model: BodyModel, camera: Camera) -> Landmarks:
    """Compute what BlazePose should say of a posed body seen by a camera.

    Depth is scaled as the picture is at the hips' distance. Visibility is 1 or 0, of the bare body.
    """
    places = posed_places(posed, model)
    screen = camera.project(places)
    hips = [LANDMARK_NAMES.index(f"{side}-hip") for side in ("left", "right")]
    middle = places[hips].mean(0)
    distance = float(screen[hips, 2].mean())
    depth = (screen[:, 2] - distance) * camera.focal_px / distance
    inside = (screen[:, :2] >= 0).all(1) & (screen[:, :2] < (camera.width, camera.height)).all(1)
    nearest = depths(
        rasterise(camera.project(posed.points), Triangles(model.faces), camera.width, camera.height)
    ).reshape(camera.height, camera.width)
    column, row = (screen[:, :2].clip(0, (camera.width - 1, camera.height - 1))).astype(int).T
    surface = np.nan_to_num(nearest[row, column], nan=np.inf)
    seen = inside & (screen[:, 2] < surface + COVERED_BEHIND_METRES)
    return Landmarks(
        image=np.concatenate([screen[:, :2], depth[:, None]], 1).astype(np.float32),
        world=((places - middle) @ camera.axes.T).astype(np.float32),
        visibility=seen.astype(np.float32),
        presence=np.asarray(inside, np.float32),
    )
