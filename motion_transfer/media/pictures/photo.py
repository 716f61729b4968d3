"""Single pictures: photos read upright and in sRGB, and pictures written or encoded."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from jaxtyping import UInt8
from PIL import ExifTags, Image, UnidentifiedImageError

from motion_transfer.errors import InputError
from motion_transfer.extras import require_extra
from motion_transfer.media.alpha import OPAQUE, add_alpha, lay_on_white
from motion_transfer.media.files import read_bytes
from motion_transfer.media.pictures.colours import ProfileError, convert_lab, convert_to_srgb
from motion_transfer.media.pictures.png import SIGNATURE, find_png_fault
from motion_transfer.media.pictures.xmp import put_xmp
from motion_transfer.media.quiet import quiet_libraries

HEIF_BRANDS = set(b"heic heix heim heis hevc hevx hevm hevs mif1 msf1".split())
AVIF_BRANDS = {b"avif", b"avis"}
"""What the first box of a file calls itself; AVIF goes by `mif1`, too."""

NO_PHOTOS = {"EPS", "WMF", "BUFR", "GRIB", "HDF5", "MPEG"}
"""Formats that Pillow tells, and cannot read; EPS is a program, which it would have run."""

TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""What turns a picture upright, by EXIF's orientation; 1 is upright, and some cameras write 0."""

UNSIGNED_16 = ("PNG", "PPM")
"""Formats whose pictures of mode `I` are of 16 bits, which some of Pillow's versions widen."""

# Tags of TIFF, and values of theirs, where Pillow gives numbers as they stand in the file.
BITS_PER_SAMPLE = 258
PHOTOMETRIC, WHITE_IS_ZERO = 262, 0
PLANAR_CONFIGURATION, PLANAR = 284, 2
SAMPLE_FORMAT, UNSIGNED, UNDEFINED = 339, 1, 4

FAST_PNG = (
    *(cv2.IMWRITE_PNG_COMPRESSION, 1),
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP),
    *(cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE),
)
"""Measured: of IUV in 60 % of the time and 63 % of the size of OpenCV's own choice, of drawn frames
in the same time and 89 %; lossless either way."""

RECTANGLE_SHARE = 0.97
"""Of the box around what is opaque: people fill less, a window with rounded corners more."""

NO_WHITE = ", and nothing says which one is white; save it with 8 or 16 bits a channel"


@dataclass(frozen=True)
class Photo:
    """An upright picture in sRGB.

    Attributes:
        rgb: The colours, not multiplied by alpha.
        alpha: The opacity where the file has one, else None.
        turned: Whether the file's EXIF orientation had to be applied.
        profile: The name of the ICC profile that the colours were converted from, if they were.
        notes: What the user should know of how the file is read, in sentences.
    """

    path: Path
    rgb: UInt8[np.ndarray, "H W 3"]
    alpha: UInt8[np.ndarray, "H W"] | None
    turned: bool
    profile: str | None = None
    notes: tuple[str, ...] = ()

    @cached_property
    def cutout(self) -> UInt8[np.ndarray, "H W"] | None:
        """The alpha if it tells where what is shown ends, else None.

        One that is opaque all over a rectangle does not: many programs write an alpha channel that
        is opaque everywhere, or but for the rounded corners of a window.
        """
        if self.alpha is None:
            return None
        opaque = self.alpha >= OPAQUE / 2
        *_, width, height = cv2.boundingRect(opaque.view(np.uint8))
        if width and np.count_nonzero(opaque) >= RECTANGLE_SHARE * width * height:
            return None
        return self.alpha

    def on_white(self) -> UInt8[np.ndarray, "H W 3"]:
        """Lay the picture on paper: where it is transparent, white shows."""
        if self.alpha is None or self.alpha.min() == 255:
            return self.rgb
        return lay_on_white(self.rgb, self.alpha)

    def rgba(self) -> UInt8[np.ndarray, "H W 4"]:
        """Put colours and alpha together."""
        return add_alpha(self.rgb, self.alpha)


def read_photo(path: Path, what: str = "source") -> Photo:
    """Read a picture of any common format, turned upright as its EXIF data says, in sRGB.

    Raises: InputError if it is missing, unreadable, truncated, not a picture, or has numbers
        without a fixed white.
    """
    data = read_bytes(path, what)
    where = f"{what} {path}"
    return _decode(data, path, where)


def decode_png(data: bytes, path: Path, where: str) -> Photo:
    """Decode what `encode_png` made, and came out of the file at a path. Raises: InputError."""
    if not data.startswith(SIGNATURE):
        raise InputError(f"{where} is damaged: it holds a picture that is no PNG; save it again")
    return _decode(data, path, where)


def _decode(data: bytes, path: Path, where: str) -> Photo:
    with explain_damage(where), open_image(io.BytesIO(data), where) as file:
        if fault := find_png_fault(data):
            raise InputError(f"{where} is {fault}; save it again")
        return decode_photo(file, path, where)


@contextmanager
def explain_damage(where: str) -> Iterator[None]:
    """Say which picture could not be decoded, whatever went wrong, and keep warnings back.

    Pillow warns of large pictures, too: up to twice its limit they are no attack, and beyond that
    it raises `DecompressionBombError` all the same.
    Raises: InputError.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except InputError:
        raise
    except UnidentifiedImageError:
        raise InputError(
            f"{where} is not a picture in a known format; save it as PNG or JPEG, with 8 bits a"
            " channel"
        ) from None
    except Image.DecompressionBombError as error:
        raise InputError(f"{where} is too large: {error}; scale it down first") from error
    except Exception as error:  # each of Pillow's plugins raises what its parser happens to meet
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{where} is damaged: {reason}; save it again") from error


def open_image(file: BinaryIO, where: str) -> Image.Image:
    """Open a picture of any format that is read here.

    Raises: InputError for HEIC where its package is missing, and what Pillow raises.
    """
    head = file.read(256)
    file.seek(0)
    if is_heif(head):
        try:
            require_extra("heic")
        except InputError as error:
            raise InputError(f"{where} is HEIC, and {error}, or save it as JPEG") from None
        from pillow_heif import register_heif_opener

        register_heif_opener()
        try:
            return Image.open(file, formats=["HEIF"])
        except UnidentifiedImageError:
            raise OSError("it begins as HEIC, and does not go on so") from None
    image = Image.open(file)
    if image.format in NO_PHOTOS:
        raise UnidentifiedImageError
    return image


def decode_photo(file: Image.Image, path: Path, where: str) -> Photo:
    """Decode the current picture of an open file.

    Raises: InputError if its numbers have no fixed white, and what Pillow raises.
    """
    _check_numbers(file, where)
    notes: list[str] = []
    said = _orientation(file)
    if said is None:
        notes.append(f"the EXIF data of {path} are damaged; the picture is taken as upright")
    with quiet_libraries() if file.format == "TIFF" else nullcontext():
        file.load()  # turns a TIFF, and then says that it is upright
    image = _with_8_bits(file)
    if turn := TURNS.get(_orientation(file) or 1):
        image = image.transpose(turn)
    alpha = image.convert("RGBA").getchannel("A") if image.has_transparency_data else None
    name: str | None = None
    if image.mode == "LAB":
        image = convert_lab(image)
    elif profile := file.info.get("icc_profile"):
        try:
            image, name = convert_to_srgb(image, profile)
        except ProfileError as error:
            notes.append(
                f"the colour profile of {path} cannot be used ({error}); its colours are taken as"
                " sRGB"
            )
    # copies of large photos add up: only where something changes
    rgb = np.array(image if image.mode == "RGB" else image.convert("RGB"))
    opacity = None if alpha is None else np.array(alpha)
    return Photo(path, rgb, opacity, said in TURNS, name, tuple(notes))


def is_heif(head: bytes) -> bool:
    """Tell whether a file's first box is HEIC's, whatever the file is called: phones write JPEG."""
    if head[4:8] != b"ftyp":
        return False
    end = int.from_bytes(head[:4], "big")
    brands = {head[8:12], *(head[at : at + 4] for at in range(16, min(end, len(head)), 4))}
    return bool(brands & HEIF_BRANDS) and not brands & AVIF_BRANDS


def _orientation(file: Image.Image) -> int | None:
    """Read EXIF's orientation; None where the EXIF data cannot be read."""
    try:
        return file.getexif().get(ExifTags.Base.Orientation, 1)
    except Exception:  # as above
        return None


def _check_numbers(file: Image.Image, where: str) -> None:
    """Refuse what Pillow would clip or take for something else. Raises: InputError."""
    tags = getattr(file, "tag_v2", {})
    if file.mode == "F":
        raise InputError(f"{where} holds floating-point numbers{NO_WHITE}")
    signed = not {UNSIGNED, UNDEFINED}.issuperset(tags.get(SAMPLE_FORMAT, (UNSIGNED,)))
    if signed or (file.mode == "I" and file.format not in UNSIGNED_16):
        raise InputError(f"{where} holds whole numbers of 32 bits, or with a sign{NO_WHITE}")
    if (
        tags.get(PLANAR_CONFIGURATION) == PLANAR
        and max(tags.get(BITS_PER_SAMPLE, (8,))) > 8
        and file.info.get("compression") == "raw"
    ):
        raise InputError(
            f"{where} holds a plane of 16 bits for each channel; save it with 8 bits a channel"
        )


def _with_8_bits(file: Image.Image) -> Image.Image:
    """Scale greys of 16 bits to 8, which Pillow would clip."""
    if not file.mode.startswith("I"):
        return file
    values = np.asarray(file)
    tags = getattr(file, "tag_v2", {})
    bits = tags.get(BITS_PER_SAMPLE, (16,))[0]
    greys = (values >> (bits - 8)).astype(np.uint8)
    image = Image.fromarray(255 - greys if tags.get(PHOTOMETRIC) == WHITE_IS_ZERO else greys)
    if (clear := file.info.get("transparency")) is not None:
        image.putalpha(Image.fromarray(np.where(values == clear, 0, 255).astype(np.uint8)))
    return image


def write_png(
    path: Path,
    pixels: UInt8[np.ndarray, "H W C"] | UInt8[np.ndarray, "H W"],
    xmp: bytes | None = None,
) -> None:
    """Write a picture, RGB, RGBA or grey, as PNG, with XMP if there is any. Raises: OSError."""
    ok, encoded = cv2.imencode(".png", _to_opencv(pixels), FAST_PNG)
    if not ok:
        raise OSError(f"cannot encode a PNG of {pixels.shape}")
    data = encoded.tobytes()
    path.write_bytes(data if xmp is None else put_xmp(data, xmp))


def encode_png(
    pixels: UInt8[np.ndarray, "H W 3"] | UInt8[np.ndarray, "H W 4"],
    *,
    compression: int | None = None,
) -> bytes:
    """Encode an RGB or RGBA picture as PNG; `compression` to 9 takes longer for smaller ones."""
    settings = FAST_PNG if compression is None else (cv2.IMWRITE_PNG_COMPRESSION, compression)
    _, encoded = cv2.imencode(".png", _to_opencv(pixels), settings)
    return encoded.tobytes()


def encode_jpeg(pixels: UInt8[np.ndarray, "H W 3"], *, quality: int = 92) -> bytes:
    """Encode an RGB picture as JPEG with whole colour resolution; `quality` from 0 to 100."""
    settings = (
        *(cv2.IMWRITE_JPEG_QUALITY, quality),
        *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
    )
    _, encoded = cv2.imencode(".jpg", _to_opencv(pixels), settings)
    return encoded.tobytes()


def _to_opencv(
    pixels: UInt8[np.ndarray, "H W C"] | UInt8[np.ndarray, "H W"],
) -> UInt8[np.ndarray, "H W C"] | UInt8[np.ndarray, "H W"]:
    """Bring colours into OpenCV's order; not by indexing, which leaves planes it takes apart."""
    if pixels.ndim == 2:
        return pixels
    way = cv2.COLOR_RGBA2BGRA if pixels.shape[-1] == 4 else cv2.COLOR_RGB2BGR
    return cv2.cvtColor(pixels, way)
