"""What people wear: outfits sampled by tables of how often and in which measures garments are worn.

Shares and ranges are chosen by eye, so that outfits look like those of catalogues and streets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from motion_transfer.people.clothes.fabrics import Colour, Fabric, sample_fabric
from motion_transfer.people.clothes.fabrics.colours import luminance, sample_palette
from motion_transfer.people.clothes.prints import sample_print
from motion_transfer.people.clothes.wardrobe import Belt, Outfit, Scarf, Shoes, Skirt, Top, Trousers
from motion_transfer.people.figure.body import Shape

LEATHER: tuple[Colour, ...] = ((0.09, 0.08, 0.08), (0.25, 0.15, 0.10), (0.45, 0.28, 0.16))
METAL: tuple[Colour, ...] = ((0.75, 0.74, 0.72), (0.72, 0.60, 0.35))
WHITE: Colour = (0.93, 0.92, 0.90)
BLACK: Colour = (0.08, 0.08, 0.09)
BEIGE: Colour = (0.76, 0.68, 0.55)
GREY: Colour = (0.5, 0.5, 0.51)
NAVY: Colour = (0.12, 0.15, 0.25)
KNITS = ("plain", "melange", "stripes", "knit", "argyle", "chevron", "colour_block")
PRINTED = (
    "stripes", "checks", "plaid", "houndstooth", "herringbone", "dots", "flowers", "leaves",
    "abstract", "leopard", "camouflage", "marble",
)  # fmt: skip
PRINTABLE = ("t_shirt", "long_sleeve", "hoodie", "crop_top", "tank", "sweater")
SHIRTS = ("plain", "plain", "stripes", "checks", "plaid", "dots", "flowers", "leaves", "melange")


@dataclass(frozen=True)
class TopKind:
    """How tops of one kind are sampled; pairs are ranges of the attributes of `Top`.

    Attributes:
        women, men: How often.
        sleeves: Lengths as shares of the arm, one of them chosen and varied a little.
        ease, drop: One chance decides about both: what is looser hangs straighter.
        necks, radii: One of them is chosen; repeated ones are likelier.
        fabrics: Kinds; empty allows all.
        fixed: What all of them have.
    """

    women: float
    men: float
    sleeves: tuple[float, ...]
    hem: tuple[float, float]
    ease: tuple[float, float]
    drop: tuple[float, float]
    necks: tuple[str, ...] = ("crew",)
    radii: tuple[tuple[float, ...], ...] = ((0.0,),)
    folds: tuple[float, float] = (0.4, 0.9)
    fabrics: tuple[str, ...] = ()
    fixed: Mapping[str, object] | None = None


SHORT, LONG = (0.22, 0.30, 0.38, 0.45), (0.97, 1.0, 1.0)
TEE_SLEEVES = ((0.0,), (0.0, 0.06, 0.068, 0.07), (0.0, 0.066, 0.075, 0.08))
LOOSE_SLEEVES = ((0.0, 0.066, 0.06, 0.045), (0.0, 0.07, 0.065, 0.055))
DRESS_SLEEVES = ((0.0,), (0.0, 0.06, 0.075, 0.08), (0.0, 0.07, 0.09, 0.06))
TOPS: dict[str, TopKind] = {
    "t_shirt": TopKind(
        0.24, 0.36, SHORT, (0.02, 0.10), (0.005, 0.014), (0.05, 0.6),
        ("crew", "crew", "crew", "v", "scoop"), TEE_SLEEVES,
    ),
    "tank": TopKind(
        0.10, 0.05, (0.0,), (0.03, 0.12), (0.003, 0.010), (0.1, 1.2),
        ("scoop", "scoop", "v", "crew", "straps", "square"),
    ),
    "long_sleeve": TopKind(
        0.10, 0.09, (0.75, *LONG), (0.03, 0.10), (0.004, 0.010), (0.2, 1.0),
        ("crew", "v", "boat", "scoop"), ((0.0,), (0.0, 0.062, 0.055, 0.045)),
    ),
    "shirt": TopKind(
        0.09, 0.17, (0.3, 0.6, *LONG), (0.015, 0.05), (0.008, 0.014), (0.05, 0.35), ("v",),
        LOOSE_SLEEVES, (0.6, 1.0), SHIRTS,
        {"collar": "shirt", "opening": "buttons", "cuffs": "buttoned"},
    ),
    "blouse": TopKind(
        0.10, 0.0, (0.0, 0.3, 0.6, 0.8, 1.0), (0.03, 0.10), (0.008, 0.014), (0.0, 0.3),
        ("v", "boat", "scoop", "off_shoulder", "square"),
        ((0.0, 0.07, 0.08, 0.08), (0.0, 0.06, 0.075, 0.11), (0.0, 0.075, 0.09, 0.05)), (0.6, 1.0),
    ),
    "hoodie": TopKind(
        0.07, 0.12, (1.0, 1.04), (0.03, 0.07), (0.016, 0.024), (0.0, 0.1), ("crew",),
        ((0.0, 0.075, 0.07, 0.07, 0.05),), (0.7, 1.0),
        ("plain", "melange", "colour_block", "tie_dye"),
        {"collar": "hood", "cuffs": "ribbed", "pocket": "kangaroo"},
    ),
    "sweater": TopKind(
        0.10, 0.09, (1.0, 1.03), (0.03, 0.09), (0.010, 0.020), (0.0, 0.3),
        ("crew", "crew", "v", "boat"), ((0.0, 0.07, 0.065, 0.06, 0.045),), (0.5, 0.8), KNITS,
        {"cuffs": "ribbed"},
    ),
    "crop_top": TopKind(
        0.08, 0.0, (0.0, 0.0, 0.25, 0.35, 1.0), (0.20, 0.27), (0.002, 0.006), (0.2, 1.5),
        ("crew", "scoop", "v", "off_shoulder", "square", "straps"), ((0.0,),), (0.2, 0.5),
    ),
    "polo": TopKind(
        0.03, 0.09, (0.3, 0.36), (0.02, 0.07), (0.006, 0.012), (0.1, 0.5), ("crew",),
        ((0.0, 0.062, 0.065),), (0.4, 0.8),
        ("plain", "plain", "stripes", "melange", "colour_block"),
        {"collar": "polo", "cuffs": "ribbed"},
    ),
    "turtleneck": TopKind(
        0.05, 0.03, (1.0,), (0.04, 0.09), (0.003, 0.012), (0.1, 1.0), ("turtle",), ((0.0,),),
        (0.3, 0.6), KNITS,
    ),
}  # fmt: skip
OVERS: dict[str, TopKind] = {
    "jacket": TopKind(
        0.3, 0.35, (1.0, 1.03), (0.05, 0.12), (0.012, 0.018), (0.0, 0.2), ("v",),
        ((0.0, 0.075, 0.07, 0.06),), (0.7, 1.0), ("plain", "denim", "melange", "camouflage"),
        {"collar": "shirt", "pocket": "patch", "cuffs": "buttoned"},
    ),
    "blazer": TopKind(
        0.25, 0.3, (1.0,), (0.015, 0.05), (0.010, 0.014), (0.1, 0.5), ("v",),
        ((0.0, 0.07, 0.065, 0.058),), (0.25, 0.5), ("plain", "herringbone", "plaid", "houndstooth"),
        {"collar": "lapels", "pocket": "patch"},
    ),
    "coat": TopKind(
        0.15, 0.15, (1.0, 1.02), (0.15, 0.17), (0.014, 0.02), (0.0, 0.2), ("v",),
        ((0.0, 0.08, 0.075, 0.07),), (0.4, 0.7), ("plain", "herringbone", "melange", "plaid"),
        {"collar": "lapels"},
    ),
    "cardigan": TopKind(
        0.3, 0.2, (0.75, 1.0, 1.03), (0.015, 0.08), (0.010, 0.016), (0.0, 0.4), ("v",),
        ((0.0, 0.068, 0.065, 0.05),), (0.5, 0.8), KNITS, {"cuffs": "ribbed", "collar": "band"},
    ),
}  # fmt: skip


LEGS: dict[str, tuple[tuple[float, ...], float, float]] = {
    "skinny": ((0.0,), 0.003, 10.0),
    "slim": ((0.0, 0.0, 0.062), 0.006, 0.6),
    "straight": ((0.0, 0.085, 0.08, 0.078), 0.010, 0.25),
    "wide": ((0.0, 0.105, 0.115, 0.12), 0.012, 0.05),
    "flared": ((0.0, 0.0, 0.06, 0.085, 0.12), 0.004, 1.0),
    "tapered": ((0.0, 0.095, 0.08, 0.06), 0.014, 0.3),
}
"""Cut of trousers -> radii from thigh to hem, ease, drop."""

SKIRTS: dict[str, tuple] = {
    "mini": (0.2, (0.22, 0.36), (0.0, 0.15), (0, 0), (0.0, 0.0)),
    "pencil": (0.15, (0.45, 0.66), (-0.08, 0.02), (0, 0), (0.0, 0.0)),
    "a_line": (0.2, (0.3, 0.66), (0.16, 0.4), (6, 9), (0.005, 0.014)),
    "circle": (0.12, (0.28, 0.55), (0.45, 0.75), (8, 11), (0.015, 0.025)),
    "pleated": (0.15, (0.25, 0.75), (0.2, 0.4), (16, 20), (0.006, 0.010)),
    "maxi": (0.12, (0.86, 1.0), (0.06, 0.22), (6, 10), (0.008, 0.018)),
    "tiered": (0.06, (0.5, 0.9), (0.16, 0.3), (8, 12), (0.010, 0.018)),
}
"""Kind of skirt -> how often, length, flare, number of waves, their height."""


def sample_outfit(rng: Generator, shape: Shape) -> Outfit:
    """Sample an outfit whose parts go together.

    Args:
        shape: Of whom it is; its `gender` weighs what is worn.
    """
    woman = bool(rng.random() < shape.gender)
    palette = sample_palette(rng, 4)
    kind = rng.random()
    bare = Shoes("bare")  # shoes are chosen last, to go with the rest
    if woman and kind < 0.27:
        outfit = _dress(rng, palette)
    else:
        top = _top(rng, TOPS, woman, palette)
        if woman and kind < 0.48:
            skirt = _skirt(rng, palette)
            outfit = Outfit(bare, top=top, skirt=skirt, tucked=top.kind != "crop_top")
        else:
            trousers = _trousers(rng, woman, palette)
            likely = 0.45 if top.kind in ("shirt", "blouse") else 0.2
            likely += 0.2 if trousers.rise > 0 else 0
            never = top.kind in ("crop_top", "hoodie", "sweater", "turtleneck")
            tucked = bool(not never and rng.random() < likely)
            outfit = Outfit(bare, top=top, trousers=trousers, tucked=tucked)
    outfit = _with_over(rng, outfit, woman, palette)
    outfit = replace(outfit, shoes=_shoes(rng, woman, outfit))
    if rng.random() < 0.05 and (outfit.over or (outfit.top and outfit.top.sleeve > 0.7)):
        fabric = sample_fabric(rng, None, palette)
        outfit = replace(outfit, scarf=Scarf(fabric, _in(rng, 0.022, 0.034), _seed(rng)))
    return outfit


def _in(rng: Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _one(rng: Generator, choices: Sequence, weights: Sequence[float] | None = None):
    share = None if weights is None else np.array(weights) / np.sum(weights)
    return choices[int(rng.choice(len(choices), p=share))]


def _seed(rng: Generator) -> int:
    return int(rng.integers(2**31))


def _trim(rng: Generator, fabric: Fabric) -> Colour:
    """Choose a colour for buttons, ribs and contrasting edges."""
    ground = fabric.colours[0]
    tone = 0.75 if luminance(ground) > 0.35 else 1.5
    toned = tuple(float(np.clip(channel * tone + 0.02, 0, 1)) for channel in ground)
    other = fabric.colours[-1] if len(fabric.colours) > 1 else _one(rng, (WHITE, BLACK))
    return _one(rng, (toned, ground, other), (0.5, 0.3, 0.2))


def _top(
    rng: Generator, kinds: Mapping[str, TopKind], woman: bool, palette: Sequence[Colour]
) -> Top:
    name = _one(rng, list(kinds), [k.women if woman else k.men for k in kinds.values()])
    kind = kinds[name]
    fabric = sample_fabric(rng, kind.fabrics or None, None if rng.random() < 0.35 else palette)
    sleeve = _one(rng, kind.sleeves)
    neck = _one(rng, kind.necks)
    deep = {"crew": 0.02, "v": 0.10, "scoop": 0.08, "boat": 0.03, "square": 0.08, "turtle": 0.055}
    wide = {"v": 0.075, "scoop": 0.095, "boat": 0.12, "square": 0.09, "straps": 0.085}
    loose = rng.random()
    fixed: dict[str, Any] = dict(kind.fixed or {})
    printed = name in PRINTABLE and fabric.kind in ("plain", "melange") and rng.random() < 0.42
    if name == "polo" or (name == "shirt" and rng.random() < 0.5):
        fixed["trim"] = WHITE if name == "shirt" else _trim(rng, fabric)
    top = Top(
        kind=name,
        fabric=fabric,
        hem=_in(rng, *kind.hem),
        sleeve=sleeve * _in(rng, 0.94, 1.02) if 0 < sleeve < 0.9 else sleeve,
        armhole=_in(rng, 0.0, 0.05),
        neck=neck,
        neck_depth=deep.get(neck, 0.05) * _in(rng, 0.8, 1.3) if neck != "straps" else 0.05,
        neck_width=wide.get(neck, 0.08) * _in(rng, 0.95, 1.05),
        ease=kind.ease[0] + (kind.ease[1] - kind.ease[0]) * loose,
        drop=kind.drop[1] + (kind.drop[0] - kind.drop[1]) * loose,
        sleeve_radii=_one(rng, kind.radii) if sleeve else (0.0,),
        folds=_in(rng, *kind.folds),
        trim=_trim(rng, fabric),
        pocket="chest" if name in ("t_shirt", "shirt") and rng.random() < 0.2 else "none",
        print=sample_print(rng, fabric.colours[0]) if printed else None,
        print_width=_in(rng, 0.14, 0.30) if printed else 0.0,
        print_on_back=bool(rng.random() < 0.12),
        seed=_seed(rng),
    )
    return replace(top, **fixed)


def _belt(rng: Generator) -> Belt:
    return Belt(_one(rng, LEATHER), _in(rng, 0.025, 0.04), _one(rng, METAL))


def _trousers(rng: Generator, woman: bool, palette: Sequence[Colour]) -> Trousers:
    kinds = ("jeans", "chinos", "suit", "leggings", "joggers", "shorts")
    women, men = (0.42, 0.12, 0.14, 0.12, 0.06, 0.14), (0.42, 0.2, 0.11, 0.0, 0.1, 0.17)
    kind = _one(rng, kinds, women if woman else men)
    cut = {"leggings": "skinny", "joggers": "tapered"}.get(kind)
    if cut is None:
        shares = (0.3, 0.2, 0.22, 0.18, 0.1, 0.0) if woman else (0.1, 0.35, 0.38, 0.07, 0.0, 0.1)
        cut = _one(rng, list(LEGS), shares)
    radii, ease, drop = LEGS[cut]
    length = _one(rng, (1.0, 1.0, 1.0, 0.93, 0.88, 0.8), (4, 4, 4, 2, 1.5, 0.5))
    if kind == "shorts":
        length = _in(rng, 0.22, 0.42) if woman else _in(rng, 0.36, 0.56)
        tight = woman and rng.random() < 0.4
        radii, ease, drop = ((0.0,), 0.004, 2.0) if tight else ((0.0, 0.0), 0.014, 0.05)
    if kind == "joggers":
        length = min(length, 0.99)
    if kind == "jeans" or (kind == "shorts" and rng.random() < 0.4):
        fabric = sample_fabric(rng, ["denim"])
    elif rng.random() < (0.35 if kind in ("leggings", "shorts") or cut == "wide" else 0.08):
        fabric = sample_fabric(rng, PRINTED, palette)
    else:
        sober = (BLACK, NAVY, GREY, BEIGE, (0.33, 0.33, 0.25), (0.2, 0.2, 0.22), palette[1])
        fabric = sample_fabric(rng, ["plain", "plain", "melange"], [_one(rng, sober)])
    belt = _belt(rng) if kind in ("jeans", "chinos", "suit") and rng.random() < 0.35 else None
    return Trousers(
        kind=kind,
        fabric=fabric,
        length=length,
        rise=_in(rng, -0.03, 0.045) if woman else _in(rng, -0.05, 0.0),
        ease=ease,
        radii=radii,
        drop=drop,
        folds={"skinny": 0.35, "wide": 0.7}.get(cut, 0.6) * _in(rng, 0.7, 1.4),
        cuffs="ribbed" if kind == "joggers" else _one(rng, ("plain", "turned_up"), (0.88, 0.12)),
        trim=_trim(rng, fabric) if kind in ("joggers", "leggings") else (0.72, 0.55, 0.33),
        stripe=bool(kind in ("joggers", "leggings", "shorts") and rng.random() < 0.3),
        belt=belt,
        gloss=0.35 if kind == "leggings" and rng.random() < 0.15 else 0.0,
        seed=_seed(rng),
    )


def _skirt(rng: Generator, palette: Sequence[Colour]) -> Skirt:
    kind = _one(rng, list(SKIRTS), [row[0] for row in SKIRTS.values()])
    _, length, flare, waves, height = SKIRTS[kind]
    denim = kind in ("mini", "pencil") and rng.random() < 0.35
    fabric = sample_fabric(rng, ["denim"]) if denim else sample_fabric(rng, None, palette)
    return Skirt(
        kind=kind,
        fabric=fabric,
        length=_in(rng, *length),
        top=_in(rng, -0.02, 0.05),
        flare=_in(rng, *flare),
        waves=int(rng.integers(waves[0], waves[1] + 1)),
        wave_height=_in(rng, *height),
        pleats=kind == "pleated",
        waistband=_in(rng, 0.02, 0.045),
        folds=_in(rng, 0.3, 0.8),
        trim=_trim(rng, fabric),
        belt=_belt(rng) if rng.random() < 0.12 else None,
        seed=_seed(rng),
    )


def _dress(rng: Generator, palette: Sequence[Colour]) -> Outfit:
    skirt = _skirt(rng, palette)
    fabric = sample_fabric(rng, None, palette if rng.random() < 0.6 else None)
    raised = _one(rng, (0.01, 0.01, 0.04, 0.10))
    skirt = replace(skirt, fabric=fabric, top=raised, waistband=0.0, ease=0.007)
    if skirt.belt is None and rng.random() < 0.15:
        skirt = replace(skirt, belt=_belt(rng))
    sleeve = _one(rng, (0.0, 0.0, 0.25, 0.35, 0.6, 1.0))
    neck = _one(rng, ("v", "scoop", "crew", "boat", "square", "straps", "off_shoulder"))
    deep = {"v": 0.12, "scoop": 0.08, "square": 0.09, "crew": 0.02}
    bodice = Top(
        kind="bodice",
        fabric=fabric,
        hem=0.19 + raised - 0.03,  # 3 cm below the skirt's edge, so that no skin shows between
        sleeve=sleeve,
        armhole=_in(rng, 0.0, 0.04),
        neck=neck,
        neck_depth=deep.get(neck, 0.04) * _in(rng, 0.8, 1.3),
        neck_width=_in(rng, 0.08, 0.11),
        ease=_in(rng, 0.003, 0.006),
        drop=_in(rng, 0.8, 2.0),
        sleeve_radii=_one(rng, DRESS_SLEEVES) if sleeve else (0.0,),
        opening="buttons" if rng.random() < 0.12 else "closed",
        folds=_in(rng, 0.2, 0.5),
        trim=_trim(rng, fabric),
        seed=_seed(rng),
    )
    return Outfit(Shoes("bare"), top=bodice, skirt=skirt, tucked=True)


def _with_over(rng: Generator, outfit: Outfit, woman: bool, palette: Sequence[Colour]) -> Outfit:
    top = outfit.top
    if top is None or top.collar == "hood" or rng.random() > 0.25:
        return outfit
    over = _top(rng, OVERS, woman, palette)
    if rng.random() < 0.6 and over.fabric.kind == "plain":  # most are sober
        colour = _one(rng, (BLACK, NAVY, GREY, BEIGE, palette[-1]))
        over = replace(over, fabric=sample_fabric(rng, ["plain", "melange"], [colour]))
    closed = rng.random() < 0.3
    over = replace(
        over,
        opening="buttons" if closed else "open",
        gap=0.0 if closed else _in(rng, 0.03, 0.09),
        neck_depth=_in(rng, 0.14, 0.26),
        neck_width=0.085,
        sleeve=max(over.sleeve, min(top.sleeve, 1.0)),
    )
    tails = None
    if over.kind == "coat":
        tails = Skirt(
            kind="tails",
            fabric=over.fabric,
            length=_in(rng, 0.25, 0.68),
            top=0.0,
            flare=_in(rng, 0.05, 0.2),
            ease=over.ease,
            gap=over.gap,
            waistband=0.0,
            belt=_belt(rng) if closed and rng.random() < 0.4 else None,
            seed=over.seed,
        )
        over = replace(over, hem=0.165)  # ends where its tails begin
    return replace(outfit, over=over, over_skirt=tails)


def _shoes(rng: Generator, woman: bool, outfit: Outfit) -> Shoes:
    formal = outfit.over is not None and outfit.over.kind in ("blazer", "coat")
    kinds = ("sneakers", "trainers", "boots", "flats", "sandals", "loafers", "bare")
    women, men = (0.3, 0.1, 0.2, 0.17, 0.1, 0.08, 0.05), (0.4, 0.18, 0.16, 0, 0.04, 0.19, 0.03)
    kind = _one(rng, kinds, women if woman else men)
    kind = "loafers" if formal and kind in ("sandals", "bare", "trainers") else kind
    casual = kind in ("sneakers", "trainers")
    leather = _one(rng, (*LEATHER, BLACK, BEIGE, (0.55, 0.1, 0.12)))
    sporty = _one(rng, (WHITE, BLACK, GREY, NAVY, sample_palette(rng, 1)[0]))
    white_sole = casual and rng.random() < 0.75
    socks = (casual or kind == "loafers") and rng.random() < 0.6
    return Shoes(
        kind=kind,
        colour=sporty if casual else leather,
        sole=WHITE if white_sole else _one(rng, (BLACK, (0.2, 0.14, 0.1))),
        trim=_one(rng, (WHITE, BLACK, sample_palette(rng, 1)[0])),
        shaft=_one(rng, (0.06, 0.12, 0.2, 0.3)) if kind == "boots" else 0.0,
        sole_height=_in(rng, 0.022, 0.038) if kind != "flats" else 0.010,
        gloss=0.1 if casual else _in(rng, 0.1, 0.5),
        socks=_one(rng, (WHITE, WHITE, BLACK, GREY, sporty)) if socks else None,
        sock=_in(rng, 0.01, 0.12) if socks else 0.0,
    )
