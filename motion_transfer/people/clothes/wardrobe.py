"""What people wear, as plain numbers: kinds, lengths, colours.

`outfits.py` chooses them, `garments.py` builds them.

Convention: lengths are metres on a body of the template's size (1.84 m) and stand for the same
places on every body; `sleeve` and `length` are shares of the arm (shoulder to wrist) or leg (hip
to ankle). Colours are sRGB 0..1. Everything is JSON-able through `dataclasses.asdict`. Of all
garments these say the same:

    kind      what it is called, and sometimes how it is decorated
    ease      distance from what is below
    drop      metres of radius by which cloth may follow the body for each metre; 0 hangs straight
    gap       half the width of an open front, 0 closed
    folds     0 smooth .. 1 crumpled
    trim      colour of buttons, ribs, stripes, laces
    gloss     0 cloth .. 1 patent leather
    seed      of folds and other details
"""

from __future__ import annotations

from dataclasses import dataclass

from motion_transfer.people.clothes.fabrics import Colour, Fabric
from motion_transfer.people.clothes.prints import Print


@dataclass(frozen=True)
class Belt:
    """A belt; `buckle` is the colour of its buckle."""

    colour: Colour
    width: float
    buckle: Colour


@dataclass(frozen=True)
class Top:
    """A garment on the trunk.

    Attributes:
        kind: t_shirt, tank, long_sleeve, shirt, blouse, hoodie, sweater, crop_top, polo,
            turtleneck, jacket, blazer, coat, cardigan or bodice (of a dress).
        hem: Height above the crotch of its lower edge; below about 0 a skirt of its own goes on.
        sleeve: Share of the arm; 0 is sleeveless.
        armhole: How far in from the shoulder's edge a sleeveless armhole is cut.
        neck: crew, v, scoop, boat, square, off_shoulder, straps or turtle.
        neck_depth, neck_width: From the neck's base down in front, and half its width.
        sleeve_radii: Least radii along the sleeve.
        opening: closed, buttons or open (in front).
        collar: none, shirt, polo, lapels, hood or band.
        cuffs: plain, ribbed or buttoned.
        print_width: Of the motif; 0 without one.
        pocket: none, chest, kangaroo or patch.
    """

    kind: str
    fabric: Fabric
    hem: float
    sleeve: float = 0.3
    armhole: float = 0.0
    neck: str = "crew"
    neck_depth: float = 0.02
    neck_width: float = 0.08
    ease: float = 0.008
    drop: float = 0.2
    sleeve_radii: tuple[float, ...] = (0.0,)
    opening: str = "closed"
    gap: float = 0.0
    collar: str = "none"
    cuffs: str = "plain"
    folds: float = 0.5
    trim: Colour = (0.9, 0.9, 0.9)
    print: Print | None = None
    print_width: float = 0.0
    print_on_back: bool = False
    pocket: str = "none"
    gloss: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Trousers:
    """A garment with two legs.

    Attributes:
        kind: jeans, chinos, suit, leggings, joggers or shorts.
        length: Share of the leg.
        rise: Height of the waistband above the waist (often below: negative).
        ease: At hips and thighs.
        radii: Least radii from thigh to hem.
        cuffs: plain, ribbed or turned_up.
        stripe: One down the outer seams.
    """

    kind: str
    fabric: Fabric
    length: float
    rise: float = -0.03
    ease: float = 0.006
    radii: tuple[float, ...] = (0.0,)
    drop: float = 10.0
    folds: float = 0.5
    cuffs: str = "plain"
    trim: Colour = (0.7, 0.55, 0.3)
    stripe: bool = False
    belt: Belt | None = None
    gloss: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Skirt:
    """A tube from the waist or the hips, alone or sewn to a bodice or a coat.

    Attributes:
        kind: mini, pencil, a_line, circle, pleated, maxi, tiered or tails (of a coat or tunic).
        length: Share of the leg where it ends.
        top: Height of its upper edge above the waist.
        flare: By how much the radius grows for each metre below the hips.
        waves: Their number around the hem; 0 none.
        wave_height: At the hem.
        pleats: Sharp pleats instead of round waves.
        waistband: Its height; 0 none.
    """

    kind: str
    fabric: Fabric
    length: float
    top: float = 0.0
    flare: float = 0.1
    waves: int = 0
    wave_height: float = 0.0
    pleats: bool = False
    ease: float = 0.008
    gap: float = 0.0
    waistband: float = 0.03
    folds: float = 0.5
    trim: Colour = (0.8, 0.8, 0.8)
    belt: Belt | None = None
    gloss: float = 0.0
    seed: int = 0


@dataclass(frozen=True)
class Shoes:
    """A pair of shoes.

    Attributes:
        kind: sneakers, trainers, boots, flats, sandals, loafers or bare.
        shaft: Height of a boot's shaft above the ankle joint; 0 for low shoes.
        socks: Their colour.
        sock: Height of the socks above the ankle joint.
    """

    kind: str
    colour: Colour = (0.2, 0.2, 0.2)
    sole: Colour = (0.9, 0.9, 0.9)
    trim: Colour = (0.9, 0.9, 0.9)
    shaft: float = 0.0
    sole_height: float = 0.025
    gloss: float = 0.1
    socks: Colour | None = None
    sock: float = 0.0


@dataclass(frozen=True)
class Scarf:
    """A scarf wound around the neck; `thickness` is its roll's."""

    fabric: Fabric
    thickness: float
    seed: int


@dataclass(frozen=True)
class Outfit:
    """Everything one person wears.

    Attributes:
        top: Next to the skin; a bodice and a `skirt` in the same fabric are a dress.
        over: A jacket or the like over the top.
        top_skirt, over_skirt: What hangs from a long top or coat below the hips.
        tucked: The top is inside the waistband.
    """

    shoes: Shoes
    top: Top | None = None
    over: Top | None = None
    trousers: Trousers | None = None
    skirt: Skirt | None = None
    top_skirt: Skirt | None = None
    over_skirt: Skirt | None = None
    tucked: bool = False
    scarf: Scarf | None = None
