"""What this installation can do, as plain facts."""

from __future__ import annotations

import platform
import sys
from pathlib import Path

import torch
from torch.utils.flop_counter import FlopCounterMode

from motion_transfer.cores import core_count
from motion_transfer.devices import find_device, name_device
from motion_transfer.drawing.engines import ANYTHING, ENGINES, choose_execution
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, RENDERERS
from motion_transfer.estimate.iuv.weights import SHIPPED as IUV_NETWORK
from motion_transfer.estimate.iuv.weights import has_shipped
from motion_transfer.estimate.models import MODEL_FILES, is_there, models_folder
from motion_transfer.extras import install_command, missing_packages
from motion_transfer.render.about_pictures import Facts
from motion_transfer.version import __version__, holders_of, package_version
from motion_transfer.weights import DEFAULT_WEIGHTS, SHIPPED, find_weights
from motion_transfer.weights.checkpoint import inspect_checkpoint
from nhrr_core import PRESETS, ModelConfig, NeuralReRenderer

OPENCV = "opencv-contrib-python-headless"
"""What is asked for; whichever distribution there is does."""

PACKAGES = ("torch", "openvino", "numpy", "av", "safetensors")


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


def _describe_shipped(name: str) -> str:
    path = find_weights(Path(name))
    notes = inspect_checkpoint(path).notes
    size = f"{path.stat().st_size / 1e6:.0f} MB"
    return f"{size}, licence {notes['licence']}, trained on {notes['data']}, {notes['step']} steps"


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
