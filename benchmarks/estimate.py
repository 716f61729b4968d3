"""How near the IUV of raw photos comes to DensePose's, and how fast.

    MT_SAMPLES=folder .venv/bin/python benchmarks/estimate.py [--weights FILE] [--pictures OUT]

The folder holds real photos with DensePose's own IUV: `deepfashion/*.png` with `*_iuv.png` beside
them, and `densepose_demo/demo_im.jpg` with `demo_im_IUV.png`, of which one person is taken.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import cv2
import numpy as np

from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.interface import PersonEstimate
from motion_transfer.estimate.iuv.network import load_shipped, load_weights
from motion_transfer.training.iuv.trainer import IuvScore, score_iuv

MAN = (slice(170, 460), slice(170, 290))
"""Rows and columns of one person of the street."""

GOALS = IuvScore(iou=0.87, part_agreement=0.86, uv_error=0.06, swapped=0.0, turned=0.0)
FRAMES = 60


def photos(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--pictures", type=Path, help="write photo, DensePose's and our IUV here")
    options = parser.parse_args()
    network = load_weights(options.weights) if options.weights else load_shipped()
    estimator = BlazePoseEstimator(network=network, most_people=1)
    names = list(IuvScore.__dataclass_fields__)
    print(f"{'':16}" + "".join(f"{name:>16}" for name in names))
    scores = []
    for name, (photo, true) in photos(Path(os.environ["MT_SAMPLES"])).items():
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
    time_frames(estimator, photo)


def time_frames(estimator: BlazePoseEstimator, photo: np.ndarray) -> None:
    """Frames a second, one person, one frame after the other."""
    frame = cv2.copyMakeBorder(photo, 50, 50, 200, 200, cv2.BORDER_REPLICATE)
    estimator.start_shot()
    estimator.estimate(frame)
    wall, cpu = time.perf_counter(), time.process_time()
    for index in range(FRAMES):
        estimator.estimate(np.roll(frame, index % 5, axis=1))
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    print(
        f"{frame.shape[1]} x {frame.shape[0]}: {FRAMES / wall:.1f} frames/s in one thread of ours;"
        f" {1e3 * cpu / FRAMES:.0f} ms of CPU a frame"
    )


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
