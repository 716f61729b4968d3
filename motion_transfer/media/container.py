"""The one way to open a media file, to read or to write.

FFmpeg takes a name for an address: a colon may name a protocol, and what a file says may send it to
other files or into the network. So it never sees the name of a file that is read, only the file,
opened, and nothing else is it allowed to open.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import cast

import av
import av.logging
from av.container import InputContainer, OutputContainer
from av.error import FFmpegError
from av.stream import Disposition

from motion_transfer.errors import InputError
from motion_transfer.media.files import check_readable

LARGEST_PICTURE = 2**27
"""Pixels: 16K (15360 x 8640) fits. A header may claim anything, and its claim becomes memory."""

BY_DESCRIPTOR = hasattr(os, "pread")
"""Where descriptors are the system's (POSIX). On Windows they are one C library's, and FFmpeg may
have another: there it asks Python for each piece of a file."""

LISTS = (b"#EXTM3U", b"ffconcat")  # how HLS and FFmpeg's concat begin
LIST_BYTES = 8

# A decoder that meets damage conceals it, returns wrong pixels and only logs an error. Errors have
# to reach Python for readers of IUV to hear of them, and nobody else needs to.
av.logging.set_level(av.logging.ERROR)
av.logging.set_skip_repeated(False)  # or the same fault in another file is not heard of
logging.getLogger("libav").addHandler(logging.NullHandler())


def hear_complaints() -> av.logging.Capture:
    """Hear, as a list in a `with` block, what FFmpeg complains of; in this thread only."""
    return av.logging.Capture()


@contextmanager
def open_input(path: Path, what: str = "video") -> Iterator[InputContainer]:
    """Open a file to read, whatever it is called.

    Lists of other files (HLS, concat) are refused.

    Args:
        what: What the file is wanted for, for messages.
    Raises: InputError for what is no file to read; FFmpegError for what FFmpeg cannot read.
    """
    check_readable(path, what)
    limits = {"max_pixels": str(LARGEST_PICTURE)}
    with ExitStack() as stack:
        file = stack.enter_context(path.open("rb", buffering=0))
        options = {"protocol_whitelist": "fd"} | limits
        if BY_DESCRIPTOR:
            options["fd"] = str(file.fileno())
        try:
            # a title in another encoding than UTF-8 is no reason to refuse pictures
            container = av.open(
                "fd:" if BY_DESCRIPTOR else file, "r", options=options, metadata_errors="replace"
            )
        except FFmpegError as error:
            file.seek(0)
            try:
                beginning = file.read(LIST_BYTES) or b""
            except OSError as failed:  # a disk that fails, a drive that is gone
                raise InputError(f"{what} {path} cannot be read: {failed.strerror}") from error
            if beginning.startswith(LISTS):
                raise InputError(
                    f"{what} {path} is a list of other files and has no pictures or sound itself;"
                    " name one of those files"
                ) from error
            raise
        if BY_DESCRIPTOR:
            file.close()  # FFmpeg has one of its own
        stack.enter_context(container)
        codecs = [stream.codec_context for stream in container.streams.video]
        codecs = [codec for codec in codecs if codec is not None]  # of codecs that FFmpeg knows
        for codec in codecs:
            codec.options = limits
        try:
            yield container
        finally:
            # Closing holds the interpreter's lock and waits for the decoder's threads, which may be
            # about to log and then wait for that lock: both for ever. They are stopped here, where
            # the lock is free.
            for codec in codecs:
                codec.flush_buffers()


def find_pictures(container: InputContainer, where: str) -> av.VideoStream:
    """Find the first stream of pictures; the cover of a song is none.

    Args:
        where: Names the file, for messages.
    Raises: InputError if there is none that can be decoded.
    """
    streams = [
        stream
        for stream in container.streams.video
        if not stream.disposition & Disposition.attached_pic
    ]
    decodable = [stream for stream in streams if stream.codec_context is not None]
    if not decodable:
        reason = "a video in an unknown codec" if streams else "no video and no pictures in it"
        raise InputError(f"{where} has {reason}; convert it, or name another file")
    return decodable[0]


def open_output(
    path: Path, *, format_name: str | None = None, options: dict[str, str] | None = None
) -> OutputContainer:
    """Open a file to write, whatever it is called.

    Args:
        format_name: FFmpeg's name of the container; else the ending says it.
        options: FFmpeg's, of the container.
    Raises: FFmpegError, which is an OSError where the disk refuses.
    """
    # a name with a colon in it is not an address when another stands before it
    return cast(OutputContainer, av.open(f"file:{path}", "w", format_name, options or {}))
