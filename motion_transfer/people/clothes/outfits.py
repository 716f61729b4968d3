"""What people wear: outfits sampled as catalogues and streets show them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from motion_transfer.people.clothes.fabric_colours import luminance, sample_palette
from motion_transfer.people.clothes.fabrics import Colour, Fabric, sample_fabric
from motion_transfer.people.clothes.outfit_tables import (
    BEIGE,
    BLACK,
    GREY,
    LEATHER,
    LEGS,
    METAL,
    NAVY,
    OVERS,
    PRINTABLE,
    PRINTED,
    SKIRTS,
    TOPS,
    WHITE,
    TopKind,
)
from motion_transfer.people.clothes.prints import sample_print
from motion_transfer.people.clothes.wardrobe import Belt, Outfit, Scarf, Shoes, Skirt, Top, Trousers
from motion_transfer.people.figure.body import Shape

__all__ = ["Belt", "Outfit", "Scarf", "Shoes", "Skirt", "Top", "Trousers", "sample_outfit"]


def sample_outfit(rng: np.random.Generator, shape: Shape) -> Outfit:
    """An outfit whose parts go together.

    Args:
        shape: of whom; its `gender` weighs what is worn.
    """
    woman = bool(rng.random() < shape.gender)
    palette = sample_palette(rng, 4)
    kind = rng.random()
    if woman and kind < 0.27:
        outfit = _dress(rng, palette)
    else:
        top = _top(rng, TOPS, woman, palette)
        if woman and kind < 0.48:
            outfit = Outfit(Shoes("bare"), top=top, skirt=_skirt(rng, palette), tucked=True)
            outfit = replace(outfit, tucked=top.kind != "crop_top")
        else:
            trousers = _trousers(rng, woman, palette)
            outfit = Outfit(Shoes("bare"), top=top, trousers=trousers)
            outfit = replace(outfit, tucked=_tucked(rng, top, trousers))
    outfit = _with_over(rng, outfit, woman, palette)
    outfit = replace(outfit, shoes=_shoes(rng, woman, outfit))
    if rng.random() < 0.05 and (outfit.over or (outfit.top and outfit.top.sleeve > 0.7)):
        fabric = sample_fabric(rng, None, palette)
        outfit = replace(outfit, scarf=Scarf(fabric, _in(rng, 0.022, 0.034), _seed(rng)))
    return outfit


def _in(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _one(rng: np.random.Generator, choices: Sequence, weights: Sequence[float] | None = None):
    share = None if weights is None else np.array(weights) / np.sum(weights)
    return choices[int(rng.choice(len(choices), p=share))]


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _trim(rng: np.random.Generator, fabric: Fabric) -> Colour:
    """For buttons, ribs and contrasting edges."""
    ground = fabric.colours[0]
    tone = 0.75 if luminance(ground) > 0.35 else 1.5
    toned = tuple(float(np.clip(channel * tone + 0.02, 0, 1)) for channel in ground)
    other = fabric.colours[-1] if len(fabric.colours) > 1 else _one(rng, (WHITE, BLACK))
    return _one(rng, (toned, ground, other), (0.5, 0.3, 0.2))


def _top(
    rng: np.random.Generator, kinds: Mapping[str, TopKind], woman: bool, palette: Sequence[Colour]
) -> Top:
    name = _one(rng, list(kinds), [k.women if woman else k.men for k in kinds.values()])
    kind = kinds[name]
    fabrics = kind.fabrics or None
    own = None if rng.random() < 0.35 else palette
    fabric = sample_fabric(rng, fabrics, own)
    sleeve = _one(rng, kind.sleeves)
    neck = _one(rng, kind.necks)
    neck = "scoop" if neck == "round" else neck
    deep = {"crew": 0.02, "v": 0.10, "scoop": 0.08, "boat": 0.03, "square": 0.08, "turtle": 0.055}
    wide = {"v": 0.075, "scoop": 0.095, "boat": 0.12, "square": 0.09, "straps": 0.085}
    loose = rng.random()
    fixed = dict(kind.fixed or {})
    printed = name in PRINTABLE and fabric.kind in ("plain", "melange") and rng.random() < 0.42
    if name == "polo" or (name == "shirt" and rng.random() < 0.5):
        fixed["trim"] = WHITE if name == "shirt" else _trim(rng, fabric)
    return Top(
        **{
            "kind": name,
            "fabric": fabric,
            "hem": _in(rng, *kind.hem),
            "sleeve": sleeve * _in(rng, 0.94, 1.02) if 0 < sleeve < 0.9 else sleeve,
            "armhole": _in(rng, 0.0, 0.05),
            "neck": neck,
            "neck_depth": deep.get(neck, 0.05) * _in(rng, 0.8, 1.3) if neck != "straps" else 0.05,
            "neck_width": wide.get(neck, 0.08) * _in(rng, 0.95, 1.05),
            "ease": kind.ease[0] + (kind.ease[1] - kind.ease[0]) * loose,
            "drop": kind.drop[1] + (kind.drop[0] - kind.drop[1]) * loose,
            "sleeve_radii": _one(rng, kind.radii) if sleeve else (0.0,),
            "folds": _in(rng, *kind.folds),
            "trim": _trim(rng, fabric),
            "pocket": "chest" if name in ("t_shirt", "shirt") and rng.random() < 0.2 else "none",
            "print": sample_print(rng, fabric.colours[0]) if printed else None,
            "print_width": _in(rng, 0.14, 0.30) if printed else 0.0,
            "print_on_back": bool(rng.random() < 0.12),
            "seed": _seed(rng),
            **fixed,
        }
    )


def _tucked(rng: np.random.Generator, top: Top, trousers: Trousers) -> bool:
    if top.kind in ("crop_top", "hoodie", "sweater", "turtleneck"):
        return False
    likely = 0.45 if top.kind in ("shirt", "blouse") else 0.2
    return bool(rng.random() < likely + (0.2 if trousers.rise > 0 else 0))


def _belt(rng: np.random.Generator) -> Belt:
    return Belt(_one(rng, LEATHER), _in(rng, 0.025, 0.04), _one(rng, METAL))


def _trousers(rng: np.random.Generator, woman: bool, palette: Sequence[Colour]) -> Trousers:
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


def _skirt(rng: np.random.Generator, palette: Sequence[Colour]) -> Skirt:
    """Any skirt; see `SKIRTS`."""
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


def _dress(rng: np.random.Generator, palette: Sequence[Colour]) -> Outfit:
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
        hem=0.19 + raised - 0.03,
        sleeve=sleeve,
        armhole=_in(rng, 0.0, 0.04),
        neck=neck,
        neck_depth=deep.get(neck, 0.04) * _in(rng, 0.8, 1.3),
        neck_width=_in(rng, 0.08, 0.11),
        ease=_in(rng, 0.003, 0.006),
        drop=_in(rng, 0.8, 2.0),
        sleeve_radii=_one(rng, ((0.0,), (0.0, 0.06, 0.075, 0.08), (0.0, 0.07, 0.09, 0.06)))
        if sleeve
        else (0.0,),
        opening="buttons" if rng.random() < 0.12 else "closed",
        folds=_in(rng, 0.2, 0.5),
        trim=_trim(rng, fabric),
        seed=_seed(rng),
    )
    return Outfit(Shoes("bare"), top=bodice, skirt=skirt, tucked=True)


def _with_over(
    rng: np.random.Generator, outfit: Outfit, woman: bool, palette: Sequence[Colour]
) -> Outfit:
    top = outfit.top
    if top is None or top.collar == "hood" or rng.random() > 0.25:
        return outfit
    over = _top(rng, OVERS, woman, palette)
    sober = rng.random() < 0.6 and over.fabric.kind == "plain"
    if sober:
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
        over = replace(over, hem=0.165)
    return replace(outfit, over=over, over_skirt=tails)


def _shoes(rng: np.random.Generator, woman: bool, outfit: Outfit) -> Shoes:
    formal = outfit.over is not None and outfit.over.kind in ("blazer", "coat")
    kinds = ("sneakers", "trainers", "boots", "flats", "sandals", "loafers", "bare")
    women, men = (0.3, 0.1, 0.2, 0.17, 0.1, 0.08, 0.05), (0.4, 0.18, 0.16, 0, 0.04, 0.19, 0.03)
    kind = _one(rng, kinds, women if woman else men)
    kind = "loafers" if formal and kind in ("sandals", "bare", "trainers") else kind
    leather = _one(rng, (*LEATHER, BLACK, BEIGE, (0.55, 0.1, 0.12)))
    sporty = _one(rng, (WHITE, BLACK, GREY, NAVY, sample_palette(rng, 1)[0]))
    colour = sporty if kind in ("sneakers", "trainers") else leather
    white_sole = kind in ("sneakers", "trainers") and rng.random() < 0.75
    socks = kind in ("sneakers", "trainers", "loafers") and rng.random() < 0.6
    return Shoes(
        kind=kind,
        colour=colour,
        sole=WHITE if white_sole else _one(rng, (BLACK, (0.2, 0.14, 0.1))),
        trim=_one(rng, (WHITE, BLACK, sample_palette(rng, 1)[0])),
        shaft=_one(rng, (0.06, 0.12, 0.2, 0.3)) if kind == "boots" else 0.0,
        sole_height=_in(rng, 0.022, 0.038) if kind != "flats" else 0.010,
        gloss=0.1 if kind in ("sneakers", "trainers") else _in(rng, 0.1, 0.5),
        socks=_one(rng, (WHITE, WHITE, BLACK, GREY, sporty)) if socks else None,
        sock=_in(rng, 0.01, 0.12) if socks else 0.0,
    )
