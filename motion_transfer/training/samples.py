"""From a pair of pictures to what the networks take, as rendering would prepare it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.utils.data import Dataset, Sampler

from motion_transfer.errors import InputError
from motion_transfer.media.image import read_photo
from motion_transfer.render.options import parse_colour
from motion_transfer.render.outline import clearance_of
from motion_transfer.render.person import Person, occupancy
from motion_transfer.render.source import unfold
from motion_transfer.render.window import TRAINED_UNSCALED, Window, plan_window
from motion_transfer.training.pairs import Pair, flat_stem
from motion_transfer.training.pictures import PersonPicture, Picture
from nhrr_core import shrink_texture
from nhrr_core.clearance import CLEARANCE_SIZE
from nhrr_core.config import CLEARANCE_CHANNELS
from nhrr_core.iuv import ALL_PARTS

Image = UInt8[np.ndarray, "H W 3"]
Texture = tuple[Float[Tensor, "3 T T"], Float[Tensor, "1 T T"]]

BEYOND_THE_PHOTO = (255, 255, 255)  # as the renderer's default background
UNKNOWN_CLEARANCE = 0.15  # of the samples


@dataclass(frozen=True, kw_only=True)
class SampleSettings:
    """How pairs become samples.

    Attributes:
        seed: of the order and the jitter.
        jitter: see `motion_transfer.training.config.DataSettings`.
        alpha: give the target's coverage; a target without one is refused.
        target_texture: unfold the target as well, for the texture loss.
        clearance: give the source's, where it can be known.
        textures: folder that keeps unfolded textures; None: unfold each time.
        half_size_samples: how many samples, the first ones, have half of the two sides.
    """

    seed: int
    image_size: int
    texture_size: int
    background: str
    jitter: float
    alpha: bool
    target_texture: bool
    textures: Path | None
    clearance: bool = False
    half_size_samples: int = 0


class TrainingSamples(Dataset[dict[str, Tensor]]):
    """Samples by their number in the run, which alone decides pair and crop.

    Every epoch has an order of its own. An endless set of pairs (`endless` is true) is taken in its
    own order. There are no flips: left and right are different charts.
    """

    def __init__(self, pairs: Sequence[Pair], settings: SampleSettings) -> None:
        self._pairs = pairs
        self._settings = settings
        self._endless = bool(getattr(pairs, "endless", False))
        self._order: tuple[int, np.ndarray] | None = None

    def __getitem__(self, number: int) -> dict[str, Tensor]:
        """One sample.

        Returns: `source_texture` 3 x T x T in [-1, 1] and `source_visibility` 1 x T x T;
            `target_image` 3 x S x S in [-1, 1], `target_iuv` uint8 3 x S x S; where wanted
            `target_alpha` 1 x S x S and `target_background` 3, both in [-1, 1],
            `target_texture` and `target_visibility`.
        Raises: InputError for a file that broke meanwhile.
        """
        random = np.random.default_rng((self._settings.seed, 1, number))
        shrink = 2 if number < self._settings.half_size_samples else 1
        return self.load(self._pairs[self._index(number)], random, shrink=shrink)

    def load(
        self, pair: Pair, random: np.random.Generator | None = None, *, shrink: int = 1
    ) -> dict[str, Tensor]:
        """The sample of a pair; without jitter unless there is a random generator.

        Args:
            shrink: divides the sides of textures and images.
        """
        settings = self._settings
        size = settings.image_size // shrink
        target = pair.target.load()
        window = person_window(target)
        least, most = TRAINED_UNSCALED
        unscaled = least * size <= window.side <= most * size
        if random is not None:
            window = _jitter(window, settings.jitter, random)
        if unscaled:  # as in rendering
            window = _around_centre(window, size)
        fill = parse_colour(settings.background) or BEYOND_THE_PHOTO
        rgb = cut_picture(window, _lay_over(target, settings.background), size, fill)
        sample = {"target_image": to_tensor(rgb), "target_iuv": _chw(window.cut(target.iuv, size))}
        if settings.alpha:
            sample["target_alpha"] = to_tensor(self._cut_alpha(window, target, size))
            if (colour := parse_colour(settings.background)) is not None:
                sample["target_background"] = torch.tensor(colour) / 127.5 - 1
        names = ("source_texture", "source_visibility")
        source = pair.source.load() if settings.clearance else None
        sample |= zip(names, self._texture(pair.source, shrink, source), strict=True)
        if source:
            sample["source_clearance"] = _clearance(source, random)
        if settings.target_texture:
            names = ("target_texture", "target_visibility")
            sample |= zip(names, self._texture(pair.target, shrink, target), strict=True)
        return sample

    def _index(self, number: int) -> int:
        if self._endless:
            return number
        epoch, place = divmod(number, len(self._pairs))
        if self._order is None or self._order[0] != epoch:
            random = np.random.default_rng((self._settings.seed, 0, epoch))
            self._order = epoch, random.permutation(len(self._pairs))
        return int(self._order[1][place])

    def _cut_alpha(
        self, window: Window, target: PersonPicture, size: int
    ) -> UInt8[np.ndarray, "S S"]:
        if target.alpha is None:
            raise InputError(
                f"{target.name} has no alpha, which a model with alpha learns from; give it"
                " STEM_alpha.png, or train without: --set model.alpha=false"
            )
        return cut_picture(window, target.alpha, size, 0)

    def _texture(
        self, picture: Picture, shrink: int, loaded: PersonPicture | None = None
    ) -> Texture:
        """Rounded to 8 bits, whether it was kept or not, so that both are the same."""
        return shrink_texture(*_as_texture(*self._unfolded(picture, loaded)), shrink)

    def _unfolded(
        self, picture: Picture, loaded: PersonPicture | None
    ) -> tuple[Image, UInt8[np.ndarray, "T T"]]:
        folder, size = self._settings.textures, self._settings.texture_size
        path = folder and folder / f"{flat_stem(picture.name)}_{size}.png"
        if path and path.exists():
            kept = read_photo(path, "kept texture")
            assert kept.alpha is not None
            return kept.rgb, kept.alpha
        rgb, seen = _unfold(loaded or picture.load(), size)
        if path:
            _keep(path, rgb, seen)
        return rgb, seen


class RunSampler(Sampler[list[int]]):
    """Batches of sample numbers for one of several processes, from any step on.

    Step s consumes the numbers [s * S, (s + 1) * S), S = batch x accumulation x processes; where a
    run stands is its step and nothing else.
    """

    def __init__(
        self, *, batch_size: int, accumulation: int, steps: range, process: int, processes: int
    ) -> None:
        self._batch_size = batch_size
        self._batches = range(steps.start * accumulation, steps.stop * accumulation)
        self._process, self._processes = process, processes

    def __len__(self) -> int:
        return len(self._batches)

    def __iter__(self) -> Iterator[list[int]]:
        for batch in self._batches:
            first = (batch * self._processes + self._process) * self._batch_size
            yield list(range(first, first + self._batch_size))


def person_window(picture: PersonPicture) -> Window:
    """The square that the renderer would cut around the person."""
    x, y, width, height = cv2.boundingRect(occupancy(picture.iuv))
    return plan_window([Person(x, y, x + width, y + height, pixels=0, regions=())])


def cut_picture(
    window: Window, picture: np.ndarray, size: int, fill: Sequence[int] | int
) -> UInt8[np.ndarray, "*shape"]:
    """The window's content of a photo or alpha at size x size; `fill` beyond the photo's edges."""
    rows, columns, own_rows, own_columns = window.visible(*picture.shape[:2])
    square = np.empty((window.side, window.side, *picture.shape[2:]), np.uint8)
    square[:] = fill
    square[own_rows, own_columns] = picture[rows, columns]
    if size == window.side:
        return square
    kind = cv2.INTER_AREA if size < window.side else cv2.INTER_CUBIC
    return cv2.resize(square, (size, size), interpolation=kind)


def to_tensor(image: UInt8[np.ndarray, "*shape"]) -> Float[Tensor, "C H W"]:
    """H x W x C or H x W of 0..255 to C x H x W in [-1, 1]."""
    return _chw(image if image.ndim == 3 else image[..., None]).float() / 127.5 - 1


def _chw(image: UInt8[np.ndarray, "H W C"]) -> UInt8[Tensor, "C H W"]:
    return torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))


def _jitter(window: Window, most: float, random: np.random.Generator) -> Window:
    side = round(window.side * (1 + most * random.random()) / 2) * 2
    room = (side - window.side) // 2
    x, y = random.integers(-room, room, size=2, endpoint=True)
    return replace(window, x=window.x - room + int(x), y=window.y - room + int(y), side=side)


def _around_centre(window: Window, side: int) -> Window:
    more = side - window.side
    return Window(window.x - more // 2, window.y - more // 2, side)


def _lay_over(picture: PersonPicture, background: str) -> Image:
    """A picture over the background colour, where there is one and its alpha is known."""
    colour = parse_colour(background)
    if picture.alpha is None or colour is None:
        return picture.rgb
    weight = picture.alpha[..., None].astype(np.float32) / 255
    mixed = picture.rgb * weight + np.array(colour, np.float32) * (1 - weight)
    return mixed.round().astype(np.uint8)


def _unfold(picture: PersonPicture, size: int) -> tuple[Image, UInt8[np.ndarray, "T T"]]:
    texture, visibility = unfold(picture.as_photo(), picture.iuv, ALL_PARTS, size)
    rgb = ((texture[0] + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
    seen = (visibility[0, 0] > 0).to(torch.uint8) * 255
    return rgb.permute(1, 2, 0).numpy(), seen.numpy()


def _clearance(source: PersonPicture, random: np.random.Generator | None) -> Float[Tensor, "2 t t"]:
    """The source's; now and then unknown, as it is of most photos without alpha."""
    if random is not None and random.random() < UNKNOWN_CLEARANCE:
        return torch.zeros(CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE)
    return clearance_of(source.as_photo(), source.iuv, ALL_PARTS)[0]


def _as_texture(rgb: Image, seen: UInt8[np.ndarray, "T T"]) -> Texture:
    visibility = (_chw(seen[..., None]) > 0).float()
    return to_tensor(rgb) * visibility, visibility


def _keep(path: Path, rgb: Image, seen: UInt8[np.ndarray, "T T"]) -> None:
    """Several processes may do so at once; each file appears whole."""
    ok, encoded = cv2.imencode(".png", np.dstack([rgb[..., ::-1], seen]))
    assert ok
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    temporary.write_bytes(encoded.tobytes())
    temporary.replace(path)
