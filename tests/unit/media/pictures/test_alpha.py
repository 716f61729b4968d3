"""Videos with alpha, and of more than 8 bits, that others made."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.media.alpha import add_alpha, premultiply
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.pictures.video import IndexedVideo

SIZE = (96, 64)
BT2020, PQ, HLG, BT709 = 9, 16, 18, 1


def picture(index: int = 0) -> np.ndarray:
    """A square that is half transparent in one half; white under alpha 0."""
    image = np.full((SIZE[1], SIZE[0], 4), 255, np.uint8)
    image[..., 3] = 0
    image[16:48, 32:64] = 200, 40, 80, 255
    image[16:48, 32:48, 3] = 128
    image[0, 0] = index, index, index, 255
    return image


def film(
    path: Path,
    codec: str,
    pixels: str,
    *,
    said: str | None = None,
    multiplied: bool = False,
    ratio: Fraction | None = None,
    count: int = 4,
    options: dict | None = None,
) -> Path:
    """What an encoder makes of it without any help of ours."""
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"} if said else {}) as out:
        if said:
            out.metadata["alpha_mode"] = said
        stream = out.add_stream(codec, rate=25, options=options or {})
        stream.width, stream.height, stream.pix_fmt = *SIZE, pixels
        if ratio:
            stream.codec_context.sample_aspect_ratio = ratio
        for index in range(count):
            image = picture(index)
            if multiplied:
                colours = premultiply(np.ascontiguousarray(image[..., :3]), image[..., 3].copy())
                image = add_alpha(colours, image[..., 3].copy())
            frame = av.VideoFrame.from_ndarray(image, format="rgba")
            out.mux(stream.encode(frame.reformat(format=pixels, threads=1)))
        out.mux(stream.encode(None))
    return path


FOREIGN = [
    ("a.webm", "libvpx", "yuva420p"),
    ("a.webm", "libvpx-vp9", "yuva420p"),
    ("a.mkv", "libvpx-vp9", "yuva420p"),
    ("a.mov", "prores_ks", "yuva444p10le"),
    ("a.mov", "qtrle", "argb"),
    ("a.mov", "png", "rgba"),
    ("a.mkv", "ffv1", "yuva420p"),
    ("a.mkv", "ffv1", "gbrap10le"),
    ("a.mkv", "ffv1", "rgba64le"),
]


@pytest.mark.parametrize(("name", "codec", "pixels"), FOREIGN)
def test_alpha_of_others_is_read(tmp_path: Path, name: str, codec: str, pixels: str) -> None:
    options = {"auto-alt-ref": "0"} if codec == "libvpx" else {}
    clip = open_pictures(film(tmp_path / name, codec, pixels, options=options))
    assert clip.has_alpha
    frames = list(clip.read_rgba())
    assert len(frames) == 4
    for frame in frames:
        assert frame.shape == (SIZE[1], SIZE[0], 4)
        np.testing.assert_allclose(frame[30, 56].astype(int), (200, 40, 80, 255), atol=6)
        np.testing.assert_allclose(frame[30, 40].astype(int), (200, 40, 80, 128), atol=6)
        assert frame[60, 80, 3] <= 3
    white = next(clip.read())
    np.testing.assert_allclose(white[30, 40].astype(int), (227, 147, 167), atol=6)
    np.testing.assert_allclose(white[60, 80].astype(int), 255, atol=3)
    np.testing.assert_array_equal(white, IndexedVideo(clip.path).read(0))


@pytest.mark.parametrize(
    ("said", "multiplied", "noted"),
    [
        (None, False, "does not say whether its colours are multiplied"),
        ("straight", False, None),
        ("premultiplied", True, None),
    ],
)
def test_what_is_multiplied_is_divided(tmp_path: Path, said, multiplied, noted) -> None:
    path = film(tmp_path / "a.mov", "prores_ks", "yuva444p10le", said=said, multiplied=multiplied)
    clip = open_pictures(path)
    frame = next(clip.read_rgba())
    np.testing.assert_allclose(frame[30, 40].astype(int), (200, 40, 80, 128), atol=4)
    assert (noted in " ".join(clip.notes)) if noted else not clip.notes
    np.testing.assert_allclose(
        IndexedVideo(path).read(1)[30, 40].astype(int), (227, 147, 167), atol=4
    )


def test_colours_under_alpha_0_stay_out_when_pixels_are_stretched(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mov", "png", "rgba", ratio=Fraction(2))
    clip = open_pictures(path)
    assert (clip.width, clip.height) == (2 * SIZE[0], SIZE[1])
    frame = next(clip.read_rgba())
    seen = frame[..., 3] > 24
    seen[:4, :6] = False  # the number
    assert seen.any()
    np.testing.assert_allclose(frame[seen][:, :3].astype(int), [(200, 40, 80)] * seen.sum(), atol=9)


def test_what_is_opaque_is_told_and_read(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    write_png(path, np.ascontiguousarray(picture()[..., :3]))
    clip = open_pictures(path)
    assert not clip.has_alpha
    assert (next(clip.read_rgba())[..., 3] == 255).all()
    write_png(path, picture())
    clip = open_pictures(path)
    assert clip.has_alpha
    np.testing.assert_array_equal(next(clip.read_rgba()), picture())


def test_10_bits_are_not_darkened(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    greys = np.repeat(np.arange(256, dtype=np.uint8), 4)
    image = np.dstack([np.tile(greys, (16, 1))] * 3)
    with av.open(str(path), "w") as out:
        stream = out.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 1024, 16, "yuv420p10le"
        frame = av.VideoFrame.from_ndarray(image, format="rgb24")
        out.mux(stream.encode(frame.reformat(format="yuv420p10le", threads=1)))
        out.mux(stream.encode(None))
    got = next(open_pictures(path).read()).astype(int)
    assert np.abs(got - image).max() <= 1
