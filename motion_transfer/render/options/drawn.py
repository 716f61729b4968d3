"""What draws a run, and how its network is run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from motion_transfer.devices import check_device
from motion_transfer.drawing.engines import ANYTHING, ENGINES, PRECISIONS, Wish
from motion_transfer.drawing.renderers import DEFAULT_RENDERER, RENDERERS, RendererRow
from motion_transfer.errors import InputError
from motion_transfer.option import option
from motion_transfer.render.options.part import Part


def _described(row: RendererRow) -> str:
    default = "; default" if row.name == DEFAULT_RENDERER else ""
    return f"{row.name} ({row.summary}{default})"


@dataclass(frozen=True, kw_only=True)
class RendererOptions(Part):
    """What draws. `weights` may name a checkpoint that ships; None is the renderer's default."""

    renderer: str = option(
        "--renderer",
        "Rendering",
        " or ".join(map(_described, RENDERERS.values())) + ".",
        default=DEFAULT_RENDERER,
        choices=tuple(RENDERERS),
        metavar="NAME",
    )
    weights: Path | None = option(
        "--weights",
        "Rendering",
        "Checkpoint for nhrr: safetensors, or hf:owner/name on the Hugging Face Hub; default: lite,"
        " which ships.",
        kind="path",
    )
    adapt: bool = option(
        "--adapt",
        "Rendering",
        "Let the network learn the source's person first, some minutes; later runs find it done.",
        kind="flag",
        default=False,
    )
    engine: str | None = option(
        "--engine",
        "Rendering",
        "What runs the network: openvino (CPUs), torch (CUDA) or onnx; default: the fastest here.",
        choices=tuple(ENGINES),
        metavar="NAME",
    )
    precision: str | None = option(
        "--precision",
        "Rendering",
        "Numbers it is computed in: int8, bf16 or f32; default: the fastest here that looks alike.",
        choices=PRECISIONS,
        metavar="NAME",
    )
    device: str | None = option(
        "--device",
        "Rendering",
        "cpu, cuda, cuda:1 or mps (Apple's GPUs); default: cuda where it is.",
        metavar="NAME",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.weights is not None and RENDERERS[self.renderer].default_weights is None:
            raise InputError(f"the {self.renderer} renderer uses no weights; leave out --weights")
        if self.adapt and RENDERERS[self.renderer].default_weights is None:
            raise InputError(f"the {self.renderer} renderer learns nothing; leave out --adapt")
        if self.wish != ANYTHING and RENDERERS[self.renderer].default_weights is None:
            raise InputError(
                f"the {self.renderer} renderer runs no network; leave out --engine, --precision and"
                " --device"
            )
        if self.device is not None:
            check_device(self.device)

    @property
    def wish(self) -> Wish:
        """How the network is to be run."""
        return Wish(self.engine, self.precision, self.device)

    @property
    def weights_files(self) -> list[Path]:
        """The files that it draws with, if any. Raises: WeightsError."""
        return RENDERERS[self.renderer].files(self.weights)
