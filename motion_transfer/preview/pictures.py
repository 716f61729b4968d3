"""Pictures for the page: drawn when somebody asks, the nearest first; encoded, and kept a while."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.canvas import show_alpha
from motion_transfer.drawing.renderers import DRAFT
from motion_transfer.errors import InputError
from motion_transfer.media.pictures.photo import encode_jpeg, encode_png
from motion_transfer.option import part_of
from motion_transfer.preview.driver import FramePlans, PreviewedDriver
from motion_transfer.preview.queue import FIRST, ByteCache, DrawQueue, StaleError
from motion_transfer.preview.views import Views, read_proxy
from motion_transfer.render.options import RenderOptions, SourceOptions

CACHED_BYTES = 128 * 2**20  # of encoded pictures: some thousand of a small driver's
SHARP_VIEWS = ("iuv", "texture", "map", "features")
"""Edges in them mean something: they are sent without loss."""

NOBODY = "there is nobody to be seen yet; drop a photo of a person"


@dataclass(frozen=True)
class Looked:
    """What a picture of a frame depends on, at one moment.

    Attributes:
        key: A digest of it.
        proxies: The folder with small copies of the driver's pictures.
        is_empty: Whether there is no source yet.
    """

    options: RenderOptions
    driver: PreviewedDriver
    plans: FramePlans
    key: str
    proxies: Path | None
    is_empty: bool


class Pictures:
    """Draws in one thread what is asked for, see `DrawQueue`."""

    def __init__(self, views: Views, broken: Callable[[PreviewedDriver, int], object]) -> None:
        """Draw nothing yet; `broken` is called after each frame, which may be broken."""
        self.views = views
        self._broken = broken
        self.queue = DrawQueue()
        self._encoded = ByteCache[bytes](CACHED_BYTES, len)

    def frame(
        self, looked: Looked, index: int, view: str, key: str, *, draft: bool = False
    ) -> Future[bytes]:
        """Ask for a picture of a frame, encoded; cancel the future if it is not wanted any more.

        Raises: StaleError; InputError if there is no such view or frame.
        """
        driver, plans = looked.driver, looked.plans
        options = replace(draft_of(looked.options) if draft else looked.options, compare=False)
        behind = "white" if options.transparent else options.background  # panels have no alpha
        beside = replace(options, compare=True, background=behind)
        calls: dict[str, Callable[[], np.ndarray]] = {
            "result": lambda: show_alpha(self.views.result(options, driver, plans, index)),
            "beside": lambda: self.views.result(beside, driver, plans, index),
            "iuv": lambda: self.views.iuv(driver, index),
            "features": lambda: self.views.feature_image(options, driver, plans, index),
            "pictures": lambda: _proxy(looked, index),
        }
        if view not in calls:
            raise InputError(f"view {view!r}; supported are {', '.join(calls)}")
        if looked.is_empty and view in ("result", "beside", "features"):
            raise InputError(NOBODY)
        if not 0 <= index < driver.frame_count:
            raise InputError(f"frame {index}; the driver has {driver.frame_count}, from 0")
        if key != looked.key:
            raise StaleError("something has changed since; ask again with the new key")
        draft = options.renderer == DRAFT  # asked for as one, or drawn as one anyway
        future = self.ask((key, view, index, draft), calls[view], view, index, draft)
        future.add_done_callback(lambda _: self._broken(driver, index))
        return future

    def still(self, options: RenderOptions, view: str) -> Future[bytes]:
        """Ask for a picture of the source, see `frame`."""
        calls: dict[str, Callable[[], np.ndarray]] = {
            "source": lambda: self.views.source(options).photo.on_white(),
            "texture": lambda: self.views.texture(options),
            "map": lambda: self.views.feature_map(options),
        }
        if view not in calls:
            raise InputError(f"view {view!r}; supported are {', '.join(calls)}")
        name = options.renderer, part_of(options, SourceOptions), view
        return self.ask(name, calls[view], view)

    def ask(
        self,
        name: Hashable,
        call: Callable[[], UInt8[np.ndarray, "H W 3"]],
        view: str,
        index: int = FIRST,
        draft: bool = False,
    ) -> Future[bytes]:
        """Ask for any picture, by a name that no other has; `view` says how it is encoded."""
        encode = encode_png if view in SHARP_VIEWS else encode_jpeg

        def draw() -> bytes:
            data = self._encoded.get(name)  # somebody else may have asked meanwhile
            if data is None:
                data = encode(call())
                self._encoded.put(name, data)
            return data

        kept = self._encoded.get(name)
        if kept is not None:
            future: Future[bytes] = Future()
            future.set_result(kept)
            return future
        return self.queue.ask(draw, place=index, draft=draft)


def draft_of(options: RenderOptions) -> RenderOptions:
    """Take the draft renderer: at hand within a second, and the source's texture with it."""
    plain = dict.fromkeys(("weights", "engine", "precision", "device"))
    return replace(options, renderer=DRAFT, adapt=False, **plain)


def _proxy(looked: Looked, index: int) -> UInt8[np.ndarray, "H W 3"]:
    if looked.driver.opened.pictures is None:
        raise InputError("the driver is IUV; it has no pictures")
    if looked.proxies is None:
        raise InputError("the driver's pictures are being read; try again in a moment")
    return read_proxy(looked.proxies, index)
