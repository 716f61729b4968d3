"""Hair as pieces, off the head and with volume.

sample_hair -> Hair -> hair_pieces -> pieces
"""

from __future__ import annotations

from motion_transfer.people.figure.body import Body, BodyModel
from motion_transfer.people.figure.mesh import Piece, PosedBody
from motion_transfer.people.head.hair_cap import cap_piece, under_piece
from motion_transfer.people.head.hair_grid import Head
from motion_transfer.people.head.hair_hang import hang_piece
from motion_transfer.people.head.hair_styles import HATS, STYLES, Hair, sample_hair
from motion_transfer.people.head.hair_tail import bun_piece, tail_piece
from motion_transfer.people.head.hats import hat_pieces

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
    pieces = hat_pieces(hair, head)
    if hair.style == "bald":
        return pieces
    if hair.style in _HANGING:
        pieces.append(hang_piece(hair, head, rest, limit))
        if hair.fringe == 0:
            pieces.append(under_piece(hair, head))
        return pieces
    pieces.append(cap_piece(hair, head, limit))
    if hair.style in ("ponytail", "braid"):
        pieces.append(tail_piece(hair, head, rest))
    if hair.style == "bun":
        pieces.append(bun_piece(hair, head))
    return pieces
