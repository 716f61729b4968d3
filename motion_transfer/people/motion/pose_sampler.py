"""Poses as people take them in photos and videos, seen from all sides.

A pose is drawn as legs that reach the floor, a trunk, two arms, and a turn of the whole body. What
one arm does is a gesture: ranges of angles to draw from. Everything comes out of the generator that
is passed in. Ranges and shares were chosen by eye.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from motion_transfer.people.motion.motions import walk_pose
from motion_transfer.people.motion.poses import Arm, Bend, Leg, Pose, clamped, mirrored
from motion_transfer.people.motion.stances import Foot, standing

Rng = np.random.Generator

_ANGLES = ("swing", "abduction", "turn_out", "elbow", "pronation", "wrist", "wrist_side")


@dataclass(frozen=True)
class Gesture:
    """One arm's place.

    Arms whose hand rests on the body were solved for the shape in the middle of all ranges: wrist
    and knuckles at the place named, the palm towards it; `touch` lets `untangled` fit them to
    other shapes.

    Attributes:
        angles: Degrees, in the order of `Arm`'s first seven.
        spread: Standard deviation, degrees: one for all, or seven.
        curl: Lowest and highest of the fingers.
        touch: The part of the body that the hand rests on; `.S` stands for the hand's own side,
            `.O` for the other.
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
    "on_thigh": Gesture((-12, 13, -19, 82, 72, -17, 0), 3.0, (0.15, 0.35), "thigh.S"),
    "on_knee": Gesture((12, 7, -16, 77, 72, -10, 0), 3.0, (0.2, 0.45), "thigh.S"),
    "lap": Gesture((2, 22, -58, 80, 58, -18, 0), 2.5, (0.3, 0.5), "thigh.S"),
    "floor_behind": Gesture((-46, 10, 50, 4, -15, -62, 0), (3, 4, 6, 3, 8, 4, 4), (0.0, 0.15)),
}


def draw_arm(rng: Rng, name: str) -> Arm:
    """Draw one arm near a gesture; it may leave the joints' limits slightly."""
    gesture = GESTURES[name]
    # cut at two deviations: a gesture stays itself
    noise = np.clip(rng.standard_normal(7), -2, 2) * gesture.spread
    values = np.radians(np.asarray(gesture.angles) + noise)
    return Arm(**dict(zip(_ANGLES, values.tolist(), strict=True)), curl=rng.uniform(*gesture.curl))


def touches(name: str, side: str) -> tuple[tuple[str, str], ...]:
    """Name what the hand on a side (`L` or `R`) rests on, for `Pose.touches`."""
    other = "R" if side == "L" else "L"
    part = GESTURES[name].touch.replace(".S", f".{side}").replace(".O", f".{other}")
    return ((f"hand.{side}", part),) if part else ()


NEAR_FRONT, NEAR_BACK = 0.45, 0.15  # shares of the poses; the rest is seen from the sides
SIDEWAYS = np.radians(35)  # how far off the camera still counts as front or back


def _between(rng: Rng, low: float, high: float) -> float:
    """Draw an angle, radians, evenly from a range in degrees."""
    return float(np.radians(rng.uniform(low, high)))


def _normal(rng: Rng, middle: float, spread: float) -> float:
    """Draw an angle, radians, about a middle in degrees, cut at two deviations."""
    return float(np.radians(middle + spread * np.clip(rng.standard_normal(), -2, 2)))


def _bend(rng: Rng, forward: float, side: float, turn: float, middle: float = 0.0) -> Bend:
    """Draw each angle with that spread, in degrees, about 0, or forward about `middle`."""
    return Bend(_normal(rng, middle, forward), _normal(rng, 0, side), _normal(rng, 0, turn))


def _one_of(rng: Rng, names: str) -> str:
    return str(rng.choice(names.split()))


def _arms(rng: Rng, pose: Pose, left: str, right: str) -> Pose:
    return replace(
        pose,
        left_arm=draw_arm(rng, left),
        right_arm=draw_arm(rng, right),
        touches=touches(left, "L") + touches(right, "R"),
    )


def sample_turn(rng: Rng) -> float:
    """Draw the whole body's turn, radians: more often near the front than by chance."""
    share = rng.random()
    if share < NEAR_FRONT:
        return rng.uniform(-SIDEWAYS, SIDEWAYS)
    if share < NEAR_FRONT + NEAR_BACK:
        return float(np.pi + rng.uniform(-SIDEWAYS, SIDEWAYS))
    return float(rng.choice([-1, 1]) * rng.uniform(SIDEWAYS, np.pi - SIDEWAYS))


def _even(rng: Rng) -> Pose:
    """Rest the weight on both feet."""
    pelvis = _bend(rng, 2, 1, 3)
    out, toes = rng.uniform(-0.05, 0.1), _between(rng, 2, 20)
    left = Foot(rng.uniform(-0.04, 0.04), out, 0.0, toes)
    right = Foot(rng.uniform(-0.04, 0.04), out, 0.0, toes + _normal(rng, 0, 3))
    sink = rng.uniform(0.0, 0.0015)
    return standing(left, right, pelvis, sink=sink, spine=_bend(rng, 3, 2, 4))


def _contrapposto(rng: Rng) -> Pose:
    """Rest the weight on the left leg: hip high, shoulder low there, the other knee soft."""
    tilt = _between(rng, 3, 8)
    pelvis = Bend(_normal(rng, 3, 2), -tilt, _normal(rng, 0, 5))
    shift = rng.uniform(0.02, 0.09)
    left = Foot(0.0, -shift, 0.0, _between(rng, 3, 18))
    right = Foot(
        rng.uniform(-0.04, 0.13),
        shift + rng.uniform(-0.08, 0.1),
        _between(rng, 0, 20) if rng.random() < 0.35 else 0.0,
        _between(rng, 5, 35),
    )
    # the trunk bends back over the leg that carries it
    spine = Bend(_normal(rng, 0, 3), tilt * rng.uniform(1.0, 1.5), _normal(rng, 0, 6))
    return standing(left, right, pelvis, spine=spine)


def _crossed_legs(rng: Rng) -> Pose:
    """Set one foot down in front of and beyond the other."""
    pelvis = Bend(_normal(rng, 1, 2), _normal(rng, -3, 2), _normal(rng, 0, 5))
    left = Foot(-0.03, -0.1, 0.0, _between(rng, 5, 15))
    lifted = _between(rng, 0, 45) if rng.random() < 0.5 else 0.0
    right = Foot(rng.uniform(0.16, 0.24), -rng.uniform(0.2, 0.27), lifted, _between(rng, 0, 15))
    return standing(left, right, pelvis, sink=0.002, spine=_bend(rng, 3, 4, 5))


def _wide(rng: Rng) -> Pose:
    """Stand with the feet apart."""
    pelvis = _bend(rng, 3, 2, 5)
    out = rng.uniform(0.12, 0.3)
    left = Foot(rng.uniform(-0.1, 0.1), out, 0.0, _between(rng, 8, 30))
    right = Foot(rng.uniform(-0.1, 0.1), out, 0.0, _between(rng, 8, 30))
    sink = rng.uniform(0.0, 0.01)
    return standing(left, right, pelvis, sink=sink, spine=_bend(rng, 4, 4, 6))


def _standing(rng: Rng) -> Pose:
    """Stand as people do who wait: arms down, now and then a hand in a pocket."""
    pose = (_even if rng.random() < 0.45 else _contrapposto)(rng)
    left = _one_of(rng, "hanging hanging hanging ready behind_hip")
    right = left if rng.random() < 0.6 else _one_of(rng, "hanging ready bent pocket")
    return replace(_arms(rng, pose, left, right), head=_bend(rng, 5, 4, 12))


_BOTH = ("clasped clasped", "behind behind", "low_cross low_cross", "crossed_inner crossed_outer")
_PAIRED = (*_BOTH, "hip_forward hip_forward", "hip_back hip_back", "pocket pocket")
_ON_BODY = (
    "hip_forward hip_forward hip_back fist_on_hip pocket pocket back_pocket chin cheek hair hair"
    " brow nape heart hold_elbow hold_upper_arm palm_up"
)


def _fashion(rng: Rng) -> Pose:
    """Stand as models do: a hand on the body, often a look aside."""
    pose = (_even, _contrapposto, _contrapposto, _crossed_legs, _wide)[rng.integers(5)](rng)
    if rng.random() < 0.35:
        left, right = _PAIRED[rng.integers(len(_PAIRED))].split()
    else:
        left = _one_of(rng, _ON_BODY)
        right = _one_of(rng, "hanging hanging ready behind_hip hip_back pocket")
    pose = _arms(rng, pose, left, right)
    if (left, right) == ("clasped", "clasped"):
        pose = replace(pose, touches=(("hand.L", "hand.R"),))
    aside = _between(rng, 15, 55) * rng.choice([-1, 1]) if rng.random() < 0.45 else 0.0
    if left in ("chin", "cheek", "hair", "brow", "nape"):
        aside *= 0.3  # the hand was placed for a head that looks ahead
    head = _bend(rng, 5, 5, 8)
    return replace(pose, head=replace(head, turn=head.turn + aside))


def _walking(rng: Rng) -> Pose:
    """Walk, at any speed and instant."""
    pose = walk_pose(rng.random(), round(rng.uniform(0.8, 1.4), 1), rng.uniform(0.6, 1.5))
    if rng.random() < 0.2:  # one hand busy
        name = _one_of(rng, "pocket bent greeting hip_back hair")
        pose = replace(pose, left_arm=draw_arm(rng, name), touches=touches(name, "L"))
    head = _bend(rng, 4, 3, 14)
    return replace(pose, head=head, offset=(0.0, 0.0, 0.0))


def _arms_up(rng: Rng) -> Pose:
    """Stand with one arm raised or both."""
    pose = (_even, _contrapposto, _wide)[rng.integers(3)](rng)
    raised = "up_side up_front up_bent over_head greeting fist_up"
    left = _one_of(rng, raised)
    if rng.random() < 0.5:
        right = left if rng.random() < 0.5 else _one_of(rng, raised)
    else:
        right = _one_of(rng, "hanging ready hip_forward hip_back pocket out")
    head = _bend(rng, 7, 5, 14, middle=-5)
    return replace(_arms(rng, pose, left, right), head=head)


def _on_chair(rng: Rng) -> Pose:
    """Sit on something as high as a chair or a stool."""
    pelvis = Bend(_normal(rng, -4, 6), 0.0, _normal(rng, 0, 3))
    height = rng.uniform(0.47, 0.6)  # of the hips above the ankles, legs
    apart, toes = rng.uniform(-0.02, 0.16), _between(rng, 0, 20)
    feet = [Foot(rng.uniform(0.36, 0.6), apart + rng.uniform(-0.03, 0.03), 0.0, toes) for _ in "LR"]
    spine = Bend(_normal(rng, 7, 7), _normal(rng, 0, 3), _normal(rng, 0, 5))
    pose = standing(feet[0], feet[1], pelvis, height=height, spine=spine)
    if rng.random() < 0.25:  # one knee over the other
        over = Leg(
            _between(rng, 98, 106), _between(rng, -22, -16), 0.0, _between(rng, 72, 95), -0.3
        )
        pose = replace(pose, left_leg=over)
    left = _one_of(rng, "on_thigh on_thigh lap bent chin")
    right = left if left != "chin" and rng.random() < 0.6 else _one_of(rng, "on_thigh lap ready")
    if rng.random() < 0.25:  # leaning on the knees
        left = right = "on_knee"
        pose = replace(pose, spine=replace(pose.spine, forward=_between(rng, 16, 34)))
    return replace(_arms(rng, pose, left, right), head=_bend(rng, 6, 5, 16))


def _knee_up(knee: float) -> Leg:
    """Bend a leg so that its sole is on the floor that the person sits on.

    The hip joint is 0.05 legs higher above the floor than a flat foot's ankle.
    """
    hip = knee / 2 + np.arccos(0.05 / (2 * np.cos(knee / 2)))
    return Leg(float(hip), 0.12, 0.05, knee, float(knee - hip))


def _on_floor(rng: Rng) -> Pose:
    """Sit on the floor: cross-legged, legs out, knees up, or on the heels."""
    shape = rng.integers(4)
    if shape == 0:  # cross-legged, solved for: shins crossed but apart, near the floor
        legs = [
            Leg(_normal(rng, hip, 1), np.radians(out), np.radians(59), np.radians(knee), -0.35)
            for hip, out, knee in ((113, 36, 113), (114, 39, 136))
        ]
    elif shape == 1:  # legs out in front, one knee up perhaps
        ranges = ((84, 90), (4, 16), (5, 20), (2, 12))
        legs = [Leg(*(_between(rng, *each) for each in ranges), ankle=-0.3) for _ in "LR"]
        if rng.random() < 0.6:
            legs[0] = _knee_up(_between(rng, 60, 105))
    elif shape == 2:  # knees up
        knee = _between(rng, 70, 105)
        legs = [_knee_up(knee), _knee_up(knee + _normal(rng, 0, 3))]
    else:  # on the heels
        hip = _between(rng, 46, 52)
        legs = [Leg(hip, _between(rng, 4, 14), 0.0, np.radians(138), np.radians(-48)) for _ in "LR"]
    leaning = shape in (1, 2) and rng.random() < 0.5  # back, on the hands
    pelvis = Bend(_normal(rng, -18, 3) if leaning else _normal(rng, -8, 4))
    spine = Bend(_normal(rng, -4, 3) if leaning else _normal(rng, 16, 6), 0.0, _normal(rng, 0, 5))
    pose = Pose(left_leg=legs[0], right_leg=legs[1], pelvis=pelvis, spine=spine)
    left = right = "floor_behind"
    if not leaning:
        left, right = _one_of(rng, "ready on_knee on_thigh"), _one_of(rng, "ready on_knee on_thigh")
    pose = replace(_arms(rng, pose, left, right), head=_bend(rng, 6, 5, 16))
    # legs that are crossed or drawn up are not where a hand was solved to rest on them
    return pose if shape in (1, 3) else replace(pose, touches=())


def _sitting(rng: Rng) -> Pose:
    return (_on_chair if rng.random() < 0.65 else _on_floor)(rng)


def _lunge(rng: Rng) -> Pose:
    """Step far forward."""
    pelvis = _bend(rng, 4, 3, 8, middle=4)
    front = Foot(rng.uniform(0.2, 0.5), rng.uniform(-0.05, 0.12), 0.0, _between(rng, 0, 25))
    behind, out = rng.uniform(0.35, 0.6), rng.uniform(-0.05, 0.12)
    back = Foot(-behind, out, _between(rng, 25, 50), _between(rng, 0, 20))
    return standing(front, back, pelvis, sink=rng.uniform(0.01, 0.1))


def _side_lunge(rng: Rng) -> Pose:
    """Step far to the side, deep on the left leg."""
    pelvis = _bend(rng, 4, 4, 6, middle=7)
    bent = Foot(rng.uniform(0, 0.12), rng.uniform(0.15, 0.35), 0.0, _between(rng, 20, 40))
    long = Foot(rng.uniform(-0.05, 0.1), rng.uniform(0.4, 0.58), 0.0, _between(rng, 8, 25))
    return standing(bent, long, pelvis, sink=rng.uniform(0.005, 0.05))


def _kick(rng: Rng) -> Pose:
    """Stand on the right foot, the left leg in the air: in front, aside, bent, or behind."""
    pelvis = _bend(rng, 4, 4, 6)
    heel = _between(rng, 0, 40) if rng.random() < 0.4 else 0.0
    point = _between(rng, -48, -20)
    shape = rng.integers(4)
    if shape == 0:
        leg = Leg(_between(rng, 45, 100), _between(rng, -5, 20), 0.2, _between(rng, 2, 25), point)
        pelvis = replace(pelvis, forward=_between(rng, -22, -6))
    elif shape == 1:
        leg = Leg(_between(rng, 0, 30), _between(rng, 32, 58), 0.5, _between(rng, 2, 25), point)
        pelvis = replace(pelvis, side=_between(rng, -18, -8))
    elif shape == 2:
        leg = Leg(_between(rng, 55, 85), _between(rng, 18, 45), 0.6, _between(rng, 80, 112), point)
    else:
        leg = Leg(_between(rng, -30, -18), 0.1, 0.2, _between(rng, 5, 75), point)
        pelvis = replace(pelvis, forward=_between(rng, 8, 26))
    foot = Foot(0.0, -0.1, heel, 0.2)
    pose = standing(Foot(), foot, sink=rng.uniform(0.001, 0.02))
    return replace(pose, left_leg=leg, pelvis=pelvis)


def _groove(rng: Rng) -> Pose:
    """Sway on soft knees."""
    pelvis = _bend(rng, 5, 7, 12, middle=4)
    feet = [
        Foot(
            rng.uniform(-0.15, 0.2),
            rng.uniform(0.0, 0.2),
            _between(rng, 0, 40) if rng.random() < 0.5 else 0.0,
            _between(rng, 5, 40),
        )
        for _ in "LR"
    ]
    return standing(feet[0], feet[1], pelvis, sink=rng.uniform(0.01, 0.09))


def _dancing(rng: Rng) -> Pose:
    """Take a dancer's step, the arms anywhere, now and then in the air."""
    pose = (_lunge, _side_lunge, _kick, _groove)[rng.integers(4)](rng)
    free = "out up_side up_front up_bent over_head forward across back bent out up_side"
    pose = _arms(rng, pose, _one_of(rng, free), _one_of(rng, f"{free} hip_forward ready"))
    bend = pose.pelvis
    spine = Bend(  # balance is kept by bending back what the pelvis does
        _normal(rng, 0, 8) - 0.6 * bend.forward,
        _normal(rng, 0, 9) - 1.1 * bend.side,
        _normal(rng, 0, 10) - bend.turn,
    )
    jump = rng.uniform(0.06, 0.3) if rng.random() < 0.15 else 0.0
    head = _bend(rng, 10, 8, 18)
    return replace(pose, spine=spine, head=head, offset=(0.0, 0.0, float(jump)))


_SHARES: dict[str, tuple[Callable[[Rng], Pose], float]] = {
    "standing": (_standing, 0.26),
    "fashion": (_fashion, 0.28),
    "walking": (_walking, 0.12),
    "arms_up": (_arms_up, 0.1),
    "sitting": (_sitting, 0.1),
    "dancing": (_dancing, 0.14),
}
KINDS = tuple(_SHARES)


def sample_pose(rng: Rng, kind: str | None = None) -> Pose:
    """Draw a pose, every angle inside its limits; limbs may still meet: see `untangled`.

    Args:
        rng: The only source of randomness.
        kind: One of `KINDS`; None draws one, standing and fashion most often.
    Raises: ValueError for an unknown kind.
    """
    if kind is None:
        kind = str(rng.choice(KINDS, p=[share for _, share in _SHARES.values()]))
    if kind not in _SHARES:
        raise ValueError(f"unknown kind of pose {kind!r}; there are {', '.join(KINDS)}")
    pose = _SHARES[kind][0](rng)
    if rng.random() < 0.5:
        pose = mirrored(pose)
    turn = sample_turn(rng)
    head = pose.head
    if abs(turn) < np.radians(75) and rng.random() < 0.5:  # people look at the camera
        head = replace(head, turn=head.turn - 0.6 * turn)
    return clamped(replace(pose, turn=turn, head=head))
