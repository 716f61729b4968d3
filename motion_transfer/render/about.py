"""What a file holds, and what this installation can do, as plain facts."""

from __future__ import annotations

import platform
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch.utils.flop_counter import FlopCounterMode

from motion_transfer.cores import core_count
from motion_transfer.devices import find_device, name_device
from motion_transfer.drawing.engines import ANYTHING, ENGINES, choose_execution
from motion_transfer.drawing.kept_source import inspect_source
from motion_transfer.drawing.person import find_people
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, RENDERERS
from motion_transfer.errors import InputError
from motion_transfer.estimate.iuv.weights import SHIPPED as IUV_NETWORK
from motion_transfer.estimate.iuv.weights import has_shipped
from motion_transfer.estimate.models import MODEL_FILES, is_there, models_folder
from motion_transfer.extras import install_command, missing_packages
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.iuv.blends import BlendMeter
from motion_transfer.media.iuv.formats import (
    CHANNEL_ORDERS,
    ChannelOrder,
    find_iuv_format,
    iuv_suffixes,
)
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.output.marks import Mark
from motion_transfer.media.output.segments import read_mark
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, VIDEO_SUFFIXES
from motion_transfer.render.about_pictures import describe_clip, describe_length, describe_photo
from motion_transfer.render.options import is_kept
from motion_transfer.render.provenance import parse_record
from motion_transfer.version import __version__, holders_of, package_version
from motion_transfer.weights import DEFAULT_WEIGHTS, SHIPPED, find_weights
from motion_transfer.weights.checkpoint import inspect_checkpoint
from nhrr_core import PART_GROUPS, PART_NAMES, PRESETS, ModelConfig, NeuralReRenderer

ORDER_WORDS = {
    "iuv": "iuv (file RGB = I, U, V)",
    "vui": "vui (file RGB = V, U, I, as Caffe2's DensePose writes)",
}
OPENCV = "opencv-contrib-python-headless"
"""What is asked for; whichever distribution there is does."""

PACKAGES = ("torch", "openvino", "numpy", "av", "safetensors")
Facts = dict[str, Any]


def describe_parts() -> Facts:
    """Tell the names of groups with their parts, then of every part with its number."""
    return {
        "groups": {
            name: [PART_NAMES[part] for part in parts] for name, parts in PART_GROUPS.items()
        },
        "parts": {PART_NAMES[part]: part for part in range(1, len(PART_NAMES))},
    }


def describe_setup() -> Facts:
    """Tell versions, device, renderers, and what a frame of each preset costs."""
    device = find_device()
    name = platform.processor() or "CPU" if device == "cpu" else name_device(device)
    how = choose_execution(ANYTHING, inspect_checkpoint(find_weights(DEFAULT_WEIGHTS)))
    return {
        "motion-transfer": __version__,
        "python": sys.version.split()[0],
        **{package: package_version(package) for package in PACKAGES},
        **_describe_opencv(),
        "device": f"{name}, {core_count()} cores",
        "nhrr runs on": str(how),
        "engines": {
            row.name: row.summary if row.installed else f"pip install {row.package}"
            for row in ENGINES.values()
        },
        "renderers": {
            name: row.summary + " (default)" * (name == DEFAULT_RENDERER)
            for name, row in RENDERERS.items()
        },
        "raw pictures": _describe_estimators(),
        "people": install_command("people") if missing_packages("people") else "installed",
        "weights": {name: _describe_shipped(name) for name in SHIPPED},
        "presets": {name: describe_preset(config) for name, config in PRESETS.items()},
    }


def _describe_opencv() -> Facts:
    """Tell which of OpenCV's distributions is there; two of them overwrite each other's files."""
    holders = holders_of("cv2") or ["opencv"]
    if len(holders) == 1:
        return {holders[0]: package_version(OPENCV)}
    return {
        "opencv": f"{' and '.join(holders)} overwrite each other: pip uninstall them all, then"
        " install one"
    }


def _describe_estimators() -> str:
    folder = models_folder()
    lacking = []
    if absent := [file.name for file in MODEL_FILES if not is_there(file)]:
        lacking.append(f"{' and '.join(absent)} not in {folder}: mt models fetch")
    if not has_shipped():
        lacking.append(f"{IUV_NETWORK} is missing: only with a DensePose model of yours")
    return "; ".join(lacking) or f"ready, {folder}"


def describe_preset(config: ModelConfig) -> Facts:
    """Count parameters, file size and arithmetic of one configuration."""
    with torch.device("meta"):  # shapes are enough to count: no memory, and no computing
        model = NeuralReRenderer(config)
        flops = {}
        for side in (256, 512):
            with FlopCounterMode(display=False) as counter:
                model.render_net(torch.empty(1, config.render_inputs, side, side))
            flops[f"RenderNet GFLOP a frame at {side} x {side}"] = round(
                counter.get_total_flops() / 1e9, 1
            )
    counts = {
        net: sum(p.numel() for p in getattr(model, name).parameters())
        for net, name in (("FeatureNet", "feature_net"), ("RenderNet", "render_net"))
    }
    return {
        **{f"{net} parameters": f"{count / 1e6:.1f} M" for net, count in counts.items()},
        "weights file (fp16)": f"{sum(counts.values()) * 2 / 1e6:.0f} MB",
        **flops,
    }


def describe_path(path: Path, order: str | None = None) -> Facts:
    """Tell what a file or folder holds. Raises: InputError if it is nothing that `mt` reads."""
    if not path.exists():
        raise InputError(f"{path} does not exist")
    if order is not None and order not in CHANNEL_ORDERS:
        raise InputError(f"channel order {order!r}; supported are {', '.join(CHANNEL_ORDERS)}")
    suffix = path.suffix.lower()
    if (mark := read_mark(path)) is not None:
        return _describe_output(path, mark)
    if is_kept(path):
        return _describe_kept(path)
    if suffix == ".safetensors":
        return _describe_weights(path)
    if path.is_dir() or find_iuv_format(path).always_iuv or suffix in VIDEO_SUFFIXES:
        # who names an order says that it is IUV
        is_iuv = order is not None or tell_kind(path) == "iuv"
        return _describe_iuv(path, order) if is_iuv else describe_clip(path)
    may_be_iuv = suffix in iuv_suffixes()
    if suffix in PHOTO_SUFFIXES and not may_be_iuv:
        return describe_photo(path)
    try:  # a picture that may be either, or an ending that no table knows
        return _describe_iuv(path, order)
    except InputError as error:
        try:
            told = describe_photo(path)
        except InputError as no_photo:
            raise (no_photo if may_be_iuv else error) from None
        # of a picture that shows somebody nobody asks why it is no IUV
        shows_people = any(isinstance(fact, dict) for fact in told.values())
        return told | ({"not IUV": str(error)} if may_be_iuv and not shows_people else {})


def _describe_output(path: Path, mark: Mark) -> Facts:
    facts: Facts = {"what": "an output of motion-transfer", "mark": mark.sentence}
    if mark.record is None:
        return facts | {"record": "none (--provenance mark)"}
    record = asdict(parse_record(mark.record, path))
    people = [
        {str(number): picture for number, picture in enumerate(pictures, start=1)}
        for pictures in record["sources"]
    ]
    record["sources"] = people[0]
    if people[1:]:
        record["partners"] = {str(number): each for number, each in enumerate(people[1:], 1)}
    return facts | record


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


def _describe_kept(path: Path) -> Facts:
    facts = inspect_source(path)
    made_of = facts.get("made of")
    if isinstance(made_of, list):
        facts["made of"] = {str(number): entry for number, entry in enumerate(made_of, start=1)}
    return {
        "what": "a kept source (safetensors)",
        "file size": f"{path.stat().st_size / 1e6:.1f} MB",
        **facts,
        "notes": facts.get("notes") or "none",
    }


def _describe_iuv(path: Path, order: str | None) -> Facts:
    # missing numbers are among what is told, and no reason to tell nothing
    stream = open_stream(path, missing="hold")
    reader = open_reader(stream, cast(ChannelOrder | None, order))
    pixels = np.zeros(len(PART_NAMES), np.int64)
    crowd: Counter[int] = Counter()
    blends = BlendMeter()
    for iuv in reader.read(0, stream.frame_count):
        pixels += np.bincount(iuv[..., 0].reshape(-1), minlength=len(PART_NAMES))
        crowd[len(find_people(iuv).persons)] += 1
        blends.add(iuv)
    facts: Facts = {
        "what": stream.kind,
        "channel order": ORDER_WORDS[reader.order],
        "size": f"{reader.width} x {reader.height}",
        **describe_length(stream),
    }
    if warning := blends.warn("it"):
        facts["warning"] = warning
    facts["missing numbers"] = list(stream.gaps) or "none"
    facts["people a frame"] = {
        "1 person" if n == 1 else f"{n} people": "1 frame" if f == 1 else f"{f} frames"
        for n, f in sorted(crowd.items())
    }
    shares = pixels[1:] / max(1, pixels[1:].sum())
    facts["parts (share of the body's pixels)"] = {
        PART_NAMES[part]: f"{share:.1%}" for part, share in enumerate(shares, 1) if share
    }
    facts["parts never seen"] = [
        PART_NAMES[part] for part, share in enumerate(shares, 1) if not share
    ] or "none"
    return facts
