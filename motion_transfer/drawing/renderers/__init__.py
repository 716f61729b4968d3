"""The renderers, by name: a table. A new one is a module with its recipe, and a row here.

The table is light; what a row names is imported when it is first used.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING

from motion_transfer.drawing.engines import ANYTHING, Wish
from motion_transfer.weights import DEFAULT_WEIGHTS, find_weights

if TYPE_CHECKING:
    from motion_transfer.drawing.renderers.interface import Recipe

__all__ = ["DEFAULT_RENDERER", "DRAFT", "RENDERERS", "RendererRow", "register_renderer"]


@dataclass(frozen=True)
class RendererRow:
    """One way of drawing a source.

    Attributes:
        name: What options and reports call it.
        summary: What it is, for help and `mt info`.
        report: What a person reads of it when a run is done.
        opener: `module:function`, which makes its recipe of a weights file and a `Wish`, or of
            nothing where it uses none.
        default_weights: Weights that are taken if none are named; None: it uses none.
    """

    name: str
    summary: str
    report: str
    opener: str
    default_weights: Path | None = None

    def files(self, weights: Path | None) -> list[Path]:
        """List the files that it draws with: a named checkpoint, or the default one, or nothing.

        Raises: WeightsError if a checkpoint ships but is not there.
        """
        if self.default_weights is None:
            return []
        return [find_weights(weights or self.default_weights)]

    def recipe(self, weights: Path | None, wish: Wish = ANYTHING) -> Recipe:
        """Make its recipe.

        Args:
            wish: How its network is to be run, where it has one.
        Raises: InputError for weights that cannot be read, or not be run as wished.
        """
        files = self.files(weights)
        return resolve_name(self.opener)(*files, *([wish] if files else []))


RENDERERS: dict[str, RendererRow] = {}


def register_renderer(row: RendererRow) -> None:
    """Add a row to the table, in the place of one of that name."""
    RENDERERS[row.name] = row


register_renderer(
    RendererRow(
        name="nhrr",
        summary="the network",
        report="nhrr renderer",
        opener="motion_transfer.drawing.renderers.network:open_recipe",
        default_weights=DEFAULT_WEIGHTS,
    )
)
register_renderer(
    RendererRow(
        name="texture",
        summary="a draft without it, faster",
        report="texture renderer: a draft, no network",
        opener="motion_transfer.drawing.renderers.texture:TextureRecipe",
    )
)
DEFAULT_RENDERER = "nhrr"
DRAFT = "texture"
"""The one that is at hand within a second, for previews."""
