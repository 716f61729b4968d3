"""Which output paths and options mean which format."""

from __future__ import annotations

from pathlib import Path

import pytest

from motion_transfer.errors import OutputError
from motion_transfer.media.codecs import CODECS
from motion_transfer.media.output.formats import CONTAINERS, choose_format


@pytest.mark.parametrize(
    ("output", "kind", "codec"),
    [
        ("out.mp4", "video", "h264"),
        ("OUT.MP4", "video", "h264"),
        ("out.mov", "video", "h264"),
        ("out.mkv", "video", "h264"),
        ("out.webm", "video", "vp9"),
        ("out.gif", "gif", "ffv1"),
        ("out.png", "image", "ffv1"),
        ("out", "frames", "ffv1"),
    ],
)
def test_the_ending_decides(output: str, kind: str, codec: str) -> None:
    chosen = choose_format(Path(output), codec=None, crf=None)
    assert (chosen.kind, chosen.codec_name) == (kind, codec)


@pytest.mark.parametrize(
    ("suffix", "codec"), [(s, c) for s, row in CONTAINERS.items() for c in row.codecs]
)
def test_every_listed_codec_can_be_chosen(suffix: str, codec: str) -> None:
    chosen = choose_format(Path(f"out{suffix}"), codec=codec, crf=None)
    assert (chosen.codec, chosen.crf) == (CODECS[codec], CODECS[codec].crf)


def test_crf_is_taken() -> None:
    assert choose_format(Path("out.mp4"), codec=None, crf=30).crf == 30


@pytest.mark.parametrize(
    ("output", "codec", "crf", "reason"),
    [
        ("out.avi", None, None, r"unknown ending \.avi; supported are \.mp4"),
        ("out.mp4", "prores", None, "unknown codec 'prores'; supported are h264"),
        ("out.webm", "h264", None, r"\.webm cannot hold h264; it takes vp9, av1"),
        ("out.gif", "h264", None, "--codec is for video"),
        ("out", None, 20, "--crf is for video"),
        ("out.mkv", "ffv1", 20, "lossless and takes no crf"),
        ("out.mp4", None, -1, "takes a crf of 0 to 51"),
        ("out.mp4", "h264", 52, "takes a crf of 0 to 51"),
        ("out.mp4", "h265", 52, "takes a crf of 0 to 51"),
        ("out.mp4", "vp9", 64, "takes a crf of 0 to 63"),
    ],
)
def test_what_does_not_fit_is_refused(output: str, codec, crf, reason: str) -> None:
    with pytest.raises(OutputError, match=reason):
        choose_format(Path(output), codec=codec, crf=crf)
