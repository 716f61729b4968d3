"""One export from a checkpoint to a folder: what `mt export` calls."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from motion_transfer.drawing.export.card import FACTS_FILE, WORDS_FILE, write_card
from motion_transfer.drawing.export.formats import Network, run_file, run_openvino
from motion_transfer.drawing.export.options import FORMATS, PLAIN, ExportOptions
from motion_transfer.drawing.export.tensorrt_plan import list_sides
from motion_transfer.drawing.graphs.networks import BYTE_LEVELS, WEIGHT_LEVELS
from motion_transfer.drawing.graphs.whole import (
    CLEARANCE,
    DETAIL,
    FEATURE_MAP,
    IUV,
    TEXTURE,
    VISIBILITY,
    build_encoder,
    build_painter,
    build_sampler,
)
from motion_transfer.errors import InputError, RenderError
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.unchanged import Inputs
from motion_transfer.version import __version__
from motion_transfer.weights import find_weights
from motion_transfer.weights.checkpoint import (
    digest_weights,
    inspect_checkpoint,
    read_checkpoint,
    read_ranges,
)
from nhrr_core.config import CLEARANCE_CHANNELS, CLEARANCE_SIZE, COLOUR_CHANNELS, ModelConfig
from nhrr_core.parts import PART_COUNT

FORMAT = "nhrr-export-1"
"""Its number goes up whenever a program would misread the files."""

TOLD = ("licence", "data", "trained_by", "adapted_from")
"""The notes of a checkpoint that its files carry on; others tell how it was trained."""

ENDINGS = {row.ending for row in FORMATS.values()} | {".bin"}
LEVELS = {"int8": 4.0, "bf16": 0.5, PLAIN: 0.5}
"""By so many of 256 levels may two libraries' pictures differ, on average. Measured with `lite` on
noise: 1.2, 0.005 and 0.0004; another network's differ by 90."""

UNITS = 1e-3  # likewise of features; 1e-7 was measured
BELOW_ZERO = -1e-9  # with which a range has a sign


def export_model(weights: Path, options: ExportOptions) -> list[Path]:
    """Write a checkpoint's networks as files that other programs run.

    Each file but TensorRT's is run once, on noise, and held to what OpenVINO makes of the graph in
    memory.

    Args:
        weights: A checkpoint, or the name of one that ships.
    Returns: The files.
    Raises: InputError and its kinds; RenderError if a file does not give what it should; with
        nothing written.
    """
    path = find_weights(weights)
    check_destination(
        options.output, force=options.force, belongs=_is_ours, content="those of an export"
    )
    inputs = Inputs([path])
    info = inspect_checkpoint(path)
    if "int8" in options.precisions and read_ranges(info) is None:
        raise InputError(
            f"--precision int8: weights {path} do not say of which ranges their numbers are; add"
            f" that with mt calibrate {path}, or choose another"
        )
    if info.config.reads_photo:
        raise InputError(
            f"weights {path} are of variant {info.config.variant}, which reads the photo itself and"
            " is not exported; choose weights of another variant"
        )
    digest = digest_weights(path)
    notes = {
        "format": FORMAT,
        "weights": path.name,
        "weights_sha256": digest,
        **{name: info.notes[name] for name in TOLD if name in info.notes},
        "exported_by": f"motion-transfer {__version__}",
    }
    least, usual, most = list_sides(info.config)
    step = 2**info.config.down_blocks
    facts = {
        "format": FORMAT,
        "notes": notes,
        "configuration": info.config.to_dict(),
        "sides": {"least": least, "usual": usual, "most": most, "multiple_of": step},
    }
    with work_folder(options.output) as work:
        folder = work / "finished"
        folder.mkdir()
        written = {}
        for name in options.formats:
            written |= _write(path, name, options.precisions, notes, folder)
        write_card(folder, written, facts)
        inputs.check()
        files = sorted(file.name for file in folder.iterdir())
        publish(folder, options.output)
    return [options.output / name for name in files]


def _is_ours(item: Path) -> bool:
    return item.suffix in ENDINGS or item.name in (FACTS_FILE, WORDS_FILE)


def _write(
    weights: Path, name: str, precisions: tuple[str, ...], notes: Mapping[str, str], folder: Path
) -> dict[Path, Network]:
    """Write all networks in one format, and check what was written."""
    row = FORMATS[name]
    write = resolve_name(row.writer)
    written = {}
    for network in list_networks(weights, precisions, notes, signed=row.signed):
        several = network.name == "painter"
        stem = f"{network.name}-{network.precision}" if several else network.name
        path = folder / f"{stem}{row.ending}"
        write(network, path)
        if row.run_here:
            _check(network, path)
        written[path] = network
    return written


def list_networks(
    weights: Path, precisions: tuple[str, ...], notes: Mapping[str, str], *, signed: bool
) -> list[Network]:
    """Build the graphs of a checkpoint, the painter once for each precision.

    Args:
        signed: Whether all 8-bit numbers are to have a sign; weights use all 8 bits then, as those
            who ask for it, unlike CPUs, add their products in 32.
    """
    config, tensors = read_checkpoint(weights)
    ranges = read_ranges(inspect_checkpoint(weights)) or {}
    weight_levels = BYTE_LEVELS if signed else WEIGHT_LEVELS
    if signed:
        ranges = {name: (min(least, BELOW_ZERO), most) for name, (least, most) in ranges.items()}
    models = [
        ("encoder", PLAIN, build_encoder(config, tensors)),
        ("sampler", PLAIN, build_sampler(config)),
    ]
    for precision in precisions:
        held = ranges if precision == "int8" else None
        painter = build_painter(config, tensors, ranges=held, weight_levels=weight_levels)
        models.append(("painter", precision, painter))
    return [Network(name, model, config, precision, notes) for name, precision, model in models]


def _check(network: Network, path: Path) -> None:
    """Hold a file to the graph that it was written from. Raises: RenderError."""
    inputs = make_noise(network.config)
    expected = run_openvino(network.model.SerializeToString(), inputs)
    pairs = zip(run_file(path, inputs), expected, strict=True)
    off = max(float(np.abs(found - wanted.astype(float)).mean()) for found, wanted in pairs)
    allowed = LEVELS[network.precision] if network.name == "painter" else UNITS
    if not off <= allowed:
        raise RenderError(
            f"{path.name} gives {off:.3g} else than the network that it was written from, on"
            f" average, and {allowed:g} is allowed; try another version of its library"
        )


def make_noise(config: ModelConfig) -> dict[str, np.ndarray]:
    """Make inputs of all networks: blocks of noise on a background."""
    rng = np.random.default_rng(0)
    side, coarse, size = 8 * 2**config.down_blocks, config.texture_size, config.finest_texture
    visibility = (rng.random((1, 1, size, size)) < 0.5).astype(np.float32)
    colours = rng.uniform(-1, 1, (1, COLOUR_CHANNELS, size, size)).astype(np.float32)
    clearance = rng.random((1, CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE), np.float32)
    clearance[:, 1] = clearance[:, 1] < 0.5
    clearance[:, 0] *= clearance[:, 1]
    iuv = rng.integers(0, 256, (1, side, side, 3), np.uint8)
    iuv[..., 0] = rng.integers(1, PART_COUNT + 1, (1, side, side))
    iuv[:, :, : side // 3] = 0
    features = rng.uniform(-1, 1, (1, config.map_channels, coarse, coarse)).astype(np.float32)
    detail = rng.uniform(-0.5, 0.5, (1, COLOUR_CHANNELS, size, size)).astype(np.float32)
    return {
        TEXTURE: colours * visibility,
        VISIBILITY: visibility,
        CLEARANCE: clearance,
        FEATURE_MAP: features,
        DETAIL: detail,
        IUV: iuv,
    }
