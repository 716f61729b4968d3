"""Folders of photos of synthetic people, with their IUV, alpha and description.

OUT/people.json             the settings, by which the folder is known
OUT/pairs.csv               source,target: pictures of one person, relative to OUT
OUT/000000/person.json      who it is, and each shot
OUT/000000/0.png            a photo; 0_IUV.png its IUV (file RGB = V, U, I), 0_alpha.png
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from motion_transfer.errors import InputError
from motion_transfer.extras import require_extra
from motion_transfer.media.growing import MakeItem, claim_folder, make_items, write_whole
from motion_transfer.media.pictures.photo import write_png
from motion_transfer.media.publish import explain_disk_errors, publish
from motion_transfer.people.dataset import PeopleStream, Split, check_numbering
from motion_transfer.people.figure.camera import Framing, check_size
from motion_transfer.people.free.assets import check_share, load_assets
from motion_transfer.people.picture.iuv_noise import IuvNoise
from motion_transfer.version import __version__

SETTINGS_FILE = "people.json"
LONGEST_SIDE = 2048  # pixels; chosen as a bound against slips of the pen


@dataclass(frozen=True, kw_only=True)
class AlbumOptions:
    """What to photograph.

    Attributes:
        out: Folder to write to. One that holds people of the same settings is completed.
        count: How many people.
        views: Photos of each.
        size: (width, height) in px.
        noise: Share of the photos whose IUV gets DensePose's faults, 0 to 1.
        framing: What the photos show of the body; None: mixed.
        assets: Folder of MakeHuman's assets, which free people wear; None: there are none of them.
        free_share: Of free people among all, 0 to 1; None: a half where there are assets.
        workers: Processes; None: one for each core. Never changes what is written.
    Raises: InputError for a value out of its range.
    """

    out: Path
    count: int
    views: int = 2
    seed: int = 0
    split: Split = "train"
    size: tuple[int, int] = (256, 256)
    noise: float = 0.0
    framing: Framing | None = None
    assets: Path | None = None
    free_share: float | None = None
    workers: int | None = None

    def __post_init__(self) -> None:
        for name in ("count", "views", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"{name} is {value}; it must be at least 1")
        check_numbering(self.seed, self.split)
        if not 0 <= self.noise <= 1:
            raise InputError(f"noise is {self.noise}; it is a share of the photos, 0 to 1")
        check_size(self.size, 32, LONGEST_SIDE)
        check_share(self.free_share, self.assets)

    @property
    def settings(self) -> dict[str, Any]:
        """What decides a person's bytes, for JSON. Raises: InputError for unusable assets."""
        left_out = ("out", "count", "workers", "assets", "free_share")
        kept = {name: value for name, value in asdict(self).items() if name not in left_out}
        if self.assets:  # what is in the folder counts, not where it lies
            kept["assets"] = load_assets(self.assets).digest
            kept["free_share"] = check_share(self.free_share, self.assets)
        return {"motion-transfer": __version__, **kept, "size": list(self.size)}


def write_album(options: AlbumOptions, done: Callable[[int], object] = int) -> int:
    """Photograph people into a folder; people who are there already stay as they are.

    Args:
        done: Called with how many more people are finished.
    Returns: How many people were added.
    Raises: OutputError if the folder holds something else or cannot be written. Whatever happens,
        each person's folder is whole or absent.
    """
    require_extra("people")
    with explain_disk_errors(options.out):
        claim_folder(options.out / SETTINGS_FILE, options.settings, "people")
        missing = [n for n in range(options.count) if not _folder(options.out, n).exists()]
        done(options.count - len(missing))
        make_items(missing, partial(_open_photographer, options), options.workers, done)
        _write_pairs(options)
    return len(missing)


def _open_photographer(options: AlbumOptions) -> MakeItem:
    people = PeopleStream(
        seed=options.seed,
        split=options.split,
        size=options.size,
        noise=IuvNoise.densepose() if options.noise else None,
        noisy_share=options.noise,
        framing=options.framing,
        assets=options.assets,
        free_share=options.free_share,
    )
    return partial(_photograph, options, people)


def _photograph(options: AlbumOptions, people: PeopleStream, number: int) -> None:
    """Write one person's folder."""
    dressed = people.dress(number)
    final = _folder(options.out, number)
    folder = Path(tempfile.mkdtemp(prefix=f".{final.name}.work-", dir=options.out))
    try:
        shots = []
        for view in range(options.views):
            shot = people.shot(number, view)
            photo = people.take(dressed, shot)
            write_png(folder / f"{view}.png", photo.rgb)
            write_png(folder / f"{view}_IUV.png", photo.iuv[..., ::-1])
            write_png(folder / f"{view}_alpha.png", photo.alpha)
            shots.append({**shot.description(), "camera": asdict(photo.camera)})
        person = dressed.person.description()
        if options.assets:  # where there are two kinds, each says which it is
            person = {"kind": "painted", **person}
        description = {"number": number, "person": person, "shots": shots}
        described = json.dumps(description, indent=1) + "\n"
        (folder / "person.json").write_text(described, encoding="utf-8")
        folder.chmod(0o755)  # mkdtemp keeps others out
        publish(folder, final)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _write_pairs(options: AlbumOptions) -> None:
    """List the ordered pairs of different photos of one person, for everybody in the folder."""
    lines = ["source,target"]
    for folder in sorted(path for path in options.out.iterdir() if path.name.isdigit()):
        names = [f"{folder.name}/{view}.png" for view in range(options.views)]
        lines += [f"{a},{b}" for a in names for b in names if a != b]
    write_whole(options.out / "pairs.csv", "\n".join(lines) + "\n")


def _folder(out: Path, number: int) -> Path:
    return out / f"{number:06d}"
