"""What photos tell of places that none of them shows, before anything is guessed of these."""

from __future__ import annotations

from motion_transfer.drawing.backs import clothe_back
from motion_transfer.drawing.hair import lay_hair
from motion_transfer.drawing.source import Source


def show_hidden(source: Source) -> Source:
    """Show what a source wears behind, and long hair; what is painted counts as seen.

    For whoever completes a texture; who wants to know what photos show asks the source given.
    """
    return lay_hair(clothe_back(source))
