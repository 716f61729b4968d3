"""Videos in HDR: SDR colours that were written in HDR, as BT.2408 maps them, come back."""

from __future__ import annotations

from pathlib import Path

import av
import numpy as np
import pytest

from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.video import IndexedVideo

BT709, BT2020, PQ, HLG = 1, 9, 16, 18
PATCH = 24
TO_BT2020 = np.array(
    [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
)  # BT.2087


def patches() -> np.ndarray:
    """Colours of SDR below what is pressed together, greys and skin among them."""
    rng = np.random.default_rng(0)
    colours = rng.integers(40, 215, (4, 6, 3))
    colours[0] = np.linspace(40, 215, 6).round()[:, None]
    colours[1, :3] = (210, 160, 130), (150, 100, 60), (90, 60, 45)
    return colours.astype(np.uint8)


def in_hdr(sdr: np.ndarray, transfer: int) -> np.ndarray:
    """Give the signal, 0 to 1, of a display that shows these colours, white at 203 cd/m2."""
    light = (sdr / 255) ** 2.4 @ TO_BT2020.T * 203
    if transfer == PQ:
        power = (light / 10000) ** 0.1593017578125
        return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375
    luminance = (light / 1000 @ [0.2627, 0.6780, 0.0593])[..., None]
    scene = light / 1000 * luminance ** (1 / 1.2 - 1)
    bright = 0.17883277 * np.log(np.maximum(12 * scene - 0.28466892, 1e-9)) + 0.55991073
    return np.where(scene <= 1 / 12, np.sqrt(3 * scene), bright)


def film(path: Path, signal: np.ndarray, transfer: int, *, alpha: bool = False) -> Path:
    """Write patches of a signal, three frames, tagged with their transfer."""
    pixels = np.kron(signal, np.ones((PATCH, PATCH, 1)))
    primaries = BT709 if transfer == BT709 else BT2020
    codec, pixel_format = ("ffv1", "yuva420p10le") if alpha else ("libx265", "yuv420p10le")
    options = {} if alpha else {"x265-params": "log-level=none:crf=1"}
    image = np.round(pixels * 65535).astype(np.uint16)
    if alpha:
        image = np.dstack([image, np.full(image.shape[:2], 65535, np.uint16)])
    frame = av.VideoFrame.from_ndarray(image, format="rgba64le" if alpha else "rgb48le")
    with av.open(str(path), "w") as out:
        stream = out.add_stream(codec, rate=25, options=options)
        stream.height, stream.width, stream.pix_fmt = *image.shape[:2], pixel_format
        context = stream.codec_context
        context.color_primaries = context.colorspace = primaries
        context.color_trc = transfer
        matrix = "ITU709" if transfer == BT709 else "BT2020"
        coded = frame.reformat(format=pixel_format, dst_colorspace=matrix, threads=1)
        coded.color_trc = transfer
        for index in range(3):
            coded.pts = index
            out.mux(stream.encode(coded))
        out.mux(stream.encode(None))
    return path


def middles(picture: np.ndarray) -> np.ndarray:
    return picture[PATCH // 2 :: PATCH, PATCH // 2 :: PATCH].astype(int)


@pytest.mark.parametrize(("transfer", "name"), [(PQ, "PQ"), (HLG, "HLG")])
@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_what_sdr_can_show_stays_what_it_is(
    tmp_path: Path, suffix: str, transfer: int, name: str
) -> None:
    path = film(tmp_path / f"a{suffix}", in_hdr(patches(), transfer), transfer)
    clip = open_pictures(path)
    assert [note for note in clip.notes if f"is HDR ({name}); its colours are brought" in note]
    frames = list(clip.read())
    assert len(frames) == 3
    for frame in frames:
        np.testing.assert_allclose(middles(frame), patches(), atol=4)
    np.testing.assert_array_equal(IndexedVideo(path).read(1), frames[1])


def test_what_is_brighter_keeps_its_order_and_hue(tmp_path: Path) -> None:
    greys = np.repeat(np.linspace(0.7, 1, 6)[None, :, None], 3, -1)
    warm = np.array([[[0.95, 0.9, 0.8]] * 6])
    path = film(tmp_path / "a.mp4", np.concatenate([greys, warm]), HLG)
    shown = middles(next(open_pictures(path).read()))
    assert (np.diff(shown[0], axis=0) > 0).all()
    assert (np.ptp(shown[0], -1) <= 1).all()
    assert shown[0, -1].min() >= 254
    red, green, blue = shown[1, 0]
    assert red > green > blue


def test_alpha_stays(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mkv", in_hdr(patches(), PQ), PQ, alpha=True)
    clip = open_pictures(path)
    assert clip.has_alpha
    picture = next(clip.read_rgba())
    assert (picture[..., 3] == 255).all()
    np.testing.assert_allclose(middles(picture[..., :3]), patches(), atol=4)


def test_sdr_is_left_alone(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mp4", patches() / 255, BT709)
    clip = open_pictures(path)
    assert not [note for note in clip.notes if "HDR" in note]
    np.testing.assert_allclose(middles(next(clip.read())), patches(), atol=3)
