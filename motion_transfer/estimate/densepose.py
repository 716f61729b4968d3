"""DensePose itself, from a file of the user's: a TorchScript export, or ONNX with the same names.

The interface is that of the exports of dajes/DensePose-TorchScript: a picture in, H x W x 3 uint8
in the order B, G, R; a dict out, for N people: `pred_boxes` (N x 4: x0, y0, x1, y1 px), `scores`
(N), `pred_densepose_coarse_segm` (N x 2 or 15 x h x w, background first),
`pred_densepose_fine_segm`, `pred_densepose_u` and `pred_densepose_v` (N x 25 x h x w, a channel for
each part, background first). It was tested on small modules of that interface, never on a real
model: none may ship.

A TorchScript file is a program, and opening it lets it run. That is done only with a file that the
user names; take it from where you would take a program. ONNX is data.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from jaxtyping import UInt8
from torch import Tensor

from motion_transfer.devices import find_device
from motion_transfer.drawing.person import Box
from motion_transfer.errors import InputError, WeightsError
from motion_transfer.estimate.interface import PersonEstimate, check_frame
from motion_transfer.estimate.models import digest
from motion_transfer.media.files import read_bytes
from motion_transfer.weights.tensors import check_weights
from nhrr_core.parts import PART_COUNT

LOWEST_SCORE = 0.8  # detectron2's own default where it draws people
FARTHEST = 4  # longer sides of a picture that a box may reach away from its corner
SAME_PERSON_OVERLAP = 0.3  # with a box of the frame before; less is somebody else

OUTPUTS = {
    "pred_boxes": (2, None),
    "scores": (1, None),
    "pred_densepose_coarse_segm": (4, None),  # 2 or 15: all but the first are body
    "pred_densepose_fine_segm": (4, PART_COUNT + 1),
    "pred_densepose_u": (4, PART_COUNT + 1),
    "pred_densepose_v": (4, PART_COUNT + 1),
}
"""How many dimensions each has, and how many channels where that matters."""

Picture = UInt8[np.ndarray, "H W 3"]
Outputs = dict[str, Tensor]


class DensePoseEstimator:
    """What turns frames into people with a DensePose model; one object serves one thread.

    Args:
        model: `.onnx`, or TorchScript with any other ending (`.pt`, `.pth`, `.torchscript`).
        lowest_score: People scored less are left out, 0..1.
    Raises: WeightsError if the file is missing, is no such model, or a package to run it is;
        InputError for an impossible score.
    """

    def __init__(self, model: Path, *, lowest_score: float = LOWEST_SCORE) -> None:
        if not 0 <= lowest_score <= 1:
            raise InputError(f"lowest score {lowest_score}; it lies between 0 and 1")
        check_weights(model, "DensePose model")
        self._path = model
        self._lowest_score = lowest_score
        self._predict = (_open_onnx if model.suffix.lower() == ".onnx" else _open_script)(model)
        self.start_shot()

    def start_shot(self) -> None:
        """Forget who was where."""
        self._last: list[tuple[int, Box]] = []
        self._tracks = 0

    def estimate(self, frame: Picture) -> list[PersonEstimate]:
        """Find the people of the next frame, the most confident first; maybe nobody.

        `alpha` is DensePose's coarse segmentation: clothes mostly, hair partly.

        Raises: InputError if the frame is no RGB picture; WeightsError if the model fails on it or
            gives something else than promised.
        """
        check_frame(frame)
        try:
            outputs = self._predict(np.ascontiguousarray(frame[..., ::-1]))
        except Exception as error:  # whatever its code does
            # TorchScript's messages end with the reason, after a traceback
            reason = (str(error).strip().splitlines() or [repr(error)])[-1]
            raise WeightsError(
                f"DensePose model {self._path} fails on {frame.shape[1]} x {frame.shape[0]}:"
                f" {reason}"
            ) from error
        self._check(outputs, max(frame.shape[:2]))
        people, seen = [], []
        for index in outputs["scores"].argsort(descending=True, stable=True).tolist():
            score = float(outputs["scores"][index])
            found = _paint(outputs, index, *frame.shape[:2])
            if score < self._lowest_score or found is None:
                continue
            box, iuv, alpha = found
            track = self._follow(box, {number for number, _ in seen})
            seen.append((track, box))
            # a foreign model's scores are not promised to end at 1
            people.append(PersonEstimate(track, box, iuv, alpha, min(1.0, score), None))
        self._last = seen
        return people

    def _follow(self, box: Box, taken: set[int]) -> int:
        """Number the person of the last frame whose box this is, or a new one."""
        free = [(box.overlap(last), number) for number, last in self._last if number not in taken]
        overlap, number = max(free, default=(0.0, -1))
        if overlap >= SAME_PERSON_OVERLAP:
            return number
        self._tracks += 1
        return self._tracks - 1

    def _check(self, outputs: Any, side: int) -> None:
        """Raise WeightsError for what is not promised; `side` is the picture's longer one, px."""
        if missing := [name for name in OUTPUTS if name not in outputs]:
            raise WeightsError(
                f"DensePose model {self._path} gives no {', '.join(missing)}; export a chart-based"
                " (IUV) model with DensePose-TorchScript"
            )
        people = outputs["scores"].numel()
        for name, (dimensions, channels) in OUTPUTS.items():
            shape = list(outputs[name].shape)
            wrong = len(shape) != dimensions or shape[0] != people
            if wrong or (channels and shape[1] != channels):
                raise WeightsError(
                    f"DensePose model {self._path} gives {name} as {shape} for {people} people"
                    + (f"; N x {channels} x h x w is expected" if channels else "")
                )
        # what is painted is as large as its box; NaN is no less and no more than anything
        if not (outputs["pred_boxes"].abs() <= FARTHEST * side).all():
            raise WeightsError(
                f"DensePose model {self._path} gives boxes that lie far outside of the picture"
            )
        if outputs["scores"].isnan().any():
            raise WeightsError(f"DensePose model {self._path} gives scores that are no numbers")


def model_facts(model: Path) -> dict[str, Any]:
    """Tell what decides the answers, for keys of content: the file. Raises: InputError."""
    return {"model": digest(read_bytes(model, "DensePose model"))}


def _open_script(path: Path) -> Callable[[Picture], Outputs]:
    """Open a TorchScript model as a function. It runs code of the file."""
    with suppress(ImportError):
        import_module("torchvision")  # exports use its operators: nms, roi_align
    device = find_device()
    try:
        module = torch.jit.load(str(path), map_location=device).eval()
    except Exception as error:  # of a damaged file they have no common base
        if "torchvision::" in str(error):
            raise WeightsError(
                f"DensePose model {path} uses operators of torchvision, which is not installed:"
                " pip install torchvision, in the version that fits torch"
            ) from error
        raise WeightsError(
            f"DensePose model {path} is not a whole TorchScript file; export it with"
            " DensePose-TorchScript, or end its name in .onnx if it is that"
        ) from error
    if device == "cpu":
        module = module.float()  # half precision is for GPUs

    def predict(picture: Picture) -> Outputs:
        with torch.inference_mode():
            outputs = module(torch.from_numpy(picture).to(device))
        if not isinstance(outputs, dict):
            raise TypeError(f"it returns a {type(outputs).__name__}, not a dict")
        return {name: value.float().cpu() for name, value in outputs.items()}

    return predict


def _open_onnx(path: Path) -> Callable[[Picture], Outputs]:
    """Open an ONNX model as a function."""
    try:
        runtime = import_module("onnxruntime")
    except ImportError:
        raise WeightsError(
            f"DensePose model {path} needs ONNX Runtime: pip install onnxruntime"
        ) from None
    try:
        session = runtime.InferenceSession(str(path), providers=runtime.get_available_providers())
        (entry, *_), names = session.get_inputs(), [out.name for out in session.get_outputs()]
    except Exception as error:  # its errors have no common base
        raise WeightsError(f"DensePose model {path} is not a readable ONNX file") from error
    # conversions differ in the picture's type and in where its channels lie
    kind = np.uint8 if entry.type == "tensor(uint8)" else np.float32
    channels_first = list(entry.shape)[:1] == [3]

    def predict(picture: Picture) -> Outputs:
        given = picture.transpose(2, 0, 1) if channels_first else picture
        try:
            values = session.run(None, {entry.name: np.ascontiguousarray(given, kind)})
        except Exception as error:
            raise RuntimeError(str(error)) from error
        named = zip(names, values, strict=True)
        return {name: torch.from_numpy(np.asarray(value)).float() for name, value in named}

    return predict


def _paint(
    outputs: Outputs, index: int, height: int, width: int
) -> tuple[Box, UInt8[np.ndarray, "h w 3"], UInt8[np.ndarray, "h w"]] | None:
    """Paint box, IUV and alpha of one person; None if the box lies outside the frame."""
    x0, y0, x1, y1 = outputs["pred_boxes"][index].tolist()
    left, top = int(x0), int(y0)
    size = max(1, int(y1 - y0)), max(1, int(x1 - x0))
    box = Box(max(0, left), max(0, top), min(width, left + size[1]), min(height, top + size[0]))
    if box.width <= 0 or box.height <= 0:
        return None
    coarse, fine, u, v = (
        F.interpolate(outputs[name][index][None], size, mode="bilinear", align_corners=False)[0]
        for name in list(OUTPUTS)[2:]
    )
    # the coarse segmentation says where a body is, the fine one which part it is there
    part = fine.argmax(0) * (coarse.argmax(0) > 0)
    places = torch.stack([chart.gather(0, part[None])[0] for chart in (u, v)], -1)
    levels = (places.clamp(0, 1) * 255).round() * (part > 0)[..., None]
    iuv = torch.cat([part[..., None].float(), levels], -1).to(torch.uint8).numpy()
    alpha = ((1 - coarse.softmax(0)[0]) * 255).round().to(torch.uint8).numpy()
    inside = np.s_[box.top - top : box.bottom - top, box.left - left : box.right - left]
    return box, np.ascontiguousarray(iuv[inside]), np.ascontiguousarray(alpha[inside])
