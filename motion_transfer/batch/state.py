"""What a batch remembers between runs: its folder, its lock, and a journal of jobs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from motion_transfer.errors import OutputError
from motion_transfer.media.journal import Journal
from motion_transfer.media.publish import explain_disk_errors
from motion_transfer.media.work import locked, work_path

Record = dict[str, Any]


class BatchState:
    """Records of jobs by their output; the last one counts."""

    def __init__(self, manifest: Path, output_root: Path) -> None:
        self.folder = output_root / f".{manifest.stem}.batch"
        self.pictures = self.folder / "pictures"
        self.scratch = self.folder / "scratch"
        self.estimates = (self.folder / "estimates").absolute()
        self._manifest = manifest
        self._journal = Journal(self.folder / "journal.jsonl")
        self.records = {record["output"]: record for record in self._journal.read()}

    @contextmanager
    def held(self) -> Iterator[None]:
        """Be the only one at work on this manifest. Raises: OutputError if somebody else is."""
        with explain_disk_errors(self.folder):
            self.pictures.mkdir(parents=True, exist_ok=True)
        with locked(self.folder, f"manifest {self._manifest}"):
            self.records = {record["output"]: record for record in self._journal.repair()}
            yield

    def record(self, entry: Record) -> None:
        """Remember what became of a job."""
        self._journal.append(entry)
        self.records[entry["output"]] = entry

    def forget(self) -> None:
        """Remember nothing; for `--restart`, inside `held`."""
        (self.folder / "journal.jsonl").unlink(missing_ok=True)
        self.records = {}

    def clean(self, outputs: list[Path]) -> int:
        """Remove this folder and what is left of interrupted jobs; how many folders went.

        Outputs stay. Raises: OutputError while somebody is at work.
        """
        if self.folder.exists():
            with self.held():
                pass
        removed = 0
        for folder in [self.folder, *map(work_path, outputs)]:
            if folder.exists():
                try:
                    shutil.rmtree(folder)
                except OSError as error:
                    raise OutputError(f"cannot remove {folder}: {error.strerror}") from error
                removed += 1
        return removed
