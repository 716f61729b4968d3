"""BlazePose's networks read by us, against MediaPipe's own results."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from estimate_stubs import FramesInMemory
from skimage import data

from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError
from motion_transfer.estimate import blazepose, inference
from motion_transfer.estimate.blazepose import BlazePoseEstimator
from motion_transfer.estimate.blazepose.networks import (
    LandmarkModel,
    PersonDetector,
    anchor_centres,
    merge_overlapping,
    refine,
)
from motion_transfer.estimate.blazepose.retarget import BONES, BodyFit
from motion_transfer.estimate.blazepose.tracker import STEADY, BodyTracker
from motion_transfer.estimate.clip import estimate_clip, lay_iuv
from motion_transfer.estimate.interface import LANDMARK, LANDMARK_NAMES, other_side
from motion_transfer.estimate.iuv.network import IuvNetwork, save_weights
from motion_transfer.estimate.iuv.weights import IuvNetworkConfig
from motion_transfer.people import PeopleStream
from motion_transfer.training.iuv.trainer import score_iuv

MEDIAN_AWAY, MOST_AWAY = 0.006, 0.05
"""Of the person's height; the farthest are single landmarks whose heat map is at the limit at which
it starts to count. Street: MediaPipe sees a person of 90 px in its network's picture."""


def picture(name: str, entry: dict, folder: Path | None) -> np.ndarray:
    if name.startswith("astronaut"):
        return data.astronaut()
    assert folder is not None
    (path,) = folder.rglob(entry["file"])
    left, top, right, bottom = entry["crop"] or (0, 0, None, None)
    photo = cv2.imread(str(path))
    assert photo is not None
    return np.ascontiguousarray(photo[top:bottom, left:right, ::-1])


def check(name: str, entry: dict, models: dict[str, Path], folder: Path | None) -> None:
    photo = picture(name, entry, folder)
    (found, *_) = PersonDetector(models["pose_detection.tflite"]).detect(photo)
    body = LandmarkModel(models["pose_landmark_full.tflite"]).locate(photo, found.region)
    assert body is not None
    assert_same(body, entry["still"], photo.shape[:2])


def assert_same(body, told: dict, size: tuple[int, int]) -> None:
    true = np.array(told["image_px"])
    tall = np.ptp(true[:, 1])
    away = np.linalg.norm(body.landmarks.image[:, :2] - true[:, :2], axis=1) / tall
    assert np.median(away) < MEDIAN_AWAY
    assert away.max() < MOST_AWAY
    depth = np.abs(body.landmarks.image[:, 2] - true[:, 2]) / tall
    assert np.median(depth) < 0.03
    assert body.landmarks.world == pytest.approx(np.array(told["world_metres"]), abs=0.025)
    assert body.landmarks.visibility == pytest.approx(np.array(told["visibility"]), abs=0.1)
    mask = body.region.paste(body.mask, Box(0, 0, size[1], size[0]))
    assert mask.sum() == pytest.approx(told["mask_area_px"], rel=0.01)
    if "mask" in told:
        small = cv2.resize(mask, (32, 32), interpolation=cv2.INTER_AREA)
        assert np.abs(small - np.array(told["mask"]) / 99).mean() < 0.01


def test_a_photo_in_the_public_domain(models, mediapipe_results) -> None:
    check("astronaut-clip", mediapipe_results["astronaut-clip"], models, None)


@pytest.mark.parametrize("name", ["blouse", "dress", "man", "street"])
def test_real_photos(models, mediapipe_results, samples: Path, name: str) -> None:
    check(name, mediapipe_results[name], models, samples)


def test_a_clip_is_followed_as_mediapipe_does(models, mediapipe_results) -> None:
    entry = mediapipe_results["astronaut-clip"]
    photo = data.astronaut()
    tracker = BodyTracker(most_people=1, smooth=False, mirror=False, second_looks=0, steady=0)
    height = photo.shape[0] - max(y for _, y in entry["shifts"])
    width = photo.shape[1] - max(x for x, _ in entry["shifts"])
    # each frame's region hangs on the last one's points, and only half of him is in the picture:
    # small differences add up (measured: 0.001 of his height in the first frame, up to 0.024 later)
    for (x, y), told in zip(entry["shifts"], entry["clip"], strict=True):
        frame = np.ascontiguousarray(photo[y : y + height, x : x + width])
        ((number, body),) = tracker.follow(frame)
        assert number == 0
        true = np.array(told["image_px"])
        away = np.linalg.norm(body.landmarks.image[:, :2] - true[:, :2], axis=1)
        shown = np.array(told["visibility"]) > 0.5
        assert np.median(away[shown]) / np.ptp(true[:, 1]) < 0.035


def test_anchors_are_those_of_the_network() -> None:
    centres = anchor_centres()
    assert centres.shape == (2254, 2)
    first = [[0.5 / 28] * 2, [0.5 / 28] * 2, [1.5 / 28, 0.5 / 28]]
    assert np.allclose(centres[:3], first)
    assert np.allclose(centres[-1], 6.5 / 7)
    assert np.allclose(centres[28 * 28 * 2], 0.5 / 14)


def test_overlapping_boxes_become_their_weighted_mean() -> None:
    box = np.zeros((6, 2), np.float32)
    box[1] = 1
    points = np.stack([box, box + 0.1, box + 5])
    merged = merge_overlapping(np.array([0.6, 0.9, 0.7], np.float32), points)
    assert [score for score, _ in merged] == pytest.approx([0.9, 0.7])
    assert merged[0][1][0] == pytest.approx([0.06, 0.06])
    assert merged[1][1] == pytest.approx(points[2])


def test_refining_moves_to_hot_cells_only() -> None:
    heat = np.full((64, 64, 2), -20.0, np.float32)
    heat[30, 33] = 5, -0.1
    places = np.array([[0.5, 0.5], [0.5, 0.5]], np.float32)
    moved = refine(places, heat)
    assert moved[0] == pytest.approx([33 / 64, 30 / 64], abs=1e-5)
    assert moved[1].tolist() == [0.5, 0.5]
    assert refine(places + 2, heat) == pytest.approx(places + 2)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A network that is quick and paints anything."""
    file = tmp_path_factory.mktemp("weights") / "small.safetensors"
    save_weights(file, IuvNetwork(IuvNetworkConfig(widths=(8, 8, 8, 8), code=8)), {})
    return file


@pytest.fixture(scope="module")
def estimator(models, weights: Path) -> BlazePoseEstimator:
    return BlazePoseEstimator(weights=weights, most_people=6)


def estimate(estimator: BlazePoseEstimator, frame: np.ndarray) -> list:
    estimator.start_shot()
    return estimator.estimate(frame)


def test_a_person_and_everything_about_her(estimator) -> None:
    photo = data.astronaut()
    (person,) = estimate(estimator, photo)
    assert person.iuv.shape == (*person.alpha.shape, 3) == (person.box.height, person.box.width, 3)
    assert person.confidence > 0.9
    iuv, alpha = person.on_frame(*photo.shape[:2])
    assert alpha[200, 230] > 250  # the face
    assert alpha[60, 450] < 5  # a shuttle
    x = dict(zip(LANDMARK_NAMES, person.landmarks.image[:, 0], strict=True))
    assert x["left-shoulder"] > x["right-shoulder"] + 100  # she faces us
    assert person.landmarks.visibility[LANDMARK["left-knee"]] < 0.5  # only shown to the waist
    assert iuv.shape == photo.shape


def test_a_mirror_shows_the_other_side(models) -> None:
    """In a mirror image that is looked at in a mirror, everything is as it was."""
    photo = data.astronaut()
    model = LandmarkModel(models["pose_landmark_full.tflite"])
    (found, *_) = PersonDetector(models["pose_detection.tflite"]).detect(photo)
    there = found.region.changed(5, 1)
    mirrored = replace(there, x=photo.shape[1] - there.x, turn=-there.turn)
    plain = model.locate(photo, there)
    seen = model.locate(np.ascontiguousarray(photo[:, ::-1]), mirrored, mirrored=True)
    other = [LANDMARK[other_side(name)] for name in LANDMARK_NAMES]
    image, world = plain.landmarks.image[other], plain.landmarks.world[other]
    pixel = there.side / 256
    away = seen.landmarks.image - image * (-1, 1, 1) - (photo.shape[1], 0, 0)
    face = slice(0, LANDMARK["left-shoulder"])  # sharp, and all of it in the picture
    assert np.abs(away[face, :2]).max() < pixel
    assert np.abs(away[face, 0].mean()) < pixel / 4  # mirrored about the very middle
    assert np.abs(seen.landmarks.world - world * (-1, 1, 1))[face].max() < 0.05  # of 0.1 and more
    visibility = plain.landmarks.visibility[other]
    assert seen.landmarks.visibility[face] == pytest.approx(visibility[face], abs=0.05)
    assert np.abs(seen.mask - plain.mask[:, ::-1]).mean() < 0.05
    assert seen.features is None


def test_a_photo_is_looked_at_several_times(models, body_model) -> None:
    """One look gets this pose wrong; and what was looked at before does not count."""
    people = PeopleStream(split="held-out", size=(384, 384))
    photo = people.take(people.dress(8), people.shot(8, 0))
    scores = []
    for estimator in (BlazePoseEstimator(), BlazePoseEstimator(for_photos=True)):
        found = estimate(estimator, photo.rgb)
        scores.append(score_iuv(lay_iuv(found, *photo.rgb.shape[:2]), photo.iuv))
    assert scores[1].part_agreement > scores[0].part_agreement + 0.1
    assert scores[1].uv_error < scores[0].uv_error
    estimator.estimate(data.astronaut())
    (again,) = estimator.estimate(photo.rgb)
    np.testing.assert_array_equal(again.iuv, found[0].iuv)
    np.testing.assert_array_equal(again.alpha, found[0].alpha)


@pytest.mark.parametrize("name", ["cat", "chelsea", "coffee", "rocket", "hubble_deep_field"])
def test_pictures_of_nobody(estimator, name: str) -> None:
    if name == "cat":
        photo = np.zeros((300, 451, 3), np.uint8)
        photo[100:200, 100:300] = 90, 60, 30
    else:
        photo = getattr(data, name)()
    assert estimate(estimator, np.ascontiguousarray(photo[..., :3])) == []


@pytest.mark.parametrize("size", [(1, 1), (1, 700), (700, 1), (2, 3), (480, 640)])
def test_black_frames_of_any_size(estimator, size: tuple[int, int]) -> None:
    assert estimate(estimator, np.zeros((*size, 3), np.uint8)) == []


def test_noise(estimator) -> None:
    frame = np.random.default_rng(0).integers(0, 256, (300, 400, 3), np.uint8)
    assert estimate(estimator, frame) == []


def test_half_a_person(estimator) -> None:
    photo = np.ascontiguousarray(data.astronaut()[:, :230])
    people = estimate(estimator, photo)
    assert len(people) <= 1
    for person in people:
        assert person.box.right <= 230


def test_a_street(estimator, samples: Path) -> None:
    photo = cv2.imread(str(samples / "densepose_demo/demo_im.jpg"))
    assert photo is not None
    people = estimate(estimator, np.ascontiguousarray(photo[..., ::-1]))
    assert len(people) >= 3
    assert len({person.track for person in people}) == len(people)
    assert all(a.box.overlap(b.box) < 0.5 for a in people for b in people if a is not b)


def test_a_huge_picture(estimator) -> None:
    photo = cv2.resize(data.astronaut(), (5000, 5000))
    (person,) = estimate(estimator, photo)
    assert person.box.width > 4000
    assert person.alpha[2000 - person.box.top, 2250 - person.box.left] > 250


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((0, 10, 3), np.uint8),
        np.zeros((10, 10), np.uint8),
        np.zeros((10, 10, 4), np.uint8),
        np.zeros((10, 10, 3), np.float32),
    ],
)
def test_what_is_no_frame(estimator, frame: np.ndarray) -> None:
    # past jaxtyping, which only tests have
    plain = inspect.unwrap(BlazePoseEstimator.estimate)
    with pytest.raises(InputError, match="RGB of 8 bits"):
        plain(estimator, frame)


def test_somebody_who_leaves_is_lost_and_found_again(estimator) -> None:
    photo = data.astronaut()
    nobody = np.zeros_like(photo)
    estimator.start_shot()
    (first,) = estimator.estimate(photo)
    (second,) = estimator.estimate(photo)
    assert first.track == second.track
    assert estimator.estimate(nobody) == []
    assert estimator.estimate(nobody) == []
    (again,) = estimator.estimate(photo)
    assert again.track > first.track


def test_who_stands_still_is_looked_at_through_the_same_pixels(models) -> None:
    photo, rng = data.astronaut(), np.random.default_rng(0)
    regions = {0.0: set(), STEADY: set()}
    for steady, seen in regions.items():
        tracker = BodyTracker(most_people=1, steady=steady)
        for _ in range(6):
            noisy = (photo + rng.normal(0, 3, photo.shape)).round().clip(0, 255).astype(np.uint8)
            ((_, body),) = tracker.follow(noisy)
            seen.add(body.region)
    assert len(regions[0.0]) == 6
    assert len(regions[STEADY]) <= 2


def test_a_clip_is_the_same_however_many_cores_there_are(models, monkeypatch) -> None:
    photo = data.astronaut()
    frames = [np.ascontiguousarray(np.roll(photo, 3 * index, axis=1)) for index in range(5)]
    found = []
    for cores in (1, 2):
        monkeypatch.setattr("motion_transfer.cores._share", cores)
        for opened in (inference.open_network, blazepose._open_shipped):
            opened.cache_clear()
        clip = FramesInMemory(frames)
        found.append([frame.tobytes() for frame in estimate_clip(clip, BlazePoseEstimator())])
    one_by_one = BlazePoseEstimator()
    iuv = [lay_iuv(one_by_one.estimate(frame), *frame.shape[:2]).tobytes() for frame in frames]
    assert found == [iuv, iuv]
    assert len(set(iuv)) == 5


def test_a_fitted_person_has_another_body(models, estimator, weights: Path) -> None:
    photo = data.astronaut()
    (before,) = estimate(estimator, photo)
    fit = BodyFit(dict.fromkeys(BONES, 1.0) | {"head": 0.7})
    (after,) = BlazePoseEstimator(weights=weights, fit=fit).estimate(photo)
    ears = [LANDMARK["left-ear"], LANDMARK["right-ear"]]
    width = [np.ptp(person.landmarks.image[ears, 0]) for person in (before, after)]
    assert width[1] / width[0] == pytest.approx(0.7, abs=0.02)
    chin = before.landmarks.image[LANDMARK["mouth-left"], 1].astype(int)
    heads = [(person.on_frame(512, 512)[1][:chin] > 127).sum() for person in (before, after)]
    assert heads[1] < 0.7 * heads[0]
