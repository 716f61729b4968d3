"""People by number: the same seed gives the same bytes."""

from __future__ import annotations

import json
from dataclasses import asdict

import numpy as np
import pytest
import torch

from motion_transfer.errors import InputError

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people.dataset import PeopleDataset, PeopleStream  # noqa: E402
from motion_transfer.people.picture.iuv_noise import IuvNoise  # noqa: E402

SIZE = (96, 128)


def photos(**settings) -> list:
    stream = PeopleStream(size=SIZE, **settings)
    return [
        stream.take(stream.dress(number), stream.shot(number, view))
        for number in (3, 4)
        for view in (0, 1)
    ]


def same(a, b) -> bool:
    return all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("rgb", "alpha", "iuv"))


def test_the_same_seed_gives_the_same_bytes_and_another_does_not():
    first, again, other = photos(seed=1), photos(seed=1), photos(seed=2)
    assert all(same(a, b) for a, b in zip(first, again, strict=True))
    assert not any(same(a, b) for a, b in zip(first, other, strict=True))


def test_splits_share_nobody():
    train, held_out = (PeopleStream(size=SIZE, split=s) for s in ("train", "held-out"))
    people = {json.dumps(s.person(n).description()) for s in (train, held_out) for n in range(20)}
    assert len(people) == 40


def test_two_views_show_one_person_in_two_poses():
    stream = PeopleStream(size=SIZE)
    a, b = stream.shot(0, 0), stream.shot(0, 1)
    assert a.pose != b.pose and a.light != b.light
    assert stream.person(0) == stream.person(0) != stream.person(1)


def test_alpha_iuv_and_photo_agree():
    for photo in photos():
        assert photo.rgb.shape == (*SIZE[::-1], 3) == photo.iuv.shape
        body = photo.iuv[..., 0] > 0
        assert 0.03 < body.mean() < 0.9
        assert (photo.alpha[body] > 0).all()  # the body is never outside of the person
        assert ((photo.alpha > 0) & ~body).any()  # cloth and hair reach beyond it
        assert not photo.iuv[~body].any()


def test_descriptions_are_json():
    stream = PeopleStream(size=SIZE)
    person, shot = stream.person(5), stream.shot(5, 0)
    assert json.loads(json.dumps(person.description()))["shape"] == asdict(person.shape)
    assert json.loads(json.dumps(shot.description()))["distance"] == shot.distance


def test_noise_changes_the_iuv_and_nothing_else():
    for clean, noisy in zip(photos(), photos(noise=IuvNoise.densepose()), strict=True):
        assert np.array_equal(clean.rgb, noisy.rgb) and np.array_equal(clean.alpha, noisy.alpha)
        assert not np.array_equal(clean.iuv, noisy.iuv)


def test_pairs_are_tensors_in_the_models_ranges():
    data = PeopleDataset(2, size=SIZE)
    pair = data[1]
    for role in ("source", "target"):
        image, iuv, alpha = (pair[f"{role}_{name}"] for name in ("image", "iuv", "alpha"))
        assert image.shape == iuv.shape == (3, *SIZE[::-1]) and alpha.shape == (1, *SIZE[::-1])
        assert image.dtype == torch.float32 and -1 <= image.min() < 0 < image.max() <= 1
        assert iuv.dtype == torch.uint8 and iuv[0].max() <= 24
        assert alpha.min() == 0 and alpha.max() == 1
    assert len(data) == 2
    with pytest.raises(IndexError):
        data[2]


def test_workers_make_the_same_pairs():
    data = PeopleDataset(2, size=SIZE)
    here = [data[i]["target_image"] for i in range(2)]
    loader = torch.utils.data.DataLoader(
        PeopleDataset(2, size=SIZE),
        batch_size=None,
        num_workers=1,
        multiprocessing_context="spawn",
    )
    there = [pair["target_image"] for pair in loader]
    assert all(torch.equal(a, b) for a, b in zip(here, there, strict=True))


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"split": "test"}, "split 'test'; supported are train, held-out"), ({"seed": -1}, "seed is")],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        PeopleStream(**settings)
