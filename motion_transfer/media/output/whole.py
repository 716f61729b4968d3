"""Marks and digests of outputs over which one encoder goes: GIF, animated WebP and PNG."""

from __future__ import annotations

from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.media.files import read_bytes
from motion_transfer.media.output.contents import shorten
from motion_transfer.media.output.marks import MakeMark, Mark, parse_mark
from motion_transfer.media.pictures.xmp import digest_pictures, find_xmp, put_xmp


def mark_file(path: Path, mark: MakeMark | None) -> None:
    """Let a finished file say what it is."""
    if mark is not None:
        data = path.read_bytes()
        path.write_bytes(put_xmp(data, mark([shorten(digest_pictures(data))]).xmp()))


def digest_output(output: Path, _counts: object) -> list[str]:
    """Make one digest of the file without its marks, see `segments.digest_output`."""
    try:
        return [shorten(digest_pictures(read_bytes(output, "output")))]
    except ValueError as error:
        raise InputError(f"{output} is damaged: {error}") from None


def read_mark(output: Path) -> Mark | None:
    """Read what a file says, see `segments.read_mark`."""
    try:
        xmp = find_xmp(read_bytes(output, "output"))
    except ValueError:
        return None
    return parse_mark(xmp.decode("utf-8", "replace")) if xmp else None
