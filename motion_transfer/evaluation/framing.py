"""How pictures of any size become pictures of one size, the same way for every method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from motion_transfer.errors import InputError
from motion_transfer.option import parse_colour
from motion_transfer.training.metrics import MASK_GROWTH, person_mask
from motion_transfer.training.pictures import PersonPicture, lay_over

Image = UInt8[np.ndarray, "H W 3"]

SMALLEST_SIDE, LARGEST_SIDE = 32, 2048  # px; the coarsest features have a stride of 32
RESIZE_FILTER = "OpenCV INTER_AREA to shrink, INTER_CUBIC to enlarge; IUV and masks nearest"
MASK_RULE = (
    "target's alpha >= 0.5 where it has one, else its IUV > 0 dilated by a disc of"
    f" {MASK_GROWTH:.0%} of the person's height"
)
ASPECT_SLACK_PX = 1.5  # a picture scaled to whole pixels misses its exact aspect by up to that


@dataclass(frozen=True)
class TargetFrame:
    """A target as it is compared: picture, IUV and the mask of its person, all of one size."""

    rgb: Image
    iuv: Image
    mask: Bool[np.ndarray, "H W"]


@dataclass(frozen=True)
class PairPictures:
    """One pair as it is compared, everything at the framing's size; a result for each method."""

    source: Image
    source_iuv: Image
    target: TargetFrame
    results: Sequence[Image]


@dataclass(frozen=True)
class Framing:
    """The size that everything is compared at; what has another aspect is padded, centred.

    Attributes:
        background: `white`, `black` or `#rrggbb`: padding, and what lies behind the person;
            `photo`: the source's own surroundings, padded with white.
    """

    width: int = 256
    height: int = 256
    background: str = "white"

    def __post_init__(self) -> None:
        if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in (self.width, self.height)):
            raise InputError(
                f"size {self.width}x{self.height}; each side must lie in"
                f" {SMALLEST_SIDE}..{LARGEST_SIDE} px"
            )
        parse_colour(self.background)

    @property
    def padding(self) -> tuple[int, int, int]:
        """The RGB of what is added."""
        return parse_colour(self.background) or (255, 255, 255)

    @property
    def background_rule(self) -> str:
        """What lies behind the person in results and targets, in words."""
        if parse_colour(self.background) is None:
            return "results: the source's photo without its person; targets: their own"
        return f"results: {self.background}; targets: the same where alpha is known, else their own"

    def fit(self, picture: Image) -> Image:
        """Scale the whole picture to fit, and pad it."""
        return self._place(picture, self.padding, exact=False)

    def fit_iuv(self, iuv: Image) -> Image:
        """Do the same with IUV, whose values are not mixed."""
        return self._place(iuv, (0, 0, 0), exact=True)

    def fit_target(self, target: PersonPicture) -> TargetFrame:
        """Lay a target over the background colour where its alpha is known, and fit it."""
        rgb = target.rgb
        colour = parse_colour(self.background)
        if target.alpha is not None and colour is not None:
            rgb = lay_over(rgb, target.alpha, colour)
        mask = person_mask(target.iuv, target.alpha)
        return TargetFrame(
            rgb=self.fit(rgb),
            iuv=self.fit_iuv(target.iuv),
            mask=self._place(mask.astype(np.uint8), 0, exact=True) > 0,
        )

    def check_aspect(self, size: tuple[int, int], target: tuple[int, int], what: str) -> None:
        """Refuse a result that is not the whole target, as another crop cannot be compared.

        Args:
            size, target: (width, height), px.
        Raises: InputError.
        """
        # other methods' pictures often have the size of the comparison, padded by themselves
        if size == (self.width, self.height):
            return
        scale = size[1] / target[1]
        if abs(size[0] - target[0] * scale) > ASPECT_SLACK_PX * max(1, scale):
            raise InputError(
                f"{what} is {size[0]} x {size[1]}, but its target is {target[0]} x {target[1]};"
                f" crop or pad it to the target's aspect, or to {self.width} x {self.height}"
            )

    def _place(self, image: np.ndarray, fill: Sequence[int] | int, *, exact: bool) -> np.ndarray:
        height, width = image.shape[:2]
        scale = min(self.width / width, self.height / height)
        inner_width = min(self.width, max(1, round(width * scale)))
        inner_height = min(self.height, max(1, round(height * scale)))
        if (inner_width, inner_height) != (width, height):
            kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
            kind = cv2.INTER_NEAREST_EXACT if exact else kind
            image = cv2.resize(image, (inner_width, inner_height), interpolation=kind)
        canvas = np.full((self.height, self.width, *image.shape[2:]), fill, np.uint8)
        top, left = (self.height - inner_height) // 2, (self.width - inner_width) // 2
        canvas[top : top + inner_height, left : left + inner_width] = image
        return canvas
