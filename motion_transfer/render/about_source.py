"""What the photos of a person show of the body, told as plain facts and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from motion_transfer.drawing.coverage import draw_coverage, measure_coverage, regions
from motion_transfer.drawing.source import tell_strangers, unfold_views
from motion_transfer.errors import InputError, OutputError
from motion_transfer.events import Listener
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.render.options import SourceOptions, is_kept
from motion_transfer.render.source_pictures import read_pictures

TEXTURE_SIZE = 256


def describe_source(
    options: SourceOptions, picture: Path | None, listener: Listener, *, force: bool = False
) -> dict[str, Any]:
    """Tell what photos show together, and which photo would help most.

    Args:
        picture: Where to draw it (PNG); None: nowhere.
        force: Whether a picture that is there may be replaced.
    Raises: InputError for photos that cannot be read; OutputError for a picture that cannot be
        written.
    """
    if any(is_kept(path) for path in options.source):
        raise InputError(
            f"{options.source_words}: a kept source has no photos to compare; inspect it alone, or"
            " the photos that it was made from"
        )
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise OutputError(f"{picture}: the picture is written as PNG; give a name in .png")
        check_destination(picture, force=force)
    pictures = [found.picture for found in read_pictures(options, listener)]
    views = unfold_views(pictures, TEXTURE_SIZE, rated=True)
    coverage = measure_coverage(views)
    if picture is not None:
        photos = {str(one.photo.path): one.photo.on_white() for one in reversed(pictures)}
        drawn = draw_coverage(coverage, [photos[name] for name in coverage.names])
        with work_folder(picture) as place:
            write_png(place / "coverage.png", drawn)
            publish(place / "coverage.png", picture)
    told = {name: coverage.of(where) for name, where in regions().items()}
    wanting = coverage.wanting()
    notes = tell_strangers(pictures, coverage.strangers)
    return {
        "what": f"source of {len(pictures)} picture{'s' * (len(pictures) > 1)}",
        "body seen": f"{coverage.seen:.0%}",
        "from": {name: f"{share:.0%} of the body" for name, share in coverage.given().items()},
        "parts seen": {
            name: f"{seen:.0%}" + (f", {_grade(quality)}" if seen else "")
            for name, (seen, quality) in told.items()
        },
        "would help most": (
            f"a photo of the {wanting[0]}: {wanting[1]:.0%} of it is seen badly or not at all"
            if wanting
            else "nothing in particular: all sides are seen"
        ),
        **({"note": "; ".join(notes)} if notes else {}),
        **({"picture": str(picture)} if picture is not None else {}),
    }


def _grade(quality: float) -> str:
    """Put into words how well a region is seen, on average, from 0 to 1."""
    return "well" if quality > 0.8 else "coarsely" if quality > 0.5 else "badly"
