"""A source in one file: unfolded and encoded once, rendered from as often as wanted, anywhere.

The file is safetensors. Its metadata are one JSON text (`FACTS`), its tensors:

    photo             the picture as PNG, with its alpha if it has one
    person            (I, U, V) as PNG; the person's alpha, where somebody could tell, is the fourth
    texture/T         3 x T x T float32, the partial texture; for one or several sizes T
    visibility/T      1 x T x T uint8, 0 or 1
    clearance         2 x 128 x 128 float32, see `nhrr_core.unfold_clearance`
    map/DIGEST        D x T x T float32, the feature map that the weights with that SHA-256 make
    detail/DIGEST     3 x T x T float32, what the photos show finer, where the weights use it

Textures and feature maps are kept as they were computed, and pictures without loss: what is drawn
from the file equals what is drawn from the photos, to the byte.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt8
from safetensors import safe_open
from safetensors.numpy import save_file

from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.source import Source, SourcePicture
from motion_transfer.drawing.textures import pick_nearest, shrink_texture
from motion_transfer.errors import InputError, first_line
from motion_transfer.media.alpha import add_alpha
from motion_transfer.media.files import check_readable
from motion_transfer.media.pictures.photo import decode_png, encode_png
from motion_transfer.media.structured import parse_json, shown
from motion_transfer.version import __version__
from nhrr_core.config import CLEARANCE_SIZE, COLOUR_CHANNELS, ModelConfig
from nhrr_core.parts import PART_COUNT

FACTS = "kept_source"
"""The only key of the metadata: several would come in another order in every file."""

FORMAT = 1
"""Goes up whenever an older program would misread a file, or draw something else from it."""

COMPRESSION = 6  # zlib's own choice; a photo of 12 megapixels takes a second or two
LARGEST_TEXTURE = 8192  # texels a side; a gigabyte, and no camera sees a body finer
ROUNDING = 1e-4  # by which means of colours in [-1, 1] may leave that range

AGAIN = "copy it again, or save it again with `mt source save`"


def save_source(
    path: Path,
    sources: Sequence[Source],
    maps: Mapping[str, FeatureMap],
    facts: Mapping[str, Any],
) -> None:
    """Write a source; the same content gives the same bytes.

    Args:
        sources: One source, unfolded to one or several sizes of texture.
        maps: What weights make of it, by the SHA-256 of the weights, hexadecimal.
        facts: Where it comes from, as JSON can hold it.
    Raises: OSError.
    """
    source = sources[0]
    photo, alphas = source.photo, (source.photo.alpha, source.alpha)
    tensors = {
        name: np.frombuffer(_pack(colours, alpha), np.uint8)
        for name, colours, alpha in zip(
            ("photo", "person"), (photo.rgb, source.iuv), alphas, strict=True
        )
    }
    for each in sources:
        size = each.texture.shape[-1]
        tensors[f"texture/{size}"] = each.texture
        tensors[f"visibility/{size}"] = each.visibility.astype(np.uint8)
    if source.clearance is not None:
        tensors["clearance"] = source.clearance
    for digest, each in maps.items():
        tensors[f"map/{digest}"] = each.features[0]
        if each.detail is not None:
            tensors[f"detail/{digest}"] = each.detail[0]
    told = {**facts, "format": FORMAT, "program": __version__, "notes": list(source.notes)}
    metadata = {FACTS: json.dumps(told, sort_keys=True, ensure_ascii=False)}
    whole = {name: np.ascontiguousarray(each) for name, each in tensors.items()}
    save_file(whole, path, metadata=metadata)
    path.chmod(0o644)  # safetensors writes for the owner only


def load_source(path: Path, texture_size: int) -> Source:
    """Read a source, with a texture of the size that is wanted.

    Where that size is not kept, it is made from the finest that is.

    Raises: InputError if the file is missing, damaged, of another kind or by a newer program.
    """
    with _open(path) as file:
        picture = _read_picture(file, path)
        texture, visibility, note = _read_texture(file, texture_size)
        clearance = None
        if "clearance" in file.shapes:
            clearance = file.read("clearance", "F32", (2, CLEARANCE_SIZE, CLEARANCE_SIZE))
        made_of = file.facts.get("made of")
    return Source(
        picture.photo,
        picture.iuv,
        None,
        texture,
        visibility,
        alpha=picture.alpha,
        clearance=clearance,
        notes=(*file.notes, *note),
        kept=path,
        # of several only the first is there, and that would be half of what was seen
        pictures=(picture,) if isinstance(made_of, list) and len(made_of) == 1 else (),
    )


def load_picture(path: Path) -> SourcePicture:
    """Read the picture of a kept source, and who is who in it. Raises: InputError."""
    with _open(path) as file:
        return _read_picture(file, path)


def load_features(path: Path, digest: str, config: ModelConfig) -> FeatureMap | None:
    """Read the feature map that some weights made; None if only others did, or another program.

    What a program draws from the file equals what it draws from the photos only so.

    Args:
        digest: SHA-256 of the weights, hexadecimal.
        config: Theirs.
    Raises: InputError as `load_source`.
    """
    side, finest = config.texture_size, config.finest_texture
    with _open(path) as file:
        if f"map/{digest}" not in file.shapes or file.facts.get("program") != __version__:
            return None
        features = file.read(f"map/{digest}", "F32", (config.map_channels, side, side))[None]
        if not config.has_detail:
            return FeatureMap(features)
        detail = file.read(f"detail/{digest}", "F32", (COLOUR_CHANNELS, finest, finest))[None]
        return FeatureMap(features, detail)


def inspect_source(path: Path) -> dict[str, Any]:
    """Tell what a kept source says of itself and holds, without decoding it. Raises: InputError."""
    with _open(path) as file:
        held = {name: f"{file.kinds[name]} {list(size)}" for name, size in file.shapes.items()}
        return {**file.facts, "tensors": dict(sorted(held.items()))}


@dataclass(frozen=True)
class _File:
    """An open kept source; everything that is read is checked.

    Attributes:
        where: Names it in messages.
        shapes, kinds: Of its tensors, by name.
    """

    where: str
    handle: Any
    facts: dict[str, Any]
    shapes: dict[str, tuple[int, ...]]
    kinds: dict[str, str]

    def expect(self, holds: Any, otherwise: str) -> None:
        """Raise InputError, saying what is wrong, unless something holds."""
        if not holds:
            raise InputError(f"{self.where} is damaged: {otherwise}; {AGAIN}")

    def read(self, name: str, kind: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """Read a tensor of a kind and a shape, None for any length; numbers are finite."""
        self.expect(name in self.shapes, f"{name} is missing")
        found, held = self.shapes[name], self.kinds[name]
        fits = len(found) == len(shape) and all(
            wanted in (None, length) for wanted, length in zip(shape, found, strict=True)
        )
        wanted = " x ".join("any" if length is None else str(length) for length in shape)
        self.expect(
            fits and held == kind, f"{name} is {held} {list(found)}, where {kind} {wanted} belongs"
        )
        tensor = self.handle.get_tensor(name)
        self.expect(np.isfinite(tensor).all(), f"{name} holds values that are no finite numbers")
        return tensor

    @property
    def notes(self) -> tuple[str, ...]:
        notes = self.facts.get("notes", [])
        told = isinstance(notes, list) and all(isinstance(note, str) for note in notes)
        self.expect(told, f"its notes are {shown(notes)}")
        return tuple(notes)


@contextmanager
def _open(path: Path) -> Iterator[_File]:
    """Open a file and read what it says of itself. Raises: InputError."""
    where = f"source {path}"
    check_readable(path, "source")
    try:
        handle = safe_open(path, framework="np")
    except Exception as error:  # of a lying header they have no common base
        raise InputError(
            f"{where} is not a whole safetensors file ({first_line(error)}); {AGAIN}"
        ) from error
    with handle as file:
        written = (file.metadata() or {}).get(FACTS)
        if written is None:
            raise InputError(
                f"{where} is a safetensors file, but no kept source; make one with `mt source save`"
            )
        try:
            facts = parse_json(written, where)
        except InputError as error:
            raise InputError(f"{error}; {AGAIN}") from None
        version = facts.get("format") if isinstance(facts, dict) else None
        if isinstance(version, int) and version > FORMAT:
            raise InputError(
                f"{where} was saved by a newer motion-transfer ({shown(facts.get('program'))}; this"
                f" is {__version__}); update this one, or save it again here"
            )
        if version != FORMAT:
            raise InputError(f"{where} is damaged: its format is {shown(version)}; {AGAIN}")
        parts = {name: file.get_slice(name) for name in file.keys()}  # noqa: SIM118 - no mapping
        yield _File(
            where,
            file,
            facts,
            {name: tuple(part.get_shape()) for name, part in parts.items()},
            {name: part.get_dtype() for name, part in parts.items()},
        )


def _read_picture(file: _File, path: Path) -> SourcePicture:
    photo, person = (
        decode_png(file.read(name, "U8", (None,)).tobytes(), path, file.where)
        for name in ("photo", "person")
    )
    iuv = person.rgb
    file.expect(iuv.shape == photo.rgb.shape, "its person and its photo differ in size")
    file.expect(iuv[..., 0].max() <= PART_COUNT, "its person has parts that no body has")
    file.expect(iuv[..., 0].any(), "it shows nobody")
    return SourcePicture(photo, iuv, person.alpha)


def _read_texture(
    file: _File, wanted: int
) -> tuple[Float32[np.ndarray, "3 T T"], Float32[np.ndarray, "1 T T"], list[str]]:
    """Read texture and visibility, and say so where they are coarser than wanted."""
    kept = [
        shape[-1]
        for name, shape in file.shapes.items()
        if shape and name == f"texture/{shape[-1]}" and 0 < shape[-1] <= LARGEST_TEXTURE
    ]
    file.expect(kept, "it has no texture")
    size = wanted if wanted in kept else max(kept)
    texture = file.read(f"texture/{size}", "F32", (3, size, size))
    visibility = file.read(f"visibility/{size}", "U8", (1, size, size)).astype(np.float32)
    file.expect(visibility.max() <= 1, "its visibility is neither 0 nor 1")
    file.expect(np.abs(texture).max() <= 1 + ROUNDING, "its colours are beyond black or white")
    file.expect(not (texture * (1 - visibility)).any(), "it has colours where nothing is seen")
    if size % wanted == 0:
        return *shrink_texture(texture, visibility, size // wanted), []
    texture, visibility = (pick_nearest(each, wanted) for each in (texture, visibility))
    if size > wanted:
        return texture, visibility, []
    note = f"{file.where} was saved with {size} texels a side, and these weights use {wanted}"
    return texture, visibility, [f"{note}; for a finer picture save it again with their --weights"]


def _pack(colours: UInt8[np.ndarray, "H W 3"], alpha: UInt8[np.ndarray, "H W"] | None) -> bytes:
    pixels = colours if alpha is None else add_alpha(colours, alpha)
    return encode_png(pixels, compression=COMPRESSION)
