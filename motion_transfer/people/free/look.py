"""What a free person looks like: which items, in which colours, and what of the project's own.

Shares are chosen by eye, so that crowds look like those of streets and catalogues. Names that
stand here are those of MakeHuman's items; a folder without them does without what they say.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from motion_transfer.people.clothes.fabrics.colours import sample_palette
from motion_transfer.people.clothes.outfits import sample_outfit
from motion_transfer.people.clothes.wardrobe import Outfit
from motion_transfer.people.figure.body import Shape
from motion_transfer.people.free.assets import Assets, Colour, Item
from motion_transfer.people.free.binding import load_parts
from motion_transfer.people.head.faces import Face, greyed, sample_face
from motion_transfer.people.head.hair import Hair, sample_hair

HELD_OUT_IN, HELD_OUT_BY = 5, "kept apart"
"""One item in so many, by the checksum of these words and its name, is never worn in training. The
words were chosen so that of MakeHuman's items some of each kind and sex are."""

HELD_OUT_SHARE = 0.5
"""How often a held-out person's skin, clothes, hair or shoes are drawn among those items alone."""

DOLLS = ("creamy_female", "light_skin_female_bronze")
"""Skins as even as a doll's."""

OVER_EYES = ("bob01", "short03", "short04")
"""Hair that covers an eye."""

UNDER_HATS = ("short04",)
"""Hair that a hat fits over; it comes through with all other."""

UNISEX = ("male_casualsuit02", "male_casualsuit03", "male_casualsuit04")
"""Suits that women wear as well."""

SKIRTED = ("female_elegantsuit01",)
"""Suits whose lower part is a skirt."""

UNDYED = ("male_elegantsuit01",)
"""Suits whose pieces have colours that belong together."""

LIGHT: tuple[Colour, ...] = (
    (0.96, 0.96, 0.95),
    (0.93, 0.91, 0.87),
    (0.90, 0.87, 0.80),
    (0.86, 0.88, 0.90),
    (0.90, 0.85, 0.83),
    (0.82, 0.83, 0.82),
)
"""White, cream and pale cloth: large plain light clothes are the hardest to keep their shape."""

LIGHT_SHARE = 0.25
OUTFIT_SHARE = 0.4  # the project's own garments: twelve suits are few cuts
GROWN_SHARE = 0.3  # its own hair, of which there are more styles than of photographed
SKIRT_SHARE, TOP_SHARE = 0.2, 0.3  # of women in photographed clothes; of those in tops
MIXED_SHARE = 0.3  # of those wear the shirt of one suit and the trousers of another
HAT_SHARE, BALD_SHARE = 0.06, 0.06
AFRO_SHARE = 0.5  # of people of african types
YOUNG, MIDDLE_AGED = 0.72, 0.82  # the ages below which a skin of that age is worn


@dataclass(frozen=True)
class Dye:
    """A colour that a cloth's mean becomes, sRGB, and how much of it, 0..1."""

    colour: Colour
    share: float


@dataclass(frozen=True)
class Worn:
    """An item of clothing, or a part of it; see `load_parts`.

    Attributes:
        dye: None: its own colours.
    """

    item: str
    part: str = "whole"
    dye: Dye | None = None


@dataclass(frozen=True)
class Look:
    """Everything of one free person but the build; JSON-able through `dataclasses.asdict`.

    Attributes:
        skin, eyes, brows, lashes, hair, hat: Names of items; eyes a picture's, which an eyeball
            wears. None: none.
        tone: Multiplies the skin's colours.
        hair_colour: sRGB; brows have it, too.
        hat_picture: A role of the hat's pictures.
        clothes: Shirt, trousers, shoes and the like.
        face: Whose beard and glasses are worn; its colours are not seen.
        outfit: The project's own garments, in place of clothes.
        grown: The project's own hair, in place of an item's.
    """

    skin: str
    tone: Colour
    eyes: str
    brows: str | None
    lashes: str | None
    hair_colour: Colour
    hair: str | None
    hat: str | None
    hat_picture: str
    clothes: tuple[Worn, ...]
    face: Face
    outfit: Outfit | None
    grown: Hair | None


def is_held_out(name: str) -> bool:
    """Tell whether an item is kept from training, whatever the folder that holds it."""
    return zlib.crc32(f"{HELD_OUT_BY}:{name}".encode()) % HELD_OUT_IN == 0


class _Closet:
    """What somebody may wear: in training nothing that is held out, if anything else is left."""

    def __init__(self, rng: Generator, assets: Assets, held_out: bool) -> None:
        self._rng, self._assets, self._held_out = rng, assets, held_out

    def of(self, kind: str, sex: str | None = None) -> list[Item]:
        """List the items of a kind that a sex may wear; None: whoever wears them."""
        items = [i for i in self._assets.of(kind) if sex is None or i.sex in (sex, "any")]
        if self._held_out:
            return items
        return [item for item in items if not is_held_out(item.name)] or items

    def draw(self, items: Sequence[Item]) -> Item | None:
        """Draw one, of the held-out split often one of the held-out; None where there is none."""
        often = self._rng.random() < HELD_OUT_SHARE
        apart = [item for item in items if is_held_out(item.name)]
        chosen = apart if self._held_out and often and apart else items
        return chosen[int(self._rng.integers(len(chosen)))] if chosen else None

    def parts(self, item: Item | None) -> tuple[str, ...]:
        """Tell what of an item can be worn apart."""
        return tuple(load_parts(item, self._assets)) if item else ()


def sample_look(rng: Generator, shape: Shape, assets: Assets, *, held_out: bool) -> Look:
    """Sample a look that goes with a body.

    Args:
        held_out: Whether the person is one of the split that nothing is trained on. Nobody in
            training wears an item that `is_held_out`; of that split's people half of the skins,
            of the suits, of the hair and of the shoes are such, wherever one fits, and all
            combinations and colours are their own.
    """
    sex = "female" if shape.gender > 0.5 else "male"
    closet = _Closet(rng, assets, held_out)
    face = sample_face(rng, replace(shape, gender=float(sex == "female")))
    skin = closet.draw(_fitting_skins(closet.of("skin"), shape, sex))
    assert skin is not None  # a folder without skins is refused
    light, warm = np.exp(rng.normal(0, 0.05)), rng.normal(0, 0.012)
    own_hair = greyed(face.hair_colour, face.grey)
    hair, hat = _hair(rng, closet, shape, sex)
    grown = None
    if hat is None and rng.random() < GROWN_SHARE:
        grown = sample_hair(rng, shape, face)
        hair = None
    clothes, outfit = _clothes(rng, closet, sex), None
    if not clothes or rng.random() < OUTFIT_SHARE:
        clothes, outfit = (), sample_outfit(rng, replace(shape, gender=float(sex == "female")))
    hats = [role for role in (hat.pictures if hat else ()) if role.startswith("diffuse")]
    return Look(
        skin=skin.name,
        tone=(float(light * (1 + warm)), float(light), float(light * (1 - warm))),
        eyes=_eyes(rng, closet, face),
        brows=_name(closet.draw(closet.of("eyebrows"))),
        lashes=_lashes(closet, sex),
        hair_colour=grown.colour if grown else own_hair,
        hair=_name(hair),
        hat=_name(hat),
        hat_picture=hats[int(rng.integers(len(hats)))] if hats else "diffuse",
        clothes=clothes,
        face=face,
        outfit=outfit,
        grown=grown,
    )


def _name(item: Item | None) -> str | None:
    return item.name if item else None


def _fitting_skins(skins: Sequence[Item], shape: Shape, sex: str) -> list[Item]:
    """Keep the skins of a body's sex, and of its origin and age as far as there are any."""
    shares = {"african": shape.african, "asian": shape.asian, "caucasian": shape.caucasian}
    origin = max(shares, key=lambda name: shares[name])
    mixed = max(shares.values()) < 0.6 * sum(shares.values()) and origin != "african"
    wanted = ("eurasian", origin) if mixed and shape.asian > 0.25 else (origin,)
    age = "young" if shape.age < YOUNG else "middleage" if shape.age < MIDDLE_AGED else "old"
    chosen = [skin for skin in skins if skin.name not in DOLLS] or list(skins)
    for fits in (
        lambda skin: skin.sex in (sex, "any"),
        lambda skin: skin.origin in wanted,
        lambda skin: skin.age == age,
    ):
        chosen = [skin for skin in chosen if fits(skin)] or chosen
    return chosen


def _eyes(rng: Generator, closet: _Closet, face: Face) -> str:
    """Choose brown eyes, or the light ones that go with a face of light eyes."""
    eyes = closet.of("eye texture")
    brown = [item for item in eyes if item.name.startswith("brown")]
    others = [item for item in eyes if item not in brown]
    light = sum(face.iris) > 1.0
    chosen = (others if light and others else brown) or eyes
    return chosen[int(rng.integers(len(chosen)))].name


def _lashes(closet: _Closet, sex: str) -> str | None:
    lashes = closet.of("eyelashes")
    return _name(closet.draw(lashes if sex == "female" else lashes[:1]))


def _hair(
    rng: Generator, closet: _Closet, shape: Shape, sex: str
) -> tuple[Item | None, Item | None]:
    """Choose hair, or none, and a hat where the hair allows for one."""
    african = shape.african > max(shape.asian, shape.caucasian)
    styles = closet.of("hair", sex)
    afro = [item for item in styles if item.name.startswith("afro")]
    # what covers an eye is left to one in ten
    free = [item for item in styles if item not in afro and item.name not in OVER_EYES]
    chosen = afro if african and afro and rng.random() < AFRO_SHARE else free
    covering = [item for item in styles if item.name in OVER_EYES]
    if not chosen or (covering and rng.random() < 0.1):
        chosen = covering or styles
    hair = closet.draw(chosen)
    if sex == "male" and rng.random() < BALD_SHARE:
        hair = None
    hats = closet.of("hat")
    if hats and rng.random() < HAT_SHARE:
        fitting = [item for item in styles if item.name in UNDER_HATS]
        hair = closet.draw(fitting) if sex == "male" and rng.random() < 0.6 else None
        if hair or sex == "male":
            return hair, closet.draw(hats)
        hair = closet.draw(chosen)
    return hair, None


def _clothes(rng: Generator, closet: _Closet, sex: str) -> tuple[Worn, ...]:
    """Choose something for trunk, legs and feet, or nothing where the folder lacks one of them."""
    suits = closet.of("suit", sex)
    if sex == "female":
        suits += [item for item in closet.of("suit") if item.name in UNISEX]
    suit, other = closet.draw(suits), closet.draw(suits)
    top, skirt = closet.draw(closet.of("top", sex)), closet.draw(closet.of("skirt", sex))
    shoes = closet.draw(closet.of("shoes", sex))
    upper, lower = _dyes(rng)
    kind = rng.random()
    parts = closet.parts(suit)
    shirt = suit.name if suit and "upper" in parts else None
    if skirt and (shirt or top) and (suit is None or kind < SKIRT_SHARE):
        plain = shirt is None or (top and kind < SKIRT_SHARE * TOP_SHARE)
        above = Worn(top.name, dye=upper) if top and plain else Worn(str(shirt), "upper", upper)
        worn = [above, Worn(skirt.name, dye=lower)]
    elif shirt and other and kind > 1 - MIXED_SHARE and "lower" in closet.parts(other):
        worn = [Worn(shirt, "upper", upper), Worn(other.name, "lower", lower)]
    elif suit:
        dyes = {} if suit.name in UNDYED else {"upper": upper, "lower": lower, "whole": upper}
        worn = [Worn(suit.name, part, dyes.get(part)) for part in parts]
    else:
        return ()
    return (*worn, Worn(shoes.name)) if shoes else ()


def _dyes(rng: Generator) -> tuple[Dye | None, Dye | None]:
    """Choose colours above and below the waist; now and then plain light cloth all over."""
    light = rng.random() < LIGHT_SHARE
    shades = [LIGHT[int(rng.integers(len(LIGHT)))] for _ in range(2)]
    palette = sample_palette(rng, 2)
    dyed = rng.random(2) < (0.8, 0.6)
    if light:
        shades[1] = shades[0] if rng.random() < 0.5 else shades[1]
        return Dye(shades[0], 0.97), Dye(shades[1], 0.97)
    upper = Dye(palette[0], 0.92) if dyed[0] else None
    return upper, Dye(palette[1], 0.85) if dyed[1] else None
