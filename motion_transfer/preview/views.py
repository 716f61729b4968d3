"""The views of a run: what each shows of a frame, of the source, or of the driver's pictures."""

from __future__ import annotations

import threading
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from motion_transfer.drawing.backgrounds import Frame
from motion_transfer.drawing.canvas import Picture, colour_iuv
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.person import find_people
from motion_transfer.drawing.renderers.interface import Appearance, Recipe, Renderer
from motion_transfer.drawing.source import Source
from motion_transfer.errors import InputError, OutputError
from motion_transfer.events import Listener, ignore
from motion_transfer.media.iuv.opening import read_single_iuv
from motion_transfer.media.output.marks import Mark
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import encode_jpeg, read_photo, write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.option import part_of
from motion_transfer.preview.driver import FramePlans, PreviewedDriver, plan_frames
from motion_transfer.preview.scenes import Scenes
from motion_transfer.render.composition import open_recipe
from motion_transfer.render.driver import open_driver
from motion_transfer.render.options import RendererOptions, RenderOptions, SourceOptions
from motion_transfer.render.provenance import source_type_of
from motion_transfer.render.source import read_source

KEPT = 4  # results of each step: some options back and forth without waiting
COLOUR_SEED = 0  # any: so that a map has the same colours in every session
COLOUR_SPREAD = 2.5  # standard deviations of the projected map that the colours span, each way
LONGEST_PROXY_SIDE = 720  # px: as large as the page shows a frame


class Views:
    """Draws views; what is needed once per source, renderer or canvas is kept."""

    def __init__(self, listener: Listener = ignore) -> None:
        """Draw nothing yet; `listener` is told how far it is where a source takes long."""
        self._open_recipe = lru_cache(KEPT)(open_recipe)
        self._read_source = lru_cache(KEPT)(partial(read_source, listener=listener))
        self._prepare = lru_cache(KEPT)(self._prepare_source)
        self._scenes = Scenes(self.source, lambda options: self.prepared(options)[1])

    def source(self, options: RenderOptions) -> Source:
        """Give the source. Raises: InputError, as a run would."""
        return self._read_source(
            part_of(options, SourceOptions), self._recipe(options).texture_size
        )

    def working_size(self, options: RenderOptions, window_side: int) -> int:
        """Tell the side, px, of the renderer's crops for a window. Raises: InputError."""
        return self._recipe(options).working_size(window_side)

    def prepared(self, options: RenderOptions) -> tuple[Appearance, Renderer]:
        """Give what the renderer knows of the source, and the renderer. Raises: InputError."""
        return self._prepare(self._recipe(options), part_of(options, SourceOptions))

    def result(
        self, options: RenderOptions, driver: PreviewedDriver, plans: FramePlans, index: int
    ) -> Picture:
        """Draw an output frame, with alpha where nothing is behind.

        Raises: InputError, WeightsError.
        """
        return self._scenes.frame(options, driver, plans, index)

    def iuv(self, driver: PreviewedDriver, index: int) -> Frame:
        """Colour a driver's frame by part, as DensePose does, everybody in it included."""
        return colour_iuv(driver.read(index))

    def texture(self, options: RenderOptions) -> Frame:
        """Show the partial texture; grey where nothing is seen."""
        source = self.source(options)
        colours = ((source.texture + 1) * 127.5).round().astype(np.uint8).transpose(1, 2, 0)
        seen = source.visibility[0][..., None] > 0
        return np.where(seen, colours, np.uint8(128))  # neither light nor dark

    def feature_map(self, options: RenderOptions) -> Frame:
        """Show the source's feature map as colours. Raises: InputError if there is none."""
        feature_map, _ = self._features(options)
        return project_features(feature_map, *_span(feature_map))

    def feature_image(
        self, options: RenderOptions, driver: PreviewedDriver, plans: FramePlans, index: int
    ) -> Frame:
        """Show the feature image that a frame is drawn from, in the colours of the map.

        Raises: InputError if there is none.
        """
        feature_map, renderer = self._features(options)
        window = plans.window_at(index)
        crop = window.cut(plans.read(index, driver), renderer.working_size(window.side))
        features = renderer.feature_image(crop[None])[0, : len(feature_map)]
        picture = project_features(features, *_span(feature_map))
        picture[crop[..., 0] == 0] = 255  # background has no features
        return picture

    def _features(self, options: RenderOptions) -> tuple[Float[np.ndarray, "D T T"], Renderer]:
        appearance, renderer = self.prepared(options)
        if not renderer.feature_channels:
            raise InputError(
                f"the {renderer.name} renderer has no feature map; choose nhrr to see one"
            )
        assert isinstance(appearance, FeatureMap)
        return appearance.features[0, : renderer.feature_channels], renderer

    def _recipe(self, options: RenderOptions) -> Recipe:
        return self._open_recipe(part_of(options, RendererOptions))

    def _prepare_source(
        self, recipe: Recipe, options: SourceOptions
    ) -> tuple[Appearance, Renderer]:
        appearance = recipe.appearance_of(self._read_source(options, recipe.texture_size))
        return appearance, recipe.renderer(appearance)


def write_frame(options: RenderOptions, index: int, output: Path) -> None:
    """Write a frame of the driver as the whole run would draw it, its crop window included.

    Raises: InputError if there is no such frame; OutputError if the file cannot be written.
    """
    if output.suffix.lower() != ".png":
        raise OutputError(f"{output} is no .png; one frame is written as PNG")
    check_destination(output, force=options.force)
    with work_folder(output) as folder:
        driver = PreviewedDriver(open_driver(options, folder, ignore))
        if not 0 <= index < driver.frame_count:
            raise InputError(
                f"frame {index} asked for, but {options.driver} has {driver.frame_count}: 0 to"
                f" {driver.frame_count - 1}"
            )
        driver.see_all(threading.Event(), lambda _count: None)  # any frame may move the window
        if index in driver.broken:
            raise InputError(driver.broken[index])
        picture = Views().result(options, driver, plan_frames(driver, options), index)
        write_png(folder / "frame.png", picture, Mark(source_type_of(options)).xmp())
        publish(folder / "frame.png", output)


def write_proxies(clip: Path, folder: Path, stop: threading.Event) -> None:
    """Write small copies of a clip's pictures, JPEG files that can be read in any order.

    Raises: InputError, OSError.
    """
    folder.mkdir()
    for index, picture in enumerate(open_pictures(clip).read()):
        if stop.is_set():
            return
        scale = min(1, LONGEST_PROXY_SIDE / max(picture.shape[:2]))
        size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        _proxy(folder, index).write_bytes(encode_jpeg(small))


def read_proxy(folder: Path, index: int) -> UInt8[np.ndarray, "h w 3"]:
    """Read a small copy of a picture. Raises: InputError if the clip has no such picture."""
    return read_photo(_proxy(folder, index), "picture").rgb


def _proxy(folder: Path, index: int) -> Path:
    return folder / f"{index:08d}.jpg"


def count_people(source: Source, options: SourceOptions) -> int:
    """Count the people of a source's IUV; 0 where it was estimated, and so shows the chosen one."""
    if source.iuv_path is None:
        return 0
    iuv = read_single_iuv(source.iuv_path, options.source_iuv_order, "source IUV")
    return 0 if iuv is None else len(find_people(iuv).persons)


def project_features(
    features: Float[np.ndarray, "D H W"], mean: np.ndarray, deviation: np.ndarray
) -> UInt8[np.ndarray, "H W 3"]:
    """Show many channels as three, by a fixed random matrix, as the paper's figures do.

    Args:
        mean, deviation: Those of each of the three, over what the colours shall span.
    """
    projected = np.einsum("cd,dhw->hwc", _colour_matrix(len(features)), features)
    scaled = (projected - mean) / (deviation * COLOUR_SPREAD)
    return ((scaled.clip(-1, 1) + 1) * 127.5).round().astype(np.uint8)


def _span(feature_map: Float[np.ndarray, "D T T"]) -> tuple[np.ndarray, np.ndarray]:
    """Measure mean and deviation of the projected map, so that its images share its colours."""
    flat = _colour_matrix(len(feature_map)) @ feature_map.reshape(len(feature_map), -1)
    return flat.mean(1), flat.std(1) + 1e-6  # which is divided by, also for a map of one colour


def _colour_matrix(channels: int) -> Float[np.ndarray, "3 D"]:
    return np.random.default_rng(COLOUR_SEED).normal(size=(3, channels)).astype(np.float32)
