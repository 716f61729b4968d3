"""What a batch remembers between runs: its folder, its lock, and a journal of jobs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from motion_transfer.errors import OutputError
from motion_transfer.media.journal import Journal
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.media.work import WorkFolder, key_of, locked, work_path

TO_DO = "to do"
Record = dict[str, Any]


class BatchState:
    """Records of jobs by their output; the last one counts."""

    def __init__(self, manifest: Path, output_root: Path) -> None:
        self.folder = output_root / f".{manifest.stem}.batch"
        self.report = output_root / f"{manifest.stem}.report"
        self.pictures = self.report / "pictures"
        self.scratch = self.folder / "scratch"
        self.estimates = (self.folder / "estimates").absolute()
        self._manifest = manifest
        self._journal = Journal(self.folder / "journal.jsonl")
        self.records = {record["output"]: record for record in self._journal.read()}

    @contextmanager
    def held(self) -> Iterator[None]:
        """Be the only one at work on this manifest. Raises: OutputError if somebody else is."""
        with explain_disk_errors(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
        with locked(self.folder, f"manifest {self._manifest}"):
            self.records = {record["output"]: record for record in self._journal.repair()}
            yield

    def record(self, entry: Record) -> None:
        """Remember what became of a job. Raises: OutputError, and it is known to this run only."""
        self.records[entry["output"]] = entry
        with explain_disk_errors(self.folder):
            self._journal.append(entry)

    def status_of(self, output: Path) -> str:
        """`done`, `failed` or `to do`, as far as was noted and the output is still there."""
        word = self.records.get(str(output), {}).get("status", TO_DO)
        return TO_DO if word == "done" and not output.exists() else word

    def picture_stem(self, output: Path) -> Path:
        """Where the pictures of a job lie; jobs are known by their outputs, in whatever order."""
        return self.pictures / key_of({"output": output})[:16]

    def forget(self) -> None:
        """Remember nothing; for `--restart`, inside `held`."""
        (self.folder / "journal.jsonl").unlink(missing_ok=True)
        self.records = {}

    def clean(self, outputs: list[Path]) -> int:
        """Remove this folder and what is left of interrupted jobs; how many folders went.

        Outputs stay, and so does the report. Raises: OutputError while somebody is at work.
        """
        is_there = self.folder.exists()
        with self.held() if is_there else nullcontext():
            left = [output for output in outputs if work_path(output).exists()]
            for output in left:
                with WorkFolder(output) as work:
                    work.clear()
            try:
                if is_there:
                    shutil.rmtree(self.folder)
            except OSError as error:
                raise OutputError(f"cannot remove {self.folder}: {error.strerror}") from error
        return len(left) + is_there
