"""What is around the person: the background, where the person stands in it, and who else does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.option import LONGEST_SHOWN, option, some_path
from motion_transfer.option import parse_background as parse_background
from motion_transfer.render.options.part import Part

FITS = ("cover", "contain", "stretch")
ENDS = ("loop", "hold", "cut")
LARGEST_SCALE = 100.0


@dataclass(frozen=True, kw_only=True)
class Partner:
    """Somebody else of the driver, and the photo of who takes that place.

    Attributes:
        photo: Of the person, or a folder, a video, a kept source.
        person: Whose motion it is, as `--driver-person` chooses.
        iuv: The photo's; None means: look beside it.
    """

    photo: Path
    person: str
    iuv: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where the person stands in the output.

    Attributes:
        x, y: Where the feet are at first, in shares of the output's width and height.
        scale: How much larger the driver's frame is than without.
    """

    x: float
    y: float
    scale: float


@dataclass(frozen=True, kw_only=True)
class SceneOptions(Part):
    """What is behind and around the person."""

    background: str = option(
        "--background",
        "Scene",
        "white (default), black, #rrggbb, transparent, a picture or a video; photo (the source's,"
        " painted over behind the person), or driver (the driver's pictures, likewise).",
        kind="background",
        default="white",
        metavar="WHAT",
    )
    background_fit: str = option(
        "--background-fit",
        "Scene",
        "How a picture behind fills the frame: cover (default; what is too much is cut off),"
        " contain (black beside it), or stretch.",
        default="cover",
        choices=FITS,
    )
    background_end: str = option(
        "--background-end",
        "Scene",
        "What a video behind does at its end: loop (default), hold its last frame, or cut the"
        " output there.",
        default="loop",
        choices=ENDS,
    )
    background_blur: float = option(
        "--background-blur",
        "Scene",
        "Blur what is behind; percent of the frame's height, such as 1.",
        kind="number",
        default=0.0,
        metavar="PERCENT",
    )
    place: str | None = option(
        "--place",
        "Scene",
        "Where the feet stand at first, in shares of the frame from its left and top, and how much"
        " larger the person is than in the driver: 0.5,0.9,1.5.",
        metavar="X,Y,SCALE",
        parse=lambda written: written or None,
    )
    on_the_spot: bool = option(
        "--on-the-spot",
        "Scene",
        "Keep the person where it stands at first, instead of on the driver's path.",
        kind="flag",
        default=False,
    )
    shadow: bool = option(
        "--shadow", "Scene", "Lay a soft shadow under the feet.", kind="flag", default=False
    )
    match_colours: bool = option(
        "--match-colours",
        "Scene",
        "Bring the person's light and tint half-way to those of the background.",
        kind="flag",
        default=False,
    )
    partners: tuple[Partner, ...] = option(
        "--partner --partner-person",
        "Scene",
        "Photo of who takes the place of somebody else in the driver; may be repeated, each with"
        " its --partner-person.",
        kind="partners",
        default=(),
        parse=lambda written: tuple(map(read_partner, written)),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        parse_background(self.background)
        if not 0 <= self.background_blur <= 100:
            raise InputError(
                f"background blur {self.background_blur}; it is a percentage, from 0 to 100"
            )
        parse_place(self.place)
        if self.match_colours and self.background == "transparent":
            raise InputError("--match-colours goes by what is behind, and that is transparent")
        for entry in self.partners:
            if entry.person == "largest":
                raise InputError(
                    f"partner {entry.photo}: name whose motion it is by an index from the left or a"
                    " box; the largest is the one who leads"
                )

    @property
    def transparent(self) -> bool:
        """Whether nothing is behind, and the output has alpha."""
        return self.background == "transparent"

    @property
    def background_file(self) -> Path | None:
        """The picture or video behind, if there is one."""
        chosen = parse_background(self.background)
        return chosen if isinstance(chosen, Path) else None


def read_partner(written: Mapping[str, str]) -> Partner:
    """Read a partner from a mapping, as `read_garment` does. Raises: InputError."""
    return Partner(
        photo=some_path(written["photo"]),
        person=str(written["person"]),
        iuv=Path(written["iuv"]) if written.get("iuv") else None,
    )


def parse_place(text: str | None) -> Place | None:
    """Read `X,Y,SCALE`. Raises: InputError."""
    if text is None:
        return None
    try:
        x, y, scale = (float(word) for word in text.split(","))
    except ValueError:
        x = y = scale = math.nan
    if not (-1 <= x <= 2 and -1 <= y <= 2 and 0 < scale <= LARGEST_SCALE):
        raise InputError(
            f"place {text[:LONGEST_SHOWN]!r}; write X,Y,SCALE: shares of the frame's width and"
            " height where the feet stand, and how much larger than the driver, such as 0.5,0.9,1.5"
        )
    return Place(x=x, y=y, scale=scale)
