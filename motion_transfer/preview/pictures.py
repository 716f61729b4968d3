"""The views of a run: what each shows of a frame, or of the source."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from jaxtyping import Float, UInt8

from motion_transfer.errors import InputError
from motion_transfer.media.iuv_stream import read_single_iuv
from motion_transfer.preview.driver_look import DriverLook
from motion_transfer.preview.frame_plans import FramePlans
from motion_transfer.render.canvas import Canvas, Image
from motion_transfer.render.compose import colour_iuv
from motion_transfer.render.content import digest_weights
from motion_transfer.render.events import ignore
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.person import find_people
from motion_transfer.render.prepare import make_canvas
from motion_transfer.render.recipe import Recipe, choose_recipe
from motion_transfer.render.renderer import Renderer
from motion_transfer.render.source import Source, prepare_source

if TYPE_CHECKING:
    from motion_transfer.render.neural_renderer import NeuralRenderer

NO_FEATURES = "the texture renderer has no feature map; choose nhrr to see one"
KEPT = 4
COLOUR_SEED = 0
COLOUR_SPREAD = 2.5  # standard deviations of the projected map that the colours span, each way

Value = TypeVar("Value")


class Memory:
    """The last few results of slow steps, by what they were made from."""

    def __init__(self) -> None:
        self._held: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = threading.RLock()

    def get(self, name: Hashable, make: Callable[[], Value]) -> Value:
        with self._lock:
            if name not in self._held:
                self._held[name] = make()
                if len(self._held) > KEPT:
                    self._held.popitem(last=False)
            self._held.move_to_end(name)
            return self._held[name]


class Pictures:
    """Draws views; what is needed once per source, renderer or canvas is kept."""

    def __init__(self) -> None:
        self._recipes, self._sources = Memory(), Memory()
        self._renderers, self._canvases = Memory(), Memory()

    def source(self, options: RenderOptions) -> Source:
        """Raises: InputError, as a run would."""
        recipe = self._recipe(options)
        name = (options.person, options.source_iuv_order, recipe.texture_size)
        return self._sources.get(name, lambda: prepare_source(options, recipe.texture_size))

    def result(
        self, options: RenderOptions, look: DriverLook, plans: FramePlans, index: int
    ) -> Image:
        """An output frame. Raises: InputError, WeightsError."""
        iuv, _ = plans.frame(index, look)
        window = plans.window_at(index)
        renderer = self._renderer(options)
        crop = window.cut(iuv, renderer.working_size(window.side))
        rgba = renderer.render(crop[None])[0]
        canvas = self.canvas(options, look, plans)
        return canvas.lay_out(iuv, crop, rgba, window)

    def canvas(self, options: RenderOptions, look: DriverLook, plans: FramePlans) -> Canvas:
        """Where results are laid out, without the comparison's other panels."""
        side = max(shot.window.side for shot in plans.shots)
        size = self._renderer(options).working_size(side)
        plain = replace(options, compare=False)
        name = (options.background, options.size, options.person, options.renderer, size)
        height, width = look.reader.height, look.reader.width
        return self._canvases.get(
            name, lambda: make_canvas(plain, height, width, size, self.source(options))
        )

    def iuv(self, look: DriverLook, index: int) -> Image:
        """A driver's frame as DensePose shows it, everybody in it included."""
        return colour_iuv(look.read(index))

    def texture(self, options: RenderOptions) -> Image:
        """The partial texture; grey where nothing is seen."""
        source = self.source(options)
        colours = ((source.texture[0] + 1) * 127.5).round().byte().permute(1, 2, 0).numpy()
        seen = source.visibility[0, 0].numpy()[..., None] > 0
        return np.where(seen, colours, np.uint8(128))

    def feature_map(self, options: RenderOptions) -> Image:
        """FeatureNet's map, 16 channels as colours. Raises: InputError if there is none."""
        feature_map, _ = self._features(options)
        return project_features(feature_map, *_span(feature_map))

    def feature_image(
        self, options: RenderOptions, look: DriverLook, plans: FramePlans, index: int
    ) -> Image:
        """What the network draws a frame from, in the colours of the map.

        Raises: InputError if there is none.
        """
        feature_map, renderer = self._features(options)
        iuv, _ = plans.frame(index, look)
        window = plans.window_at(index)
        crop = window.cut(iuv, renderer.working_size(window.side))
        features = renderer.feature_image(crop[None])[0, : len(feature_map)]
        picture = project_features(features, *_span(feature_map))
        picture[crop[..., 0] == 0] = 255
        return picture

    def _features(
        self, options: RenderOptions
    ) -> tuple[Float[np.ndarray, "D T T"], NeuralRenderer]:
        from motion_transfer.render.neural_renderer import NeuralRenderer

        if options.renderer == "texture":
            raise InputError(NO_FEATURES)
        appearance, renderer = self.prepared(options)
        if not isinstance(renderer, NeuralRenderer):
            raise InputError(NO_FEATURES)
        return appearance[0, : renderer.feature_channels], renderer

    def _renderer(self, options: RenderOptions) -> Renderer:
        return self.prepared(options)[1]

    def prepared(self, options: RenderOptions) -> tuple[np.ndarray, Renderer]:
        """What the renderer knows of the source, and the renderer. Raises: InputError."""
        recipe = self._recipe(options)

        def make() -> tuple[np.ndarray, Renderer]:
            appearance = recipe.appearance_of(self.source(options))
            return appearance, recipe.renderer(appearance)

        return self._renderers.get((recipe, options.person), make)

    def _recipe(self, options: RenderOptions) -> Recipe:
        # a single frame is wanted soon, so nothing is compiled
        plain = replace(options, compile=False)
        return self._recipes.get(
            (options.renderer, options.weights),
            lambda: choose_recipe(plain, 1, digest_weights(plain), ignore),
        )


def count_people(source: Source, options: RenderOptions) -> int:
    """How many people a source's IUV shows; 0 where it was estimated, and so shows the chosen."""
    if source.iuv_path is None:
        return 0
    iuv = read_single_iuv(source.iuv_path, options.source_iuv_order, "source IUV")
    return 0 if iuv is None else len(find_people(iuv).persons)


def _span(feature_map: Float[np.ndarray, "D T T"]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and deviation of the projected map, so that its images share its colours."""
    flat = _colour_matrix(len(feature_map)) @ feature_map.reshape(len(feature_map), -1)
    return flat.mean(1), flat.std(1) + 1e-6


def project_features(
    features: Float[np.ndarray, "D H W"], mean: np.ndarray, deviation: np.ndarray
) -> UInt8[np.ndarray, "H W 3"]:
    """Many channels as three, by a fixed random matrix, as the paper's figures show them.

    Args:
        mean, deviation: of each of the three, over what the colours shall span.
    """
    projected = np.einsum("cd,dhw->hwc", _colour_matrix(len(features)), features)
    scaled = (projected - mean) / (deviation * COLOUR_SPREAD)
    return ((scaled.clip(-1, 1) + 1) * 127.5).round().astype(np.uint8)


def _colour_matrix(channels: int) -> Float[np.ndarray, "3 D"]:
    return np.random.default_rng(COLOUR_SEED).normal(size=(3, channels)).astype(np.float32)
