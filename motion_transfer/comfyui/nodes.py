"""The nodes: load a source, estimate IUV, load a driver, encode once, render.

What ComfyUI keeps of a node it keeps for as long as the node's inputs stay the same; so a person is
encoded once, however many drivers and options are tried.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.comfyui import host
from motion_transfer.comfyui.tensors import put, to_photo, to_pictures
from motion_transfer.drawing.backgrounds import fit_picture
from motion_transfer.drawing.canvas import lay_over
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, DRAFT
from motion_transfer.errors import InputError
from motion_transfer.estimate.frames import estimate_frames
from motion_transfer.estimate.opening import landmark_estimators
from motion_transfer.events import FramesDone, Stage
from motion_transfer.media.iuv.formats import MISSING
from motion_transfer.render.memory import EncodedSource, MotionTransfer
from motion_transfer.render.options import LEGS, Legs

CATEGORY = "motion transfer"
DRAFT_WEIGHTS = f"{DRAFT} (a draft without a network)"
SIZES = ("driver", "crop", "even")
ESTIMATOR = "What finds people in pictures; the heavy model is nearer, and slower."
WHO = "largest, an index from the left (0 first), or a box x0,y0,x1,y1 in pixels."
IN_INPUT = "in ComfyUI's input folder"
UNLISTED = "What the list lacks, instead of it: a file further down, or people:walk,azimuth=30."

Inputs = dict[str, dict[str, tuple[Any, ...]]]


@dataclass(frozen=True, eq=False)
class Photograph:
    """An MT_SOURCE: who is to be drawn, from a file or from arrays."""

    photo: Path | UInt8[np.ndarray, "H W C"]
    iuv: UInt8[np.ndarray, "H W 3"] | None
    person: str
    estimator: str


@dataclass(frozen=True, eq=False)
class Motion:
    """An MT_DRIVER: whose motion it is, from a file or from IUV frames."""

    frames: Path | UInt8[np.ndarray, "N H W 3"]
    person: str
    missing: str | None
    chosen: str
    estimator: str


@dataclass(frozen=True, eq=False)
class Encoded:
    """An MT_APPEARANCE: a person, and the renderer that knows them."""

    model: MotionTransfer
    person: EncodedSource


class _FileNode:
    """A node that may name a file of the input folder: checked before it runs, known by content.

    Its list is no limit: what is unlisted, or was there when the page was loaded, is looked for.
    """

    @classmethod
    def VALIDATE_INPUTS(cls, file: str, unlisted: str = "") -> bool | str:
        return host.explain(_named(file, unlisted))

    @classmethod
    def IS_CHANGED(cls, file: str, unlisted: str = "", **_others: Any) -> str:
        return host.key_of_input(_named(file, unlisted))


class LoadSource(_FileNode):
    """The photo of a person."""

    CATEGORY = CATEGORY
    DESCRIPTION = (
        "The person to be drawn: an image, or a file (photo, folder of photos, video, .mtsource)"
        f" {IN_INPUT}. Its IUV is estimated where none is given."
    )
    RETURN_TYPES = ("MT_SOURCE",)
    RETURN_NAMES = ("source",)
    FUNCTION = "load"

    @classmethod
    def INPUT_TYPES(cls) -> Inputs:
        return {
            "required": {
                "file": _choice(
                    host.list_sources(),
                    f"What lies {IN_INPUT}; {host.NOTHING} where an image is connected.",
                    image_upload=True,
                ),
                "person": _text("largest", f"Whom: {WHO}"),
            },
            "optional": {
                "image": _socket("IMAGE", "The photo; of a batch, the first."),
                "mask": _socket(
                    "MASK", "1 where the person is, as segmentation gives; Load Image's is inverse."
                ),
                "iuv": _socket("IMAGE", "The photo's IUV: I, U and V as red, green and blue."),
                "estimator": _choice(landmark_estimators(), ESTIMATOR),
                "unlisted": _text("", UNLISTED),
            },
        }

    def load(
        self,
        file: str,
        person: str,
        image: Tensor | None = None,
        mask: Tensor | None = None,
        iuv: Tensor | None = None,
        estimator: str = "blazepose",
        unlisted: str = "",
    ) -> tuple[Photograph]:
        name = _named(file, unlisted)
        if (image is None) == (not name):
            raise InputError("a source is an image or a file; connect the one, or name the other")
        if image is None:
            if mask is not None or iuv is not None:
                raise InputError("mask and iuv belong to an image; connect that, or leave them out")
            return (Photograph(host.find_input(name), None, person, estimator),)
        body = None if iuv is None else to_pictures(iuv[:1])[0]
        return (Photograph(to_photo(image, mask), body, person, estimator),)


class EstimateIuv:
    """Pictures of people as IUV."""

    CATEGORY = CATEGORY
    DESCRIPTION = (
        "Finds the people of a clip, and where each of their pixels lies on the body. IUV comes as"
        " an IMAGE whose red, green and blue are I, U and V; never scale it but by nearest"
        " neighbour. Needs `mt models fetch`, once."
    )
    RETURN_TYPES = ("IMAGE", "MASK")
    RETURN_NAMES = ("iuv", "people")
    FUNCTION = "estimate"

    @classmethod
    def INPUT_TYPES(cls) -> Inputs:
        rate = {"default": 30.0, "min": 1.0, "max": 240.0, "step": 0.001}
        return {
            "required": {
                "images": _socket("IMAGE", "The frames of a clip, or a photo."),
                "frame_rate": ("FLOAT", {**rate, "tooltip": "Of the clip, for smoothing."}),
                "person": _text("all", f"all, {WHO}"),
                "missing": _choice(MISSING[1:] + MISSING[:1], "Of frames that show nobody."),
            },
            "optional": {"estimator": _choice(landmark_estimators(), ESTIMATOR)},
        }

    def estimate(
        self,
        images: Tensor,
        frame_rate: float,
        person: str,
        missing: str,
        estimator: str = "blazepose",
    ) -> tuple[Tensor, Tensor]:
        progress = host.Progress()
        progress(Stage("estimate", len(images)))
        iuv, people = _make_batch(len(images), *images.shape[1:3])
        frames = estimate_frames(
            to_pictures(images),
            frame_rate=frame_rate,
            person=person,
            missing=missing,  # type: ignore[arg-type] - one of the choices
            estimator=estimator,
            with_alpha=True,
        )
        for index, frame in enumerate(frames):
            put(frame[..., :3], iuv[index])
            put(frame[..., 3], people[index])
            progress(FramesDone(1))
        return iuv, people


class LoadDriver(_FileNode):
    """The motion."""

    CATEGORY = CATEGORY
    DESCRIPTION = (
        "The motion to be shown: IUV frames, or a file (video, folder of IUV images, lossless IUV"
        f" video, .npy) {IN_INPUT}, or a built-in motion such as people:walk."
    )
    RETURN_TYPES = ("MT_DRIVER",)
    RETURN_NAMES = ("driver",)
    FUNCTION = "load"

    @classmethod
    def INPUT_TYPES(cls) -> Inputs:
        return {
            "required": {
                "file": _choice(
                    host.list_drivers(),
                    f"What lies {IN_INPUT}; {host.NOTHING} where IUV is connected.",
                    video_upload=True,
                ),
                "person": _text("largest", f"Whom to follow: {WHO}"),
                "frames": _text("", "Only these, A:B, counted from 0, B excluded; empty: all."),
                "missing": _choice(("auto", *MISSING), "Of frames that show nobody."),
            },
            "optional": {
                "iuv": _socket("IMAGE", "IUV frames, as Estimate IUV gives them."),
                "estimator": _choice(landmark_estimators(), ESTIMATOR),
                "unlisted": _text("", UNLISTED),
            },
        }

    def load(
        self,
        file: str,
        person: str,
        frames: str,
        missing: str,
        iuv: Tensor | None = None,
        estimator: str = "blazepose",
        unlisted: str = "",
    ) -> tuple[Motion]:
        name = _named(file, unlisted)
        if (iuv is None) == (not name):
            raise InputError("a driver is IUV or a file; connect the one, or name the other")
        motion = host.find_input(name) if iuv is None else to_pictures(iuv)
        shown = None if missing == "auto" else missing
        return (Motion(motion, person, shown, frames, estimator),)


class EncodeSource:
    """A person, once for all that is drawn of them."""

    CATEGORY = CATEGORY
    DESCRIPTION = "Makes the feature map of a person, once; any number of drivers share it."
    RETURN_TYPES = ("MT_APPEARANCE",)
    RETURN_NAMES = ("appearance",)
    FUNCTION = "encode"

    @classmethod
    def INPUT_TYPES(cls) -> Inputs:
        weights = (*host.list_weights(), DRAFT_WEIGHTS)
        where = f"Those that ship, and .safetensors in models/{host.OWN_FOLDER}."
        return {
            "required": {
                "source": _socket("MT_SOURCE", "Of Load Source."),
                "weights": _choice(weights, where),
            },
            "optional": {"unseen_legs": _choice(LEGS, "What legs wear that the photo hides.")},
        }

    def encode(
        self, source: Photograph, weights: str, unseen_legs: Legs = "jeans"
    ) -> tuple[Encoded]:
        draft = weights == DRAFT_WEIGHTS
        model = MotionTransfer(
            None if draft else host.find_listed_weights(weights),
            renderer=DRAFT if draft else DEFAULT_RENDERER,
        )
        person = model.encode(
            source.photo,
            source.iuv,
            person=source.person,
            unseen_legs=unseen_legs,
            estimator=source.estimator,
            listener=host.Progress(),
        )
        return (Encoded(model, person),)


class RenderFrames:
    """The person in the motion, frame by frame."""

    CATEGORY = CATEGORY
    DESCRIPTION = (
        "Draws the person in the driver's motion. IMAGE is the person over the background, or alone"
        " (colours not multiplied by alpha, black where nobody is); MASK is 1 where the person is."
        " Both are float32 in memory: a frame of 1280 x 720 takes 15 MB, 300 take 4.4 GB; take"
        " parts by the driver's frames, with one window for all of them."
    )
    RETURN_TYPES = ("IMAGE", "MASK", "FLOAT")
    RETURN_NAMES = ("images", "masks", "frame_rate")
    FUNCTION = "render"

    @classmethod
    def INPUT_TYPES(cls) -> Inputs:
        switch: dict[str, Any] = {"default": False}
        return {
            "required": {
                "appearance": _socket("MT_APPEARANCE", "Of Encode Source."),
                "driver": _socket("MT_DRIVER", "Of Load Driver."),
                "size": _choice(
                    SIZES,
                    "The driver's frame, the square around the person, or even sides.",
                ),
                "window": _text(
                    "auto", "auto, or the square X,Y,SIDE of the driver's frame, px, that is drawn."
                ),
                "place": _text(
                    "", "Where the feet stand at first, and how much larger: 0.5,0.9,1.5."
                ),
                "on_the_spot": ("BOOLEAN", {**switch, "tooltip": "Keep the person in its place."}),
                "shadow": ("BOOLEAN", {**switch, "tooltip": "A soft shadow under the feet."}),
            },
            "optional": {
                "background": _socket(
                    "IMAGE", "What is behind; a batch plays, and begins anew at its end."
                )
            },
        }

    def render(
        self,
        appearance: Encoded,
        driver: Motion,
        size: str,
        window: str,
        place: str,
        on_the_spot: bool,
        shadow: bool,
        background: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, float]:
        frames = appearance.model.render(
            appearance.person,
            driver.frames,
            size=size,  # type: ignore[arg-type] - one of the choices
            window=window,
            place=place or None,
            on_the_spot=on_the_spot,
            shadow=shadow,
            driver_person=driver.person,
            missing=driver.missing,  # type: ignore[arg-type] - likewise
            frames=driver.chosen or None,
            estimator=driver.estimator,
            folder=host.temporary_folder(),
            listener=host.Progress(),
        )
        images, masks = _make_batch(len(frames), frames.height, frames.width)
        for index, frame in enumerate(frames):
            put(frame[..., 3], masks[index])
            if background is None:
                put(frame[..., :3], images[index])
                continue
            number = index % len(background)
            behind = to_pictures(background[number : number + 1])[0]
            picture = fit_picture(behind, frame.shape[:2], "cover").copy()
            lay_over(picture, frame, 0, 0)
            put(picture, images[index])
        return images, masks, float(frames.frame_rate)


def _socket(kind: str, tooltip: str) -> tuple[str, dict[str, Any]]:
    return kind, {"tooltip": tooltip}


def _text(default: str, tooltip: str) -> tuple[str, dict[str, Any]]:
    return "STRING", {"default": default, "tooltip": tooltip}


def _choice(
    values: Iterable[str], tooltip: str, **settings: bool
) -> tuple[list[str], dict[str, Any]]:
    return list(values), {"tooltip": tooltip, **settings}


def _named(file: str, unlisted: str) -> str:
    """Take what is named, from the list or beside it; empty where nothing is."""
    return unlisted or ("" if file == host.NOTHING else file)


def _make_batch(count: int, height: int, width: int) -> tuple[Tensor, Tensor]:
    """Make room for an IMAGE and a MASK."""
    return torch.empty(count, height, width, 3), torch.empty(count, height, width)


NODE_CLASS_MAPPINGS: dict[str, type] = {
    "MotionTransferSource": LoadSource,
    "MotionTransferEstimateIuv": EstimateIuv,
    "MotionTransferDriver": LoadDriver,
    "MotionTransferEncode": EncodeSource,
    "MotionTransferRender": RenderFrames,
}
NODE_DISPLAY_NAME_MAPPINGS = {
    "MotionTransferSource": "Load Source (Motion Transfer)",
    "MotionTransferEstimateIuv": "Estimate IUV (Motion Transfer)",
    "MotionTransferDriver": "Load Driver (Motion Transfer)",
    "MotionTransferEncode": "Encode Source (Motion Transfer)",
    "MotionTransferRender": "Render Frames (Motion Transfer)",
}
