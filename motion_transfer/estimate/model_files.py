"""BlazePose's two model files: where they lie, and whether they are what they should be.

They are part of the PyPI package mediapipe (Apache-2.0), in a version that fits no environment of
today; only the files are taken out of its wheel, see `model_fetch.py`.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import InputError

WHEEL_REQUIREMENT = "mediapipe==0.10.14"
"""The last versions' wheels no longer carry the files."""

CACHE_VARIABLE = "MT_CACHE_DIR"


@dataclass(frozen=True)
class ModelFile:
    """A file that is fetched.

    Attributes:
        name: in the cache.
        member: inside the wheel.
    """

    name: str
    member: str
    size_bytes: int
    sha256: str


DETECTOR = ModelFile(
    "pose_detection.tflite",
    "mediapipe/modules/pose_detection/pose_detection.tflite",
    2_959_046,
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
)
LANDMARKER = ModelFile(
    "pose_landmark_full.tflite",
    "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
    6_440_512,
    "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
)
MODEL_FILES = (DETECTOR, LANDMARKER)


def models_folder() -> Path:
    """Where the files lie: $MT_CACHE_DIR/models, or motion-transfer/models in the user's cache
    ($XDG_CACHE_HOME, or ~/.cache)."""
    if chosen := os.environ.get(CACHE_VARIABLE):
        return Path(chosen).expanduser() / "models"
    cache = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG specification says to ignore relative paths
    base = Path(cache) if Path(cache).is_absolute() else Path.home() / ".cache"
    return base / "motion-transfer" / "models"


def is_there(file: ModelFile) -> bool:
    """Whether a file lies in the cache, whole as far as its size tells."""
    path = models_folder() / file.name
    return path.is_file() and path.stat().st_size == file.size_bytes


def find_model(file: ModelFile) -> Path:
    """A file's path, its content checked.

    Raises: InputError if it is not there or damaged, with the command that fetches it.
    """
    path = models_folder() / file.name
    if not path.is_file():
        raise InputError(
            f"the model {file.name} is not in {path.parent}; `mt models fetch` fetches it"
            " (once; 9 MB are kept)"
        )
    if digest(path.read_bytes()) != file.sha256:
        raise InputError(f"{path} is damaged; `mt models fetch` fetches it anew")
    return path


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(content).hexdigest()
