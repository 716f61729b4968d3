"""Free people: who is one, what they wear, and photos of them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from motion_transfer.errors import InputError

pytest.importorskip("warp", reason="needs the `people` extra")
pytestmark = pytest.mark.usefixtures("body_model")

from motion_transfer.people.album import AlbumOptions, write_album  # noqa: E402
from motion_transfer.people.dataset import PeopleStream  # noqa: E402
from motion_transfer.people.figure.charts import load_charts, render_iuv  # noqa: E402
from motion_transfer.people.free.assets import Assets, load_assets  # noqa: E402
from motion_transfer.people.free.binding import load_helpers, load_parts  # noqa: E402
from motion_transfer.people.free.look import is_held_out  # noqa: E402
from motion_transfer.people.free.person import FreePerson  # noqa: E402

SIZE = (96, 128)


def worn(person: FreePerson) -> set[str]:
    look = person.look
    names = {look.skin, look.hair, look.hat, look.brows, *(each.item for each in look.clothes)}
    return {name for name in names if name}


def test_the_same_number_is_the_same_person_and_photo(assets):
    first, again = (PeopleStream(size=SIZE, assets=assets, free_share=1.0) for _ in range(2))
    one, two = (s.take(s.dress(3), s.shot(3, 0)) for s in (first, again))
    assert first.person(3) == again.person(3) != first.person(4)
    for name in ("rgb", "alpha", "iuv"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_a_share_of_people_is_free_and_the_others_are_who_they_would_have_been(assets):
    half, painted = PeopleStream(assets=assets), PeopleStream()
    mixed = [half.person(number) for number in range(60)]
    free = [isinstance(person, FreePerson) for person in mixed]
    assert 15 < sum(free) < 45
    assert all(mixed[n] == painted.person(n) for n in range(60) if not free[n])
    all_free = PeopleStream(assets=assets, free_share=1.0)
    assert all(mixed[n] == all_free.person(n) for n in range(60) if free[n])
    none = PeopleStream(assets=assets, free_share=0.0)
    assert all(none.person(n) == painted.person(n) for n in range(5))


def test_nobody_in_training_wears_what_is_held_out(assets):
    train, held_out = (
        PeopleStream(assets=assets, free_share=1.0, split=split) for split in ("train", "held-out")
    )
    apart = {name for name in load_assets(assets).items if is_held_out(name)}
    assert {"female_1", "suit_a"} <= apart and "suit_b" not in apart  # what the folder was made for
    trained = set.union(*(worn(train.person(n)) for n in range(60)))
    tested = set.union(*(worn(held_out.person(n)) for n in range(60)))
    assert not apart & trained
    assert apart & tested and tested - apart


def test_a_description_tells_kind_and_items(assets):
    person = PeopleStream(assets=assets, free_share=1.0).person(1)
    assert isinstance(person, FreePerson)
    told = json.loads(json.dumps(person.description()))
    assert told["kind"] == "free" and told["look"]["skin"] == person.look.skin
    assert told["shape"]["age"] == person.shape.age


def test_an_album_knows_its_assets_by_what_they_are(assets, tmp_path):
    options = AlbumOptions(out=tmp_path / "a", count=2, views=1, size=(64, 64), assets=assets)
    options = replace(options, workers=1)
    assert write_album(options) == 2
    settings = json.loads((tmp_path / "a" / "people.json").read_text())
    assert settings["assets"] == load_assets(assets).digest and settings["free_share"] == 0.5
    kinds = {json.loads(f.read_text())["person"]["kind"] for f in tmp_path.glob("a/*/person.json")}
    assert kinds <= {"free", "painted"}
    without = AlbumOptions(out=tmp_path / "b", count=1).settings
    assert not {"assets", "free_share"} & set(without)
    with pytest.raises(InputError, match="needs assets"):
        AlbumOptions(out=tmp_path / "c", count=1, free_share=0.5)


def test_iuv_is_the_bare_bodys_and_alpha_that_of_all_that_is_worn(assets):
    stream = PeopleStream(size=SIZE, assets=assets, free_share=1.0)
    for number in range(4):
        dressed, shot = stream.dress(number), stream.shot(number, 0)
        photo = stream.take(dressed, shot)
        bare = dressed.posed(shot.pose).points
        iuv = render_iuv(bare, dressed.model.faces, load_charts(), photo.camera)
        assert np.array_equal(photo.iuv, iuv)


def test_geometry_that_points_nowhere_is_refused(assets, tmp_path):
    item = load_assets(assets).items["curls"]
    assert item.geometry is not None
    arrays = dict(np.load(item.geometry))
    arrays["index"][0, 0] = 99999
    np.savez(tmp_path / "bad.npz", **arrays)
    bad = replace(item, geometry=tmp_path / "bad.npz")
    with pytest.raises(InputError, match=r"index points outside of 0..19157; copy it anew"):
        load_parts(bad, load_assets(assets))


def test_a_point_bound_to_a_vertex_lies_its_offset_away(assets, body_model):
    known = load_assets(assets)
    garment = load_parts(known.items["suit_b"], known)["whole"]
    rest = load_helpers(known).rest(body_model.template)
    # the offset is forward in MakeHuman's axes, a decimetre's tenth: -y here, one centimetre
    moved = garment.fit(rest) - rest[garment.index[:, 0]]
    assert np.allclose(moved, [0, -0.01, 0], atol=1e-6)
    assert np.allclose(rest[:13718], body_model.template.points, atol=1e-6)


def test_helpers_of_another_folder_are_not_mixed_up(assets):
    known = load_assets(assets)
    assert isinstance(known, Assets) and load_assets(assets) is known  # once a folder
