"""The same run from arrays in memory, frame by frame: for notebooks, and for programs around it."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import UInt8

from motion_transfer.drawing.canvas import Picture
from motion_transfer.drawing.person import find_people
from motion_transfer.drawing.renderers import DEFAULT_RENDERER
from motion_transfer.drawing.renderers.interface import Appearance, Recipe
from motion_transfer.drawing.source import Source, SourcePicture, take_person, unfold_source
from motion_transfer.errors import InputError
from motion_transfer.events import FramesDone, Listener, Notice, Stage, ignore
from motion_transfer.media.iuv.formats import ChannelOrder, DriverKind, Missing
from motion_transfer.media.iuv.frames import FrameStream
from motion_transfer.media.iuv.opening import open_reader
from motion_transfer.media.iuv.stream import IuvReader
from motion_transfer.media.pictures.photo import Photo
from motion_transfer.media.unchanged import Inputs
from motion_transfer.option import frame_range, parse_frames, parse_path, parse_rate
from motion_transfer.render.composition import (
    Scene,
    open_canvas,
    open_recipe,
    plan_run,
    set_scene,
)
from motion_transfer.render.driver import DriverScan, scan_driver
from motion_transfer.render.frames import FrameDrawer
from motion_transfer.render.options import (
    EstimatorOptions,
    Garment,
    Legs,
    RendererOptions,
    RenderOptions,
    SourceOptions,
)
from motion_transfer.render.plan import scan_people
from motion_transfer.render.source import check_photos, check_visible, clothe_legs, read_source
from motion_transfer.render.source_pictures import estimate_person, show_estimate
from motion_transfer.weights import DEFAULT_WEIGHTS, find_pretrained
from motion_transfer.weights.pretrained import save_pretrained

AnyPath = str | PathLike[str]
Image = UInt8[np.ndarray, "H W C"]
Iuv = UInt8[np.ndarray, "H W 3"]
Frames = UInt8[np.ndarray, "N H W 3"]

PHOTO, PHOTO_IUV, DRIVER = Path("the given photo"), "the given IUV", Path("the given IUV frames")
"""What messages call arrays."""

NOWHERE = Path("frames")
"""A folder of PNG, which can hold any frames; nothing is written to it."""


@dataclass(frozen=True, eq=False)
class EncodedSource:
    """A person as a renderer knows them, made once and drawn from as often as wanted.

    Attributes:
        source: What the photos show, unfolded.
        appearance: What the renderer made of it: a `FeatureMap`, or a texture.
        recipe: The renderer's.
    """

    source: Source
    appearance: Appearance
    recipe: Recipe


class MotionTransfer:
    """A renderer that is ready: photos are encoded, and IUV frames become pictures.

    >>> model = MotionTransfer.from_pretrained("lite")
    >>> person = model.encode("me.jpg")
    >>> pictures = list(model.render(person, "dance_iuv/"))

    What it draws equals what `render_video` and `mt run` draw, to the byte.
    """

    def __init__(
        self,
        weights: AnyPath | None = None,
        *,
        renderer: str = DEFAULT_RENDERER,
        engine: str | None = None,
        precision: str | None = None,
        device: str | None = None,
    ) -> None:
        """Take the options of `render_video`. Raises: InputError, WeightsError."""
        self._options = RendererOptions(
            renderer=renderer,
            weights=read_path(weights),
            engine=engine,
            precision=precision,
            device=device,
        )
        self.recipe = open_recipe(self._options)

    @classmethod
    def from_pretrained(
        cls,
        name: AnyPath = DEFAULT_WEIGHTS,
        *,
        revision: str | None = None,
        engine: str | None = None,
        precision: str | None = None,
        device: str | None = None,
    ) -> MotionTransfer:
        """Open weights by name.

        Args:
            name: `lite`, which ships; a folder that `save_pretrained` wrote; a checkpoint; or
                `owner/name` on the Hugging Face Hub (extra `hub`), where no such file is here.
            revision: A branch, tag or commit on the Hub.
        Raises: WeightsError; FetchError if the Hub cannot be reached; InputError.
        """
        weights = find_pretrained(name, revision)
        return cls(weights, engine=engine, precision=precision, device=device)

    def save_pretrained(self, folder: AnyPath, *, push: str | None = None) -> None:
        """Write the weights as a folder for the Hub: configuration, tensors and a model card.

        Args:
            push: `owner/name` on the Hub to upload it to.
        Raises: OutputError if the folder exists; FetchError if it cannot be uploaded.
        """
        files = self._options.weights_files
        if not files:
            raise InputError(f"the {self.recipe.name} renderer has no weights to save")
        save_pretrained(files[0], parse_path(folder), push=push)

    def encode(
        self,
        source: AnyPath | Sequence[AnyPath] | Image,
        iuv: AnyPath | Sequence[AnyPath] | Iuv | None = None,
        *,
        person: str = "largest",
        iuv_order: ChannelOrder | None = None,
        unseen_legs: Legs = "jeans",
        garments: Sequence[Garment] = (),
        estimator: str = "blazepose",
        estimator_model: AnyPath | None = None,
        listener: Listener = ignore,
    ) -> EncodedSource:
        """Encode a person.

        Args:
            source: As that of `render_video`; or one photo, H x W x 3 or 4, RGB or RGBA.
            iuv: Its IUV, of the same kind; None: it is looked for beside a file, and else
                estimated.
            iuv_order: The channels of the IUV, and of garments'; else found out.
            unseen_legs: As that of `render_video`.
            listener: Told what the user should know, see `motion_transfer.events`.
        Raises: InputError and its kinds.
        """
        model = read_path(estimator_model)
        size = self.recipe.texture_size
        if isinstance(source, np.ndarray):
            if isinstance(iuv, str | PathLike | Sequence) or garments:
                raise InputError("a photo in memory takes its IUV from memory, and no garments")
            options = EstimatorOptions(estimator=estimator, estimator_model=model)
            found = unfold_source([_take_photo(source, iuv, iuv_order, person, options)], size)
            check_visible(found, str(PHOTO))
            (found,) = clothe_legs([found], unseen_legs)
        else:
            if isinstance(iuv, np.ndarray):
                raise InputError("a photo in a file takes its IUV from a file; give its path")
            options = SourceOptions(
                source=list_paths(source),
                source_iuv=list_paths(iuv),
                person=person,
                source_iuv_order=iuv_order,
                unseen_legs=unseen_legs,
                garments=tuple(garments),
                estimator=estimator,
                estimator_model=model,
            )
            check_photos(options)
            found = read_source(options, size, listener)
        for note in found.notes:
            listener(Notice(note))
        return EncodedSource(found, self.recipe.appearance_of(found), self.recipe)

    def render(
        self,
        source: EncodedSource,
        driver: AnyPath | Frames,
        *,
        background: AnyPath = "transparent",
        background_fit: Literal["cover", "contain", "stretch"] = "cover",
        background_end: Literal["loop", "hold", "cut"] = "loop",
        background_blur: float = 0.0,
        place: str | None = None,
        on_the_spot: bool = False,
        shadow: bool = False,
        match_colours: bool = False,
        size: Literal["driver", "crop", "even", "background"] = "driver",
        driver_kind: DriverKind | None = None,
        driver_person: str = "largest",
        iuv_order: ChannelOrder | None = None,
        missing: Missing | None = None,
        window: str = "auto",
        frames: str | tuple[int | None, int | None] | None = None,
        estimator: str = "blazepose",
        estimator_model: AnyPath | None = None,
        frame_rate: str | float | Fraction | None = None,
        workers: int | None = None,
        folder: AnyPath | None = None,
        listener: Listener = ignore,
    ) -> RenderedFrames:
        """Look through a driver, and give its frames, each drawn when it is asked for.

        Args:
            source: What `encode` of this very renderer gave.
            driver: As that of `render_video`; or frames of IUV, N x H x W x 3. An array that is
                mapped from a file is not read into memory.
            frame_rate: What a video behind plays against; else the driver's, or 30.
            folder: Where the IUV is kept that is found in a driver's pictures, for the next call
                with that driver; None keeps it no longer than the frames.
            listener: Told how far looking and drawing are, and what the user should know.
        All others are as those of `render_video`, but for the background, which is transparent.

        Raises: InputError and its kinds.
        """
        if source.recipe != self.recipe:
            raise InputError(
                "this source was encoded by other weights, or to be run otherwise; encode it again"
            )
        given = driver if isinstance(driver, np.ndarray) else None
        options = RenderOptions(
            **vars(self._options),
            source=(source.source.photo.path,),
            driver=DRIVER if isinstance(driver, np.ndarray) else parse_path(driver),
            output=NOWHERE,
            background=str(background),
            background_fit=background_fit,
            background_end=background_end,
            background_blur=background_blur,
            place=place,
            on_the_spot=on_the_spot,
            shadow=shadow,
            match_colours=match_colours,
            size=size,
            driver_kind=driver_kind,
            driver_person=driver_person,
            iuv_order=iuv_order,
            missing=missing,
            window=window,
            frames=parse_frames(frames) if isinstance(frames, str) else frames or (None, None),
            estimator=estimator,
            estimator_model=read_path(estimator_model),
            frame_rate=None if frame_rate is None else parse_rate(str(frame_rate)),
            workers=workers,
        )
        return RenderedFrames(options, source, given, listener, folder=read_path(folder))


class RenderedFrames:
    """The frames of a run: their number and size are known, and each is drawn when it is wanted.

    Every pass over them draws them anew. An unfinished one is ended by closing its iterator.

    Attributes:
        height, width: Px.
        missing: Half-open ranges of driver frames in which nobody was found.
    """

    def __init__(
        self,
        options: RenderOptions,
        source: EncodedSource,
        driver: Frames | None,
        listener: Listener,
        *,
        folder: Path | None = None,
    ) -> None:
        """Look through the driver; see `MotionTransfer.render`."""
        self._listener = listener
        self._threads = options.worker_count
        self._appearance = source.appearance
        if folder is None:  # there for as long as frames may be asked for
            folder = Path(tempfile.mkdtemp(prefix="mt-frames-"))
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        if driver is None:
            scan = scan_driver(options, folder, listener, workers=self._threads)
        else:
            scan = _scan_frames(options, driver, listener)
        self._inputs = scan.inputs
        scans, plans = [scan], [plan_run(options, scan)]
        recipe, about = source.recipe, source.source
        canvas = open_canvas(options, scans, plans, recipe, about)
        self._scene: Scene = set_scene(
            options, scans, plans, recipe, [about], canvas, folder, listener
        )
        self.width, self.height = canvas.size
        self.missing = tuple(plans[0].missing)

    @property
    def frame_rate(self) -> Fraction:
        return self._scene.plan.frame_rate

    def __len__(self) -> int:
        return len(self._scene.plan.frames)

    def __iter__(self) -> Generator[Picture, None, None]:
        """Draw the frames in order: RGB, or RGBA where nothing is behind, not multiplied by it.

        Raises: RenderError; InputError for a driver that has changed.
        """
        scene = self._scene
        drawer = FrameDrawer(
            scene,
            readers=scene.open_people(),
            renderers=[scene.recipe.renderer(self._appearance)],
            backdrop=scene.backdrop.open(),
        )
        self._listener(Stage("render", len(self)))
        with drawer.at_work(self._threads):
            for chunk in scene.plan.chunks:
                for frame in drawer.frames(chunk):
                    yield frame
                    self._listener(FramesDone(1))
                self._inputs.glance()


@dataclass(frozen=True, eq=False)
class _DriverFrames:
    """A driver's IUV in memory."""

    frames: Frames
    order: ChannelOrder

    def open(self) -> IuvReader:
        return open_reader(FrameStream(self.frames, DRIVER), self.order)


def read_path(path: AnyPath | None) -> Path | None:
    """Read a path that may be left out. Raises: InputError, see `parse_path`."""
    return None if path is None else parse_path(path)


def list_paths(paths: AnyPath | Sequence[AnyPath] | None) -> tuple[Path, ...]:
    """List what is one path, several, or none. Raises: InputError, see `parse_path`."""
    if paths is None:
        return ()
    several = [paths] if isinstance(paths, str | PathLike) else paths
    return tuple(map(parse_path, several))


def _take_photo(
    pixels: Image,
    iuv: Iuv | None,
    order: ChannelOrder | None,
    choice: str,
    options: EstimatorOptions,
) -> SourcePicture:
    """Take one person of a photo in memory. Raises: InputError."""
    _check_array(pixels, str(PHOTO), ("H", "W", "3 or 4"), (3, 4))
    alpha = np.ascontiguousarray(pixels[..., 3]) if pixels.shape[2] == 4 else None
    photo = Photo(PHOTO, np.ascontiguousarray(pixels[..., :3]), alpha, turned=False)
    if iuv is None:
        return show_estimate(photo, estimate_person(photo, choice, options, "source"))
    _check_array(iuv, PHOTO_IUV, ("H", "W", "3"), (3,))
    reader = open_reader(FrameStream(iuv[None], Path(PHOTO_IUV)), order)
    return SourcePicture(photo, take_person(photo, next(reader.read(0, 1)), choice, PHOTO_IUV))


def _scan_frames(options: RenderOptions, frames: Frames, listener: Listener) -> DriverScan:
    """Look through a driver in memory, as `scan_driver` does. Raises: InputError."""
    _check_array(frames, str(DRIVER), ("N", "H", "W", "3"), (3,))
    reader = open_reader(FrameStream(frames, DRIVER), options.iuv_order)
    chosen = frame_range(options.frames, len(frames), str(DRIVER))
    listener(Stage("scan", len(chosen)))
    seen = scan_people(
        reader,
        chosen,
        options.worker_count,
        lambda count: listener(FramesDone(count)),
        find=find_people,
    )
    found = next((i for i, frame in enumerate(seen) if frame.people.persons), 0)
    return DriverScan(
        path=DRIVER,
        file=_DriverFrames(frames, reader.order),
        height=reader.height,
        width=reader.width,
        frame_rate=None,
        start_seconds=Fraction(0),
        chosen=chosen,
        seen=seen,
        where_first=reader.stream.where(chosen.start),
        where_found=reader.stream.where(chosen.start + found),
        inputs=Inputs(),
    )


def _check_array(
    array: np.ndarray, name: str, wanted: tuple[str, ...], channels: tuple[int, ...]
) -> None:
    """Raise InputError for an array of another shape or type."""
    fits = array.ndim == len(wanted) and array.shape[-1] in channels and array.size
    if array.dtype != np.uint8 or not fits:
        raise InputError(
            f"{name}: an array of {array.dtype} {list(array.shape)}, where uint8"
            f" {' x '.join(wanted)} is wanted"
        )
