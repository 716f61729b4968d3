"""What FeatureNet guesses of hidden places, amended by what a source shows near them.

Departs from the paper, which draws what FeatureNet guesses of the photo alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from motion_transfer.drawing.engines.around import continue_patterns
from motion_transfer.drawing.engines.crotch import clothe_crotch
from motion_transfer.drawing.engines.hues import keep_hues
from motion_transfer.drawing.engines.interface import FeatureMap, Guess
from motion_transfer.drawing.engines.neck import close_neck
from motion_transfer.drawing.engines.seam import join_halves
from motion_transfer.drawing.hidden import show_hidden
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import average, mirror_texture, shrink_texture
from nhrr_core.config import COLOUR_CHANNELS

Amendment = Callable[[Guess], None]

BY_PLACE: tuple[Amendment, ...] = (
    clothe_crotch,
    keep_hues,
    join_halves,
    close_neck,
)
"""Patterns go on after these, where guesses have their ground's colour by then."""


def encode_amended(source: Source, encode: Callable[[Source], FeatureMap]) -> FeatureMap:
    """Encode a source, told what it wears behind and how long its hair is, and amend the guesses.

    Args:
        encode: A network's.
    """
    worn = show_hidden(source)
    feature_map = amend_guesses(encode(worn), worn, BY_PLACE)
    # on what was painted for the network, patterns that photos show go on as elsewhere
    return amend_guesses(feature_map, source, [continue_patterns])


def amend_guesses(
    feature_map: FeatureMap, source: Source, amendments: Sequence[Amendment]
) -> FeatureMap:
    """Amend the colours that a network guesses.

    Args:
        feature_map: The network's; one without detail does not begin with colours, and stays.
    """
    if feature_map.detail is None:
        return feature_map
    features = feature_map.features.copy()
    size = features.shape[-1]
    factor = source.texture.shape[-1] // size
    texture, shown = mirror_texture(*shrink_texture(source.texture, source.visibility, factor))
    hidden = 1 - average(source.visibility, size)[0]
    guess = Guess(features[0, :COLOUR_CHANNELS], texture, shown[0] > 0, hidden)  # a view
    for amend in amendments:
        amend(guess)
    return replace(feature_map, features=features)
