"""What a file holds, and what the parts of the body are called, as plain facts."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import cast

import numpy as np

from motion_transfer.drawing.kept_source import inspect_source
from motion_transfer.drawing.person import find_people
from motion_transfer.errors import InputError
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
from motion_transfer.render.about_pictures import (
    Facts,
    describe_clip,
    describe_length,
    describe_photo,
)
from motion_transfer.render.options import is_kept
from motion_transfer.render.provenance import parse_record
from motion_transfer.weights.checkpoint import inspect_checkpoint
from nhrr_core import PART_GROUPS, PART_NAMES

ORDER_WORDS = {
    "iuv": "iuv (file RGB = I, U, V)",
    "vui": "vui (file RGB = V, U, I, as Caffe2's DensePose writes)",
}


def describe_parts() -> Facts:
    """Tell the names of groups with their parts, then of every part with its number."""
    return {
        "groups": {
            name: [PART_NAMES[part] for part in parts] for name, parts in PART_GROUPS.items()
        },
        "parts": {PART_NAMES[part]: part for part in range(1, len(PART_NAMES))},
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
