"""The Python API: the same run as on the command line, as a function."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Literal

from motion_transfer.events import Listener, ignore
from motion_transfer.media.iuv.formats import ChannelOrder, DriverKind, Missing
from motion_transfer.option import parse_frames, parse_path, parse_rate
from motion_transfer.render.memory import AnyPath, list_paths, read_path
from motion_transfer.render.options import Garment, Legs, Partner, RenderOptions
from motion_transfer.render.run import RenderReport, run


def render_video(
    source: AnyPath | Sequence[AnyPath],
    driver: AnyPath,
    output: AnyPath,
    *,
    source_iuv: AnyPath | Sequence[AnyPath] | None = None,
    person: str = "largest",
    source_iuv_order: ChannelOrder | None = None,
    unseen_legs: Legs = "jeans",
    garments: Sequence[Garment] = (),
    driver_kind: DriverKind | None = None,
    driver_person: str = "largest",
    iuv_order: ChannelOrder | None = None,
    missing: Missing | None = None,
    window: str = "auto",
    frames: str | tuple[int | None, int | None] | None = None,
    estimator: str = "blazepose",
    estimator_model: AnyPath | None = None,
    fit_body: bool = False,
    azimuth: float | None = None,
    renderer: str = "nhrr",
    weights: AnyPath | None = None,
    background: AnyPath = "white",
    background_fit: Literal["cover", "contain", "stretch"] = "cover",
    background_end: Literal["loop", "hold", "cut"] = "loop",
    background_blur: float = 0.0,
    place: str | None = None,
    on_the_spot: bool = False,
    shadow: bool = False,
    match_colours: bool = False,
    partners: Sequence[Partner] = (),
    workers: int | None = None,
    adapt: bool = False,
    engine: str | None = None,
    precision: str | None = None,
    device: str | None = None,
    frame_rate: str | float | Fraction | None = None,
    codec: str | None = None,
    crf: int | None = None,
    pix_fmt: str | None = None,
    alpha: Literal["straight", "premultiplied"] = "straight",
    audio: AnyPath | None = None,
    audio_track: int | None = None,
    size: Literal["driver", "crop", "even", "background"] = "driver",
    compare: bool = False,
    sheet: AnyPath | None = None,
    provenance: Literal["full", "mark"] = "full",
    credentials_cert: AnyPath | None = None,
    credentials_key: AnyPath | None = None,
    force: bool = False,
    restart: bool = False,
    listener: Listener = ignore,
) -> RenderReport:
    """Render the person of a photo in the motion of a driver.

    Args:
        source: Photo of the person, a folder of photos, or a video; or several of them, the best
            photo first.
        driver: A video, a photo or a folder of photos of a person; or a folder of IUV images, an
            IUV image, a lossless IUV video, `.npy`, `.npz`, a detectron2 dump; or a motion such as
            `people:walk`.
        output: `.mp4`, `.mov`, `.mkv`, `.webm`, `.gif`, `.webp`, `.apng`, `.png` (one frame), or a
            folder of PNG.
        source_iuv: The IUV of each source; else it is looked for beside it, and estimated where
            there is none.
        person: `largest`, an index from the left (0 first), or a box `x0,y0,x1,y1` in px.
        source_iuv_order: Channels of the source's and garments' IUV files; else found out.
        unseen_legs: What legs wear that no source shows: jeans, or the network's guess.
        garments: Parts taken from other photos.
        driver_kind: `iuv` or `pictures`; else found out.
        driver_person: Whom to follow, as `person`.
        iuv_order: Channels of the driver's IUV files; else found out.
        missing: What frames show in which nobody is found: `hold`, `background` or `fail`.
        window: `auto`, or the square `X,Y,SIDE` of the driver's frame, px, that is drawn.
        frames: `"10:50"` or `(10, 50)`, half-open.
        estimator: Who finds the IUV of raw pictures, `blazepose`, `blazepose-heavy` or `densepose`.
        estimator_model: DensePose's file.
        fit_body: Give the driver's body the proportions of the source's.
        azimuth: See a driver of raw pictures from so many degrees towards its left hand.
        renderer: `nhrr` (the network) or `texture` (a draft without it).
        weights: Checkpoint of the network, or `hf:owner/name`; else the one that ships.
        background: `white`, `black`, `#rrggbb`, `transparent`, a picture or a video; `photo` (the
            source's, without its person) or `driver` (the driver's pictures, likewise).
        background_fit: How a picture behind fills the frame.
        background_end: What a video behind does at its end; `cut` ends the output there.
        background_blur: In percent of the frame's height.
        place: `X,Y,SCALE`: where the feet stand at first, in shares of the frame, and how much
            larger the person is than in the driver.
        on_the_spot: Keep the person where it stands at first.
        shadow: Lay a soft shadow under the feet.
        match_colours: Bring the person's light half-way to the background's.
        partners: Who takes the place of others in the driver.
        workers: Threads; else one for each core.
        adapt: Let the network learn the source's person first, some minutes; later runs find it
            done.
        engine: What runs the network, `openvino`, `torch` or `onnx`; else the fastest here.
        precision: What it is computed in, `int8`, `bf16` or `f32`; else the fastest here.
        device: `cpu`, `cuda`, `cuda:1` or `mps`; else `cuda` where it is.
        frame_rate: Frames per second, exact if given as a string or Fraction.
        codec, crf, pix_fmt: Of a video; else by container and codec.
        alpha: How transparent colours are written.
        audio: File whose sound is laid under, or `"none"`; else the driver's own, if it has any.
        audio_track: Which of the sound's tracks, 0 first; else the one that is marked as default.
        size: The driver's frame, the square around the person, the frame made even, or that of a
            picture or video behind.
        compare: Show source, IUV and result side by side.
        sheet: Where to write a contact sheet (PNG) as well.
        provenance: What the output says of itself: `full`, what it was made of and by, or `mark`,
            only that it is synthetic.
        credentials_cert, credentials_key: Certificate and private key (PEM) that sign the output as
            Content Credentials (C2PA).
        force: Replace an existing output.
        restart: Begin anew, whatever an interrupted run of the same output has finished.
        listener: Called with events (`motion_transfer.events`) as the work goes on, from several
            threads.

    Returns: Where the output is, what it holds and how long it took.
    Raises: MotionTransferError (`InputError` for input that cannot be used), saying what is wrong,
        where, and what to do. Nothing half-written is left behind.
    """
    return run(
        RenderOptions(
            source=list_paths(source),
            source_iuv=list_paths(source_iuv),
            person=person,
            source_iuv_order=source_iuv_order,
            unseen_legs=unseen_legs,
            garments=tuple(garments),
            driver=parse_path(driver),
            driver_kind=driver_kind,
            driver_person=driver_person,
            iuv_order=iuv_order,
            missing=missing,
            window=window,
            frames=parse_frames(frames) if isinstance(frames, str) else frames or (None, None),
            estimator=estimator,
            estimator_model=read_path(estimator_model),
            fit_body=fit_body,
            azimuth=azimuth,
            renderer=renderer,
            weights=read_path(weights),
            background=str(background),
            background_fit=background_fit,
            background_end=background_end,
            background_blur=background_blur,
            place=place,
            on_the_spot=on_the_spot,
            shadow=shadow,
            match_colours=match_colours,
            partners=tuple(partners),
            workers=workers,
            adapt=adapt,
            engine=engine,
            precision=precision,
            device=device,
            output=parse_path(output),
            frame_rate=None if frame_rate is None else parse_rate(str(frame_rate)),
            codec=codec,
            crf=crf,
            pix_fmt=pix_fmt,
            alpha=alpha,
            audio=read_path(audio),
            audio_track=audio_track,
            size=size,
            compare=compare,
            sheet=read_path(sheet),
            provenance=provenance,
            credentials_cert=read_path(credentials_cert),
            credentials_key=read_path(credentials_key),
            force=force,
            restart=restart,
        ),
        listener,
    )
