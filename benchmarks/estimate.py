"""How near the IUV of raw photos and clips comes to DensePose's, or to the exact one.

    MT_SAMPLES=folder .venv/bin/python benchmarks/estimate.py photos [--pictures OUT]
    .venv/bin/python benchmarks/estimate.py people [--people 40] [--assets MAKEHUMAN] [--once]
    .venv/bin/python benchmarks/estimate.py clips [--people 8]

`photos`: the folder holds real photos with DensePose's own IUV, `deepfashion/*.png` with
`*_iuv.png` beside them, and `densepose_demo/demo_im.jpg` with `demo_im_IUV.png`, of which one
person is taken.

`people`: photos of held-out people, two each, and their exact IUV; every second one is a free
person, where assets are given.

`clips`: held-out people who stand still, seen by a camera with noise and a flickering exposure: how
many of the body's pixels change their part from one frame to the next. And people who turn once
around themselves: in how many frames left and right, or front and back, are exchanged.

`--heavy` looks with the estimator blazepose-heavy. Hands and heads have `estimate_details.py`, and
time has `estimate_speed.py`.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.interface import PersonEstimate
from motion_transfer.people import PeopleStream
from motion_transfer.training.iuv.trainer import IuvScore, score_iuv

MAN = (slice(170, 460), slice(170, 290))
"""Rows and columns of one person of the street."""

GOALS = IuvScore(iou=0.87, part_agreement=0.86, uv_error=0.06, swapped=0.0, turned=0.0)
CLIP_SIZE = (384, 384)
EXCHANGED = 0.4  # of a body or a trunk: more than borders


def main() -> None:
    parser = argparse.ArgumentParser(description="The estimator.")
    ways = parser.add_subparsers(required=True)
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--heavy", action="store_true")
    common.add_argument("--weights", type=Path, help="of the IUV network")
    photos = ways.add_parser("photos", parents=[common])
    photos.add_argument("--pictures", type=Path, help="write photo, DensePose's and our IUV here")
    photos.set_defaults(do=compare_photos)
    people = ways.add_parser("people", parents=[common])
    people.add_argument("--people", type=int, default=40)
    people.add_argument("--assets", type=Path, help="of free people")
    people.add_argument("--once", action="store_true", help="look as at the frames of a clip")
    people.set_defaults(do=score_people)
    clips = ways.add_parser("clips", parents=[common])
    clips.add_argument("--people", type=int, default=8)
    clips.add_argument("--frames", type=int, default=60)
    clips.set_defaults(do=score_clips)
    options = parser.parse_args()
    options.do(options)


def compare_photos(options: argparse.Namespace) -> None:
    """Print how near each photo's IUV comes to DensePose's."""
    estimator = BlazePoseEstimator(
        heavy=options.heavy, weights=options.weights, most_people=1, for_photos=True
    )
    names = list(IuvScore.__dataclass_fields__)
    print(f"{'':16}" + "".join(f"{name:>16}" for name in names))
    scores = []
    for name, (photo, true) in list_photos(Path(os.environ["MT_SAMPLES"])).items():
        estimator.start_shot()
        (person,) = estimator.estimate(photo)
        iuv, _ = person.on_frame(*photo.shape[:2])
        scores.append(score_iuv(iuv, true))
        print(f"{name:16}" + "".join(f"{getattr(scores[-1], n):16.3f}" for n in names))
        if options.pictures:
            options.pictures.mkdir(parents=True, exist_ok=True)
            picture = np.hstack(
                [photo[..., ::-1], coloured(true), coloured(iuv), faded(photo, person)]
            )
            cv2.imwrite(str(options.pictures / f"{name}.png"), picture)
    means = [np.mean([getattr(score, n) for score in scores]) for n in names]
    print(f"{'mean':16}" + "".join(f"{mean:16.3f}" for mean in means))
    print(f"{'goal':16}" + "".join(f"{getattr(GOALS, n):16.3f}" for n in names))


def score_people(options: argparse.Namespace) -> None:
    """Print how near the IUV of held-out people's photos comes to the exact one."""
    estimator = BlazePoseEstimator(
        heavy=options.heavy,
        weights=options.weights,
        most_people=1,
        smooth=False,
        for_photos=not options.once,
    )
    streams = [PeopleStream(split="held-out", size=CLIP_SIZE)]
    if options.assets:
        free = PeopleStream(split="held-out", size=CLIP_SIZE, assets=options.assets, free_share=1.0)
        streams.append(free)
    scores, missed = [], 0
    for number in range(options.people):
        people = streams[number % len(streams)]
        dressed = people.dress(number)
        for view in range(2):
            photo = people.take(dressed, people.shot(number, view))
            estimator.start_shot()
            found = estimator.estimate(photo.rgb)
            if found:
                scores.append(score_iuv(lay_iuv(found, *photo.rgb.shape[:2]), photo.iuv))
            missed += not found
    print(f"{len(scores)} photos; nobody was found in {missed} more")
    for name in IuvScore.__dataclass_fields__:
        print(f"{name} {np.nanmean([getattr(score, name) for score in scores]):.4f}")


def list_photos(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name -> photo and DensePose's IUV."""
    found = {}
    for file in sorted((folder / "deepfashion").glob("*_iuv.png")):
        photo = file.with_name(file.name.replace("_iuv", ""))
        if photo.exists():  # these files' RGB is I, U, V
            found[photo.stem.removeprefix("fashionWOMEN")[:14]] = _rgb(photo), _rgb(file)
    street = folder / "densepose_demo/demo_im.jpg"
    if street.exists():  # and this one's V, U, I
        iuv = _rgb(street.with_name("demo_im_IUV.png"))[..., ::-1]
        found["man"] = _rgb(street)[MAN], iuv[MAN]
    return found


def _rgb(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    assert picture is not None, path
    return np.ascontiguousarray(picture[..., ::-1])


def score_clips(options: argparse.Namespace) -> None:
    """Print how steady the IUV of still people is, and how right that of turning ones."""
    people = PeopleStream(split="held-out", size=CLIP_SIZE, framing="full")
    unsteady, turning = [], []
    for number in range(options.people):
        dressed, shot = people.dress(number), people.shot(number, 0)
        estimator = BlazePoseEstimator(heavy=options.heavy, weights=options.weights, most_people=1)
        photo = people.take(dressed, replace(shot, grain=0)).rgb
        rng = np.random.default_rng(number)
        noisy = (with_noise(photo, rng) for _ in range(options.frames))
        still = [estimator.estimate(frame) for frame in noisy]
        parts = [lay_iuv(found, *photo.shape[:2])[..., 0] for found in still]
        unsteady.append([changed_share(a, b) for a, b in pairwise(parts)])
        estimator.start_shot()
        for turn in np.linspace(0, 2 * np.pi, options.frames, endpoint=False):
            pose = replace(shot.pose, turn=shot.pose.turn + turn)
            taken = people.take(dressed, replace(shot, pose=pose, seed=rng.integers(1 << 30)))
            iuv = lay_iuv(estimator.estimate(taken.rgb), *photo.shape[:2])
            turning.append(score_iuv(iuv, taken.iuv))
    print(f"still: {np.mean(unsteady):.2%} of the body changes its part from frame to frame")
    for name in IuvScore.__dataclass_fields__:
        print(f"turning: {name} {np.nanmean([getattr(one, name) for one in turning]):.3f}")
    for name in ("swapped", "turned"):
        frames = sum(getattr(one, name) > EXCHANGED for one in turning)
        print(f"turning: {name} in {frames} of {len(turning)} frames")


def with_noise(photo: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What a camera makes of a scene that does not move."""
    exposed = photo * rng.normal(1, 0.01)
    return (exposed + rng.normal(0, 3, photo.shape)).round().clip(0, 255).astype(np.uint8)


def changed_share(before: np.ndarray, after: np.ndarray) -> float:
    """The share of the pixels of a body in either frame that have another part in the other."""
    body = (before > 0) | (after > 0)
    return float((before != after)[body].mean()) if body.any() else 0.0


def coloured(iuv: np.ndarray) -> np.ndarray:
    """IUV for eyes."""
    return np.stack([iuv[..., 0] * 10, iuv[..., 1], iuv[..., 2]], -1).astype(np.uint8)


def faded(photo: np.ndarray, person: PersonEstimate) -> np.ndarray:
    """The photo, dark where it is not the person, with landmarks."""
    _, alpha = person.on_frame(*photo.shape[:2])
    out = (photo[..., ::-1] * (0.3 + 0.7 * alpha[..., None] / 255)).astype(np.uint8)
    assert person.landmarks is not None
    for x, y in person.landmarks.image[:, :2]:
        cv2.circle(out, (round(float(x)), round(float(y))), 2, (0, 255, 0), -1)
    return out


if __name__ == "__main__":
    main()
