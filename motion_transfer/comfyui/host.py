"""What ComfyUI lends its nodes: folders, a bar of progress, and the button that cancels.

Its modules are there only inside it, and are imported when a node runs.
"""

from __future__ import annotations

import logging
import os
from importlib import import_module
from mimetypes import guess_type
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.events import Event, FramesDone, Notice, Stage
from motion_transfer.extras import missing_packages
from motion_transfer.media.iuv.formats import iuv_suffixes, names_file
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES
from motion_transfer.media.unchanged import status_key
from motion_transfer.preview.choices import FIRST_MOTION, FIRST_PERSON
from motion_transfer.render.inputs import CAPTURED
from motion_transfer.render.options import is_kept
from motion_transfer.weights import SHIPPED, find_weights

OWN_FOLDER = "motion_transfer"
"""Below ComfyUI's folders of models and of temporary files."""
NOTHING = "nothing"
"""The name of a file where a node takes what is connected."""
EXAMPLE_PERSON, EXAMPLE_DANCE = "Example person", "Example dance"
EXAMPLES = {EXAMPLE_PERSON: FIRST_PERSON, EXAMPLE_DANCE: FIRST_MOTION}
"""What comes with the package, so that a first workflow runs without a file of one's own."""

LOG = logging.getLogger(__name__)


class Progress:
    """Hears how far the work of a node is; it ends the node when somebody has cancelled it."""

    def __init__(self) -> None:
        self._bar: Any = None

    def __call__(self, event: Event) -> None:
        import_module("comfy.model_management").throw_exception_if_processing_interrupted()
        if isinstance(event, Stage):
            self._bar = import_module("comfy.utils").ProgressBar(event.frame_count)
        elif isinstance(event, FramesDone) and self._bar is not None:
            self._bar.update(event.frame_count)
        elif isinstance(event, Notice):
            LOG.warning(event.message)


def list_sources() -> list[str]:
    """List what lies in ComfyUI's input folder and may show a person, and the example."""
    iuv = tuple(f"_iuv{suffix}" for suffix in iuv_suffixes())
    return [
        NOTHING,
        *(
            file.name
            for file in _list_input()
            if (_shows_something(file) or is_kept(file)) and not file.name.lower().endswith(iuv)
        ),
        EXAMPLE_PERSON,
    ]


def list_drivers() -> list[str]:
    """List what lies in ComfyUI's input folder and may move, and the motions that are built in."""
    arrays = iuv_suffixes(several=True)
    given = [
        f"people:{file.name}" if file.suffix.lower() == CAPTURED else file.name
        for file in _list_input()
        if _shows_something(file) or file.suffix.lower() in (*arrays, CAPTURED)
    ]
    if missing_packages("people"):
        return [NOTHING, *given, EXAMPLE_DANCE]
    from motion_transfer.people import MOTIONS

    return [NOTHING, *given, EXAMPLE_DANCE, *(f"people:{name}" for name in MOTIONS)]


def _list_input() -> list[Path]:
    """List the files and folders of the input folder, by name; not those of its folders."""
    entries = Path(_folders().get_input_directory()).iterdir()
    return sorted(entry for entry in entries if not entry.name.startswith("."))


def _shows_something(file: Path) -> bool:
    """Tell by its name whether it is a picture or a video; any folder may hold pictures."""
    if file.suffix.lower() in PHOTO_SUFFIXES or file.is_dir():
        return True
    kind, _ = guess_type(file.name)
    return kind is not None and kind.startswith("video/")


def find_input(name: str) -> Path:
    """Find what a node names, below ComfyUI's input folder, or a motion such as `people:walk`.

    Whoever may queue a workflow need not be allowed to read everything on the machine. A link in
    the input folder, which its owner has put there, may lead elsewhere.
    Raises: InputError.
    """
    if name in EXAMPLES:
        return EXAMPLES[name]
    if not names_file(name):
        scheme, _, motion = name.partition(":")
        captured, comma, settings = motion.partition(",")
        if Path(captured).suffix.lower() == CAPTURED:
            captured = str(find_input(captured))
        return Path(f"{scheme}:{captured}{comma}{settings}")
    root = os.path.abspath(_folders().get_input_directory())  # noqa: PTH100 - links stay links
    path = os.path.abspath(os.path.join(root, name))  # noqa: PTH100, PTH118
    if not path.startswith(root + os.sep):
        raise InputError(f"{name} is not in ComfyUI's input folder; put it there, or a link to it")
    if not os.path.exists(path):  # noqa: PTH110
        raise InputError(f"{name} does not exist in ComfyUI's input folder, {root}")
    return Path(path)


def explain(name: str) -> bool | str:
    """Tell whether a node can use what it names, as `VALIDATE_INPUTS` is to: True, or why not."""
    try:
        if name:
            find_input(name)
    except InputError as error:
        return str(error)
    return True


def key_of_input(name: str) -> str:
    """Make a key that changes when what a node names does, as `IS_CHANGED` is to."""
    try:
        if not name:
            return ""
        if name in EXAMPLES:
            return name
        motion = name.partition(":")[2].partition(",")[0]
        if not names_file(name) and Path(motion).suffix.lower() != CAPTURED:
            return name
        return status_key(find_input(name if names_file(name) else motion))
    except InputError:  # which the node itself says
        return ""


def temporary_folder() -> Path:
    """Give a folder that ComfyUI empties when it starts."""
    folder = Path(_folders().get_temp_directory()) / OWN_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def list_weights() -> list[str]:
    """List the checkpoints that ship, and those in `models/motion_transfer`."""
    folders = _folders()
    if OWN_FOLDER not in folders.folder_names_and_paths:
        folder = Path(folders.models_dir) / OWN_FOLDER
        folders.add_model_folder_path(OWN_FOLDER, str(folder))
    names = folders.get_filename_list(OWN_FOLDER)
    return [*SHIPPED, *(name for name in names if name.endswith(".safetensors"))]


def find_listed_weights(name: str) -> Path:
    """Find a checkpoint that `list_weights` names. Raises: WeightsError, InputError."""
    if name in SHIPPED:
        return find_weights(Path(name))
    path = _folders().get_full_path(OWN_FOLDER, name)
    if path is None:
        raise InputError(f"weights {name} are not in ComfyUI's models/{OWN_FOLDER} any more")
    return Path(path)


def _folders() -> Any:
    return import_module("folder_paths")
