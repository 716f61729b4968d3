"""The source: photo and IUV found, checked and unfolded, with garments."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from motion_transfer.drawing.source import Source, untouched_texels
from motion_transfer.drawing.trimming import trim
from motion_transfer.errors import InputError
from motion_transfer.render.options import Garment, SourceOptions, parse_parts
from motion_transfer.render.source import read_source
from nhrr_core import load_uv_tables

SIZE = 64
TORSO, HEAD, SHINS = (2,), (23, 24), (13, 14)
RED, GREEN, YELLOW = (200, 40, 40), (40, 160, 60), (220, 180, 40)


def prepare(photo: Path, **changes) -> Source:
    return read_source(SourceOptions(source=(photo,), **changes), SIZE)


def colour_of(source: Source, parts: tuple[int, ...]) -> list[int] | None:
    """The median colour of some parts in the texture; None where only their border is seen."""
    step = 256 // SIZE
    texels = np.isin(load_uv_tables().part[step // 2 :: step, step // 2 :: step], parts)
    seen = texels & (source.visibility[0] > 0)
    if seen.sum() < 0.3 * texels.sum():
        return None
    colours = source.texture[:, seen].T
    return ((np.median(colours, axis=0) + 1) * 127.5).round().astype(int).tolist()


@pytest.mark.parametrize("order", ["iuv", "vui"])
def test_parts_take_their_colours_from_the_photo(studio, order: str) -> None:
    source = prepare(studio.source(order=order))
    assert colour_of(source, TORSO) == list(RED)
    assert colour_of(source, HEAD) == list(YELLOW)
    assert colour_of(source, (1,)) is None  # the back


@pytest.mark.parametrize("word", ["IUV", "iuv"])
def test_the_iuv_is_found_beside_the_photo(studio, word: str) -> None:
    photo = studio.source()
    (studio.folder / "person_IUV.png").rename(studio.folder / f"person_{word}.png")
    assert prepare(photo).iuv_path.name == f"person_{word}.png"


def test_a_named_iuv_is_taken(studio) -> None:
    photo = studio.source()
    other = (studio.folder / "person_IUV.png").rename(studio.folder / "other.png")
    assert prepare(photo, source_iuv=(other,)).iuv_path == other
    with pytest.raises(InputError, match=r"neither person_IUV\.png nor person_iuv\.png is beside"):
        prepare(photo)


def test_a_turned_photo_matches_an_upright_iuv(studio) -> None:
    upright = np.asarray(Image.open(studio.source()))
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.rot90(upright)).save(studio.folder / "person.png", exif=exif)
    assert colour_of(prepare(studio.folder / "person.png"), TORSO) == list(RED)


def test_an_iuv_of_the_unturned_photo_is_refused_with_a_hint(studio) -> None:
    upright = np.asarray(Image.open(studio.source()))
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.rot90(upright)).save(studio.folder / "person.png", exif=exif)
    iuv = np.asarray(Image.open(studio.folder / "person_IUV.png"))
    studio.image("person_IUV.png", np.rot90(iuv))
    with pytest.raises(InputError, match=r"is 192 x 128, but .* is 128 x 192; .*EXIF"):
        prepare(studio.folder / "person.png")


def test_an_iuv_of_another_size_is_refused(studio) -> None:
    photo = studio.source()
    studio.image("person_IUV.png", studio.iuv())
    with pytest.raises(InputError, match=r"is 64 x 96, but .* is 128 x 192; make the IUV from"):
        prepare(photo)


def test_an_empty_iuv_is_refused(studio) -> None:
    photo = studio.source()
    studio.image("person_IUV.png", np.zeros((192, 128, 3), np.uint8))
    with pytest.raises(InputError, match=r"person_IUV\.png: no person in it"):
        prepare(photo)


def test_too_little_body_is_refused(studio) -> None:
    photo = studio.source()
    iuv = studio.iuv(scale=2, size=(192, 128), parts=(2,))
    iuv[..., 1:] //= 16  # a corner of the chest, large in the photo
    studio.image("person_IUV.png", iuv)
    with pytest.raises(InputError, match=r"too little of the body \(0\.\d% of the texture\)"):
        prepare(photo, source_iuv_order="iuv")


def test_transparent_pixels_are_left_out(studio) -> None:
    photo = studio.source()
    rgb = np.asarray(Image.open(photo))
    iuv = np.asarray(Image.open(studio.folder / "person_IUV.png"))
    alpha = np.where(np.isin(iuv[..., 0], HEAD), 0, 255).astype(np.uint8)
    studio.image("person.png", np.concatenate([rgb, alpha[..., None]], 2))
    source = prepare(photo)
    assert colour_of(source, HEAD) is None
    assert colour_of(source, TORSO) == list(RED)


@pytest.mark.parametrize("depth", [np.uint8, np.uint16])
def test_grey_photos_work(studio, depth: type) -> None:
    photo = studio.source()
    iuv = np.asarray(Image.open(studio.folder / "person_IUV.png"))
    grey = np.where(iuv[..., 0] == 2, 0xC8, 0x20).astype(depth)
    Image.fromarray(grey * (257 if depth is np.uint16 else 1)).save(photo)
    assert colour_of(prepare(photo), TORSO) == [0xC8] * 3


def pair(studio) -> np.ndarray:
    """Two people side by side, in a photo and its IUV: red shirt left, green shirt right."""
    left = studio.iuv(scale=2, size=(192, 128))
    photos = [studio.dress(left), studio.dress(left, {TORSO: GREEN})]
    studio.image("pair_IUV.png", np.hstack([left, left]))
    studio.image("pair.png", np.hstack(photos))
    return studio.folder / "pair.png"


@pytest.mark.parametrize(("person", "shirt"), [("0", RED), ("1", GREEN), ("130,0,256,192", GREEN)])
def test_one_of_several_people(studio, person: str, shirt: tuple) -> None:
    assert colour_of(prepare(pair(studio), person=person), TORSO) == list(shirt)


def garment(photo: Path, parts: str, iuv: Path | None = None) -> Garment:
    return Garment(photo=photo, parts=parse_parts(parts), iuv=iuv)


def test_a_garment_replaces_its_parts_only(studio) -> None:
    shirt = studio.source("shirt", colours={TORSO: GREEN, HEAD: (0, 0, 0)})
    source = prepare(studio.source(), garments=(garment(shirt, "torso"),))
    assert colour_of(source, TORSO) == list(GREEN)
    assert colour_of(source, HEAD) == list(YELLOW)


@pytest.mark.parametrize("covered", [False, True])
def test_nothing_shows_under_a_garment(studio, covered: bool) -> None:
    """Its photo shows one arm; the other must not keep the sleeve of source or earlier garment."""
    sleeve = studio.source("sleeve", parts=(2, 15, 19), colours={(15, 19): (0, 0, 0)})
    garments = [garment(sleeve, "upper-arms")]
    if covered:
        garments.insert(0, garment(studio.source("shirt"), "torso,upper-arms"))
    source = prepare(studio.source(), garments=tuple(garments))
    assert colour_of(source, (15,)) == [0, 0, 0]
    assert colour_of(source, (16,)) is None


@pytest.mark.parametrize("swap", [False, True])
def test_the_later_of_two_garments_wins(studio, swap: bool) -> None:
    shirt = garment(studio.source("shirt", colours={TORSO: GREEN}), "torso,upper-legs")
    jacket = garment(studio.source("jacket", colours={TORSO: YELLOW}), "torso")
    pairs = (jacket, shirt) if swap else (shirt, jacket)
    source = prepare(studio.source(), garments=pairs)
    assert colour_of(source, TORSO) == list(GREEN if swap else YELLOW)


def test_every_part_may_come_from_garments(studio) -> None:
    everything = "torso,hands,feet,upper-legs,lower-legs,upper-arms,lower-arms,head"
    other = studio.source("other", colours={TORSO: GREEN})
    source = prepare(studio.source(), garments=(garment(other, everything),))
    assert colour_of(source, TORSO) == list(GREEN)


def test_a_garment_without_its_parts_says_what_it_shows(studio) -> None:
    hat = studio.source("hat", parts=(23, 24))
    with pytest.raises(InputError, match=r"hat\.png shows none of torso-back, torso-front; it sho"):
        prepare(studio.source(), garments=(garment(hat, "torso"),))


def test_a_garments_iuv_can_be_named(studio) -> None:
    shirt = studio.source("shirt", colours={TORSO: GREEN})
    iuv = (studio.folder / "shirt_IUV.png").rename(studio.folder / "elsewhere.png")
    source = prepare(studio.source(), garments=(garment(shirt, "torso", iuv),))
    assert colour_of(source, TORSO) == list(GREEN)
    with pytest.raises(InputError, match=r"no IUV found for .*shirt"):
        prepare(studio.source(), garments=(garment(shirt, "torso"),))


def test_a_garment_brings_its_own_clearance(studio) -> None:
    """A photo with alpha tells how wide the trousers are cut; the rest stays the source's."""

    def clear(name: str, reach: int) -> Path:
        path = studio.source(name, scale=3)
        pixels = np.array(Image.open(path))
        body = np.array(Image.open(path.with_name(f"{name}_IUV.png")))[..., 0] > 0
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        alpha = cv2.dilate(body.astype(np.uint8) * 255, disc)
        return studio.image(f"{name}.png", np.dstack([pixels, alpha]))

    def width(source: Source, parts: tuple[int, ...]) -> float:
        assert source.clearance is not None
        clearance, known = source.clearance
        texels = np.isin(load_uv_tables().part[1::2, 1::2], parts) & (known > 0)
        return float(np.percentile(clearance[texels], 90))

    person, trousers = clear("person", 3), clear("trousers", 9)
    plain, dressed = prepare(person), prepare(person, garments=(garment(trousers, "lower-legs"),))
    assert width(dressed, SHINS) > 2 * width(plain, SHINS)
    assert width(dressed, HEAD) == width(plain, HEAD)


@pytest.mark.parametrize(
    ("taken", "beside", "far_off"),
    [
        ((11, 12, 13, 14), (5, 6), (7, 8, 9, 10)),  # hems on shoes; the trousers above stay
        ((19, 20, 21, 22), (3, 4), (15, 16, 17, 18)),
        ((1, 2), (7, 8, 9, 10), (23, 24)),
    ],
)
def test_what_clothes_cover_of_others_goes_with_them(taken, beside, far_off) -> None:
    tables = load_uv_tables()
    kept = untouched_texels(frozenset(taken))
    part, place = tables.part, tables.position
    assert not kept[np.isin(part, taken)].any()
    assert kept[np.isin(part, far_off)].all()
    near = np.isin(part, beside) & ~kept
    assert 0.05 < near.sum() / np.isin(part, beside).sum() < 0.7
    own = place[np.isin(part, taken)]
    for texel in place[near][::97]:
        assert np.linalg.norm(own - texel, axis=-1).min() <= 0.0501


def test_one_leg_alone_covers_no_shoe() -> None:
    assert untouched_texels(frozenset((11, 13)))[np.isin(load_uv_tables().part, (5, 6))].all()


@pytest.mark.parametrize("corners", [0, 40, 120], ids=["opaque", "rounded", "a window's shadow"])
def test_an_alpha_that_cuts_nobody_out_changes_nothing(studio, corners: int) -> None:
    """As screenshots and exported pictures have it; trimmed to it, a backdrop was worn."""
    photo = studio.source()
    plain = prepare(photo)
    rgb = cv2.imread(str(photo))
    alpha = np.full(rgb.shape[:2], 255, np.uint8)
    if corners == 40:
        alpha[:3, :1] = alpha[-1:, -3:] = corners
    elif corners:
        alpha[[0, -1]] = alpha[:, [0, -1]] = corners
    cv2.imwrite(str(photo), np.dstack([rgb, alpha]))
    source = prepare(photo)
    assert source.photo.alpha is not None
    assert source.photo.cutout is None
    assert (source.texture == plain.texture).all()
    assert (source.visibility == plain.visibility).all()
    assert source.clearance is not None
    assert plain.clearance is not None
    assert (source.clearance == plain.clearance).all()


def test_a_large_photo_is_unfolded_no_finer_than_a_texture_holds(studio, monkeypatch) -> None:
    photo = studio.source()
    for path in (photo, studio.folder / "person_IUV.png"):
        picture = cv2.imread(str(path))
        scale = 4000 / len(picture)
        large = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
        cv2.imwrite(str(path), large)
    heights: list[int] = []

    def trim_and_tell(rgb: np.ndarray, *arguments: object) -> np.ndarray:
        heights.append(len(rgb))
        return trim(rgb, *arguments)

    monkeypatch.setattr("motion_transfer.drawing.source.trim", trim_and_tell)
    quick = prepare(photo)
    monkeypatch.setattr("motion_transfer.drawing.source.LEAST_HEIGHT", np.inf)
    whole = prepare(photo)
    assert heights[0] < 0.6 * heights[1]
    both = (quick.visibility * whole.visibility)[0] > 0
    assert both.sum() > 0.97 * max(quick.visibility.sum(), whole.visibility.sum())
    apart = np.abs(quick.texture - whole.texture)[:, both].max(0)
    assert np.percentile(apart, 95) < 0.05, "all but the borders between colours"
