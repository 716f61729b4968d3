"""Ever new people for training, kept on the device that learns.

Painting a person takes longer than learning from one: so each stays for a while, and batches are
drawn from whoever is there. How far the painters were when a batch was drawn is left to chance:
a run on such people cannot be repeated, and one that goes on sees other people than if it had never
been stopped. Its learning is no worse for that. Albums of a fixed number of people are exact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext

import numpy as np
import psutil
import torch
from torch import Tensor

from motion_transfer.training.config import TrainConfig
from motion_transfer.training.painters import PaintedPerson, Painters
from motion_transfer.training.samples import UNKNOWN_CLEARANCE, background_colour
from nhrr_core import extract_texture, load_uv_layout
from nhrr_core.config import CLEARANCE_SIZE, PICTURE_CHANNELS

FIRST_PEOPLE, FIRST_OF_BATCH = 32, 4
"""So many, or so many for each of a batch if that is less, are there before the first step: enough
that batches differ; chosen."""

UNFOLDED_AT_ONCE = 8
"""People; so many are taken in before a step at most, which keeps it from waiting for more."""

MOST_OF_GPU, MOST_OF_RAM = 1 / 2, 1 / 8
"""Shares of the GPU's free memory, and of the machine's, that the pool may fill; chosen."""

UINT8, FLOAT16 = torch.uint8, torch.float16


class PeoplePool:
    """Photos of people in the device's memory, unfolded and cut out; the oldest give way.

    Everybody is drawn from `data.draws` times on average, if the painters are fast enough: they
    wait, once they are ahead of that.

    Args:
        seed: Of what is drawn.
    """

    def __init__(
        self, config: TrainConfig, painters: Painters, device: torch.device, seed: Sequence[int]
    ) -> None:
        self._config, self._painters, self._device = config, painters, device
        self._random = torch.Generator(device)
        self._random.manual_seed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
        self._charts = load_uv_layout().charts.to(device)
        colour = background_colour(config.data)
        self._background = None if colour is None else colour.to(device)
        self._added = self._drawn = 0
        kinds = _kinds(config)
        size = _fit(config.data.pool, kinds, device)
        self._kept = {
            name: torch.empty((size, *shape), dtype=dtype, device=device)
            for name, (shape, dtype) in kinds.items()
        }
        self._size = size
        self._stream = torch.cuda.Stream(device) if device.type == "cuda" else None

    def __len__(self) -> int:
        return min(self._added, self._size)

    def __iter__(self) -> Iterator[dict[str, Tensor]]:
        """Draw batches without end, as `TrainingSamples` makes them, on the device.

        Raises: TrainingError if people cannot be painted.
        """
        while True:
            self._take_in()
            yield self._draw(self._config.optimiser.batch_size)

    def _take_in(self) -> None:
        """Keep who is painted, if it is time for new people; wait for the first ones."""
        first = min(FIRST_PEOPLE, FIRST_OF_BATCH * self._config.optimiser.batch_size, self._size)
        while self._added < first:
            self._add(self._painted(min(UNFOLDED_AT_ONCE, first - self._added), wait_for_one=True))
        behind = first + self._drawn // self._config.data.draws - self._added
        self._add(self._painted(min(UNFOLDED_AT_ONCE, behind), wait_for_one=False))

    def _painted(self, most: int, *, wait_for_one: bool) -> list[PaintedPerson]:
        people = []
        while len(people) < most:
            person = self._painters.take(wait_for_one=wait_for_one)
            if person is None:
                break
            people.append(person)
        return people

    def _add(self, people: Sequence[PaintedPerson]) -> None:
        if not people:
            return
        with self._beside():
            rows = self._unfold(people)
            places = (torch.arange(len(people)) + self._added) % self._size
            places = places.to(self._device)
        if self._stream is not None:
            # only now, so that steps whose batches hold those who give way are done with them
            torch.cuda.current_stream(self._device).wait_stream(self._stream)
        for name, values in {**rows, "places": places}.items():
            if self._stream is not None:
                values.record_stream(torch.cuda.current_stream(self._device))
            if name in self._kept:
                self._kept[name].index_copy_(0, places, values)
        self._added += len(people)

    def _beside(self) -> AbstractContextManager[object]:
        """Beside the steps that the device is still busy with: unfolding asks it for numbers."""
        return torch.cuda.stream(self._stream) if self._stream is not None else nullcontext()

    @torch.no_grad()
    def _unfold(self, people: Sequence[PaintedPerson]) -> dict[str, Tensor]:
        def gather(name: str) -> Tensor:
            stacked = torch.from_numpy(np.stack([getattr(person, name) for person in people]))
            return stacked.to(self._device)

        photo, photo_iuv = (gather(name).flatten(0, 1) for name in ("photo", "photo_iuv"))
        size = self._config.model.texture_size
        texture, visibility = extract_texture(photo.float(), photo_iuv, self._charts, size)
        rows = {name: gather(name) for name in self._kept if name not in ("texture", "visibility")}
        views = (len(people), self._config.data.views)
        rows["texture"] = texture.round_().to(UINT8).unflatten(0, views)
        rows["visibility"] = visibility.to(UINT8).unflatten(0, views)
        return rows

    def _draw(self, count: int) -> dict[str, Tensor]:
        """Draw two views of each of some people."""
        config = self._config

        def any_of(number: int) -> Tensor:
            return torch.randint(number, (count,), generator=self._random, device=self._device)

        person, source = any_of(len(self)), any_of(config.data.views)
        target = (source + 1 + any_of(config.data.views - 1)) % config.data.views
        self._drawn += count

        def colours(name: str, view: Tensor) -> Tensor:
            return self._kept[name][person, view].float() / 127.5 - 1

        batch = {"target_image": colours("image", target)}
        batch["target_iuv"] = self._kept["iuv"][person, target]
        roles = {"source": source}
        if config.model.supervises_texture:
            roles["target"] = target
        for role, view in roles.items():
            visibility = self._kept["visibility"][person, view].float()
            batch[f"{role}_texture"] = colours("texture", view) * visibility
            batch[f"{role}_visibility"] = visibility
        if config.model.alpha:
            batch["target_alpha"] = colours("alpha", target)
            if self._background is not None:
                batch["target_background"] = self._background.expand(count, -1)
        if config.model.clearance:
            known = torch.rand(count, 1, 1, 1, generator=self._random, device=self._device)
            clearance = self._kept["clearance"][person, source].float()
            batch["source_clearance"] = clearance * (known >= UNKNOWN_CLEARANCE)
        if config.model.reads_photo:
            batch["source_pictures"] = self._kept["picture"][person, source][:, None]
        return batch


def _kinds(config: TrainConfig) -> dict[str, tuple[tuple[int, ...], torch.dtype]]:
    """Shape and type of what is kept of each person."""
    model, views = config.model, config.data.views
    image, texture = ((side, side) for side in (model.image_size, model.texture_size))
    kinds = {
        "texture": ((views, 3, *texture), UINT8),
        "visibility": ((views, 1, *texture), UINT8),
        "image": ((views, 3, *image), UINT8),
        "iuv": ((views, 3, *image), UINT8),
    }
    if model.alpha:
        kinds["alpha"] = ((views, 1, *image), UINT8)
    if model.clearance:
        kinds["clearance"] = ((views, 2, CLEARANCE_SIZE, CLEARANCE_SIZE), FLOAT16)
    if model.reads_photo:
        kinds["picture"] = ((views, PICTURE_CHANNELS, *image), UINT8)
    return kinds


def _fit(
    wanted: int, kinds: dict[str, tuple[tuple[int, ...], torch.dtype]], device: torch.device
) -> int:
    """How many people there is memory for, at most as many as wanted."""
    each_bytes = sum(int(np.prod(shape)) * dtype.itemsize for shape, dtype in kinds.values())
    if device.type == "cuda":
        room_bytes = torch.cuda.mem_get_info(device)[0] * MOST_OF_GPU
    else:  # taken from the system as it fills
        room_bytes = psutil.virtual_memory().total * MOST_OF_RAM
    return max(1, min(wanted, int(room_bytes / each_bytes)))
