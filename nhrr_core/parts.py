"""DensePose's parts of the body, by number. Left and right are the person's own.

Source: DensePose (Güler et al., CVPR 2018).
"""

PART_COUNT = 24

ALL_PARTS = tuple(range(1, PART_COUNT + 1))

PART_NAMES: tuple[str, ...] = (
    "background",
    "torso-back",
    "torso-front",
    "hand-right",
    "hand-left",
    "foot-left",
    "foot-right",
    "upper-leg-right-back",
    "upper-leg-left-back",
    "upper-leg-right-front",
    "upper-leg-left-front",
    "lower-leg-right-back",
    "lower-leg-left-back",
    "lower-leg-right-front",
    "lower-leg-left-front",
    "upper-arm-left-front",
    "upper-arm-right-front",
    "upper-arm-left-back",
    "upper-arm-right-back",
    "lower-arm-left-inner",
    "lower-arm-right-inner",
    "lower-arm-left-outer",
    "lower-arm-right-outer",
    "head-right",
    "head-left",
)
"""`PART_NAMES[i]` is the name of part i."""

PART_GROUPS: dict[str, tuple[int, ...]] = {
    "torso": (1, 2),
    "hands": (3, 4),
    "feet": (5, 6),
    "upper-legs": (7, 8, 9, 10),
    "lower-legs": (11, 12, 13, 14),
    "upper-arms": (15, 16, 17, 18),
    "lower-arms": (19, 20, 21, 22),
    "head": (23, 24),
}
"""The words people use for garments, each for both sides and both faces of the limb."""

FOREARMS: dict[int, tuple[int, int]] = {3: (20, 22), 4: (19, 21)}
"""The two faces of each hand's forearm."""
