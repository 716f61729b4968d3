"""A picture of a person with its IUV, wherever it comes from."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.source import read_person
from motion_transfer.errors import InputError
from motion_transfer.media.iuv.formats import ChannelOrder, list_iuv_names
from motion_transfer.media.pictures.photo import Photo, read_photo

Image = UInt8[np.ndarray, "H W 3"]
Plane = UInt8[np.ndarray, "H W"]


@dataclass(frozen=True)
class PersonPicture:
    """One person in one picture.

    Attributes:
        rgb: H x W x 3 uint8, not multiplied by alpha.
        iuv: H x W x 3 uint8 (I, U, V), of that person only; at least one pixel is not background.
        alpha: H x W uint8, what the person covers, where that is known; else None.
    """

    name: str
    rgb: Image
    iuv: Image
    alpha: Plane | None

    def as_photo(self) -> Photo:
        """Make it what a renderer's source is made of."""
        return Photo(Path(self.name), self.rgb, self.alpha, turned=False)

    def digest(self) -> str:
        """Compute the SHA-256 of the pixels, which another encoding of the picture shares."""
        content = hashlib.sha256()
        for plane in (self.rgb, self.iuv, self.alpha):
            if plane is not None:
                content.update(repr(plane.shape).encode() + np.ascontiguousarray(plane).tobytes())
        return content.hexdigest()


class Picture(Protocol):
    """Where a picture can be had.

    Attributes:
        name: The same picture always has the same one; it may hold `/`.
    """

    @property
    def name(self) -> str: ...

    def load(self) -> PersonPicture:
        """Read or make it; called from several threads. Raises: InputError."""
        ...


@dataclass(frozen=True)
class PhotoFile:
    """A photo with its IUV, and perhaps its alpha, beside it.

    The IUV is `STEM_IUV.png` or `STEM_iuv.png`; the alpha is the photo's own, or `STEM_alpha.png`.
    Of several people the largest counts.
    """

    name: str
    path: Path
    iuv_order: ChannelOrder | None = None

    @property
    def iuv_path(self) -> Path:
        """The file of its IUV. Raises: InputError if there is none."""
        candidates = list_iuv_names(self.path)
        if found := next(filter(Path.exists, candidates), None):
            return found
        raise InputError(
            f"photo {self.path} has no IUV: neither {candidates[0].name} nor {candidates[1].name}"
            " is beside it"
        )

    @property
    def alpha_path(self) -> Path:
        """Where its alpha lies, if it is not in the photo itself."""
        return self.path.with_name(f"{self.path.stem}_alpha.png")

    @property
    def has_alpha(self) -> bool:
        """Whether `load` would find one. Raises: InputError if the photo cannot be read."""
        return self.alpha_path.exists() or read_photo(self.path, "photo").cutout is not None

    def load(self) -> PersonPicture:
        """Read photo, IUV and alpha.

        Raises: InputError if a file is missing or broken, sizes differ, or nobody is seen.
        """
        photo = read_photo(self.path, "photo")
        iuv = read_person(photo, self.iuv_path, "largest", self.iuv_order, "photo")
        if not iuv.any():
            raise InputError(f"photo {self.path}: its alpha leaves nobody of its IUV")
        alpha, path = photo.cutout, self.alpha_path
        if alpha is None and path.exists():
            alpha = np.ascontiguousarray(read_photo(path, "alpha").rgb[..., 0])
            if alpha.shape != photo.rgb.shape[:2]:
                raise InputError(
                    f"alpha {path} is {alpha.shape[1]} x {alpha.shape[0]}, but {photo.path} is"
                    f" {photo.rgb.shape[1]} x {photo.rgb.shape[0]}"
                )
        return PersonPicture(self.name, photo.rgb, iuv, alpha)


def lay_over(rgb: Image, alpha: Plane, colour: tuple[int, int, int]) -> Image:
    """Lay a picture over one colour, as its alpha says."""
    weight = alpha[..., None].astype(np.float32) / 255
    return (rgb * weight + np.array(colour, np.float32) * (1 - weight)).round().astype(np.uint8)
