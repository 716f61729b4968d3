"""How good the weights are: `docs/quality.md` has what this prints.

    MT_SAMPLES=DIR python benchmarks/quality.py photos  [--weights lite]
    MT_SAMPLES=DIR python benchmarks/quality.py flicker [--weights lite]
    MT_SAMPLES=DIR python benchmarks/quality.py checkerboard [--weights lite]
    python benchmarks/quality.py behind [--weights lite ...] [--assets DIR] [--count 100]

`photos`: fashion photos from themselves, network against draft (the photos cannot be shipped).
`flicker`: change between consecutive frames that motion does not explain, over a walk of 90 frames.
`checkerboard`: over the same walk, patterns of a period of 2, 4 and 8 px where the draft is smooth.
`behind`: held-out synthetic people photographed from behind, drawn facing the camera: in how many a
face is found, and whose, against the real pictures (needs `mt models fetch --faces`).
The numbers on synthetic people come from `mt eval --protocol people`.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean

import numpy as np

from motion_transfer.cli.main import main as mt
from motion_transfer.evaluation.candidates import (
    Draw,
    OpenedSource,
    RenderedCandidate,
    TargetCandidate,
)
from motion_transfer.evaluation.framing import Framing
from motion_transfer.evaluation.measures import choose_measures
from motion_transfer.evaluation.report import summarise_methods, table
from motion_transfer.evaluation.scoring import Scorer
from motion_transfer.media.iuv.formats import find_iuv_of
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.people import PeopleStream
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.run import run
from motion_transfer.training.metrics import (
    LATTICE_PERIODS,
    Image,
    flat_windows,
    flicker,
    lattice_energy,
)
from motion_transfer.training.pairs import Pair, PairList
from motion_transfer.training.pictures import PersonPicture, lay_over
from motion_transfer.training.sources import HELD_OUT_SEED
from motion_transfer.weights import find_weights

RENDERERS = ("nhrr", "texture")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=("photos", "flicker", "checkerboard", "behind"))
    parser.add_argument("--weights", type=Path, nargs="+", default=[Path("lite")])
    parser.add_argument("--assets", type=Path, help="free people, in these assets, not painted")
    parser.add_argument("--count", type=int, default=100, help="people seen from behind")
    arguments = parser.parse_args()
    if arguments.what == "behind":
        compare_behind(arguments.weights, arguments.assets, arguments.count)
        return
    samples = Path(os.environ["MT_SAMPLES"])
    for weights in arguments.weights:
        with tempfile.TemporaryDirectory() as folder:
            if arguments.what == "photos":
                compare_photos(samples / "deepfashion", weights, Path(folder))
            elif arguments.what == "flicker":
                compare_flicker(samples, weights, Path(folder))
            else:
                compare_lattices(samples, weights, Path(folder))


def list_photos(folder: Path) -> list[Path]:
    """Those with an IUV beside them."""
    return [path for path in sorted(folder.glob("*.png")) if find_iuv_of(path)]


def compare_photos(fashion: Path, weights: Path, folder: Path) -> None:
    table = folder / "self.csv"
    with table.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["source", "target"])
        writer.writerows([[path.name, path.name] for path in list_photos(fashion)])
    options = ["--pairs", table, "--images", fashion, "--weights", weights]
    mt([str(word) for word in ("eval", *options, "--renderer", "texture", "-o", folder / "out")])


@dataclass(frozen=True)
class Walk:
    """A photo's walk: the driver's IUV, and the frames of each of RENDERERS."""

    poses: list[Image]
    frames: dict[str, list[Image]]


def walk(samples: Path, photo: Path, weights: Path, folder: Path) -> Walk:
    driver = samples / "drivers" / "walk_turn_iuv"
    reader = open_reader(open_stream(driver))
    drawn = {}
    for renderer in RENDERERS:
        output = folder / f"{photo.stem}-{renderer}"
        run(
            RenderOptions(
                source=(photo,),
                driver=driver,
                output=output,
                renderer=renderer,
                weights=weights if renderer == "nhrr" else None,
            )
        )
        drawn[renderer] = [read_photo(path).rgb for path in sorted(output.iterdir())]
    return Walk(list(reader.read(0, reader.stream.frame_count)), drawn)


def compare_flicker(samples: Path, weights: Path, folder: Path) -> None:
    for photo in list_photos(samples / "deepfashion"):
        walked = walk(samples, photo, weights, folder)
        found = {}
        for renderer, frames in walked.frames.items():
            steps = zip(frames, walked.poses, frames[1:], walked.poses[1:], strict=False)
            found[renderer] = mean(flicker(*step) for step in steps)
        ratio = found["nhrr"] / found["texture"]
        print(
            f"{photo.stem}: nhrr {found['nhrr']:.2f}, texture {found['texture']:.2f} of 255,"
            f" ratio {ratio:.2f}"
        )


def compare_lattices(samples: Path, weights: Path, folder: Path) -> None:
    """Medians over the frames that have a smooth window."""
    for photo in list_photos(samples / "deepfashion"):
        walked = walk(samples, photo, weights, folder)
        windows = [
            flat_windows(frame, iuv[..., 0] > 0)
            for frame, iuv in zip(walked.frames["texture"], walked.poses, strict=True)
        ]
        print(f"{photo.stem}: {sum(map(len, windows))} windows, levels^2 of 255")
        for renderer, frames in walked.frames.items():
            energies = [lattice_energy(*each) for each in zip(frames, windows, strict=True)]
            medians = np.nanmedian(energies, axis=0)
            words = [f"{p} px {e:.2f}" for p, e in zip(LATTICE_PERIODS, medians, strict=True)]
            print(f"  {renderer}: {', '.join(words)}")


@dataclass(frozen=True)
class TurnedPhoto:
    """A photo of somebody who is turned by an angle and looks straight ahead."""

    people: PeopleStream
    number: int
    view: int
    turn: float

    @property
    def name(self) -> str:
        return f"{self.number:06d}/{self.view}.png"

    def load(self) -> PersonPicture:
        shot = self.people.shot(self.number, self.view)
        head = replace(shot.pose.head, turn=0.0)
        shot = replace(shot, pose=replace(shot.pose, turn=self.turn, head=head))
        photo = self.people.take(self.people.dress(self.number), shot)
        return PersonPicture(self.name, photo.rgb, photo.iuv, photo.alpha)


class Truth(TargetCandidate):
    """The real pictures on white, as the targets are that everything is compared with."""

    def open_source(self, _source: OpenedSource) -> Draw:
        def draw(_pair: Pair, target: PersonPicture) -> Image:
            assert target.alpha is not None
            return lay_over(target.rgb, target.alpha, (255, 255, 255))

        return draw


def compare_behind(weights: Sequence[Path], assets: Path | None, count: int) -> None:
    share = 1.0 if assets else None
    people = PeopleStream(seed=HELD_OUT_SEED, split="held-out", assets=assets, free_share=share)
    pairs = [
        Pair(
            TurnedPhoto(people, number, 0, math.pi), TurnedPhoto(people, number, 1, 0), str(number)
        )
        for number in range(count)
    ]
    candidates = [
        *(RenderedCandidate("nhrr", find_weights(each), "white") for each in weights),
        RenderedCandidate("texture", None, "white"),
        Truth(),
    ]
    measures = choose_measures(["head", "faces", "identity"])
    framing = Framing()
    with Scorer(candidates, measures, framing, workers=2) as scorer:
        scored = scorer.score(PairList("behind", pairs, ""))
    print(table(measures.columns, summarise_methods(candidates, measures, scored), count))


if __name__ == "__main__":
    main()
