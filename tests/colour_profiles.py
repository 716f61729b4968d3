"""ICC profiles, made from their numbers: none may be copied from where they come with photos."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np
from PIL import ImageCms

WHITE = (0.9642, 1.0, 0.8249)
CURVE_OF_SRGB = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
SRGB_CURVE = struct.pack(">4s4xHH", b"para", 3, 0) + struct.pack(
    ">5i", *(round(number * 65536) for number in CURVE_OF_SRGB)
)


def gamma(power: float) -> bytes:
    return struct.pack(">4s4xIH", b"curv", 1, round(power * 256))


def matrix_profile(name: str, columns: Sequence[Sequence[float]], curve: bytes) -> bytes:
    """RGB with XYZ (D50) of red, green and blue, and one curve for all of them."""
    tags = {f"{letter}XYZ": _xyz(column) for letter, column in zip("rgb", columns, strict=True)}
    return _profile(name, b"RGB ", {**tags, **{f"{letter}TRC": curve for letter in "rgb"}})


def grey_profile(name: str, curve: bytes) -> bytes:
    return _profile(name, b"GRAY", {"kTRC": curve})


def cmyk_profile(name: str, inked: tuple[int, int, int]) -> bytes:
    """Paper is white, all inks together are black, and others one colour (L, a, b in 8 bits)."""
    straight = bytes(range(256))
    grid = bytes((255, 128, 128)) + bytes(inked) * 14 + bytes((0, 128, 128))
    unit = struct.pack(">9i", *(np.eye(3) * 65536).astype(int).ravel())
    table = struct.pack(">4s4xBBBx", b"mft1", 4, 3, 2) + unit + straight * 4 + grid + straight * 3
    return _profile(name, b"CMYK", {"A2B0": table}, b"prtr", b"Lab ")


def _xyz(values: Sequence[float]) -> bytes:
    return struct.pack(">4s4x3i", b"XYZ ", *(round(value * 65536) for value in values))


def _profile(
    name: str,
    space: bytes,
    tags: dict[str, bytes],
    kind: bytes = b"mntr",
    connection: bytes = b"XYZ ",
) -> bytes:
    text = name.encode() + b"\0"
    described = struct.pack(">4s4xI", b"desc", len(text)) + text + bytes(78)
    tags = {"desc": described, "wtpt": _xyz(WHITE), **tags}
    bodies, table = b"", struct.pack(">I", len(tags))
    for tag, body in tags.items():
        table += struct.pack(">4sII", tag.encode(), 132 + 12 * len(tags) + len(bodies), len(body))
        bodies += body + bytes(-len(body) % 4)
    length = 132 + 12 * len(tags) + len(bodies)
    head = struct.pack(">I4xI4s4s4s12x4s", length, 0x02400000, kind, space, connection, b"acsp")
    head = head.ljust(68, b"\0") + struct.pack(">3i", *(round(value * 65536) for value in WHITE))
    return head.ljust(128, b"\0") + table + bodies


SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
DISPLAY_P3 = matrix_profile(
    "Display P3",
    [(0.5151, 0.2412, -0.0011), (0.2920, 0.6922, 0.0419), (0.1571, 0.0666, 0.7841)],
    SRGB_CURVE,
)
ADOBE_RGB = matrix_profile(
    "Adobe RGB (1998)",
    [(0.6097, 0.3111, 0.0195), (0.2053, 0.6257, 0.0609), (0.1492, 0.0632, 0.7446)],
    gamma(2.199),
)
LINEAR_GREY = grey_profile("Linear grey", gamma(1))
RED_INK = cmyk_profile("Red ink", (138, 209, 198))
"""CIE Lab of sRGB's red: 54, 81, 70."""
