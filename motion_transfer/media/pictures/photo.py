"""Single pictures: photos read upright, and pictures written or encoded."""

from __future__ import annotations

import io
import warnings
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image, ImageOps, UnidentifiedImageError

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes


@dataclass(frozen=True)
class Photo:
    """An upright picture.

    Attributes:
        rgb: The colours, not multiplied by alpha.
        alpha: The opacity where the file has one, else None.
        turned: Whether the file's EXIF orientation had to be applied.
    """

    path: Path
    rgb: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"] | None
    turned: bool

    def on_white(self) -> UInt8[np.ndarray, "H W 3"]:
        """Lay the picture on paper: where it is transparent, white shows."""
        if self.alpha is None or self.alpha.min() == 255:
            return self.rgb
        weight = self.alpha[..., None].astype(np.uint16)
        # in whole numbers, + 127 to round: the same bytes on every machine
        return ((self.rgb * weight + 255 * (255 - weight) + 127) // 255).astype(np.uint8)


def allow_large() -> AbstractContextManager[object]:
    """Let Pillow read up to twice its limit without a warning: that is a large picture, no attack.

    Beyond that it raises `DecompressionBombError` all the same.
    """
    return warnings.catch_warnings(action="ignore", category=Image.DecompressionBombWarning)


def read_photo(path: Path, what: str = "source") -> Photo:
    """Read a picture of any common format, turned upright as its EXIF data says.

    Raises: InputError if it is missing, unreadable, truncated or not a picture.
    """
    data = read_bytes(path, what)
    try:
        with allow_large(), Image.open(io.BytesIO(data)) as file:
            # 1 is upright, and some cameras write 0, which means nothing
            turned = file.getexif().get(ExifTags.Base.Orientation, 1) not in (0, 1)
            # copies of large photos add up: only where something changes
            image = ImageOps.exif_transpose(file) if turned else file
            if image.mode.startswith("I"):  # 16-bit grey; convert() would clip, not scale
                grey = np.asarray(image).astype(np.uint32) >> 8
                image = Image.fromarray(grey.astype(np.uint8))
            transparent = "A" in image.mode or "transparency" in image.info
            mode = "RGBA" if transparent else "RGB"
            pixels = np.array(image if image.mode == mode else image.convert(mode))
    except UnidentifiedImageError:
        raise InputError(f"{what} {path} is not a picture in a known format") from None
    except Image.DecompressionBombError as error:
        raise InputError(f"{what} {path} is too large: {error}; scale it down first") from error
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{what} {path} is damaged: {error}; save it again") from error
    alpha = pixels[..., 3].copy() if transparent else None
    return Photo(path=path, rgb=np.ascontiguousarray(pixels[..., :3]), alpha=alpha, turned=turned)


def write_png(path: Path, pixels: UInt8[np.ndarray, "H W 3"] | UInt8[np.ndarray, "H W"]) -> None:
    """Write a picture, RGB or grey, as PNG. Raises: OSError."""
    ok, encoded = cv2.imencode(".png", pixels[..., ::-1] if pixels.ndim == 3 else pixels)
    if not ok:
        raise OSError(f"cannot encode a PNG of {pixels.shape}")
    path.write_bytes(encoded.tobytes())


def encode_png(pixels: UInt8[np.ndarray, "H W 3"], *, compression: int = 1) -> bytes:
    """Encode an RGB picture as PNG; `compression` from 0 (large, fast) to 9."""
    _, encoded = cv2.imencode(".png", pixels[..., ::-1], (cv2.IMWRITE_PNG_COMPRESSION, compression))
    return encoded.tobytes()


def encode_jpeg(pixels: UInt8[np.ndarray, "H W 3"], *, quality: int = 92) -> bytes:
    """Encode an RGB picture as JPEG with whole colour resolution; `quality` from 0 to 100."""
    settings = (
        *(cv2.IMWRITE_JPEG_QUALITY, quality),
        *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
    )
    _, encoded = cv2.imencode(".jpg", pixels[..., ::-1], settings)
    return encoded.tobytes()
