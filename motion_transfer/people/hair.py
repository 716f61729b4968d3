"""Hair as pieces, off the head and with volume.

    sample_hair -> Hair -> hair_pieces -> pieces
"""

from __future__ import annotations

from motion_transfer.people.body import Body, BodyModel
from motion_transfer.people.hair_cap import cap_piece
from motion_transfer.people.hair_grid import Head
from motion_transfer.people.hair_hang import hang_piece
from motion_transfer.people.hair_styles import HATS, STYLES, Hair, sample_hair
from motion_transfer.people.mesh import Piece, PosedBody

__all__ = ["HATS", "STYLES", "Hair", "hair_pieces", "sample_hair"]

_HANGING = ("bob", "shoulder", "long")


def hair_pieces(hair: Hair, body: Body, model: BodyModel) -> list[Piece]:
    """The pieces of one head of hair and of what is worn on it; none for a bald head.

    Raises: KeyError for an unknown style.
    """
    STYLES[hair.style]
    head = Head.of(body, model)
    still = body.transforms({})
    rest = PosedBody(body, still, body.points, body.heads)
    limit = None if hair.hat == "none" else 0.006
    if hair.style in _HANGING:
        return [hang_piece(hair, head, rest, limit)]
    return [cap_piece(hair, head, limit)]
