"""Weights as a folder for the Hugging Face Hub: `config.json`, `model.safetensors`, `README.md`.

The tensors' file is a checkpoint like any other, with its configuration inside. Nothing is ever
unpickled.
"""

from __future__ import annotations

import json
import shutil
from functools import lru_cache
from pathlib import Path

from motion_transfer.errors import FetchError, InputError, WeightsError, first_line
from motion_transfer.extras import require_extra
from motion_transfer.media.publish import check_destination, publish, work_folder
from motion_transfer.media.structured import parse_json, read_text
from motion_transfer.weights.card import write_card
from motion_transfer.weights.checkpoint import FORMAT, inspect_checkpoint

CONFIG, TENSORS, CARD = "config.json", "model.safetensors", "README.md"
KEPT_PLACES = 8  # a process asks the Hub once for each


def save_pretrained(
    weights: Path, folder: Path, *, name: str | None = None, push: str | None = None
) -> None:
    """Write a checkpoint as a folder, whole or not at all.

    Args:
        name: What the card calls it; else after the folder.
        push: `owner/name` on the Hub to upload the folder to.
    Raises: OutputError if the folder exists; WeightsError; FetchError if it cannot be uploaded,
        the folder then being there.
    """
    if push is not None:
        require_extra("hub")
    check_destination(folder, force=False)
    info = inspect_checkpoint(weights)
    config = {"model_type": "nhrr", "format": FORMAT, **info.config.to_dict()}
    with work_folder(folder) as work:
        written = work / "finished"
        written.mkdir()
        shutil.copyfile(weights, written / TENSORS)
        (written / CONFIG).write_text(json.dumps(config, indent=2) + "\n", "utf-8")
        (written / CARD).write_text(write_card(weights, name or folder.name, push), "utf-8")
        publish(written, folder)
    if push is not None:
        _upload(folder, push)


def check_folder(folder: Path) -> Path:
    """Give the checkpoint of a folder. Raises: WeightsError if it has none, or two stories."""
    path = folder / TENSORS
    if not path.is_file():
        raise WeightsError(
            f"weights {folder} are a folder without {TENSORS}; name the checkpoint itself, or a"
            " folder that save_pretrained wrote"
        )
    if (beside := folder / CONFIG).is_file():
        try:
            told = parse_json(read_text(beside, "configuration"), str(beside))
        except InputError as error:
            raise WeightsError(str(error)) from None
        own = inspect_checkpoint(path).config.to_dict()
        told = told if isinstance(told, dict) else {}
        if other := [field for field in own if told.get(field, own[field]) != own[field]]:
            raise WeightsError(
                f"{beside} says {other[0]} {told[other[0]]!r}, and {TENSORS} beside it"
                f" {own[other[0]]!r}; the tensors fit only what they say themselves; save both"
            )
    return path


@lru_cache(KEPT_PLACES)
def fetch_folder(place: str, revision: str | None = None) -> Path:
    """Have a folder of the Hub here, in the Hub's own cache; what is there already is not fetched.

    Args:
        place: `owner/name`.
    Raises: FetchError; InputError if the extra is missing.
    """
    require_extra("hub")
    import huggingface_hub

    try:
        fetched = huggingface_hub.snapshot_download(
            place, revision=revision, allow_patterns=[CONFIG, TENSORS, CARD]
        )
    except Exception as error:  # of the network's and the Hub's errors there is no common base
        wanted = place if revision is None else f"{place} at {revision}"
        raise FetchError(
            f"weights {wanted} cannot be had from the Hugging Face Hub: {first_line(error)}; check"
            " the name and the network, or download the folder and name that"
        ) from error
    return Path(fetched)


def _upload(folder: Path, place: str) -> None:
    import huggingface_hub

    try:
        huggingface_hub.create_repo(place, exist_ok=True)
        huggingface_hub.upload_folder(repo_id=place, folder_path=folder)
    except Exception as error:  # as above
        raise FetchError(
            f"{folder} is written, and cannot be uploaded to {place}: {first_line(error)}; see `hf"
            " auth login`, then `hf upload`"
        ) from error
