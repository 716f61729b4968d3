"""What FeatureNet guesses of hidden places, amended by what a source shows near them.

Departs from the paper, which draws what FeatureNet guesses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from motion_transfer.drawing.engines.around import continue_patterns
from motion_transfer.drawing.engines.crotch import clothe_crotch
from motion_transfer.drawing.engines.interface import FeatureMap, Guess
from motion_transfer.drawing.engines.limbs import go_around_limbs
from motion_transfer.drawing.source import Source
from motion_transfer.drawing.textures import average, mirror_texture, shrink_texture
from nhrr_core.config import COLOUR_CHANNELS

Amendment = Callable[[Guess], None]

AMENDMENTS: tuple[Amendment, ...] = (clothe_crotch, go_around_limbs, continue_patterns)
"""In this order: patterns go on where guesses have their ground's colour by then."""


def amend_guesses(
    feature_map: FeatureMap, source: Source, amendments: Sequence[Amendment] = AMENDMENTS
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
