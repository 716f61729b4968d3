"""A model card for the Hugging Face Hub, of what a checkpoint says of itself and what is known."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from motion_transfer.weights.checkpoint import digest_weights, inspect_checkpoint

HUB_LICENCES = ("cc0-1.0", "cc-by-4.0", "cc-by-nc-4.0", "cc-by-nc-sa-4.0", "apache-2.0", "mit")
"""Those of the Hub's names for licences that are SPDX's, in lower case."""

STORY = """## Data

The checkpoint says of its data: {data}.

## Measurements

None are known here. `mt eval --weights {place}` measures, see the project's `docs/quality.md`."""


def write_card(weights: Path, name: str, place: str | None = None) -> str:
    """Write the card, Markdown with the Hub's metadata on top.

    Args:
        name: What the card calls the weights.
        place: Where they can be had on the Hub; else the name stands there.
    Raises: WeightsError.
    """
    from jinja2 import Environment  # a run needs none of it

    info, digest = inspect_checkpoint(weights), digest_weights(weights)
    licence, data = (info.notes.get(note, "not told") for note in ("licence", "data"))
    place = place or name
    here = files("motion_transfer.weights")
    story = STORY.format(data=data, place=place)
    for known in here.iterdir():  # what is told beside weights that ship is told of them alone
        if known.name.endswith(".md"):
            shipped = Path(str(known)).with_suffix(".safetensors")
            if shipped.is_file() and digest_weights(shipped) == digest:
                story = known.read_text("utf-8").rstrip()
    template = here.joinpath("card.md.j2").read_text("utf-8")
    return (
        Environment(keep_trailing_newline=True)
        .from_string(template)
        .render(
            name=name,
            place=place,
            licence=licence,
            licence_id=licence.lower() if licence.lower() in HUB_LICENCES else "other",
            parameters=info.parameter_count,
            side=info.config.image_size,
            variant=info.config.variant,
            alpha=info.config.alpha,
            data=data,
            steps=info.notes.get("step"),
            trained_by=info.notes.get("trained_by", "not told"),
            digest=digest,
            story=story,
        )
    )
