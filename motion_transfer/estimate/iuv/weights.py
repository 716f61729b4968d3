"""The IUV network's sizes, and the file of its weights, read as arrays without torch.

The file is safetensors, with the sizes inside; its tensors are those of `IuvNetwork.state_dict()`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from motion_transfer.errors import InputError, WeightsError
from motion_transfer.estimate.iuv.body import MAP_CHANNELS, VECTOR_LENGTH
from motion_transfer.media.structured import parse_json
from motion_transfer.weights.tensors import Array, Entry, read_header, read_tensors
from nhrr_core.parts import PART_COUNT

PARTS = PART_COUNT + 1  # and the background
FINER = 2  # output pixels a cell and side
MOST_LEVELS = 7  # the last one is a single cell
WIDEST = 4096
SHIPPED, SHIPPED_HEAVY = "iuv_network.safetensors", "iuv_network_heavy.safetensors"
WHAT = "weights of the IUV network in"

Weights = Mapping[str, Array]


@dataclass(frozen=True)
class IuvNetworkConfig:
    """The network's sizes.

    Attributes:
        widths: Channels from the finest level (64 x 64) to the coarsest (8 x 8).
        code: How many numbers the row of landmarks is condensed to.
    """

    widths: tuple[int, ...] = (48, 80, 128, 192)
    code: int = 128

    def __post_init__(self) -> None:
        """Raises: ValueError for sizes that no network has."""
        sizes = (*self.widths, self.code)
        if not 1 <= len(self.widths) <= MOST_LEVELS or not all(
            type(size) is int and 1 <= size <= WIDEST for size in sizes
        ):
            raise ValueError(
                f"1 to {MOST_LEVELS} widths and a code from 1 to {WIDEST}, not {sizes[:9]}"
            )


def read_weights(path: Path) -> tuple[IuvNetworkConfig, Weights]:
    """Read the network's sizes and its tensors, in float32 from the half precision of the file.

    Raises: WeightsError if the file is missing, damaged, or another network's.
    """
    header = read_header(path, WHAT)
    config = read_config(header.metadata, path)
    return config, read_tensors(path, list_tensors(config), header.state, WHAT)


def read_config(metadata: Mapping[str, str], path: Path) -> IuvNetworkConfig:
    """Read the network's sizes from the metadata of a file. Raises: WeightsError."""
    try:
        values = parse_json(metadata["config"], "config")
        return IuvNetworkConfig(widths=tuple(values.pop("widths")), **values)
    except (InputError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise WeightsError(
            f"{path} holds no weights of the IUV network ({type(error).__name__}: {error});"
            " give a file written by `mt train iuv fit`"
        ) from error


def list_tensors(config: IuvNetworkConfig) -> dict[str, Entry]:
    """List the tensors of a network by name."""
    return {
        name: Entry(shape, not name.endswith("num_batches_tracked"))
        for name, shape in _list_shapes(config)
    }


def _list_shapes(config: IuvNetworkConfig) -> Iterator[tuple[str, tuple[int, ...]]]:
    widths, code = config.widths, config.code
    outputs = FINER**2 * (PARTS + 2 * PART_COUNT)
    blocks = {
        f"down.{level}": pair for level, pair in enumerate(pairwise((widths[0], *widths)))
    } | {
        f"up.{level}": (above + width, width)
        for level, (width, above) in enumerate(reversed(list(pairwise(widths))))
    }
    layers: dict[str, tuple[int, ...]] = {
        "encode_row.0": (2 * code, VECTOR_LENGTH),
        "encode_row.2": (code, 2 * code),
        "stem": (widths[0], MAP_CHANNELS, 1, 1),
        "head": (outputs, widths[0], 1, 1),
        **{f"{name}.film": (2 * width, code) for name, (_, width) in blocks.items()},
    }
    for name, shape in layers.items():
        yield f"{name}.weight", shape
        yield f"{name}.bias", shape[:1]
    for name, (inputs, width) in blocks.items():
        for conv, channels in (("first", inputs), ("second", width)):
            yield f"{name}.{conv}.weight", (width, channels, 3, 3)
            for what in ("weight", "bias", "running_mean", "running_var"):
                yield f"{name}.{conv}_norm.{what}", (width,)
            yield f"{name}.{conv}_norm.num_batches_tracked", ()


def shipped_file(*, heavy: bool = False) -> Path:
    """Name the file of the weights that come with the package.

    Args:
        heavy: Those for what the large landmark model sees.
    """
    return Path(__file__).parents[1] / (SHIPPED_HEAVY if heavy else SHIPPED)


def has_shipped() -> bool:
    """Tell whether weights came with the package."""
    return shipped_file().is_file()


def find_shipped(*, heavy: bool = False) -> Path:
    """Find the weights that come with the package, see `shipped_file`. Raises: WeightsError."""
    file = shipped_file(heavy=heavy)
    if not file.is_file():
        raise WeightsError(
            f"this installation lacks {file.name}, the weights with which the blazepose estimator"
            " paints IUV; choose the densepose estimator with a model of yours, or give IUV"
        )
    return file
