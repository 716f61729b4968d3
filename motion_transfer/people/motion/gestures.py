"""What one arm does, as ranges of angles to draw from.

Degrees, in the order of `Arm`'s first seven angles; `spread` is how far each may be off. Arms whose
hand rests on the body were solved for the shape in the middle of all ranges: the wrist and the
knuckles at the place named, the palm towards it; `touch` lets `untangled` fit them to other shapes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motion_transfer.people.motion.poses import Arm

NAMES = ("swing", "abduction", "turn_out", "elbow", "pronation", "wrist", "wrist_side")


@dataclass(frozen=True)
class Gesture:
    """One arm's place.

    Attributes:
        angles: seven, degrees.
        spread: standard deviation, degrees: one for all, or seven.
        curl: lowest and highest of the fingers.
        touch: the part of the body that the hand rests on; `.O` stands for the other side.
    """

    angles: tuple[float, ...]
    spread: float | tuple[float, ...] = 4.0
    curl: tuple[float, float] = (0.2, 0.45)
    touch: str = ""


GESTURES: dict[str, Gesture] = {
    # free
    "hanging": Gesture((2, 11, -10, 16, 28, 2, 0), (6, 3, 8, 8, 16, 6, 5)),
    "ready": Gesture((0, 22, -12, 38, 22, 0, 0), (10, 6, 10, 16, 18, 8, 5)),
    "behind_hip": Gesture((-22, 16, -10, 24, 20, 0, 0), (7, 5, 10, 10, 18, 8, 5)),
    "bent": Gesture((18, 14, -20, 82, 10, 0, 0), (12, 6, 14, 18, 30, 12, 6)),
    "palm_up": Gesture((12, 26, 10, 76, -52, -8, 0), (10, 8, 12, 14, 14, 10, 5), (0.1, 0.35)),
    "out": Gesture((4, 84, 10, 16, 8, -4, 0), (12, 18, 22, 14, 24, 12, 6), (0.0, 0.4)),
    "forward": Gesture((84, 6, -8, 16, 20, -6, 0), (18, 12, 14, 14, 30, 14, 6), (0.0, 0.4)),
    "across": Gesture((62, -8, -22, 44, 14, 0, 0), (16, 10, 14, 22, 20, 12, 6), (0.1, 0.5)),
    "back": Gesture((-38, 24, -10, 14, 20, 0, 0), (8, 10, 12, 12, 20, 12, 6), (0.1, 0.5)),
    # up
    "up_side": Gesture((6, 146, 26, 16, 8, 0, 0), (8, 14, 22, 12, 24, 10, 6), (0.0, 0.45)),
    "up_front": Gesture((154, 8, -6, 14, 8, 0, 0), (12, 8, 14, 12, 24, 10, 6), (0.0, 0.45)),
    "up_bent": Gesture((10, 112, 68, 74, 10, 0, 0), (10, 14, 12, 20, 24, 12, 6), (0.0, 0.8)),
    "over_head": Gesture((8, 150, 70, 62, 0, 0, 0), (6, 8, 10, 12, 20, 10, 6), (0.0, 0.4)),
    "greeting": Gesture((22, 74, 66, 96, 24, -6, 0), (10, 12, 10, 16, 16, 10, 10), (0.0, 0.3)),
    "fist_up": Gesture((14, 128, 40, 52, 20, 0, 0), (8, 12, 16, 18, 20, 8, 5), (0.9, 1.0)),
    # hands on the body
    "hip_forward": Gesture((-30, 39, -61, 86, 16, -63, 0), 2.5, (0.1, 0.35), "hips"),
    "hip_back": Gesture((0, 44, -73, 83, 0, 72, 0), 2.5, (0.15, 0.4), "hips"),
    "fist_on_hip": Gesture((-24, 48, -58, 91, 21, 10, -7), 2.5, (0.8, 1.0), "hips"),
    "pocket": Gesture((-13, 31, -54, 64, -47, -13, 0), 2.5, (0.15, 0.35), "hips"),
    "back_pocket": Gesture((-44, 11, -21, 64, -72, -15, -27), 2.0, (0.1, 0.3), "hips"),
    "chin": Gesture((47, -5, -30, 127, -62, 28, 0), 1.5, (0.4, 0.8), "head"),
    "cheek": Gesture((69, 19, -44, 140, 38, -43, 0), 1.5, (0.15, 0.5), "head"),
    "hair": Gesture((175, 66, -70, 142, -36, -23, 0), 2.0, (0.2, 0.5), "head"),
    "brow": Gesture((131, 60, -76, 131, -72, -18, 0), 1.5, (0.0, 0.15), "head"),
    "nape": Gesture((26, 108, 79, 148, 2, -41, 18), 1.5, (0.1, 0.4), "head"),
    "heart": Gesture((7, 25, -31, 121, -53, 60, 0), 2.5, (0.1, 0.35), "shoulders"),
    "clasped": Gesture((9, 7, -58, 42, -4, 20, 0), 1.5, (0.4, 0.6)),
    "behind": Gesture((-30, 19, -73, 63, 26, -1, 18), 1.5, (0.3, 0.5)),
    "crossed_inner": Gesture((16, 9, -65, 102, -26, 33, 0), 1.5, (0.2, 0.4), "chest"),
    "crossed_outer": Gesture((25, 6, -58, 90, -38, 41, 0), 1.5, (0.2, 0.4), "upperarm.O"),
    "low_cross": Gesture((12, 2, -62, 66, -14, 28, 0), 2.0, (0.2, 0.45)),
    "hold_elbow": Gesture((8, 1, -60, 82, -25, 38, 0), 2.0, (0.3, 0.5), "belly"),
    "hold_upper_arm": Gesture((16, -5, -71, 85, -14, 43, 18), 1.5, (0.3, 0.5), "upperarm.O"),
    # sitting
    "on_thigh": Gesture((-12, 13, -19, 82, 72, -17, 0), 3.0, (0.15, 0.35), "thigh"),
    "on_knee": Gesture((12, 7, -16, 77, 72, -10, 0), 3.0, (0.2, 0.45), "thigh"),
    "lap": Gesture((2, 22, -58, 80, 58, -18, 0), 2.5, (0.3, 0.5), "thigh"),
    "floor_behind": Gesture((-46, 10, 50, 4, -15, -62, 0), (3, 4, 6, 3, 8, 4, 4), (0.0, 0.15)),
}


def drawn(rng: np.random.Generator, name: str) -> Arm:
    """One arm near a gesture; it may leave the joints' limits slightly."""
    gesture = GESTURES[name]
    # cut at two deviations: a gesture stays itself
    noise = np.clip(rng.standard_normal(7), -2, 2) * gesture.spread
    values = np.radians(np.asarray(gesture.angles) + noise)
    return Arm(
        **dict(zip(NAMES, values.tolist(), strict=True)),
        curl=float(rng.uniform(*gesture.curl)),
    )


def touches(name: str, side: str) -> tuple[tuple[str, str], ...]:
    """What the hand on a side (`L` or `R`) rests on, for `Pose.touches`."""
    part = GESTURES[name].touch
    if not part:
        return ()
    other = "R" if side == "L" else "L"
    if part.endswith(".O"):
        part = part.replace(".O", f".{other}")
    elif part in ("thigh", "upperarm"):
        part = f"{part}.{side}"
    return ((f"hand.{side}", part),)
