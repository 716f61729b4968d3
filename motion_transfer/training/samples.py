"""From pairs of pictures to batches of what the networks take, as rendering would prepare it.

The batches of a run follow from its seed and a step's number alone. Other processes read them while
the networks work. Ever new people come by another way, `motion_transfer.training.pool`.
"""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from motion_transfer.cores import core_count
from motion_transfer.drawing.outline import clearance_of
from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.source import SourcePicture, cut_source, unfold_picture
from motion_transfer.drawing.window import (
    BEYOND_THE_PHOTO,
    TRAINED_UNSCALED,
    Window,
    cut_picture,
    plan_window,
)
from motion_transfer.errors import InputError
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.media.publish import name_beside
from motion_transfer.option import parse_colour
from motion_transfer.training.config import TrainConfig
from motion_transfer.training.pairs import Pair, Pairs, flat_stem
from motion_transfer.training.pictures import Image, PersonPicture, Picture, Plane, lay_over
from motion_transfer.training.settings import DataSettings, SpeedSettings
from nhrr_core import shrink_texture
from nhrr_core.config import CLEARANCE_CHANNELS, CLEARANCE_SIZE, COLOUR_CHANNELS
from nhrr_core.parts import ALL_PARTS

UNKNOWN_CLEARANCE = 0.15
"""The share of the samples whose clearance is withheld, as it is unknown of most photos without
alpha; chosen."""

MOST_WORKERS = 4
"""More processes than these are seldom needed to keep one device busy, and each takes memory."""

ORIGIN = re.compile(r"motion_transfer\.errors\.\w+: ")


class TrainingSamples(Dataset[dict[str, Tensor]]):
    """Samples by their number in the run, which alone decides pair and crop.

    Every epoch has an order of its own. There are no flips: left and right are different charts.

    Args:
        textures: The folder that keeps unfolded textures; None: unfold each time.
        half_size_samples: How many samples, the first ones, have half of the two sides.
    """

    def __init__(
        self,
        pairs: Pairs,
        config: TrainConfig,
        *,
        textures: Path | None,
        half_size_samples: int = 0,
    ) -> None:
        self._pairs, self._config = pairs, config
        self._textures, self._half_size_samples = textures, half_size_samples
        self._order: tuple[int, np.ndarray] | None = None

    def __getitem__(self, number: int) -> dict[str, Tensor]:
        """Make one sample.

        Returns: `source_texture` 3 x T x T in [-1, 1] and `source_visibility` 1 x T x T;
            `target_image` 3 x S x S in [-1, 1], `target_iuv` uint8 3 x S x S; where wanted
            `target_alpha` 1 x S x S and `target_background` 3, both in [-1, 1],
            `source_clearance` 2 x t x t, `source_pictures` uint8 1 x 6 x S x S, `target_texture`
            and `target_visibility`.
        Raises: InputError for a file that broke meanwhile.
        """
        random = np.random.default_rng((self._config.run.seed, 1, number))
        shrink = 2 if number < self._half_size_samples else 1
        return self.load(self._pairs[self._index(number)], random, shrink=shrink)

    def load(
        self, pair: Pair, random: np.random.Generator | None = None, *, shrink: int = 1
    ) -> dict[str, Tensor]:
        """Make the sample of a pair; without jitter unless there is a random generator.

        Args:
            shrink: Divides the sides of textures and images.
        """
        model, data = self._config.model, self._config.data
        target = pair.target.load()
        crop = cut_target(target, model.image_size // shrink, data, random)
        sample = {"target_image": to_tensor(crop.rgb), "target_iuv": _chw(crop.iuv)}
        if model.alpha:
            if crop.alpha is None:
                raise InputError(
                    f"{target.name} has no alpha, which a model with alpha learns from; give it"
                    " STEM_alpha.png, or train without: --set model.alpha=false"
                )
            sample["target_alpha"] = to_tensor(crop.alpha)
            if (colour := background_colour(data)) is not None:
                sample["target_background"] = colour
        source = pair.source.load() if model.clearance or model.reads_photo else None
        sample |= self._texture("source", pair.source, shrink, source)
        if source and model.reads_photo:
            shown = SourcePicture(source.as_photo(), source.iuv)
            picture = cut_source(shown, model.image_size // shrink)
            sample["source_pictures"] = torch.from_numpy(picture)[None]
        if source and model.clearance:
            known = random is None or random.random() >= UNKNOWN_CLEARANCE
            sample["source_clearance"] = (
                torch.from_numpy(clearance_of(source.as_photo(), source.iuv, ALL_PARTS))
                if known
                else torch.zeros(CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE)
            )
        if model.supervises_texture:
            sample |= self._texture("target", pair.target, shrink, target)
        return sample

    def _index(self, number: int) -> int:
        epoch, place = divmod(number, len(self._pairs))
        if self._order is None or self._order[0] != epoch:
            random = np.random.default_rng((self._config.run.seed, 0, epoch))
            self._order = epoch, random.permutation(len(self._pairs))
        return int(self._order[1][place])

    def _texture(
        self, role: str, picture: Picture, shrink: int, loaded: PersonPicture | None
    ) -> dict[str, Tensor]:
        # rounded to 8 bits, whether it was kept or not, so that both are the same
        rgb, seen = self._unfolded(picture, loaded)
        visibility = (_chw(seen[..., None]) > 0).float()
        texture, visibility = shrink_texture(to_tensor(rgb) * visibility, visibility, shrink)
        return {f"{role}_texture": texture, f"{role}_visibility": visibility}

    def _unfolded(self, picture: Picture, loaded: PersonPicture | None) -> tuple[Image, Plane]:
        """A picture's texture, H x W x 3 of 0..255, and 255 where it is visible."""
        folder, size = self._textures, self._config.model.texture_size
        path = folder and folder / f"{flat_stem(picture.name)}_{size}.png"
        if path and path.exists():
            kept = read_photo(path, "kept texture")
            assert kept.alpha is not None
            return kept.rgb, kept.alpha
        whole = loaded or picture.load()
        texture, visibility = unfold_picture(SourcePicture(whole.as_photo(), whole.iuv), size)
        levels = ((texture + 1) * 127.5).round().clip(0, 255).astype(np.uint8)
        rgb, seen = levels.transpose(1, 2, 0), (visibility[0] > 0) * np.uint8(255)
        if path:  # several processes may keep it at once; the file appears whole
            # texture and visibility as one RGBA picture
            ok, encoded = cv2.imencode(".png", np.dstack([rgb[..., ::-1], seen]))
            assert ok
            temporary = name_beside(path, f".{os.getpid()}")
            temporary.write_bytes(encoded.tobytes())
            temporary.replace(path)
        return rgb, seen


@dataclass(frozen=True)
class Crop:
    """A target as the networks draw it, S x S, 0..255; its colours lie over the background."""

    rgb: Image
    iuv: Image
    alpha: Plane | None


def cut_target(
    picture: PersonPicture, size: int, data: DataSettings, random: np.random.Generator | None
) -> Crop:
    """Cut a target out of its picture, with jitter if there is a random generator."""
    colour = parse_colour(data.background)
    window = person_window(picture)
    least, most = TRAINED_UNSCALED
    unscaled = least * size <= window.side <= most * size
    if random is not None:
        window = _jitter(window, data.jitter, random)
    if unscaled:  # as in rendering; jitter then only moves the window
        more = size - window.side
        window = Window(window.x - more // 2, window.y - more // 2, size)
    rgb, alpha = picture.rgb, picture.alpha
    if alpha is not None:
        if colour is not None:
            rgb = lay_over(rgb, alpha, colour)
        alpha = cut_picture(window, alpha, size, 0)
    rgb = cut_picture(window, rgb, size, colour or BEYOND_THE_PHOTO)
    return Crop(rgb, window.cut(picture.iuv, size), alpha)


def background_colour(data: DataSettings) -> Float[Tensor, " 3"] | None:
    """The colour behind targets whose alpha is known, in [-1, 1]; None: photos stay as they are."""
    colour = parse_colour(data.background)
    return None if colour is None else torch.tensor(colour) / 127.5 - 1


def person_window(picture: PersonPicture) -> Window:
    """Plan the square that the renderer would cut around the person."""
    return plan_window([bounding_box(picture.iuv)])


def halve(batch: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Halve the sides of a batch's textures and images, which saves three quarters of the work."""
    halved = dict(batch)
    for role in ("source", "target"):
        names = f"{role}_texture", f"{role}_visibility"
        if names[0] in batch:
            halved |= zip(names, shrink_texture(*(batch[name] for name in names), 2), strict=True)
    for name in {"target_image", "target_alpha"} & batch.keys():
        halved[name] = F.avg_pool2d(batch[name], 2)
    halved["target_iuv"] = batch["target_iuv"][..., 1::2, 1::2]  # as `Window.cut` chooses
    if "source_pictures" in batch:
        rgb, iuv = batch["source_pictures"].tensor_split([COLOUR_CHANNELS], dim=2)
        rgb = F.avg_pool2d(rgb.flatten(0, 1).float(), 2).round().to(torch.uint8)
        halved["source_pictures"] = torch.cat([rgb[:, None], iuv[..., 1::2, 1::2]], dim=2)
    return halved


def to_tensor(image: UInt8[np.ndarray, "*shape"]) -> Float[Tensor, "C H W"]:
    """Turn H x W x C or H x W of 0..255 into C x H x W in [-1, 1]."""
    return _chw(image if image.ndim == 3 else image[..., None]).float() / 127.5 - 1


def _chw(image: UInt8[np.ndarray, "H W C"]) -> UInt8[Tensor, "C H W"]:
    return torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))


def _jitter(window: Window, most: float, random: np.random.Generator) -> Window:
    side = round(window.side * (1 + most * random.random()) / 2) * 2  # even, as the window's is
    room = (side - window.side) // 2
    x, y = random.integers(-room, room, size=2, endpoint=True)
    return replace(window, x=window.x - room + int(x), y=window.y - room + int(y), side=side)


def number_batches(
    *, batch_size: int, accumulation: int, steps: range, process: int, processes: int
) -> Iterator[list[int]]:
    """Number the samples of each batch of one of several processes, from any step on.

    Step s consumes the numbers [s * S, (s + 1) * S), S = batch x accumulation x processes; where a
    run stands is its step and nothing else.
    """
    for batch in range(steps.start * accumulation, steps.stop * accumulation):
        first = (batch * processes + process) * batch_size
        yield list(range(first, first + batch_size))


def count_workers(speed: SpeedSettings, *, beside_gpu: bool = False) -> int:
    """Count the processes that make data.

    Args:
        beside_gpu: Whether they may have all the cores but one by default: a GPU learns faster than
            any number of them paints.
    """
    if speed.workers >= 0:
        return speed.workers
    cores = core_count()
    return max(1, cores - 1) if beside_gpu else min(MOST_WORKERS, max(1, cores // 2))


def load_batches(
    samples: TrainingSamples,
    config: TrainConfig,
    steps: range,
    *,
    process: int,
    processes: int,
    pin_memory: bool,
) -> Iterator[dict[str, Tensor]]:
    """Read the batches of some steps, always the same ones.

    Args:
        process, processes: Which of how many devices' share.
    Raises: InputError, while iterating, for a file that broke meanwhile.
    """
    batches = number_batches(
        batch_size=config.optimiser.batch_size,
        accumulation=config.optimiser.accumulation,
        steps=steps,
        process=process,
        processes=processes,
    )
    workers = count_workers(config.speed)
    loader = DataLoader(
        samples,
        batch_sampler=batches,
        num_workers=workers,
        # spawned: neither torch's threads nor signal handlers survive a fork
        multiprocessing_context="spawn" if workers else None,
        worker_init_fn=_start_worker,
        pin_memory=pin_memory,
        generator=torch.Generator(),  # or it would draw from the random state that is kept
    )
    try:
        yield from loader
    except InputError as error:
        # from another process it comes with that one's traceback as its message
        raise InputError(ORIGIN.split(str(error).rstrip())[-1]) from error


def _start_worker(_worker: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent tells when to stop
    cv2.setNumThreads(1)
