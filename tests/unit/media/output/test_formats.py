"""Which output paths and options mean which format."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
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
        ("out.webp", "webp", "ffv1"),
        ("out.apng", "apng", "ffv1"),
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
        ("out.mp4", "cinepak", None, "unknown codec 'cinepak'; supported are h264"),
        ("out.mp4", "prores", None, r"\.mp4 cannot hold prores; it takes h264"),
        ("out.mov", "prores", 20, "prores takes no crf"),
        ("out.webp", None, 20, "--crf is for video"),
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


@pytest.mark.parametrize(
    ("output", "codec", "pixels"),
    [
        ("out.mov", "prores", "yuva444p10le"),
        ("out.mkv", "ffv1", "bgra"),
        ("out.webm", "vp9", "yuva420p"),
        ("out.png", "ffv1", "bgra"),
        ("out", "ffv1", "bgra"),
        ("out.webp", "ffv1", "bgra"),
        ("out.apng", "ffv1", "bgra"),
    ],
)
def test_transparent_frames_have_a_codec_that_holds_alpha(output: str, codec, pixels: str) -> None:
    chosen = choose_format(Path(output), codec=None, crf=None, transparent=True)
    assert (chosen.codec_name, chosen.pixel_format) == (codec, pixels)
    assert (chosen.alpha_mode, chosen.premultiplied) == ("straight", False)


@pytest.mark.parametrize("suffix", [s for s, row in CONTAINERS.items() if row.alpha])
def test_videos_may_be_premultiplied(suffix: str) -> None:
    for codec in CONTAINERS[suffix].alpha:
        chosen = choose_format(
            Path(f"out{suffix}"), codec=codec, crf=None, transparent=True, alpha="premultiplied"
        )
        assert chosen.alpha_mode == "premultiplied"


@pytest.mark.parametrize(
    ("output", "options", "reason"),
    [
        ("out.gif", {}, r"out\.gif cannot hold transparency; \.mov, \.mkv, \.webm, \.webp, \.apng"),
        ("out.mp4", {}, r"out\.mp4 cannot hold transparency; .* and a folder of PNG can"),
        ("out.mov", {"codec": "h264"}, r"h264 in \.mov cannot hold transparency; there prores can"),
        ("out.webm", {"codec": "av1"}, r"av1 in \.webm cannot hold transparency; there vp9 can"),
        ("out.mkv", {"codec": "h265"}, "there ffv1 or vp9 or prores can"),
        ("out.png", {"alpha": "premultiplied"}, "straight by its specification, and not premul"),
        ("out", {"alpha": "premultiplied"}, "straight by its specification, and not premul"),
        ("out.webp", {"alpha": "premultiplied"}, r"write \.mov, \.mkv, \.webm for that"),
        ("out.mov", {"alpha": "associated"}, "supported are straight, premultiplied"),
        ("out.mov", {"pix_fmt": "yuv422p10le"}, "has no alpha for this output; prores takes yuva"),
        ("out.png", {"pix_fmt": "bgra"}, "--pix-fmt is for video"),
    ],
)
def test_alpha_that_cannot_be_is_refused(output: str, options: dict, reason: str) -> None:
    settings = {"codec": None, "crf": None} | options
    with pytest.raises(OutputError, match=reason) as caught:
        choose_format(Path(output), transparent=True, **settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("output", "options", "reason"),
    [
        ("out.mov", {"alpha": "premultiplied"}, "not to be transparent"),
        ("out.png", {"alpha": "premultiplied"}, "not to be transparent"),
        ("out.mkv", {"codec": "ffv1", "pix_fmt": "bgra"}, "bgra has alpha, which is not in"),
        ("out.mp4", {"pix_fmt": "rgb24"}, "h264 takes yuv420p, yuv444p, yuv420p10le"),
    ],
)
def test_pixels_that_do_not_fit_are_refused(output: str, options: dict, reason: str) -> None:
    settings = {"codec": None, "crf": None} | options
    with pytest.raises(OutputError, match=reason):
        choose_format(Path(output), **settings)


def test_pixels_that_the_encoder_lacks_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CODECS, "av1", replace(CODECS["av1"], pixel_formats=("yuv420p", "gray")))
    with pytest.raises(OutputError, match="the installed FFmpeg's libsvtav1 takes none"):
        choose_format(Path("out.mkv"), codec="av1", crf=None, pix_fmt="gray")


@pytest.mark.parametrize(
    ("output", "options", "even"),
    [
        ("out.mp4", {}, True),
        ("out.mp4", {"pix_fmt": "yuv444p"}, False),
        ("out.mp4", {"pix_fmt": "yuv420p10le"}, True),
        ("out.mov", {"codec": "prores"}, False),
        ("out.mov", {"transparent": True}, False),
        ("out.webm", {"transparent": True}, True),
        ("out.webp", {"transparent": True}, False),
        ("out.apng", {}, False),
    ],
)
def test_which_sizes_have_to_be_even(output: str, options: dict, even: bool) -> None:
    settings = {"codec": None, "crf": None} | options
    assert choose_format(Path(output), **settings).codec.needs_even_size == even


def test_what_is_chosen_is_a_key() -> None:
    plain = choose_format(Path("out.mkv"), codec="ffv1", crf=None)
    clear = choose_format(Path("out.mkv"), codec="ffv1", crf=None, transparent=True)
    multiplied = choose_format(
        Path("out.mkv"), codec="ffv1", crf=None, transparent=True, alpha="premultiplied"
    )
    keys = [json.dumps(asdict(chosen)) for chosen in (plain, clear, multiplied)]
    assert len(set(keys)) == 3
