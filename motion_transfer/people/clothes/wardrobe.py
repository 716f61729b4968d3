"""What people wear, as plain numbers: kinds, lengths, colours.

`outfits.py` chooses them, `garments.py` builds them.

Convention: lengths are metres on a body of the template's size (1.84 m) and stand for the same
places on every body; `sleeve` and `length` are shares of the arm (shoulder to wrist) or leg (hip
to ankle). Everything is JSON-able through `dataclasses.asdict`.
"""

from __future__ import annotations

from dataclasses import dataclass

from motion_transfer.people.clothes.fabrics import Colour, Fabric
from motion_transfer.people.clothes.prints import Print


@dataclass(frozen=True)
class Belt:
    """Attributes: colour: sRGB 0..1; width: metres; buckle: sRGB colour of its buckle."""

    colour: Colour
    width: float
    buckle: Colour


@dataclass(frozen=True)
class Top:
    """A garment on the trunk.

    Attributes:
        kind: t_shirt, tank, long_sleeve, shirt, blouse, hoodie, sweater, crop_top, polo,
            turtleneck, jacket, blazer, coat, cardigan, bodice.
        fabric: of it.
        hem: height above the crotch of its lower edge; below about 0 a skirt of its own goes on.
        sleeve: share of the arm; 0 is sleeveless.
        armhole: how far in from the shoulder's edge a sleeveless armhole is cut, metres.
        neck: crew, v, scoop, boat, square, off_shoulder, straps or turtle.
        neck_depth, neck_width: metres below the neck's base in front, and half its width.
        ease: distance from what is below, metres.
        drop: 0 hangs straight down from the chest; about 1 follows the body.
        sleeve_radii: least radii along the sleeve, metres.
        opening: closed, buttons, zip or open (in front).
        gap: half the width of an open front, metres.
        collar: none, shirt, polo, lapels, hood or band.
        cuffs: plain, ribbed or buttoned.
        folds: 0 smooth .. 1 crumpled.
        trim: colour of buttons, ribs, stripes; sRGB.
        print: a motif, or None.
        print_width: metres; 0 without a print.
        print_on_back: its place.
        pocket: none, chest, kangaroo or patch.
        gloss: 0 cloth .. 1 patent leather.
        seed: of folds and other details.
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
        kind: jeans, chinos, suit, leggings, joggers, shorts.
        length: share of the leg.
        rise: height of the waistband above the waist (often below: negative), metres.
        ease: at hips and thighs, metres.
        radii: least radii from thigh to hem, metres.
        drop: as for tops, in metres of radius a metre.
        cuffs: plain, ribbed or turned_up.
        stripe: a stripe down the outer seams.
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
        top: height of its upper edge above the waist, metres.
        length: share of the leg where it ends; below 0 the hip joint's height is the edge.
        flare: by how much the radius grows for each metre below the hips.
        waves: number of waves around the hem; 0 none.
        wave_height: of the waves at the hem, metres.
        pleats: sharp pleats instead of round waves.
        ease: from hips and legs, metres.
        gap: half the width of an open front, metres; 0 closed.
        waistband: height of a waistband, metres; 0 none.
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
        colour, sole, trim: sRGB; trim is of laces, stripes and straps.
        shaft: height of a boot's shaft above the ankle joint, metres; 0 for low shoes.
        socks: colour of socks, or None.
        sock: height of the socks above the ankle joint, metres.
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
    """Attributes: fabric: of it; thickness: of its roll, metres; seed: of its folds."""

    fabric: Fabric
    thickness: float
    seed: int


@dataclass(frozen=True)
class Outfit:
    """Everything one person wears.

    Attributes:
        shoes: on the feet.
        top: next to the skin; with a `skirt` in the same fabric and no trousers it is a dress.
        over: a jacket or the like over the top.
        trousers: or None.
        skirt: or None.
        top_skirt, over_skirt: what hangs from a long top or coat below the hips.
        tucked: the top is inside the waistband.
        scarf: or None.
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

    @property
    def is_dress(self) -> bool:
        """The skirt is sewn to the top."""
        return self.top is not None and self.top.kind == "bodice"
