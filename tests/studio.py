"""Painted people, and the files that hold them."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from PIL import Image

HEIGHT, WIDTH = 96, 64
BODY = {  # part: top, bottom, left, right in px; a person seen from the front
    23: (4, 20, 24, 32),
    24: (4, 20, 32, 40),
    2: (20, 50, 22, 42),
    16: (20, 36, 14, 22),
    15: (20, 36, 42, 50),
    20: (36, 50, 14, 22),
    19: (36, 50, 42, 50),
    3: (50, 56, 14, 22),
    4: (50, 56, 42, 50),
    9: (50, 70, 22, 32),
    10: (50, 70, 32, 42),
    13: (70, 88, 22, 32),
    14: (70, 88, 32, 42),
    6: (88, 93, 22, 32),
    5: (88, 93, 32, 42),
}
TORSO, LEGS, ARMS, HEAD = (2,), (9, 10, 13, 14, 5, 6), (15, 16, 19, 20, 3, 4), (23, 24)
UPPER = (*HEAD, *TORSO, *ARMS)
COLOURS = {TORSO: (200, 40, 40), LEGS: (30, 60, 160), ARMS: (40, 160, 60), HEAD: (220, 180, 40)}
BACKDROP = (120, 120, 120)


class Studio:
    """Paints people and writes the files that `mt` reads, into one folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def iuv(
        self,
        x: int = 0,
        y: int = 0,
        *,
        size: tuple[int, int] = (HEIGHT, WIDTH),
        scale: int = 1,
        parts: tuple[int, ...] = tuple(BODY),
    ) -> np.ndarray:
        """A mannequin moved by (x, y) px on an empty frame of (height, width), as (I, U, V)."""
        figure = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        for part in parts:
            top, bottom, left, right = BODY[part]
            box = figure[top:bottom, left:right]
            box[..., 0] = part
            box[..., 1] = np.linspace(0, 255, right - left).round()
            box[..., 2] = np.linspace(0, 255, bottom - top).round()[:, None]
        figure = figure.repeat(scale, 0).repeat(scale, 1)
        frame = np.zeros((*size, 3), np.uint8)
        top, left = max(y, 0), max(x, 0)
        piece = figure[top - y :, left - x :][: size[0] - top, : size[1] - left]
        frame[top : top + piece.shape[0], left : left + piece.shape[1]] = piece
        return frame

    def walk(self, count: int) -> np.ndarray:
        """Frames in each of which the mannequin stands elsewhere."""
        return np.stack([self.iuv(2 * (i % 5) - 4, i % 3 - 1) for i in range(count)])

    def dress(
        self, iuv: np.ndarray, colours: dict[tuple[int, ...], tuple[int, int, int]] | None = None
    ) -> np.ndarray:
        """A photo with one flat colour for each limb."""
        photo = np.full(iuv.shape, BACKDROP, np.uint8)
        for parts, colour in {**COLOURS, **(colours or {})}.items():
            photo[np.isin(iuv[..., 0], parts)] = colour
        return photo

    def image(self, name: str, pixels: np.ndarray, order: str = "iuv") -> Path:
        """Write a picture, or an IUV in the channel order of a file."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(pixels if order == "iuv" else pixels[..., ::-1].copy()).save(path)
        return path

    def source(
        self,
        name: str = "person",
        *,
        scale: int = 2,
        parts: tuple[int, ...] = tuple(BODY),
        colours: dict[tuple[int, ...], tuple[int, int, int]] | None = None,
        order: str = "iuv",
    ) -> Path:
        """A photo with its IUV beside it; returns the photo."""
        iuv = self.iuv(scale=scale, size=(HEIGHT * scale, WIDTH * scale), parts=parts)
        self.image(f"{name}_IUV.png", iuv, order)
        return self.image(f"{name}.png", self.dress(iuv, colours))

    def driver(
        self, frames: int | np.ndarray = 3, *, name: str = "driver", order: str = "iuv"
    ) -> Path:
        """A folder of IUV images."""
        frames = self.walk(frames) if isinstance(frames, int) else frames
        for index, frame in enumerate(frames):
            self.image(f"{name}/frame_{index}_IUV.png", frame, order)
        return self.folder / name

    def video(
        self,
        frames: int | np.ndarray = 3,
        *,
        name: str = "driver.mkv",
        order: str = "iuv",
        codec: str = "ffv1",
        pixels: str = "bgr0",
        rate: Fraction = Fraction(30000, 1001),
        options: dict[str, str] | None = None,
    ) -> Path:
        """A video of IUV frames; lossless unless another codec is asked for."""
        frames = self.walk(frames) if isinstance(frames, int) else frames
        path = self.folder / name
        with av.open(str(path), "w") as container:
            stream = container.add_stream(codec, rate=rate, options=options)
            stream.height, stream.width = frames.shape[1:3]
            stream.pix_fmt = pixels
            for frame in frames if order == "iuv" else frames[..., ::-1]:
                picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))
        return path

    def array(self, frames: int | np.ndarray = 3, *, name: str = "driver.npy") -> Path:
        """A NumPy stack, `.npy` or `.npz`."""
        frames = self.walk(frames) if isinstance(frames, int) else frames
        path = self.folder / name
        if path.suffix == ".npy":
            np.save(path, frames)
        else:
            np.savez_compressed(path, iuv=frames)
        return path
