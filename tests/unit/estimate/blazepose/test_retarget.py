"""One person's pose in another person's body: proportions, landmarks, mask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate.blazepose.networks import SeenBody
from motion_transfer.estimate.blazepose.region import Region
from motion_transfer.estimate.blazepose.retarget import (
    BONES,
    LARGEST_CHANGE,
    BodyFit,
    compare_proportions,
    fit_body,
    fit_landmarks,
    measure_proportions,
)
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_COUNT, Landmarks

PX = 200.0
"""Of a metre."""

HIPS = np.array([260.0, 300.0])
BODY = {  # metres from the pelvis: x to the right of the picture, y down, z away; left side
    "shoulder": (0.18, -0.5, 0.0),
    "elbow": (0.32, -0.28, 0.05),
    "wrist": (0.5, -0.4, -0.1),
    "pinky": (0.57, -0.42, -0.12),
    "index": (0.58, -0.46, -0.12),
    "thumb": (0.53, -0.47, -0.13),
    "hip": (0.1, 0.0, 0.0),
    "knee": (0.16, 0.42, -0.08),
    "ankle": (0.14, 0.82, 0.02),
    "heel": (0.13, 0.87, 0.06),
    "foot-index": (0.2, 0.88, -0.12),
    "ear": (0.07, -0.7, 0.0),
    "eye-inner": (0.02, -0.73, -0.1),
    "eye-middle": (0.03, -0.73, -0.1),
    "eye-outer": (0.04, -0.73, -0.09),
    "mouth": (0.02, -0.66, -0.1),
}
LEGS = ("knee", "ankle", "heel", "foot-index")
WHOLE = dict.fromkeys(BONES, 1.0)


def person(**moved: tuple[float, float, float]) -> Landmarks:
    """A standing person; `moved` says where left and right joints are elsewhere."""
    world = np.zeros((LANDMARK_COUNT, 3), np.float32)
    for name, row in LANDMARK.items():
        side = -1 if "right" in name else 1
        kind = "mouth" if "mouth" in name else name.partition("-")[2]
        place = BODY.get(kind, (0.0, -0.7, -0.13))
        world[row] = place * np.array([side, 1, 1])
        if name.replace("-", "_") in moved:
            world[row] = moved[name.replace("-", "_")]
    image = world * PX
    image[:, :2] += HIPS
    sure = np.ones(LANDMARK_COUNT, np.float32)
    return Landmarks(image.astype(np.float32), world, sure, sure)


def with_legs(landmarks: Landmarks, scale: float) -> Landmarks:
    """The same person with other legs; the hips stay where they were."""
    image, world = landmarks.image.copy(), landmarks.world.copy()
    for points in (image, world):
        for side in ("left", "right"):
            rows = [LANDMARK[f"{side}-{joint}"] for joint in LEGS]
            hip = points[LANDMARK[f"{side}-hip"]]
            points[rows] = hip + scale * (points[rows] - hip)
    return replace(landmarks, image=image, world=world)


ENDS = ("shoulder", "hip")


def length(points: np.ndarray, *joints: str) -> float:
    rows = [LANDMARK[joint] for joint in joints]
    return float(np.linalg.norm(points[rows[1]] - points[rows[0]]))


def angle(points: np.ndarray, *joints: str) -> float:
    first, middle, last = (points[LANDMARK[joint]] for joint in joints)
    one, other = first - middle, last - middle
    return float(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))


def trunk(points: np.ndarray) -> float:
    ends = [points[[LANDMARK[f"{s}-{j}"] for s in ("left", "right")]].mean(0) for j in ENDS]
    return float(np.linalg.norm(ends[1] - ends[0]))


def seen_body(landmarks: Landmarks) -> SeenBody:
    """A body whose mask covers each bone as far as a hand's width around it, in a turned region."""
    region = Region(260.0, 300.0, 560.0, 0.2)
    x, y = np.meshgrid(np.arange(256) + 0.5, np.arange(256) + 0.5)
    places = region.to_frame((np.stack([x, y], -1).reshape(-1, 2) / 256).astype(np.float32))
    away = np.full(len(places), np.inf)
    for bones in BONES.values():
        for ends in bones:
            a, b = (landmarks.image[[LANDMARK[n] for n in end], :2].mean(0) for end in ends)
            share = ((places - a) @ (b - a) / ((b - a) @ (b - a))).clip(0, 1)
            away = np.minimum(away, np.linalg.norm(places - a - share[:, None] * (b - a), axis=1))
    mask = (10.5 - away).clip(0, 1).astype(np.float32).reshape(256, 256)
    return SeenBody(0.9, landmarks, region, mask, region, None)


def on_frame(body: SeenBody) -> np.ndarray:
    return body.region.paste(body.mask, Box(0, 0, 520, 600)) > 0.5


def test_a_body_fitted_to_itself_is_unchanged() -> None:
    body = seen_body(person(left_knee=(0.3, 0.3, -0.3)))
    own = measure_proportions([body.landmarks])
    assert own.keys() == BONES.keys()
    fit = compare_proportions(own, own)
    assert fit.scales == pytest.approx(WHOLE)
    fitted = fit_body(body, fit)
    assert fitted.landmarks.image == pytest.approx(body.landmarks.image, abs=1e-4)
    assert fitted.landmarks.world == pytest.approx(body.landmarks.world, abs=1e-6)
    assert fitted.mask == pytest.approx(body.mask, abs=0.01)
    assert fitted.region.side == pytest.approx(body.region.side)


def test_shorter_legs_become_the_sources() -> None:
    source, driver = person(), with_legs(person(), 0.8)
    fit = compare_proportions(measure_proportions([source]), measure_proportions([driver]))
    assert fit.scales["thigh"] / fit.scales["trunk"] == pytest.approx(1.25)
    fitted = fit_landmarks(driver, fit)
    for points, true in ((fitted.world, source.world), (fitted.image, source.image)):
        for joints in (("left-hip", "left-knee"), ("right-knee", "right-ankle")):
            ratio = length(points, *joints) / trunk(points)
            assert ratio == pytest.approx(length(true, *joints) / trunk(true), rel=1e-4)
    # the driver keeps its height, and its feet where they were
    assert np.ptp(fitted.world[:, 1]) == pytest.approx(np.ptp(driver.world[:, 1]), rel=0.03)
    assert fitted.image[:, 1].max() == pytest.approx(driver.image[:, 1].max(), abs=1e-3)


def test_proportions_do_not_depend_on_size_or_pose() -> None:
    source = person()
    waving = person(right_elbow=(-0.32, -0.72, 0.05))
    larger = replace(source, world=source.world * 1.3)
    own = measure_proportions([source])
    assert compare_proportions(measure_proportions([larger]), own).scales == pytest.approx(WHOLE)
    elsewhere = measure_proportions([waving])
    assert elsewhere["upper-arm"] == pytest.approx(own["upper-arm"], rel=1e-5)


FITS = [
    {"thigh": 1.2, "shin": 0.9},
    {"trunk": 0.8, "head": 1.3},
    {"shoulders": 1.3, "hips": 0.8, "upper-arm": 0.75, "lower-arm": 1.1},
]


@pytest.mark.parametrize("scales", FITS)
def test_joint_angles_are_kept(scales: dict[str, float]) -> None:
    driver = person(left_elbow=(0.4, -0.6, -0.2), right_knee=(-0.3, 0.3, -0.25))
    fitted = fit_landmarks(driver, BodyFit(WHOLE | scales))
    for side in ("left", "right"):
        for joints in (("elbow", "wrist", "index"), ("hip", "knee", "ankle")):
            names = [f"{side}-{joint}" for joint in joints]
            for before, after in ((driver.world, fitted.world), (driver.image, fitted.image)):
                assert angle(after, *names) == pytest.approx(angle(before, *names), abs=1e-3)
        upper = f"{side}-shoulder", f"{side}-elbow"
        change = length(fitted.world, *upper) / length(driver.world, *upper)
        assert change == pytest.approx((WHOLE | scales)["upper-arm"], rel=1e-4)


@pytest.mark.parametrize("scales", FITS)
def test_left_stays_left(scales: dict[str, float]) -> None:
    fit = BodyFit(WHOLE | scales)
    turn = np.array([-1, 1, -1])
    for driver in (person(), replace(person(), world=person().world * turn)):
        fitted = fit_landmarks(driver, fit)
        for name in LANDMARK:
            if name.startswith("left-"):
                rows = LANDMARK[name], LANDMARK[name.replace("left", "right")]
                before, after = (
                    points[rows[0], 0] - points[rows[1], 0]
                    for points in (driver.world, fitted.world)
                )
                assert before * after > 0
    # one lifted arm: the other does not move
    waving = person(left_wrist=(0.4, -0.9, 0.0))
    moved = fit_landmarks(waving, fit).world - fit_landmarks(person(), fit).world
    assert np.abs(moved[LANDMARK["left-wrist"]]).max() > 0.1
    assert np.abs(moved[LANDMARK["right-wrist"]]).max() < 1e-6


def test_small_moves_stay_small() -> None:
    """Also where the lowest foot is first one, then the other; and jumps stay as high."""
    fit = BodyFit(WHOLE | {"thigh": 1.2, "shin": 0.8, "trunk": 0.9})
    before, after = person(), person()
    for landmarks, side in ((before, "left"), (after, "right")):
        rows = [LANDMARK[f"{side}-heel"], LANDMARK[f"{side}-foot-index"]]
        landmarks.image[rows, 1] += 0.01
    moved = fit_landmarks(after, fit).image - fit_landmarks(before, fit).image
    assert np.abs(moved).max() < 0.05
    jumping = replace(before, image=before.image - np.array([0, 40, 0], np.float32))
    moved = fit_landmarks(jumping, fit).image - fit_landmarks(before, fit).image
    assert moved == pytest.approx(np.tile([0, -40, 0], (LANDMARK_COUNT, 1)), abs=1e-3)


def test_bones_that_one_of_them_does_not_show_stay_the_drivers() -> None:
    source = person()
    legs = [LANDMARK[f"{s}-{j}"] for s in ("left", "right") for j in ("knee", "ankle")]
    visibility, presence = source.visibility.copy(), source.presence.copy()
    visibility[legs[:2]], presence[legs[2:]] = 0.1, 0.2
    half = measure_proportions([replace(source, visibility=visibility, presence=presence)])
    assert {"thigh", "shin"}.isdisjoint(half)
    driver = measure_proportions([with_legs(person(), 0.8)])
    for pair in ((half, driver), (driver, half)):
        assert compare_proportions(*pair).scales == pytest.approx(WHOLE)


def test_one_side_and_most_frames_are_enough() -> None:
    true = person()
    visibility = true.visibility.copy()
    visibility[[LANDMARK["left-knee"], LANDMARK["left-elbow"]]] = 0
    beside = measure_proportions([replace(true, visibility=visibility)])
    whole = measure_proportions([true])
    assert beside == pytest.approx(whole)
    wrong = replace(true, world=true.world * (1, 2, 1))
    assert measure_proportions([true, wrong, true]) == whole


def test_in_profile_all_but_widths_is_measured() -> None:
    true = person()
    visibility = true.visibility.copy()
    visibility[[row for name, row in LANDMARK.items() if name.startswith("right-")]] = 0.1
    beside = measure_proportions([replace(true, visibility=visibility)])
    assert beside.keys() == BONES.keys() - {"shoulders", "hips"}
    whole = measure_proportions([true])
    assert beside == pytest.approx({name: whole[name] for name in beside})


def test_nothing_changes_beyond_what_people_differ_by() -> None:
    own = measure_proportions([person()])
    wrong = own | {"lower-arm": 9.0, "upper-arm": 0.01}
    scales = compare_proportions(wrong, own).scales
    assert scales["lower-arm"] == LARGEST_CHANGE
    assert scales["upper-arm"] == 1 / LARGEST_CHANGE


@pytest.mark.parametrize("scales", [{"thigh": 1.25, "shin": 1.25}, *FITS])
def test_the_mask_goes_with_the_bones(scales: dict[str, float]) -> None:
    body = seen_body(person())
    fitted = fit_body(body, BodyFit(WHOLE | scales))
    covered = on_frame(fitted)
    for name, bones in BONES.items():
        for ends in bones:
            a, b = (fitted.landmarks.image[[LANDMARK[n] for n in end], :2].mean(0) for end in ends)
            for share in np.linspace(0.05, 0.95, 7):
                x, y = (a + share * (b - a)).astype(int)
                assert covered[y, x], (name, share)
    true = on_frame(seen_body(fitted.landmarks))
    assert (covered & true).sum() / (covered | true).sum() > 0.75
    assert fitted.next_region == body.next_region  # the frame shows the driver as it is


def test_limbs_get_wider_as_they_get_longer() -> None:
    body = seen_body(person())
    widths = []
    for scale in (1.0, 1.3):
        fitted = fit_body(body, BodyFit(WHOLE | {"shin": scale, "thigh": scale}))
        ends = [fitted.landmarks.image[LANDMARK[f"left-{j}"], :2] for j in ("knee", "ankle")]
        x, y = np.mean(ends, 0).astype(int)
        widths.append(on_frame(fitted)[y, x - 40 : x + 40].sum())
    assert widths[1] / widths[0] == pytest.approx(1.3, rel=0.1)


def test_a_body_that_grows_stays_in_its_region() -> None:
    body = seen_body(person())
    tight = replace(body, region=replace(body.region, side=400.0))
    fitted = fit_body(tight, BodyFit(dict.fromkeys(BONES, 1.4)))
    corners = fitted.region.to_frame(np.array([[0, 0], [1, 1]], np.float32))
    assert fitted.region.side > 500
    points = fitted.landmarks.image[:, :2]
    assert (points > corners.min(0)).all() and (points < corners.max(0)).all()


def test_bad_input_is_refused_in_words() -> None:
    fit = BodyFit(WHOLE)
    broken = person()
    broken.world[3, 1] = np.nan
    with pytest.raises(InputError, match=r"finite numbers are needed"):
        fit_landmarks(broken, fit)
    with pytest.raises(InputError, match=r"landmarks of shape \(12, 3\)"):
        measure_proportions([replace(person(), image=np.zeros((12, 3), np.float32))])
    with pytest.raises(InputError, match="one above 0 for each of trunk"):
        BodyFit(WHOLE | {"shin": 0.0})
    with pytest.raises(InputError, match="one above 0 for each of trunk"):
        BodyFit({"shin": 1.0})
    arms = {"upper-arm": 0.3}
    with pytest.raises(InputError, match=r"neither trunk, head nor legs .* leave out --fit-body"):
        compare_proportions(arms, measure_proportions([person()]))
