"""What methods made, under names that they share: the items of a study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError
from motion_transfer.evaluation.result_names import item_name
from motion_transfer.media.folders import list_files, natural_key
from motion_transfer.media.pictures.formats import PHOTO_SUFFIXES, VIDEO_SUFFIXES

IMAGES_FOLDER, EVALUATION_FILE = "images", "results.json"
"""Where `mt eval --save-images` writes a folder for each method, and the file beside it."""

ANIMATED = (".gif", ".apng")  # no video to a browser: they cannot be started together
MISSING_SHOWN = 3

Say = Callable[[str], None]


@dataclass(frozen=True)
class MethodFolder:
    """What one method made: a file for each item."""

    label: str
    path: Path
    files: dict[str, Path]


def is_video(path: Path) -> bool:
    """Tell whether a result is a video, by its name."""
    return path.suffix.lower() in VIDEO_SUFFIXES


def open_methods(results: Sequence[str]) -> list[MethodFolder]:
    """Open the folders that were named, in order; an evaluation's is one for each of its methods.

    Raises: InputError if one is missing or empty, or labels or names are there twice.
    """
    methods: list[MethodFolder] = []
    for words in results:
        label, path = _split_label(words)
        folders = _method_folders(path)
        if label and len(folders) > 1:
            raise InputError(
                f"{path} holds {len(folders)} methods, which {label!r} cannot all be called; name"
                " one of the folders in its images/"
            )
        methods += [_open(label or folder.resolve().name, folder) for folder in folders]
    if len(methods) < 2:
        raise InputError(f"a study compares two methods or more; {len(methods)} was given")
    labels = [method.label for method in methods]
    for method in reversed(methods):
        if labels.count(method.label) > 1:
            raise InputError(
                f"two methods are called {method.label!r}; rename one, as NAME={method.path}"
            )
    return methods


def shared_items(methods: Sequence[MethodFolder], notice: Say) -> list[str]:
    """List the items that every method has, in natural order; others are told of in one line.

    Raises: InputError if there are none, or one is a picture here and a video there.
    """
    common = set.intersection(*(set(method.files) for method in methods))
    if not common:
        examples = ", ".join(f"{m.path}/{next(iter(m.files.values())).name}" for m in methods)
        raise InputError(f"no name is shared by all methods; such as {examples}")
    lacking = {
        item: [method.label for method in methods if item not in method.files]
        for item in set.union(*(set(method.files) for method in methods)) - common
    }
    if lacking:
        told = sorted(lacking)[:MISSING_SHOWN]
        words = "; ".join(f"{item} (not of {', '.join(lacking[item])})" for item in told)
        more = f" and {len(lacking) - len(told)} more" if len(lacking) > len(told) else ""
        notice(f"left out, as not all methods have them: {words}{more}")
    for item in sorted(common):
        if len({is_video(method.files[item]) for method in methods}) > 1:
            files = ", ".join(str(method.files[item]) for method in methods)
            raise InputError(f"{item} is a picture and a video: {files}; make all of them one kind")
    return sorted(common, key=natural_key)


def find_sources(folder: Path, items: Sequence[str]) -> dict[str, Path]:
    """Find each item's source: the photo with whose name the item's begins, the longest such.

    Raises: InputError if there is no such folder, or an item has none.
    """
    if not folder.is_dir():
        raise InputError(f"sources {folder} is not a folder")
    photos = {
        item_name("-".join(file.relative_to(folder).with_suffix("").parts)): file
        for file in sorted(folder.rglob("*"))
        if file.suffix.lower() in PHOTO_SUFFIXES and not file.name.startswith(".")
    }
    found = {}
    for item in items:
        starts = [item[:end] for end in range(len(item), 0, -1) if item[end:][:1] in ("", "_")]
        name = next((start for start in starts if start in photos), None)
        if name is None:
            raise InputError(
                f"sources {folder}: no photo has the name with which {item} begins; it should be"
                f" called {item.split('__')[0]}.png"
            )
        found[item] = photos[name]
    return found


def _split_label(words: str) -> tuple[str | None, Path]:
    """Read `NAME=FOLDER`, or a folder alone, which may have such a name itself."""
    label, equals, path = words.partition("=")
    if not equals or Path(words).is_dir():
        return None, Path(words)
    if not label.strip():
        raise InputError(f"{words!r} has no name before its =; write NAME=FOLDER")
    return label.strip(), Path(path)


def _method_folders(path: Path) -> list[Path]:
    if not path.is_dir():
        raise InputError(f"results {path} is not a folder")
    images = path / IMAGES_FOLDER
    if not images.is_dir():
        if (path / EVALUATION_FILE).is_file():
            raise InputError(f"{path} holds no images; evaluate once more, with --save-images")
        return [path]
    return [folder for folder in list_files(images) if folder.is_dir()] or [images]


def _open(label: str, folder: Path) -> MethodFolder:
    files: dict[str, Path] = {}
    for file in list_files(folder):
        suffix = file.suffix.lower()
        if suffix in ANIMATED:
            raise InputError(f"{file} is an animation; make a video of it, such as .mp4")
        if suffix not in (*PHOTO_SUFFIXES, *VIDEO_SUFFIXES):
            continue
        item = item_name(file.name[: -len(suffix)])
        if item in files:
            raise InputError(f"{files[item]} and {file} go by one name, {item}; rename one")
        files[item] = file
    if not files:
        raise InputError(f"results {folder} holds no pictures and no videos")
    return MethodFolder(label, folder, files)
