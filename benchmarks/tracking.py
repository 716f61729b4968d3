"""How near a body fitted to a clip comes to the one that was filmed, and what it costs.

    .venv/bin/python benchmarks/tracking.py [--people 4] [--frames 40] [--heavy] [--pictures OUT]

Held-out synthetic people walk, dance and turn before a camera that stands still. BlazePose's
landmarks of the clip are fitted as `mt people track` does. The fitted body's IUV, drawn from the
clip's own camera, and the IUV that the estimator paints are compared with the exact one; and the
fitted landmarks with the true ones, both from the middle of the hips and equally large.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from motion_transfer.estimate import BlazePoseEstimator
from motion_transfer.estimate.clip import lay_iuv
from motion_transfer.estimate.interface import LANDMARK
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.people import Camera, PeopleStream, load_body_model
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.photo import PersonPhoto, take_photo
from motion_transfer.tracking import track_clip
from motion_transfer.tracking.landmarks import posed_places
from motion_transfer.training.iuv.trainer import score_iuv

SIZE = (384, 512)
CAMERA = Camera(*SIZE, 560.0, 3.4, (0.0, 0.0, 0.9))
CLIPS = ("walk", "dance", "turntable")
RATE = 30
EXCHANGED = 0.4  # of a body or a trunk: more than borders
HIPS = [LANDMARK["left-hip"], LANDMARK["right-hip"]]


def main() -> None:
    parser = argparse.ArgumentParser(description="Bodies fitted to clips.")
    parser.add_argument("--people", type=int, default=4)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--heavy", action="store_true", help="look with blazepose-heavy")
    parser.add_argument("--pictures", type=Path, help="write photos, painted and fitted IUV here")
    options = parser.parse_args()
    print(f"{'':12}{'':9}{'parts':>7}{'IoU':>7}{'U, V':>7}{'swapped':>9}{'turned':>8}{'cm':>6}")
    totals: dict[str, list[np.ndarray]] = {"painted": [], "fitted": []}
    for name in CLIPS:
        results = [score_clip(name, number, options) for number in range(options.people)]
        for way, kept in totals.items():
            rows = np.concatenate([result[way] for result in results])
            kept.append(rows)
            show(name, way, rows, [result["away"] for result in results])
        print(
            f"{'':12}{np.mean([result['ms'] for result in results]):.0f} ms of CPU a frame to fit"
        )
    for way, kept in totals.items():
        show("all", way, np.concatenate(kept), [])


def show(name: str, way: str, rows: np.ndarray, away: list[float]) -> None:
    """Print means, and in how many frames sides are exchanged."""
    iou, parts, uv = np.nanmean(rows[:, :3], axis=0)
    swapped, turned = (rows[:, 3:] > EXCHANGED).sum(0)
    centimetres = f"{np.mean(away):6.1f}" if away and way == "fitted" else ""
    print(
        f"{name:12}{way:9}{parts:7.3f}{iou:7.3f}{uv:7.3f}{swapped:9}{turned:8}{centimetres}"
        f"  of {len(rows)} frames"
    )


def score_clip(name: str, number: int, options: argparse.Namespace) -> dict:
    """Film somebody; paint and fit; compare."""
    model = load_body_model()
    photos, places = film(name, number, options.frames)
    with tempfile.TemporaryDirectory() as folder:
        for index, photo in enumerate(photos):
            cv2.imwrite(f"{folder}/{index:03d}.png", photo.rgb[..., ::-1])
        began = time.process_time()
        painter = BlazePoseEstimator(heavy=options.heavy, most_people=1)
        painted = [lay_iuv(painter.estimate(p.rgb), *p.rgb.shape[:2]) for p in photos]
        painting = time.process_time() - began
        began = time.process_time()
        again = BlazePoseEstimator(heavy=options.heavy, most_people=1)
        track = track_clip(open_pictures(Path(folder)), again)
        seconds = time.process_time() - began - painting
    fitted = [track.iuv(index, model) for index in range(len(track))]
    if options.pictures:
        options.pictures.mkdir(parents=True, exist_ok=True)
        rows = zip(photos, painted, fitted, strict=True)
        sheet = [
            np.vstack([photo.rgb[..., ::-1], coloured(first), coloured(second)])
            for photo, first, second in list(rows)[:: max(1, options.frames // 8)]
        ]
        cv2.imwrite(str(options.pictures / f"{name}-{number}.png"), np.hstack(sheet))
    marks = track.puppet.place(track.postures).landmarks
    (axes,) = {shot.camera.axes.tobytes(): shot.camera.axes for shot in track.shots}.values()
    found, true = seen(marks, axes), seen(places, CAMERA.axes)
    scale = (found * true).sum() / (found * found).sum()  # how large somebody is no picture tells
    return {
        "painted": score(painted, photos),
        "fitted": score(fitted, photos),
        "away": 100 * float(np.linalg.norm(found * scale - true, axis=-1).mean()),
        "ms": 1e3 * seconds / len(photos),
    }


def film(name: str, number: int, frames: int) -> tuple[list[PersonPhoto], np.ndarray]:
    """Photograph a held-out person's motion, and tell where the landmarks truly are, metres."""
    people, model, motion = PeopleStream(split="held-out"), load_body_model(), MOTIONS[name]
    dressed, shot = people.dress(number), people.shot(number, 0)
    photos, places = [], []
    for frame in range(frames):
        pose = motion.pose(frame / (RATE * motion.seconds))
        photos.append(
            take_photo(dressed, replace(shot, pose=pose, seed=frame), SIZE, camera=CAMERA)
        )
        places.append(posed_places(dressed.posed(pose), model))
    return photos, np.stack(places)


def seen(places: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Landmarks in a camera's axes, from the middle of the hips."""
    return (places - places[:, HIPS].mean(1, keepdims=True)) @ axes.T


def score(found: list[np.ndarray], photos: list[PersonPhoto]) -> np.ndarray:
    """IoU, parts, U and V, and what is exchanged, for each frame."""
    pairs = zip(found, photos, strict=True)
    return np.array([list(vars(score_iuv(iuv, photo.iuv)).values()) for iuv, photo in pairs])


def coloured(iuv: np.ndarray) -> np.ndarray:
    """IUV for eyes."""
    return np.stack([iuv[..., 0] * 10, iuv[..., 1], iuv[..., 2]], -1).astype(np.uint8)


if __name__ == "__main__":
    main()
