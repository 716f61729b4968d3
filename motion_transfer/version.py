"""Versions: the program's own, and those of the packages that it finds installed."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module

__version__ = "0.7.0"

MODULES = {"opencv-contrib-python-headless": "cv2", "pillow": "PIL"}
"""What a package is imported as, where it is installed under several names or another than that."""


def package_version(name: str) -> str:
    """Tell the version of an installed package, or `unknown`.

    Several distributions hold the same module: OpenCV comes as `opencv-python`, as conda's
    `opencv`, and so on; the one that is there counts.
    """
    from importlib.metadata import PackageNotFoundError, packages_distributions, version

    # a broken installation has no version, or no metadata at all
    with suppress(PackageNotFoundError, KeyError):
        if found := version(name):
            return found
    for other in packages_distributions().get(MODULES.get(name, name), []):
        with suppress(PackageNotFoundError, KeyError, ValueError, TypeError):  # or no name
            if found := version(other):
                return found
    # conda's OpenCV and a build of one's own may have no metadata; the module itself knows
    with suppress(ImportError):
        return str(getattr(import_module(MODULES.get(name, name)), "__version__", "unknown"))
    return "unknown"


def holders_of(module: str) -> list[str]:
    """List the distributions that hold a module; of several, the last one overwrote the others."""
    from importlib.metadata import packages_distributions

    return sorted(set(packages_distributions().get(module, [])))
