"""MakeHuman's own assets, where MT_SAMPLES has them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people.dataset import PeopleStream  # noqa: E402
from motion_transfer.people.figure.charts import load_charts, render_iuv  # noqa: E402
from motion_transfer.people.figure.rasterise import (  # noqa: E402
    Triangles,
    depths,
    rasterise,
)
from motion_transfer.people.free.assets import load_assets  # noqa: E402
from motion_transfer.people.free.binding import load_parts  # noqa: E402
from motion_transfer.people.free.look import is_held_out  # noqa: E402
from motion_transfer.people.free.pictures import LOGOS, load_picture  # noqa: E402
from motion_transfer.people.photo import PersonPhoto  # noqa: E402

NOTHING_METRES = 1e3
CLOSE_METRES = 0.01
"""Skin so near in front of cloth has come through it; what is further in front is another limb."""


def test_every_item_can_be_read(real_assets):
    assets = load_assets(real_assets)
    for item in assets.items.values():
        if item.geometry:
            parts = load_parts(item, assets)
            assert all(len(part.faces) for part in parts.values())
        for role in item.pictures:
            assert load_picture(item, role, assets).whole.shape[2] == 4


def test_no_logo_is_left(real_assets):
    """MakeHuman's figure is orange on blue or white cloth: no such colour is left where it was."""
    assets = load_assets(real_assets)
    for name, logos in LOGOS.items():
        whole = load_picture(assets.items[name], "diffuse", assets).whole.astype(int)
        for logo in logos:
            rows = slice(*(int((logo.v + s * logo.high) * len(whole)) for s in (-1, 1)))
            columns = slice(*(int((logo.u + s * logo.wide) * whole.shape[1]) for s in (-1, 1)))
            red, _, blue = np.moveaxis(whole[rows, columns, :3], 2, 0)
            assert (red - blue).max() < 30, name


def test_skin_does_not_come_through_cloth(real_assets):
    stream = PeopleStream(size=(192, 192), assets=real_assets, free_share=1.0)
    through = cloth = number = dressed_count = 0
    while dressed_count < 10:
        number += 1
        if not stream.person(number).look.clothes:
            continue
        dressed_count += 1
        dressed, shot = stream.dress(number), stream.shot(number, 0)
        photo = stream.take(dressed, shot)
        posed = dressed.posed(shot.pose)
        names = {each.item for each in dressed.person.look.clothes}
        seen = []
        for chosen in ({"skin"}, names):
            nearest = np.full(photo.camera.width * photo.camera.height, NOTHING_METRES)
            for piece in dressed.pieces:
                if piece.name in chosen:
                    screen = photo.camera.project(piece.posed(posed))
                    triangles = Triangles.two_sided(piece.faces, piece.keep)
                    found = depths(rasterise(screen, triangles, *stream.size))
                    nearest = np.fmin(nearest, found)
            seen.append(nearest)
        skin, garment = seen
        through += ((skin < garment) & (garment - skin < CLOSE_METRES)).sum()
        cloth += (garment < NOTHING_METRES).sum()
    assert cloth > 10_000
    assert through / cloth < 0.005


def test_iuv_is_the_bare_bodys_and_alpha_covers_clothes_and_hair(real_assets):
    stream = PeopleStream(size=(128, 160), assets=real_assets, free_share=1.0)
    beyond = 0
    for number in range(6):
        dressed, shot = stream.dress(number), stream.shot(number, 0)
        photo: PersonPhoto = stream.take(dressed, shot)
        bare = dressed.posed(shot.pose).points
        iuv = render_iuv(bare, dressed.model.faces, load_charts(), photo.camera)
        assert np.array_equal(photo.iuv, iuv)
        body = iuv[..., 0] > 0
        # in a bent knee cloth may lie a pixel inside the skin that it hides
        assert (photo.alpha[body] > 0).mean() > 0.99
        beyond += ((photo.alpha > 0) & ~body).mean()
    assert beyond / 6 > 0.01


def test_nobody_in_training_wears_what_is_held_out(real_assets):
    train = PeopleStream(assets=real_assets, free_share=1.0)
    held_out = PeopleStream(assets=real_assets, free_share=1.0, split="held-out")
    looks = [[stream.person(n).look for n in range(80)] for stream in (train, held_out)]
    names = [
        [
            {look.skin, look.hair, look.hat, look.brows, look.eyes, *(w.item for w in look.clothes)}
            for look in each
        ]
        for each in looks
    ]
    apart = [[any(is_held_out(n) for n in worn if n) for worn in each] for each in names]
    assert not any(apart[0])
    assert np.mean(apart[1]) > 0.7
