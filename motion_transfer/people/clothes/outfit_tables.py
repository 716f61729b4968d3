"""How often which garments are worn, and the ranges their numbers are sampled from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from motion_transfer.people.clothes.fabrics import Colour

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
    """How tops of one kind are sampled; pairs are ranges.

    Attributes:
        women, men: how often.
        sleeves: lengths as shares of the arm, one of them chosen and varied a little.
        fabrics: kinds; empty allows all.
        rooms: (drop, ease) from tight to loose.
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
        ("v", "boat", "round", "off_shoulder", "square"),
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
    # radii from thigh to hem, ease, drop
    "skinny": ((0.0,), 0.003, 10.0),
    "slim": ((0.0, 0.0, 0.062), 0.006, 0.6),
    "straight": ((0.0, 0.085, 0.08, 0.078), 0.010, 0.25),
    "wide": ((0.0, 0.105, 0.115, 0.12), 0.012, 0.05),
    "flared": ((0.0, 0.0, 0.06, 0.085, 0.12), 0.004, 1.0),
    "tapered": ((0.0, 0.095, 0.08, 0.06), 0.014, 0.3),
}


# kind: how often, length, flare, number of waves, their height
SKIRTS: dict[str, tuple] = {
    "mini": (0.2, (0.22, 0.36), (0.0, 0.15), (0, 0), (0.0, 0.0)),
    "pencil": (0.15, (0.45, 0.66), (-0.08, 0.02), (0, 0), (0.0, 0.0)),
    "a_line": (0.2, (0.3, 0.66), (0.16, 0.4), (6, 9), (0.005, 0.014)),
    "circle": (0.12, (0.28, 0.55), (0.45, 0.75), (8, 11), (0.015, 0.025)),
    "pleated": (0.15, (0.25, 0.75), (0.2, 0.4), (16, 20), (0.006, 0.010)),
    "maxi": (0.12, (0.86, 1.0), (0.06, 0.22), (6, 10), (0.008, 0.018)),
    "tiered": (0.06, (0.5, 0.9), (0.16, 0.3), (8, 12), (0.010, 0.018)),
}
