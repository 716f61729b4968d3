"""Colours of photos in sRGB, whatever ICC profile they were written with."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, cast

import numpy as np
from PIL import Image, ImageCms

MODES = {"RGB": "RGB", "GRAY": "L", "CMYK": "CMYK"}
"""Pillow's mode for each space of colours that a profile may describe."""

SPACES = {"1": "GRAY", "L": "GRAY", "LA": "GRAY", "La": "GRAY", "CMYK": "CMYK"}
"""The space of each of Pillow's modes; of the others, palettes included, it is RGB."""

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB"))
SAME = 2
"""Grey levels by which profiles of sRGB differ among each other, the one's curves being tables and
the other's formulas. Display P3 is 31 away."""

PROBED = np.linspace(0, 255, 9, dtype=np.uint8)
"""Levels of each channel at which a profile is compared with sRGB."""


class ProfileError(ValueError):
    """A profile says nothing about the picture that holds it."""


@dataclass(frozen=True)
class Conversion:
    """The way from a profile to sRGB.

    Attributes:
        name: What the profile calls itself.
        mode: The mode that a picture has to have.
        transform: None where the profile is sRGB itself.
    """

    name: str
    mode: str
    transform: ImageCms.ImageCmsTransform | None


def convert_to_srgb(image: Image.Image, profile: bytes) -> tuple[Image.Image, str | None]:
    """Convert a picture from its profile to sRGB, as it is to be seen (perceptual intent).

    Args:
        image: 8 bits a channel, without alpha.
    Returns: The picture, in RGB if it was converted, and the name of the profile; the picture
        as it is, and None, if the profile is sRGB's.
    Raises: ProfileError if the profile is damaged, or of other colours than the picture.
    """
    conversion = _conversion(profile, SPACES.get(image.mode, "RGB"))
    if conversion.transform is None:
        return image, None
    if image.mode != conversion.mode:
        image = image.convert(conversion.mode)
    converted = ImageCms.applyTransform(image, conversion.transform)
    assert converted is not None  # only in place there is none
    return converted, conversion.name


def convert_lab(image: Image.Image) -> Image.Image:
    """Convert L*a*b*, which needs no profile, to sRGB."""
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB"))
    transform = ImageCms.buildTransform(lab, SRGB, "LAB", "RGB")
    converted = ImageCms.applyTransform(image, transform)
    assert converted is not None
    return converted


@lru_cache(maxsize=8)  # photos of one folder share it
def _conversion(profile: bytes, space: str) -> Conversion:
    """Find the way from a profile to sRGB for pictures of one space. Raises: ProfileError."""
    try:
        opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        facts = cast(Any, opened.profile)  # it is open: the types leave that open
        described = facts.xcolor_space.strip()
        # grey is a colour, too: editors keep the profile of a photo that is made grey
        if described != space and (described, space) != ("RGB", "GRAY"):
            raise ProfileError(f"it is for {described}, the picture is {space}")
        mode = MODES[described]
        transform = ImageCms.buildTransform(opened, SRGB, mode, "RGB")
        name = " ".join((facts.profile_description or "").split())
        same = mode != "CMYK" and _is_srgb(transform, mode)
    except ProfileError:
        raise
    except (ImageCms.PyCMSError, OSError, ValueError, TypeError) as error:
        raise ProfileError("it is damaged") from error
    name = "".join(letter for letter in name if letter.isprintable())[:80]
    return Conversion(name or "an unnamed profile", mode, None if same else transform)


def _is_srgb(transform: ImageCms.ImageCmsTransform, mode: str) -> bool:
    """Tell whether a transform changes nothing that can be seen: names do not say it."""
    levels = list(product(PROBED, repeat=len(mode)))
    colours = np.array(levels, np.uint8)[None]
    probe = Image.fromarray(colours if mode == "RGB" else colours[..., 0])
    converted = np.asarray(transform.apply(probe)).astype(int)
    return bool(np.abs(converted - colours).max() <= SAME)
