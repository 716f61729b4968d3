"""Files like those of detectron2's `apply_net.py dump`, without detectron2."""

from __future__ import annotations

import base64
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import numpy as np
import torch

MODULE = "densepose.structures.chart_result"


@cache
def result_class(name: str, module: str = MODULE) -> type:
    """A class that pickles under that module and name."""
    return type(name, (), {"__module__": module, "__qualname__": name})


def result(name: str = "DensePoseChartResult", **attributes: Any) -> Any:
    """An instance with attributes, without behaviour."""
    made = result_class(name)()
    vars(made).update(attributes)
    return made


def person(iuv: np.ndarray) -> Any:
    """A chart result of a crop (I, U, V): labels and floats."""
    planes = torch.from_numpy(iuv.copy()).permute(2, 0, 1)
    return result(labels=planes[0].long(), uv=planes[1:].float() / 255)


def photo(frame: np.ndarray, name: str, *, left: float = 0.0) -> dict:
    """One photo with one person who fills the frame; the box's corners are fractions of a pixel."""
    height, width = frame.shape[:2]
    return {
        "file_name": name,
        "scores": torch.tensor([0.95]),
        "pred_boxes_XYXY": torch.tensor([[left, 0.25, left + width + 0.4, 0.25 + height]]),
        "pred_densepose": [person(frame)],
    }


def array_photo(frame: np.ndarray, name: str) -> dict:
    """The same photo with NumPy's arrays in place of tensors."""
    made = photo(frame, name)
    (shown,) = made["pred_densepose"]
    return {
        "file_name": name,
        "scores": made["scores"].numpy(),
        "pred_boxes_XYXY": made["pred_boxes_XYXY"].numpy(),
        "pred_densepose": [result(labels=shown.labels.numpy(), uv=shown.uv.numpy())],
    }


def photo_of_2020(frame: np.ndarray, name: str) -> dict:
    """The same photo as detectron2 dumped it until the middle of 2020: people as PNG."""
    made = photo(frame, name)
    left, top, right, bottom = made["pred_boxes_XYXY"][0].tolist()
    held = result_class("DensePoseResult", "densepose.structures")()
    vars(held).update(
        boxes_xywh=[[left, top, right - left, bottom - top]],
        results=[((3, *frame.shape[:2]), compress(frame))],
    )
    return {**made, "pred_densepose": held}


def compress(frame: np.ndarray) -> str:
    """Base64 of a PNG whose RGB is (I, U, V)."""
    ok, png = cv2.imencode(".png", frame[..., ::-1])
    assert ok
    return base64.encodebytes(png.tobytes()).decode()


def save_pickle(path: Path, held: Any, protocol: int) -> Path:
    """`pickle.dump`, with DensePose's classes importable while it works."""
    with _importable():
        path.write_bytes(pickle.dumps(held, protocol))
    return path


def save(path: Path, held: Any, *, zipped: bool = True) -> Path:
    """`torch.save`, with DensePose's classes importable while it works."""
    with _importable():
        torch.save(held, path, _use_new_zipfile_serialization=zipped)
    return path


@contextmanager
def _importable() -> Iterator[None]:
    names = ("densepose", "densepose.structures", MODULE)
    modules = {name: ModuleType(name) for name in names}
    for name in ("", "Quantized", "Compressed"):
        kind = result_class(f"DensePoseChartResult{name}")
        setattr(modules[MODULE], kind.__name__, kind)
    old = result_class("DensePoseResult", "densepose.structures")
    modules["densepose.structures"].DensePoseResult = old  # pyright: ignore
    sys.modules.update(modules)
    try:
        yield
    finally:
        for name in names:
            del sys.modules[name]
