"""The pictures of a source: photos, folders and videos, their IUV, and what is kept of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from estimate_stubs import RED, scene, write_red_model
from studio import LEGS, UPPER

from motion_transfer.drawing.moments import MOST_MOMENTS
from motion_transfer.drawing.person import Box
from motion_transfer.drawing.source import SourcePicture, unfold_picture
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Stage, ignore
from motion_transfer.render import source_pictures
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source import read_source
from motion_transfer.render.source_pictures import FoundPicture, read_pictures

FRAME = (300, 260)


def read(*sources: Path, **more) -> list[FoundPicture]:
    return read_pictures(SourceOptions(source=sources, **more), ignore)


def parts_of(found: FoundPicture) -> set[int]:
    return set(np.unique(found.picture.iuv[..., 0]).tolist()) - {0}


def names_of(found: list[FoundPicture]) -> list[str]:
    return [one.picture.photo.path.name for one in found]


def refusal(*sources: Path, **more) -> str:
    with pytest.raises(InputError) as caught:
        read(*sources, **more)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def frames(studio) -> np.ndarray:
    """A clip's IUV: nobody; legs; all but the legs, elsewhere; and the legs again, smaller."""
    pieces = [
        studio.iuv(80, 40, size=FRAME, scale=2, parts=LEGS),
        studio.iuv(20, 20, size=FRAME, scale=2, parts=UPPER),
        studio.iuv(10, 10, size=FRAME, parts=LEGS),
    ]
    return np.stack([np.zeros((*FRAME, 3), np.uint8), *pieces])


@pytest.fixture
def film(studio, frames):
    """Write the pictures of the clip, grainy as pictures are, as a video or a folder."""

    def write(name: str = "me.mkv") -> Path:
        grain = np.random.default_rng(0).integers(-30, 30, frames.shape)
        pictures = np.stack([studio.dress(iuv) for iuv in frames]).astype(int) + grain
        pictures = pictures.clip(0, 255).astype(np.uint8)
        if "." in name:
            return studio.video(pictures, name=name)
        for index, picture in enumerate(pictures):
            studio.image(f"{name}/{index}.png", picture)
        return studio.folder / name

    return write


def test_photos_come_in_the_order_that_they_are_named(studio) -> None:
    small, large = studio.source("small", scale=1), studio.source("large", scale=3)
    found = read(small, large)
    assert names_of(found) == ["small.png", "large.png"]
    assert [one.iuv_path for one in found] == [
        studio.folder / f"{name}_IUV.png" for name in ("small", "large")
    ]
    assert names_of(read(large, small, small)) == ["large.png", "small.png", "small.png"]


def test_each_photo_takes_the_iuv_that_is_named_for_it(studio) -> None:
    photos = [studio.source(name) for name in ("a", "b")]
    named = [
        studio.image(f"{name}.png", studio.iuv(scale=2, size=(192, 128), parts=parts))
        for name, parts in (("first", UPPER), ("second", LEGS))
    ]
    found = read(*photos, source_iuv=tuple(named))
    assert [one.iuv_path for one in found] == named
    assert [parts_of(one) for one in found] == [set(UPPER), set(LEGS)]


@pytest.mark.parametrize("count", [1, 3])
def test_there_is_one_iuv_for_each_source_or_none(studio, count: int) -> None:
    photos = [studio.source(name) for name in ("a", "b")]
    named = (studio.folder / "a_IUV.png",) * count
    assert refusal(*photos, source_iuv=named) == (
        f"{count} source IUV for 2 sources; give one for each, in their order, or none"
    )


def test_a_folder_holds_photos_and_beside_each_its_iuv(studio) -> None:
    """The IUV is no photo; a photo that adds nothing is left out; the fullest one leads."""
    studio.source("me/1", parts=LEGS)
    studio.source("me/2", parts=UPPER)
    studio.source("me/3", parts=UPPER, scale=1)
    (studio.folder / "me/2_IUV.png").rename(studio.folder / "me/2_iuv.png")
    (studio.folder / "me/notes.txt").write_text("no photo")
    found = read(studio.folder / "me")
    assert names_of(found) == ["2.png", "1.png"]
    assert [parts_of(one) for one in found] == [set(UPPER), set(LEGS)]


@pytest.mark.parametrize("place", ["me_IUV.mkv", "me_iuv.mkv", "me_IUV.npz", "me_iuv", "named"])
@pytest.mark.parametrize("name", ["me.mkv", "me"])
def test_a_clip_takes_its_iuv_from_beside_it(studio, frames, film, place: str, name: str) -> None:
    clip, more = film(name), {}
    if place.endswith(".mkv"):
        studio.video(frames, name=place)
    elif place.endswith(".npz"):
        studio.array(frames, name=place)
    elif place == "named":
        more = {"source_iuv": (studio.driver(frames, name="elsewhere"),)}
    else:
        studio.driver(frames, name=place)
    found = read(clip, **more)
    assert [parts_of(one) for one in found] == [set(UPPER), set(LEGS)]
    assert [one.iuv_path for one in found] == [None, None]


def test_a_clip_and_a_photo_show_one_person(studio, frames, film) -> None:
    studio.video(frames, name="me_IUV.mkv")
    clip, photo = film(), studio.source("face", parts=(23, 24))
    assert names_of(read(photo, clip)) == ["face.png", "me.mkv", "me.mkv"]
    together = read_source(SourceOptions(source=(photo, clip)), 64)
    alone = read_source(SourceOptions(source=(clip,)), 64)
    assert together.photo.path == photo
    # of what does not lead, edges give nothing
    assert (together.visibility * alone.visibility).sum() > 0.8 * alone.visibility.sum()


def test_a_video_without_iuv_is_looked_at(studio) -> None:
    """Frames in which nobody is found are passed over."""
    boxes = [Box(10, 6, 40, 50), Box(16, 6, 46, 50)]
    pictures = [scene(), *(scene((RED, box)) for box in boxes), scene()]
    clip = studio.video(np.stack(pictures), name="me.mkv")
    model = write_red_model(studio.folder / "red.pt")
    options = SourceOptions(source=(clip,), estimator="densepose", estimator_model=model)
    told: list[object] = []
    found = read_pictures(options, told.append)
    assert told[0] == Stage("look", 4)
    assert sum(event.frame_count for event in told if isinstance(event, FramesDone)) == 4
    assert 1 <= len(found) <= 2
    assert found[0].picture.alpha is not None and found[0].picture.alpha.max() == 255
    assert parts_of(found[0]) == {2, 10}
    empty = studio.video(np.stack([scene()] * 3), name="empty.mkv")
    message = refusal(empty, estimator="densepose", estimator_model=model)
    assert message.startswith(f"nobody was found in source {empty}; it should show a person")


@pytest.mark.parametrize("change", ["fewer", "more", "narrower"])
def test_iuv_of_another_clip_is_refused(studio, frames, film, change: str) -> None:
    clip = film()
    changed = {
        "fewer": frames[:-1],
        "more": np.concatenate([frames, frames[:1]]),
        "narrower": frames[:, :, :-20],
    }[change]
    iuv = studio.video(np.ascontiguousarray(changed), name="me_IUV.mkv")
    count, height, width = changed.shape[:3]
    assert refusal(clip) == (
        f"source IUV {iuv} has {count} frames of {width} x {height}, but {clip} has 4 of"
        f" {FRAME[1]} x {FRAME[0]}; make it from this very clip"
    )


def test_a_clip_of_nobody_is_refused(studio, frames, film) -> None:
    clip = film()
    studio.video(np.zeros_like(frames), name="me_IUV.mkv")
    assert "nobody" in refusal(clip) or "no person" in refusal(clip)


def test_what_is_no_source_is_said(studio) -> None:
    (studio.folder / "empty").mkdir()
    (studio.folder / "text.mkv").write_text("no video")
    for name, words in (
        ("gone.png", "gone.png"),
        ("gone.mkv", "gone.mkv does not exist"),
        ("empty", "empty holds no pictures"),
        ("text.mkv", "text.mkv"),
    ):
        assert words in refusal(studio.folder / name)
    missing = studio.folder / "gone_IUV.mkv"
    clip = studio.video(studio.walk(2), name="me.mkv")
    assert "gone_IUV.mkv" in refusal(clip, source_iuv=(missing,))


def test_the_chosen_person_is_followed_through_a_clip(studio) -> None:
    """Somebody larger stands on the left; the one on the right is meant."""
    large = studio.iuv(0, 20, size=FRAME, scale=2, parts=UPPER)
    frames = []
    for step in range(3):
        small = studio.iuv(170 + 5 * step, 40, size=FRAME, parts=LEGS)
        frames.append(np.where(small[..., :1] > 0, small, large))
    pictures = np.stack([studio.dress(iuv) for iuv in frames])
    clip = studio.video(pictures, name="two.mkv")
    studio.video(np.stack(frames), name="two_IUV.mkv")
    assert {part for one in read(clip, person="1") for part in parts_of(one)} == set(LEGS)
    assert {part for one in read(clip) for part in parts_of(one)} == set(UPPER)


@pytest.fixture
def uncut(monkeypatch: pytest.MonkeyPatch):
    """Read pictures that stay whole."""

    def call(*sources: Path) -> list[SourcePicture]:
        with monkeypatch.context() as patch:
            patch.setattr(source_pictures, "_cut", lambda picture: picture)
            return [one.picture for one in read(*sources)]

    return call


def test_all_but_the_leader_are_cut_and_show_the_same(studio, frames, film, uncut) -> None:
    studio.video(frames, name="me_IUV.mkv")
    clip = film()
    leader, *others = (one.picture for one in read(clip))
    assert leader.photo.rgb.shape == leader.iuv.shape == (*FRAME, 3)
    whole_leader, *whole = uncut(clip)
    np.testing.assert_array_equal(leader.photo.rgb, whole_leader.photo.rgb)
    assert len(others) == len(whole) == 1
    for cut, all_of_it in zip(others, whole, strict=True):
        assert cut.iuv.shape == cut.photo.rgb.shape
        assert cut.photo.rgb.size < 0.6 * all_of_it.photo.rgb.size
        assert cut.photo.rgb.base is None  # a view would keep the whole frame
        for one, other in zip(unfold_picture(cut, 64), unfold_picture(all_of_it, 64), strict=True):
            np.testing.assert_array_equal(one, other)


def test_alpha_is_cut_with_the_picture(studio, uncut) -> None:
    """Photos of a folder may have alpha of their own, which says where the person ends."""
    for name, parts in (("1", LEGS), ("2", UPPER)):
        iuv = studio.iuv(60, 30, size=FRAME, scale=2, parts=parts)
        alpha = ((iuv[..., 0] > 0) * 255).astype(np.uint8)
        alpha[:, :110] = 0
        studio.image(f"me/{name}_IUV.png", iuv)
        studio.image(f"me/{name}.png", np.dstack([studio.dress(iuv), alpha]))
    _, cut = (one.picture for one in read(studio.folder / "me"))
    _, whole = uncut(studio.folder / "me")
    assert cut.photo.alpha is not None and cut.photo.alpha.shape == cut.iuv.shape[:2]
    assert cut.photo.alpha.size < whole.iuv[..., 0].size
    for one, other in zip(unfold_picture(cut, 64), unfold_picture(whole, 64), strict=True):
        np.testing.assert_array_equal(one, other)


def test_of_a_long_clip_few_frames_are_kept(studio) -> None:
    """However much each of them adds: here another slice of the body."""
    whole = studio.iuv(scale=2, size=(192, 128))
    rows = np.arange(192)[:, None, None]
    slices = [whole * (abs(rows - middle) < 8) for middle in range(10, 184, 4)]
    assert len(slices) > 1.5 * MOST_MOMENTS
    pictures = np.stack([studio.dress(iuv) for iuv in slices])
    clip = studio.video(pictures, name="long.mkv")
    studio.video(np.stack(slices), name="long_IUV.mkv")
    assert 5 < len(read(clip)) <= MOST_MOMENTS + 1


def test_garments_take_their_parts_out_of_every_picture(studio, frames, film) -> None:
    studio.video(frames, name="me_IUV.mkv")
    options = SourceOptions(source=(film(), studio.source("a")))
    found = read_pictures(options, ignore, UPPER)
    assert [one.picture.parts for one in found] == [UPPER] * 3
