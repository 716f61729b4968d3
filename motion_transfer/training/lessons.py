"""What is learned of one person: photos to draw from feature maps, and poses to hold.

Everything but the crops is made once. A lesson is a batch of one:

    feature_map    1 x D x T x T, what is drawn from
    detail         1 x 3 x t x t, what the photos show finer, where the model has a use for it
    target_iuv     1 x 3 x S x S uint8
    target_image   1 x 3 x S x S in [-1, 1], over white where alpha is known
    target_alpha   1 x 1 x S x S in [-1, 1], where it is known
    learned        1 x 1 x S x S bool, the pixels whose colours are compared; if absent, all are
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Protocol

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, UInt8
from torch import Tensor

from motion_transfer.drawing.engines.torch_engine import encode_source
from motion_transfer.drawing.outline import stand_out
from motion_transfer.drawing.person import bounding_box, occupancy
from motion_transfer.drawing.source import Source, SourcePicture, unfold_source, unfold_views
from motion_transfer.drawing.textures import average
from motion_transfer.drawing.unfolding import texel_index, texture_coordinates
from motion_transfer.drawing.views import equalise_light
from motion_transfer.drawing.window import (
    BEYOND_THE_PHOTO,
    DRAWN_UNSCALED,
    SIDE_STEP,
    Window,
    cut_picture,
    plan_window,
)
from motion_transfer.training.metrics import SHOWN_TEXELS
from motion_transfer.training.pictures import Image, Plane
from motion_transfer.training.samples import to_tensor
from motion_transfer.training.step import Batch
from nhrr_core import NeuralReRenderer
from nhrr_core.config import COLOUR_CHANNELS

Gains = Float64[np.ndarray, " 3"]
"""What the values of each colour are multiplied by."""

MOST_MAPS = 16
"""More would take too much memory: 22 MB each with `lite`."""

MOST_TOGETHER = 4
"""So many other photos at most are merged to draw one from; each takes a second or two."""

NEAR = 0.75
"""Photos are drawn between this size and that of the photo itself, as drivers differ in theirs."""

SHIFT = 0.06
"""Of the person's window: how far it is moved, so that nobody learns where the middle is."""

HIDDEN_ENOUGH = 0.5
"""Poses are held that show half as much of what is hidden as the one that shows most, or more."""


class LessonSettings(Protocol):
    """What lessons read of `AdaptationSettings`."""

    @property
    def held_every(self) -> int: ...
    @property
    def held_poses(self) -> int: ...
    @property
    def maps(self) -> int: ...
    @property
    def light(self) -> float: ...
    @property
    def tint(self) -> float: ...
    @property
    def seed(self) -> int: ...


@dataclass(frozen=True)
class Portrait:
    """A photo to be drawn.

    Attributes:
        alpha: The person's, where it is known.
        window: The square that the renderer would cut around them.
    """

    rgb: Image
    iuv: Image
    alpha: Plane | None
    window: Window


@dataclass(frozen=True)
class Likeness:
    """What is drawn from, and the photo that is to be drawn, under this light."""

    known: Batch
    portrait: int
    gains: Gains


class Lessons:
    """Lessons without end, the same ones for the same seed.

    Args:
        model: Before it learns, in evaluation mode; it encodes, and draws what is held.
        pictures: One person; all get the light of the first.
        poses: IUV of somebody in motion.
    """

    def __init__(
        self,
        model: NeuralReRenderer,
        pictures: Sequence[SourcePicture],
        poses: Sequence[Image],
        settings: LessonSettings,
    ) -> None:
        self._model, self._settings = model, settings
        self._device = next(model.parameters()).device
        self._random = np.random.default_rng(settings.seed)
        self._pictures = give_one_light(pictures)
        self._portraits = [take_portrait(p, alpha=model.config.alpha) for p in self._pictures]
        self._likenesses = self._vary()
        self._held = self._hold(poses) if settings.held_every else []

    def __iter__(self) -> Iterator[Batch]:
        photos, held = count(), count()
        for step in count(1):
            if self._held and step % self._settings.held_every == 0:
                lesson = self._held[next(held) % len(self._held)]
            else:
                lesson = self._draw(self._likenesses[next(photos) % len(self._likenesses)])
            yield {name: each.to(self._device) for name, each in lesson.items()}

    def _vary(self) -> list[Likeness]:
        """Encode the ways in which each photo is drawn; every other one has a light of its own."""
        settings, random, number = self._settings, self._random, len(self._pictures)
        ways = [(photo, kind) for photo in range(number) for kind in range(3 if number > 1 else 1)]
        ways = [ways[index] for index in random.permutation(len(ways))]
        likenesses = []
        for index in range(min(max(settings.maps, number), MOST_MAPS)):
            photo, kind = ways[index % len(ways)]
            others = random.permutation([other for other in range(number) if other != photo])
            # from itself, from another one, or from several together
            chosen = ([photo], others[:1], others[:MOST_TOGETHER])[kind]
            gains = np.exp(random.normal(0, settings.light) + random.normal(0, settings.tint, 3))
            if index % 2 == 0:
                gains = np.ones(3)
            shown = self._unfold([relight(self._pictures[int(each)], gains) for each in chosen])
            likenesses.append(Likeness(self._encode(shown), photo, gains))
        return likenesses

    def _unfold(self, pictures: Sequence[SourcePicture]) -> Source:
        return unfold_source(pictures, self._model.config.finest_texture)

    def _encode(self, source: Source) -> Batch:
        """Compute the feature map of a source, and its detail, as a run would."""
        found = encode_source(self._model, source)
        known = {"feature_map": found.features, "detail": found.detail}
        return {
            name: torch.from_numpy(array).to(self._device)
            for name, array in known.items()
            if array is not None
        }

    def _draw(self, likeness: Likeness) -> Batch:
        """Cut a photo, at a size and a place that are left to chance."""
        portrait, size = self._portraits[likeness.portrait], self._model.config.image_size
        whole = portrait.window.side
        largest = min(max(size, whole), round(DRAWN_UNSCALED[1] * size))
        # px of a drawing of the whole window
        drawn = math.exp(self._random.uniform(math.log(NEAR * largest), math.log(largest)))
        side = min(size, round(drawn / SIDE_STEP) * SIDE_STEP)
        cut = round(whole * side / drawn)
        centre = self._choose_centre(portrait, cut)
        window = Window(*(middle - cut // 2 for middle in centre), side=cut)
        rgb = lit(cut_picture(window, portrait.rgb, side, BEYOND_THE_PHOTO), likeness.gains)
        lesson = {
            **likeness.known,
            "target_image": to_tensor(rgb)[None],
            "target_iuv": _stack(window.cut(portrait.iuv, side)),
        }
        if portrait.alpha is None:
            # the person's surroundings are not known, and neither is what of them is clothes
            return {**lesson, "learned": lesson["target_iuv"][:, :1] > 0}
        alpha = to_tensor(cut_picture(window, portrait.alpha, side, 0))[None]
        pixels = torch.cat([lesson["target_image"], alpha], dim=1)
        return {**lesson, "target_image": lay_over_white(pixels), "target_alpha": alpha}

    def _choose_centre(self, portrait: Portrait, cut: int) -> tuple[int, int]:
        """Choose the middle of a cut, x and y: the person's, or a place on a larger person."""
        whole = portrait.window
        shift = self._random.uniform(-SHIFT, SHIFT, 2) * whole.side
        centre = whole.x + whole.side / 2, whole.y + whole.side / 2
        if cut < whole.side:
            rows, columns = portrait.iuv[..., 0].nonzero()
            place = self._random.integers(len(rows))
            # what lies within the window, as the networks never see less than a person's middle
            room = (whole.side - cut) / 2
            centre = tuple(
                float(np.clip(at, middle - room, middle + room))
                for at, middle in zip((columns[place], rows[place]), centre, strict=True)
            )
        return round(centre[0] + shift[0]), round(centre[1] + shift[1])

    def _hold(self, poses: Sequence[Image]) -> list[Batch]:
        """Draw poses that show what no photo does, as the model draws them before it learns."""
        size = self._model.config.image_size
        boxes = [bounding_box(iuv) for iuv in poses]
        crops = [
            plan_window([box]).cut(iuv, size)
            for iuv, box in zip(poses, boxes, strict=True)
            if box.area
        ]
        if not crops:
            return []
        source = self._unfold(self._pictures)
        seen = average(source.visibility, SHOWN_TEXELS)[0] > 0
        hidden = np.array([np.count_nonzero(hidden_pixels(iuv, seen)) for iuv in crops])
        fit = np.flatnonzero(hidden >= HIDDEN_ENOUGH * hidden.max())
        spread = np.linspace(0, len(fit) - 1, self._settings.held_poses).round().astype(int)
        known = self._encode(source)
        held = []
        for index in fit[spread]:
            iuv = _stack(crops[index])
            with torch.no_grad():
                drawn = self._model.render(
                    known["feature_map"], iuv.to(self._device), known.get("detail")
                )
            lesson = {
                **known,
                "target_iuv": iuv,
                "target_image": lay_over_white(drawn),
            }
            if self._model.config.alpha:
                lesson["target_alpha"] = drawn[:, COLOUR_CHANNELS:]
            held.append(lesson)
        return held


def give_one_light(pictures: Sequence[SourcePicture]) -> list[SourcePicture]:
    """Give photos the exposure and white balance of the first, see `equalise_light`."""
    if len(pictures) == 1:
        return list(pictures)
    size = 256  # texels: medians of colours ask for no more
    before = unfold_views(pictures, size)
    relit = []
    for picture, own, other in zip(pictures, before, equalise_light(before), strict=True):
        seen = own.visibility[0] > 0
        means = [(view.texture[:, seen] + 1).mean(1, np.float64) for view in (other, own)]
        relit.append(relight(picture, means[0] / np.maximum(means[1], 1e-6)))
    return relit


def relight(picture: SourcePicture, gains: Gains) -> SourcePicture:
    """Give a photo another exposure and white balance."""
    if (gains == 1).all():
        return picture
    return replace(picture, photo=replace(picture.photo, rgb=lit(picture.photo.rgb, gains)))


def lit(rgb: Image, gains: Gains) -> Image:
    """Multiply colours, 0..255, which are clipped."""
    table = np.clip(np.arange(256)[:, None] * gains, 0, 255).round().astype(np.uint8)
    return np.stack([table[rgb[..., channel], channel] for channel in range(3)], axis=-1)


def take_portrait(picture: SourcePicture, *, alpha: bool) -> Portrait:
    """Prepare a photo to be drawn; its outline is found where the backdrop is plain.

    Args:
        alpha: Whether the networks draw it.
    """
    box = bounding_box(picture.iuv)
    cover = picture.photo.alpha if picture.alpha is None else picture.alpha
    if cover is None and alpha:
        cover = stand_out(picture.photo.rgb, occupancy(picture.iuv), max(box.width, box.height))
    return Portrait(picture.photo.rgb, picture.iuv, cover if alpha else None, plan_window([box]))


def hidden_pixels(iuv: Image, seen: Bool[np.ndarray, "T T"]) -> Bool[np.ndarray, "H W"]:
    """Mark the body's pixels whose texel is not among those that are seen."""
    texel = texel_index(texture_coordinates(iuv), len(seen))
    return (iuv[..., 0] > 0) & ~seen.ravel()[texel]


def lay_over_white(drawn: Float[Tensor, "B K H W"]) -> Float[Tensor, "B 3 H W"]:
    """Lay a drawing over white as its alpha says; one without alpha stays as it is."""
    colours, alpha = drawn.tensor_split([COLOUR_CHANNELS], dim=1)
    return (
        torch.lerp(torch.ones_like(colours), colours, (alpha + 1) / 2) if len(alpha[0]) else colours
    )


def _stack(iuv: Image) -> UInt8[Tensor, "1 3 H W"]:
    return torch.from_numpy(np.ascontiguousarray(iuv.transpose(2, 0, 1)))[None]
