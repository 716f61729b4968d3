"""Write down what MediaPipe itself finds, for tests/reference/blazepose_landmarks.json.

Needs an environment of its own, since mediapipe wants other versions of what this project uses:

    python -m venv mp && mp/bin/pip install mediapipe==0.10.14
    mp/bin/python tools/build_blazepose_reference.py NAME=FILE[:LEFT,TOP,RIGHT,BOTTOM] ...

Each picture is looked at on its own (`static_image_mode`); one whose name ends in `-clip` is also
shown as a clip of frames that wander over it, so that tracking is written down too, and its mask is
kept, small: give such names to pictures in the public domain only.
"""

from __future__ import annotations

import json
import sys
import types
from pathlib import Path

import numpy as np

for name in ("sounddevice", "jax", "jaxlib"):  # imported by parts of mediapipe not used here
    if name not in sys.modules:
        sys.modules[name] = types.ModuleType(name)

import cv2  # noqa: E402
import mediapipe  # type: ignore[import-not-found]  # noqa: E402

OUTPUT = Path(__file__).parents[1] / "tests/reference/blazepose_landmarks.json"
MASK_SIDE = 32  # enough to see where the mask lies, and small in the repository
CLIP_SHIFTS = [(0, 0), (4, 2), (9, 3), (13, 6), (16, 10), (18, 13)]


def main(arguments: list[str]) -> None:
    found = {}
    for argument in arguments:
        name, _, place = argument.partition("=")
        path, _, crop = place.partition(":")
        picture = cv2.imread(path)[..., ::-1]
        if crop:
            left, top, right, bottom = (int(side) for side in crop.split(","))
            picture = picture[top:bottom, left:right]
        entry = {"file": Path(path).name, "crop": [int(side) for side in crop.split(",") if side]}
        frames = [np.ascontiguousarray(picture)]
        entry["still"] = watch(frames, still=True)[0]
        if entry["still"] and not name.endswith("-clip"):
            del entry["still"]["mask"]
        if name.endswith("-clip"):
            frames = [np.ascontiguousarray(picture[y:, x:]) for x, y in CLIP_SHIFTS]
            size = min(f.shape[0] for f in frames), min(f.shape[1] for f in frames)
            frames = [np.ascontiguousarray(f[: size[0], : size[1]]) for f in frames]
            entry["shifts"] = CLIP_SHIFTS
            entry["clip"] = watch(frames, still=False)
            for seen in entry["clip"]:
                del seen["mask"]
        found[name] = entry
    text = json.dumps(found, separators=(",", ":")).replace('},"', '},\n"')
    OUTPUT.write_text(text + "\n", encoding="utf-8")


def watch(frames: list[np.ndarray], *, still: bool) -> list[dict | None]:
    """Look at frames, each on its own (`still`) or as a clip; None where nobody is."""
    pose = mediapipe.solutions.pose.Pose(
        static_image_mode=still,
        model_complexity=1,  # the full model, the one that this project fetches
        smooth_landmarks=False,
        enable_segmentation=True,
        smooth_segmentation=False,
        min_detection_confidence=0.5,
    )
    return [describe(pose.process(frame), *frame.shape[:2]) for frame in frames]


def describe(result, height: int, width: int) -> dict | None:
    """Write down one frame's person: pixels, metres, visibility, and the mask in 100 levels."""
    if result.pose_landmarks is None:
        return None
    image = [[p.x * width, p.y * height, p.z * width] for p in result.pose_landmarks.landmark]
    world = [[p.x, p.y, p.z] for p in result.pose_world_landmarks.landmark]
    visibility = [p.visibility for p in result.pose_landmarks.landmark]
    mask = result.segmentation_mask
    small = cv2.resize(mask, (MASK_SIDE, MASK_SIDE), interpolation=cv2.INTER_AREA)
    return {
        "image_px": np.round(image, 2).tolist(),
        "world_metres": np.round(world, 4).tolist(),
        "visibility": np.round(visibility, 4).tolist(),
        "mask_area_px": round(float(mask.sum()), 1),
        "mask": np.rint(small * 99).astype(int).tolist(),
    }


if __name__ == "__main__":
    main(sys.argv[1:])
