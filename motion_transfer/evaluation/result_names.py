"""How methods name what they made of a pair, and how many pictures they join in one file."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import PurePosixPath

from motion_transfer.drawing.backgrounds import Frame
from motion_transfer.evaluation.in_shop import spell_names
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.training.pairs import Pair, flat_stem

PATTERNS = {
    "SOURCE__TARGET": 1,
    "SOURCE___TARGET": 1,
    "SOURCE___TARGET_vis": 5,
    "SOURCE_2_TARGET": 1,
    "SOURCE_2_TARGET_vis": 1,
    "SOURCE.jpg_TARGET.jpg": 3,
    "SOURCE.jpg___TARGET.jpg": 1,
    "SOURCE.jpg___TARGET.jpg_vis": 5,
}
"""How results are named, without their ending: as this program does, then as the published code of
Zhu et al. (PATN, `___`), Ren et al. (GFLA, `_2_`) and Siarohin et al. (DSC, `.jpg_`) does. Where a
name held folders, `-` joins them; `.jpg` keeps the ending of each picture in the pair list.

And how many pictures stand side by side in a file, the result last: DSC's `test.py` joins source,
target and result, PATN's visuals are source, pose, target, pose and result. What is no such strip
is taken whole. The code of Esser et al. (VUnet) names no pairs: its `transfer_0.png` tiles a
shuffled batch, each person in the poses of all; pictures cut out of it have to be named."""

WORD = re.compile(r"(SOURCE|TARGET)(\.jpg)?")
USUAL_ASPECT = 3 / 4
"""Width by height of a picture of a person, where nothing tells better."""


def fill_pattern(pattern: str, pair: Pair) -> str:
    """Fill a pattern of `PATTERNS` in with the names of a pair's pictures.

    In-shop's are spelled as `spell_names` does.
    """
    words = {}
    for word, picture in (("SOURCE", pair.source), ("TARGET", pair.target)):
        words[word] = flat_stem(picture.name)
        words[f"{word}.jpg"] = PurePosixPath(picture.name).name
    # at once, as a source may itself be called TARGET
    return spell_names(WORD.sub(lambda found: words[found[0]], pattern))


def item_name(stem: str) -> str:
    """Turn a name in any of `PATTERNS` into one in the first; others stay as they are.

    In-shop's are spelled as `spell_names` does.
    """
    stem = spell_names(stem)
    pattern = find_pattern(stem)
    found = pattern and _reading(pattern).fullmatch(stem)
    return f"{found['SOURCE']}__{found['TARGET']}" if found else stem


def find_pattern(stem: str) -> str | None:
    """Find which of `PATTERNS` a name is in: the one that says most of it."""
    fitting = (pattern for pattern in PATTERNS if _reading(pattern).fullmatch(stem))
    # "_2_" last, as a name may well hold it
    return max(fitting, key=lambda pattern: ("_2_" not in pattern, len(pattern)), default=None)


@lru_cache
def _reading(pattern: str) -> re.Pattern[str]:
    """Make the regular expression that reads what `fill_pattern` wrote."""
    endings = "|".join(re.escape(suffix) for suffix in PHOTO_SUFFIXES)

    def read(found: re.Match[str]) -> str:
        # no name begins or ends with what joins two: "a___b" is no "a_" and "b"
        return f"(?P<{found[1]}>[^_](?:.*?[^_])?)" + (f"(?:{endings})" if found[2] else "")

    return re.compile(WORD.sub(read, pattern), re.I | re.S)


def cut_result(picture: Frame, count: int, aspect: float = USUAL_ASPECT) -> Frame:
    """Cut the result, the last of `count` pictures, out of a strip; else give the picture itself.

    Args:
        aspect: Width by height of what one of them shows.
    """
    height, width = picture.shape[:2]
    # half-way, in ratios: a method may crop the target to 176 of 256 px, or pad it from there
    is_strip = count > 1 and width > math.sqrt(count) * height * aspect
    return picture[:, -(width // count) :] if is_strip else picture
