"""How good the weights are on real photos: `docs/quality.md` has what this prints.

    MT_SAMPLES=DIR python benchmarks/quality.py photos  [--weights lite]
    MT_SAMPLES=DIR python benchmarks/quality.py flicker [--weights lite]

`photos`: fashion photos from themselves, network against draft (the photos cannot be shipped).
`flicker`: change between consecutive frames that motion does not explain, over a walk of 90 frames.
The numbers on synthetic people come from `mt eval --protocol people`.
"""

from __future__ import annotations

import argparse
import csv
import os
import tempfile
from pathlib import Path
from statistics import mean

from motion_transfer.cli.main import main as mt
from motion_transfer.media.iuv.opening import find_iuv_of, open_reader, open_stream
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.render.options import RenderOptions
from motion_transfer.render.run import run
from motion_transfer.training.metrics import flicker


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=("photos", "flicker"))
    parser.add_argument("--weights", type=Path, default=Path("lite"))
    arguments = parser.parse_args()
    samples = Path(os.environ["MT_SAMPLES"])
    with tempfile.TemporaryDirectory() as folder:
        if arguments.what == "photos":
            compare_photos(samples / "deepfashion", arguments.weights, Path(folder))
        else:
            compare_flicker(samples, arguments.weights, Path(folder))


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


def compare_flicker(samples: Path, weights: Path, folder: Path) -> None:
    driver = samples / "drivers" / "walk_turn_iuv"
    reader = open_reader(open_stream(driver))
    poses = list(reader.read(0, reader.stream.frame_count))
    for photo in list_photos(samples / "deepfashion"):
        found = {}
        for renderer in ("nhrr", "texture"):
            output = folder / f"{photo.stem}-{renderer}"
            run(
                RenderOptions(
                    source=photo,
                    driver=driver,
                    output=output,
                    renderer=renderer,
                    weights=weights if renderer == "nhrr" else None,
                )
            )
            frames = [read_photo(path).rgb for path in sorted(output.iterdir())]
            steps = zip(frames, poses, frames[1:], poses[1:], strict=False)
            found[renderer] = mean(flicker(*step) for step in steps)
        ratio = found["nhrr"] / found["texture"]
        print(
            f"{photo.stem}: nhrr {found['nhrr']:.2f}, texture {found['texture']:.2f} of 255,"
            f" ratio {ratio:.2f}"
        )


if __name__ == "__main__":
    main()
