"""How near the IUV of raw photos comes to DensePose's, and how fast `mt iuv` is.

    MT_SAMPLES=folder .venv/bin/python benchmarks/estimate.py photos [--pictures OUT]
    .venv/bin/python benchmarks/estimate.py people [--people 40] [--assets MAKEHUMAN] [--once]
    .venv/bin/python benchmarks/estimate.py clips [--people 8]
    .venv/bin/python benchmarks/estimate.py hands [--people 20]
    .venv/bin/python benchmarks/estimate.py heads [--people 75] [--assets MAKEHUMAN]
    .venv/bin/python benchmarks/estimate.py speed [--against CHECKOUT] [--size 854x480]

`photos`: the folder holds real photos with DensePose's own IUV, `deepfashion/*.png` with
`*_iuv.png` beside them, and `densepose_demo/demo_im.jpg` with `demo_im_IUV.png`, of which one
person is taken.

`people`: photos of held-out people, two each, and their exact IUV; every second one is a free
person, where assets are given.

`clips`: held-out people who stand still, seen by a camera with noise and a flickering exposure: how
many of the body's pixels change their part from one frame to the next. And people who turn once
around themselves: in how many frames left and right, or front and back, are exchanged.

`hands`: large photos of held-out people: around each true hand, how many pixels have the right part
(background and body included), and how well the hand itself is covered, with hands that are looked
at once more and without.

`heads`: photos of held-out people, two each: how far off the direction of the head is, painted and
drawn. A direction is the turn of the head's mean surface that brings the places that IUV names
nearest to its pixels; it is compared with that of the exact IUV, and, as a check of the measure,
both with the turn of the person's own head. Around each head, how many pixels have the right part,
how far U and V are off, and how well the head is covered.

`--heavy` looks with the estimator blazepose-heavy.

`speed`: a clip of the demo's person, who goes to and fro, in H.264. Whole runs, decode to encode,
in turns with those of another checkout of this project; then what each step takes alone.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from scipy.spatial import KDTree

from motion_transfer.cores import core_count
from motion_transfer.estimate.blazepose import BlazePoseEstimator, details
from motion_transfer.estimate.blazepose.faces import find_face
from motion_transfer.estimate.blazepose.hands import find_hands
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.interface import AT_ONCE, PersonEstimate
from motion_transfer.estimate.shots import mark_shots
from motion_transfer.estimate.surfaces.hand_surface import fit_turn
from motion_transfer.media.iuv.writing import IuvOutput, write_iuv
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.people import Camera, PeopleStream, load_body_model, load_charts
from motion_transfer.training.iuv.trainer import IuvScore, score_iuv

ROOT = Path(__file__).parents[1]
PERSON = ROOT / "motion_transfer/demo/source.png"
MAN = (slice(170, 460), slice(170, 290))
"""Rows and columns of one person of the street."""

GOALS = IuvScore(iou=0.87, part_agreement=0.86, uv_error=0.06, swapped=0.0, turned=0.0)
STEP_FRAMES = 60
CLIP_SIZE, HANDS_SIZE = (384, 384), (768, 768)
LEAST_HAND = LEAST_HEAD = 24  # px
HEADS_SIZE = (512, 512)
ENOUGH = 600  # pixels of each part, which tell a head's turn
HEAD = 23  # the first of its parts
HEAD_TURNS = {"frontal": 45, "profile": 110, "from behind": 180}
"""The most degrees that each looks past the camera."""

TO_PICTURE = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # x right, y down, z away from who looks
EXCHANGED = 0.4  # of a body or a trunk: more than borders

RUN = r"""
import re, sys, time
from pathlib import Path
began, stamps = time.perf_counter(), []
from motion_transfer.estimate.run import EstimateOptions, estimate_iuv
options = EstimateOptions(source=Path(sys.argv[1]), output=Path(sys.argv[2]), force=True)
estimate_iuv(options, lambda *_: stamps.append(time.perf_counter()))
ended = time.perf_counter()
# not getrusage's, which begins with the memory of the process that started this one
most = int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1]) / 1024
print((len(stamps) - 1) / (stamps[-1] - stamps[0]), ended - began, time.process_time(), most)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description="The estimator.")
    ways = parser.add_subparsers(required=True)
    looks = argparse.ArgumentParser(add_help=False)
    looks.add_argument("--heavy", action="store_true")
    photos = ways.add_parser("photos", parents=[looks])
    photos.add_argument("--weights", type=Path)
    photos.add_argument("--pictures", type=Path, help="write photo, DensePose's and our IUV here")
    photos.set_defaults(do=compare_photos)
    people = ways.add_parser("people", parents=[looks])
    people.add_argument("--people", type=int, default=40)
    people.add_argument("--assets", type=Path, help="of free people")
    people.add_argument("--weights", type=Path)
    people.add_argument("--once", action="store_true", help="look as at the frames of a clip")
    people.set_defaults(do=score_people)
    clips = ways.add_parser("clips", parents=[looks])
    clips.add_argument("--people", type=int, default=8)
    clips.add_argument("--frames", type=int, default=60)
    clips.add_argument("--weights", type=Path)
    clips.set_defaults(do=score_clips)
    hands = ways.add_parser("hands", parents=[looks])
    hands.add_argument("--people", type=int, default=20)
    hands.add_argument("--pictures", type=Path, help="write photo, exact, coarse and fine IUV here")
    hands.set_defaults(do=score_hands)
    heads = ways.add_parser("heads", parents=[looks])
    heads.add_argument("--people", type=int, default=75)
    heads.add_argument("--assets", type=Path, help="of free people")
    heads.add_argument("--pictures", type=Path, help="write photo, exact, coarse and fine IUV here")
    heads.set_defaults(do=score_heads)
    speed = ways.add_parser("speed")
    speed.add_argument("--against", type=Path, metavar="CHECKOUT")
    speed.add_argument("--clip", type=Path, help="instead of the demo's person")
    speed.add_argument("--size", default="854x480")
    speed.add_argument("--frames", type=int, default=300)
    speed.add_argument("--rounds", type=int, default=5)
    speed.set_defaults(do=time_runs)
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


def score_hands(options: argparse.Namespace) -> None:
    """Print how right hands are, drawn and only painted."""
    people = PeopleStream(split="held-out", size=HANDS_SIZE)
    estimator = BlazePoseEstimator(heavy=options.heavy, most_people=1)
    rows, changed = [], 0
    for number in range(options.people):
        dressed = people.dress(number)
        for view in range(2):
            photo = people.take(dressed, people.shot(number, view))
            pair = []
            for find in (lambda *_: {}, find_hands):
                details.find_hands = find
                details.find_face = lambda _frame, _landmarks: None
                estimator.start_shot()
                pair.append(lay_iuv(estimator.estimate(photo.rgb), *photo.rgb.shape[:2])[..., 0])
            for part in (3, 4):
                x, y, width, height = cv2.boundingRect((photo.iuv[..., 0] == part).view(np.uint8))
                if max(width, height) < LEAST_HAND:
                    continue
                rim = max(width, height) // 4
                place = np.s_[max(0, y - rim) : y + height + rim, max(0, x - rim) : x + width + rim]
                true = photo.iuv[place][..., 0]
                found = [each[place] for each in pair]
                changed += bool((found[0] != found[1]).any())
                hands = [(each == part, true == part) for each in found]
                rows.append(
                    [float((each == true).mean()) for each in found]
                    + [float((a & b).sum() / (a | b).sum()) for a, b in hands]
                )
                if options.pictures:
                    options.pictures.mkdir(parents=True, exist_ok=True)
                    shown = [np.repeat(each[..., None] * 10, 3, 2) for each in (true, *found)]
                    picture = np.hstack([photo.rgb[place][..., ::-1], *shown])
                    cv2.imwrite(str(options.pictures / f"{number}-{view}-{part}.png"), picture)
    painted, drawn, coarse, fine = np.mean(rows, 0)
    print(f"{len(rows)} hands of {LEAST_HAND} px and more; {changed} of them drawn")
    print(f"parts right around them: painted {painted:.3f}, drawn {drawn:.3f}")
    print(f"intersection over union: painted {coarse:.3f}, drawn {fine:.3f}")


def score_heads(options: argparse.Namespace) -> None:
    """Print how right heads are, drawn and only painted, by how they are turned."""
    people = PeopleStream(split="held-out", size=HEADS_SIZE, assets=options.assets)
    estimator = BlazePoseEstimator(heavy=options.heavy, most_people=1)
    places = HeadPlaces()
    details.find_hands = lambda *_: {}  # they take longest, and change no head
    rows: dict[str, list[list[float]]] = {name: [] for name in HEAD_TURNS}
    for number in range(options.people):
        dressed = people.dress(number)
        for view in range(2):
            shot = people.shot(number, view)
            photo = people.take(dressed, shot)
            x, y, width, height = cv2.boundingRect((photo.iuv[..., 0] >= HEAD).view(np.uint8))
            if max(width, height) < LEAST_HEAD:
                continue
            exact = places.turn(photo.iuv)
            own = places.true_turn(photo.camera, dressed.posed(shot.pose).points)
            pair = []
            for find in (lambda _frame, _landmarks: None, find_face):
                details.find_face = find
                estimator.start_shot()
                pair.append(lay_iuv(estimator.estimate(photo.rgb), *photo.rgb.shape[:2]))
            rim = max(width, height) // 4
            place = np.s_[max(0, y - rim) : y + height + rim, max(0, x - rim) : x + width + rim]
            row = [degrees(exact, own), float((pair[0] != pair[1]).any())]
            for found in pair:
                turn = places.turn(found)
                row += [degrees(turn, exact), degrees(turn, own)]
                row += head_score(found[place], photo.iuv[place])
            away = abs(np.degrees(np.arctan2(-own[0, 2], own[2, 2])))
            rows[next(name for name, most in HEAD_TURNS.items() if away <= most)].append(row)
            if options.pictures:
                options.pictures.mkdir(parents=True, exist_ok=True)
                shown = [coloured(each[place]) for each in (photo.iuv, *pair)]
                picture = np.hstack([photo.rgb[place][..., ::-1], *shown])
                cv2.imwrite(str(options.pictures / f"{number}-{view}.png"), picture)
    rows["all"] = [row for each in rows.values() for row in each]
    rows["of them drawn"] = [row for row in rows["all"] if row[1]]
    for name, kept in rows.items():
        if not kept:
            continue
        values = np.array(kept)
        exact, drawn = values[:, :2].T
        print(
            f"{name}: {len(kept)} heads of {LEAST_HEAD} px and more, {drawn.sum():.0f} drawn; exact"
            f" IUV {np.median(exact):.1f} degrees from the person's own head"
        )
        for way, columns in (("painted", values[:, 2:7]), ("drawn", values[:, 7:])):
            off, own, parts, iou, uv = columns.T
            half, most = (np.percentile([off, own], share, axis=1) for share in (50, 90))
            print(
                f"  {way:8} off by {half[0]:.1f} degrees (90 %: {most[0]:.1f}), from the person's"
                f" own {half[1]:.1f} ({most[1]:.1f}); parts right {parts.mean():.3f},"
                f" IoU {iou.mean():.3f}, U and V {np.nanmean(uv):.4f}"
            )


class HeadPlaces:
    """Where on the middle of all heads a pixel of IUV lies, and so how a head is turned."""

    def __init__(self) -> None:
        model, charts = load_body_model(), load_charts()
        chosen = charts.part >= HEAD
        corners, uv = model.faces[chosen], charts.uv[chosen]
        bone = model.weights.matrix[:, [model.skeleton.index["head"]]].toarray()[:, 0]
        self._own = np.intersect1d(corners, np.flatnonzero(bone > 0.5))
        rest = (model.template.points - model.template.joint("head")) @ TO_PICTURE.T
        self._rest = rest[self._own]
        shares = np.array([(a, b, 3 - a - b) for a in range(4) for b in range(4 - a)]) / 3
        # only what the head's bone moves: the neck turns less
        values = np.concatenate([rest, bone[:, None]], 1)[corners]
        self._values = (shares @ values).reshape(-1, 4)
        self._trees: dict[int, tuple[KDTree, np.ndarray]] = {}
        for part in (HEAD, HEAD + 1):
            rows = np.repeat(charts.part[chosen] == part, len(shares))
            self._trees[part] = KDTree((shares @ uv).reshape(-1, 2)[rows]), self._values[rows]

    def turn(self, iuv: np.ndarray) -> np.ndarray:
        """Fit weak perspective to a head's pixels, so that few wrong ones do not count.

        Returns: 3 x 3, from the axes of the picture at rest; that from behind if there is no head.
        """
        pixels, places = [], []
        for part, (tree, values) in self._trees.items():
            y, x = np.nonzero(iuv[..., 0] == part)
            if not len(x):
                continue
            every = max(1, len(x) // ENOUGH)
            y, x = y[::every], x[::every]
            found = values[tree.query(iuv[y, x, 1:] / 255)[1]]
            own = found[:, 3] > 0.8
            pixels.append(np.stack([x, y], 1)[own] + 0.5)
            places.append(found[own, :3])
        if sum(map(len, pixels)) < LEAST_HEAD:
            return np.diag([-1.0, 1, -1])
        return fit_weak_perspective(np.concatenate(places), np.concatenate(pixels))

    def true_turn(self, camera: Camera, points: np.ndarray) -> np.ndarray:
        """Tell how the head of a posed body is turned, seen where it is in the picture."""
        seen = camera.project(points[self._own]).astype(np.float64)
        metres = seen[:, 2].mean()
        seen[:, 2] = (seen[:, 2] - metres) * camera.focal_px / metres
        return fit_turn(self._rest.astype(np.float32), seen.astype(np.float32))[1]


def fit_weak_perspective(places: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Find the turn with which places, seen from far away, lie nearest to pixels."""
    weights = np.ones(len(places))
    turn, scale = None, 1.0
    for _ in range(12):
        share = weights / weights.sum()
        rest, seen = places - share @ places, pixels - share @ pixels
        if turn is None:
            root = np.sqrt(weights)[:, None]
            affine = np.linalg.lstsq(rest * root, seen * root, rcond=None)[0].T
            left, sizes, right = np.linalg.svd(affine, full_matrices=False)
            rows = left @ right
            turn, scale = np.vstack([rows, np.cross(*rows)]), float(sizes.mean())
        for _ in range(3):
            x, y, z = turned = (rest @ turn.T).T
            none = np.zeros_like(x)
            # how x and y change with a small turn about each axis, and with the scale
            slopes = np.stack([scale * np.stack([none, z, -y]), scale * np.stack([-z, none, x])])
            slopes = np.concatenate([slopes, turned[:2, None]], 1)
            away = seen.T - scale * turned[:2]
            normal = np.einsum("cin,n,cjn->ij", slopes, weights, slopes)
            step = np.linalg.solve(
                normal + 1e-6 * np.trace(normal) * np.eye(4),
                np.einsum("cin,n,cn->i", slopes, weights, away),
            )
            turn, scale = cv2.Rodrigues(step[:3])[0] @ turn, scale + float(step[3])
        far = np.linalg.norm(seen - scale * (rest @ turn.T)[:, :2], axis=1)
        weights = 1 / (1 + np.square(far / (1.5 * np.median(far) + 1e-6)))
    assert turn is not None
    return turn


def degrees(one: np.ndarray, other: np.ndarray) -> float:
    """The angle between two turns."""
    return float(np.degrees(np.arccos(np.clip((np.trace(one @ other.T) - 1) / 2, -1, 1))))


def head_score(found: np.ndarray, true: np.ndarray) -> list[float]:
    """The share of pixels with the right part, intersection over union of the heads, and the mean
    error of U and V where both are the same part of the head."""
    mine, yours = found[..., 0], true[..., 0]
    heads = mine >= HEAD, yours >= HEAD
    same = (mine == yours) & heads[1]
    away = np.abs(found[same][:, 1:].astype(int) - true[same][:, 1:]) / 255
    iou = (heads[0] & heads[1]).sum() / (heads[0] | heads[1]).sum()
    uv = float(away.mean()) if same.any() else float("nan")
    return [float((mine == yours).mean()), float(iou), uv]


def with_noise(photo: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What a camera makes of a scene that does not move."""
    exposed = photo * rng.normal(1, 0.01)
    return (exposed + rng.normal(0, 3, photo.shape)).round().clip(0, 255).astype(np.uint8)


def changed_share(before: np.ndarray, after: np.ndarray) -> float:
    """The share of the pixels of a body in either frame that have another part in the other."""
    body = (before > 0) | (after > 0)
    return float((before != after)[body].mean()) if body.any() else 0.0


def time_runs(options: argparse.Namespace) -> None:
    """Print frames a second of whole runs, and what each step takes alone."""
    with tempfile.TemporaryDirectory() as folder:
        clip = options.clip or make_clip(Path(folder), options.size, options.frames)
        pictures = open_pictures(clip)
        print(
            f"{pictures.width} x {pictures.height}, {pictures.frame_count} frames;"
            f" {core_count()} cores, {cpu_name()}"
        )
        trees = {"here": ROOT, **({"there": options.against.resolve()} if options.against else {})}
        results: dict[str, list[list[float]]] = {name: [] for name in trees}
        for _ in range(options.rounds):
            for name, tree in trees.items():
                command = [sys.executable, "-c", RUN, str(clip), f"{folder}/{name}.mkv"]
                places = {**os.environ, "PYTHONPATH": str(tree)}
                told = subprocess.run(
                    command, cwd=folder, env=places, check=True, capture_output=True, text=True
                )
                results[name].append([float(number) for number in told.stdout.split()])
        for name, rounds in results.items():
            rates, walls, cpus, sizes = zip(*rounds, strict=True)
            each = 1e3 * statistics.median(cpus) / pictures.frame_count
            print(
                f"{name:6} {statistics.median(rates):5.1f} frames/s ({min(rates):.1f} to"
                f" {max(rates):.1f}); {pictures.frame_count / statistics.median(walls):.1f} with"
                f" what it takes to start; {each:.0f} ms of CPU a frame with that; {max(sizes):.0f}"
                " MiB at most"
            )
        if options.against:
            pairs = zip(results["here"], results["there"], strict=True)
            ratios = [here[0] / there[0] for here, there in pairs]
            print(f"{statistics.median(ratios):.2f} times ({min(ratios):.2f} to {max(ratios):.2f})")
        time_steps(clip, Path(folder))


def make_clip(folder: Path, size: str, frames: int) -> Path:
    """The demo's person in front of a blurred wall, to and fro, with a camera's noise."""
    width, height = (int(number) for number in size.split("x"))
    photo = cv2.imread(str(PERSON))
    assert photo is not None
    tall, wide = photo.shape[:2]
    wall = cv2.GaussianBlur(cv2.resize(photo, (width, height)), (0, 0), 25)
    rng = np.random.default_rng(0)
    with av.open(str(folder / "clip.mp4"), "w") as container:
        stream = container.add_stream("libx264", 30, {"crf": "18", "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for index in range(frames):
            turn, grow, go = (np.sin(2 * np.pi * index / n) for n in (51, 69, 150))
            scale = height / tall * (1 + 0.04 * grow)
            matrix = cv2.getRotationMatrix2D((wide / 2, tall / 2), 3 * turn, scale)
            matrix[:, 2] += (width - wide) / 2 + 0.2 * width * go, (height - tall) / 2
            frame = cv2.warpAffine(
                photo, matrix, (width, height), wall.copy(), borderMode=cv2.BORDER_TRANSPARENT
            )
            noisy = frame + rng.normal(0, 3, (height, width, 1))
            picture = noisy.round().clip(0, 255).astype(np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode(None))
    return folder / "clip.mp4"


def time_steps(clip: Path, folder: Path) -> None:
    """Print what each step takes alone of CPU, over the first frames."""
    pictures = open_pictures(clip)
    count = min(STEP_FRAMES, pictures.frame_count)
    estimator = BlazePoseEstimator()
    took: dict[str, float] = {}

    def step(name: str, work: Callable[[], Any]) -> Any:
        began = time.process_time()
        result = work()
        took[name] = 1e3 * (time.process_time() - began) / count
        return result

    frames = step("decode", lambda: list(islice(pictures.read(), count)))
    step("look for cuts", lambda: list(mark_shots(frames)))
    estimator.estimate(frames[0])  # a shot's first frame is searched everywhere, for 0.3 s
    located = step("find people", lambda: [estimator.locate(frame) for frame in frames])
    people = step("paint IUV", lambda: [finish() for finish in located])
    size = frames[0].shape[:2]
    laid = step("lay", lambda: [lay_iuv(each, *size) for each in people])
    settings = IuvOutput(frame_count=count, height=size[0], width=size[1], force=True)
    step("encode", lambda: write_iuv(laid, folder / "steps.mkv", settings))
    total, cores = sum(took.values()), core_count()
    print("ms of CPU a frame: " + ", ".join(f"{name} {ms:.1f}" for name, ms in took.items()))
    print(f"{total:.1f} in all: {1e3 * cores / total:.0f} frames/s, were {cores} cores always busy")
    one_thread = {
        "decode and look for cuts": took["decode"] + took["look for cuts"],
        "paint IUV (half, as two threads do)": took["paint IUV"] / AT_ONCE,
        **{name: took[name] for name in ("find people", "lay", "encode")},
    }
    most = max(one_thread, key=lambda name: one_thread[name])
    limit = 1e3 / one_thread[most]
    print(f"the busiest thread: {most}, {one_thread[most] / total:.0%}; no faster than {limit:.0f}")


def cpu_name() -> str:
    """The processor's name, as far as the system tells."""
    info = Path("/proc/cpuinfo")
    found = re.search(r"model name\s*:\s*(.+)", info.read_text()) if info.exists() else None
    return found[1] if found else platform.processor()


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
