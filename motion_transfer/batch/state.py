"""What a batch remembers between runs: its folder, its lock, a journal of jobs, and their files.

Whether the files that an output was made from are still the same is told without decoding them, see
`media/unchanged.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError, OutputError
from motion_transfer.media.publish import explain_disk_errors, extend_name
from motion_transfer.media.unchanged import content_key
from motion_transfer.media.work import (
    Journal,
    WorkFolder,
    key_of,
    locked,
    remove_held,
    remove_lock,
    work_path,
)
from motion_transfer.option import list_options
from motion_transfer.render.inputs import appearance_files, audio_files, motion_files
from motion_transfer.render.options import RenderOptions
from motion_transfer.version import __version__

NOT_DRAWN = ("workers", "restart", "force")
"""Options that decide nothing of an output."""

DONE, TO_DO = "done", "to do"
Record = dict[str, Any]
"""What became of a job, as a line of the journal."""

Signature = dict[str, Any]
Files = dict[str, list[str]]
"""By path: a key of its status, and one of its content, see `Inputs.keys`."""


def sign(options: RenderOptions, files: Files) -> Signature:
    """Note what tells a published output from another. Raises: OSError."""
    return {"options": _options_key(options), "files": files, "output": file_status(options.output)}


def is_current(
    options: RenderOptions, signature: Signature, status_of: Callable[[Path], str]
) -> bool:
    """Tell whether the output is there, untouched, and made from these options and this content.

    Args:
        status_of: `status_key`, which may remember the inputs that jobs share.
    """
    try:
        if signature["options"] != _options_key(options):
            return False
        if signature["output"] != file_status(options.output):
            return False
        parts = (motion_files(options), appearance_files(options), audio_files(options))
        paths = {str(path): path for part in parts for path in part}
        return paths.keys() == signature["files"].keys() and all(
            signature["files"][name][0] == status_of(path)
            or signature["files"][name][1] == content_key(path)
            for name, path in paths.items()
        )
    except (OSError, InputError, KeyError):
        return False


def is_ours(options: RenderOptions, signature: Signature) -> bool:
    """Tell whether the output is the one that the signature's job made, from whatever."""
    try:
        return signature.get("output") == file_status(options.output)
    except OSError:
        return False


def _options_key(options: RenderOptions) -> str:
    names = [e.name for e in list_options(RenderOptions) if e.name not in NOT_DRAWN]
    return key_of({"version": __version__, **{name: getattr(options, name) for name in names}})


def file_status(path: Path) -> str:
    """Make a key of size, time and inode of an output, or of a folder's files. Raises: OSError."""
    files = sorted(f for f in path.iterdir() if f.is_file()) if path.is_dir() else [path]
    return key_of({f.name: [(s := f.stat()).st_size, s.st_mtime_ns, s.st_ino] for f in files})


class BatchState:
    """What is kept of a manifest's runs, hidden in its output root.

    Attributes:
        report: The folder of the report, which is for people to look at.
        scratch: Where local workers hand each other results.
        estimates: Where the IUV of drivers is kept that are raw pictures.
        manifest: The file; paths in the report are told from its folder.
        records: Those of jobs by their output; the last one of each counts.
    """

    def __init__(self, manifest: Path, output_root: Path) -> None:
        self.folder = output_root / ("." + extend_name(manifest.stem, ".batch"))
        self.report = output_root / extend_name(manifest.stem, ".report")
        self.scratch = self.folder / "scratch"
        self.estimates = (self.folder / "estimates").absolute()
        self.manifest = manifest
        self._journal = Journal(self.folder / "journal.jsonl")
        self.records = {record["output"]: record for record in self._journal.read()}

    @contextmanager
    def held(self) -> Iterator[None]:
        """Be the only one at work on this manifest. Raises: OutputError if somebody else is."""
        with explain_disk_errors(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder, f"manifest {self.manifest}"):
            self.records = {record["output"]: record for record in self._journal.repair()}
            yield

    def record(self, entry: Record) -> None:
        """Remember what became of a job. Raises: OutputError, and it is known to this run only."""
        self.records[entry["output"]] = entry
        with explain_disk_errors(self.folder):
            self._journal.append(entry)

    def status_of(self, output: Path) -> str:
        """Say `done`, `failed` or `to do`, as far as was noted and the output is still there."""
        word = self.records.get(str(output), {}).get("status", TO_DO)
        return TO_DO if word == DONE and not output.exists() else word

    def picture_stem(self, output: Path) -> Path:
        """Say where a job's pictures lie; jobs are known by their outputs, in whatever order."""
        return self.report / "pictures" / key_of({"output": output})[:16]

    def forget(self) -> None:
        """Remember nothing; for `--restart`, inside `held`."""
        (self.folder / "journal.jsonl").unlink(missing_ok=True)
        self.records = {}

    def clean(self, outputs: list[Path]) -> int:
        """Remove this folder and what is left of interrupted jobs; count the folders that went.

        Outputs stay, and so does the report. Raises: OutputError while somebody is at work.
        """
        is_there = self.folder.exists()  # or the lock would make it
        with self.held() if is_there else nullcontext():
            left = [output for output in outputs if work_path(output).exists()]
            for output in left:
                with WorkFolder(output) as work:
                    work.clear()
            try:
                leaves_lock = is_there and remove_held(self.folder)
            except OSError as error:
                raise OutputError(f"cannot remove {self.folder}: {error.strerror}") from error
        if leaves_lock:
            remove_lock(self.folder)
        return len(left) + is_there
