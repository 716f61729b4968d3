"""What a file holds, and what this installation can do, as plain facts."""

from __future__ import annotations

import os
import platform
import sys
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.utils.flop_counter import FlopCounterMode

from motion_transfer.errors import InputError
from motion_transfer.estimate.extra import ESTIMATE_EXTRA
from motion_transfer.estimate.extra import missing_packages as missing_for_pictures
from motion_transfer.estimate.iuv_weights import SHIPPED as IUV_NETWORK
from motion_transfer.estimate.iuv_weights import has_shipped
from motion_transfer.estimate.model_files import MODEL_FILES, is_there, models_folder
from motion_transfer.media.image import read_photo
from motion_transfer.media.iuv_image import CHANNEL_ORDERS, IUV_SUFFIXES
from motion_transfer.media.iuv_stream import IuvReader, open_reader, open_stream
from motion_transfer.people.extra import PEOPLE_EXTRA, missing_packages
from motion_transfer.render.neural_renderer import choose_dtype
from motion_transfer.render.person import find_people
from motion_transfer.version import __version__
from motion_transfer.weights.checkpoint import inspect_checkpoint
from motion_transfer.weights.shipped import SHIPPED, find_weights
from nhrr_core import PART_GROUPS, PART_NAMES, PRESETS, ModelConfig, RenderNet
from nhrr_core.feature_net import FeatureNet

ORDER_WORDS = {
    "iuv": "iuv (file RGB = I, U, V)",
    "vui": "vui (file RGB = V, U, I, as Caffe2's DensePose writes)",
}
PACKAGES = ("torch", "numpy", "opencv-contrib-python-headless", "av", "safetensors")
Facts = dict[str, Any]


def describe_parts() -> Facts:
    """Group names with their parts, then every part with its number."""
    return {
        "groups": {
            name: [PART_NAMES[part] for part in parts] for name, parts in PART_GROUPS.items()
        },
        "parts": {PART_NAMES[part]: part for part in range(1, len(PART_NAMES))},
    }


def describe_setup() -> Facts:
    """Versions, device, renderers, and what a frame of each preset costs."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    name = torch.cuda.get_device_name() if device.type == "cuda" else platform.processor() or "CPU"
    cores = len(os.sched_getaffinity(0))
    return {
        "motion-transfer": __version__,
        "python": sys.version.split()[0],
        **{package: version(package) for package in PACKAGES},
        "device": f"{device.type} ({name}, {cores} cores), nhrr in {choose_dtype(device)}".replace(
            "torch.", ""
        ),
        "renderers": {
            "nhrr": "the network (default)",
            "texture": "a draft without it",
        },
        "raw pictures": _describe_estimators(),
        "people": f"pip install '{PEOPLE_EXTRA}'" if missing_packages() else "installed",
        "weights": {name: _describe_shipped(name) for name in SHIPPED},
        "presets": {name: describe_preset(config) for name, config in PRESETS.items()},
    }


def _describe_estimators() -> str:
    if missing_for_pictures():
        return f"pip install '{ESTIMATE_EXTRA}'"
    folder = models_folder()
    lacking = []
    if absent := [file.name for file in MODEL_FILES if not is_there(file)]:
        lacking.append(f"{' and '.join(absent)} not in {folder}: mt models fetch")
    if not has_shipped():
        lacking.append(f"{IUV_NETWORK} is missing: only with a DensePose model of yours")
    return "; ".join(lacking) or f"ready, {folder}"


def describe_preset(config: ModelConfig) -> Facts:
    """Parameters, file size and arithmetic of one configuration."""
    with torch.device("meta"):
        feature_net = FeatureNet(
            inputs=config.feature_inputs,
            outputs=config.feature_outputs,
            width=config.feature_width,
        )
        render_net = RenderNet(
            inputs=config.render_inputs,
            outputs=config.render_outputs,
            width=config.render_width,
            down_blocks=config.down_blocks,
            residual_blocks=config.residual_blocks,
            shortcut=config.geometry,
        )
        flops = {}
        for side in (256, 512):
            with FlopCounterMode(display=False) as counter:
                render_net(torch.empty(1, config.render_inputs, side, side))
            flops[f"RenderNet GFLOP a frame at {side} x {side}"] = round(
                counter.get_total_flops() / 1e9, 1
            )
    counts = [sum(p.numel() for p in net.parameters()) for net in (feature_net, render_net)]
    return {
        "FeatureNet parameters": f"{counts[0] / 1e6:.1f} M",
        "RenderNet parameters": f"{counts[1] / 1e6:.1f} M",
        "weights file (fp16)": f"{sum(counts) * 2 / 1e6:.0f} MB",
        **flops,
    }


def describe_path(path: Path, order: str | None = None) -> Facts:
    """What a file or folder holds. Raises: InputError if it is nothing that `mt` reads."""
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if order is not None and order not in CHANNEL_ORDERS:
        raise InputError(f"channel order {order!r}; supported are {', '.join(CHANNEL_ORDERS)}")
    if path.suffix == ".safetensors":
        return _describe_weights(path)
    if path.is_file() and path.suffix.lower() not in (*IUV_SUFFIXES, ".npy", ".npz"):
        try:
            return _describe_photo(path)
        except InputError:
            pass  # not a picture: a video, or nothing we know, which open_stream will say
    try:
        reader = open_reader(open_stream(path, missing="hold"), order)  # type: ignore[arg-type]
    except InputError as error:
        if not path.is_file():
            raise
        try:
            return {**_describe_photo(path), "not IUV": str(error)}
        except InputError:
            raise error from None
    return _describe_iuv(reader)


def _describe_shipped(name: str) -> str:
    path = find_weights(Path(name))
    notes = inspect_checkpoint(path).notes
    size = f"{path.stat().st_size / 1e6:.0f} MB"
    return f"{size}, licence {notes['licence']}, trained on {notes['data']}, {notes['step']} steps"


def _describe_weights(path: Path) -> Facts:
    info = inspect_checkpoint(path)
    return {
        "what": "nhrr weights (safetensors)",
        "file size": f"{path.stat().st_size / 1e6:.1f} MB",
        "tensors": info.tensor_count,
        "parameters": f"{info.parameter_count / 1e6:.2f} M",
        "configuration": info.config.to_dict(),
        "notes": info.notes or "none",
    }


def _describe_photo(path: Path) -> Facts:
    photo = read_photo(path, "picture")
    height, width = photo.rgb.shape[:2]
    return {
        "what": "picture" + (", turned upright as its EXIF says" if photo.turned else ""),
        "size": f"{width} x {height}",
        "alpha": "no" if photo.alpha is None else "yes",
    }


def _describe_iuv(reader: IuvReader) -> Facts:
    stream = reader.stream
    pixels = np.zeros(len(PART_NAMES), np.int64)
    crowd: Counter[int] = Counter()
    for iuv in reader.read(0, stream.frame_count):
        pixels += np.bincount(iuv[..., 0].reshape(-1), minlength=len(PART_NAMES))
        crowd[len(find_people(iuv).persons)] += 1
    facts: Facts = {
        "what": stream.kind,
        "channel order": ORDER_WORDS[reader.order],
        "size": f"{reader.width} x {reader.height}",
        "frames": stream.frame_count,
    }
    if stream.frame_rate:
        seconds = float(stream.frame_count / stream.frame_rate)
        facts["frame rate"] = f"{stream.frame_rate} ({seconds:.2f} s)"
    if stream.notes:
        facts["note"] = "; ".join(stream.notes)
    facts["missing numbers"] = list(stream.gaps) or "none"
    facts["people a frame"] = {f"{n} people": f"{f} frames" for n, f in sorted(crowd.items())}
    shares = pixels[1:] / max(1, pixels[1:].sum())
    facts["parts (share of the body's pixels)"] = {
        PART_NAMES[part]: f"{share:.1%}" for part, share in enumerate(shares, 1) if share
    }
    facts["parts never seen"] = [
        PART_NAMES[part] for part, share in enumerate(shares, 1) if not share
    ] or "none"
    return facts
