"""What learning a person gives and costs: `docs/sources.md` has what this prints.

    MT_SAMPLES=DIR python benchmarks/adaptation.py photos [--steps N]
    python benchmarks/adaptation.py people [--count 8] [--photos 1] [--steps N]

`photos`: fashion photos from themselves, as `quality.py photos` (the photos cannot be shipped).
`people`: held-out synthetic people, who are learned from `--photos` views and drawn in six others:
the perceptual distance of what those views show, and of what none of them shows.
Both print what it is without learning, what it is with it, and how long learning takes.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from motion_transfer.drawing.backgrounds import make_background
from motion_transfer.drawing.canvas import draw_over
from motion_transfer.drawing.engines import Execution
from motion_transfer.drawing.engines.torch_engine import TorchEngine
from motion_transfer.drawing.person import bounding_box
from motion_transfer.drawing.renderers.network import (
    NeuralRenderer,
)
from motion_transfer.drawing.source import SourcePicture, read_person, unfold_source
from motion_transfer.drawing.window import plan_window
from motion_transfer.evaluation.framing import Framing
from motion_transfer.evaluation.measures import open_efficientnet, to_tensor
from motion_transfer.media.iuv.formats import find_iuv_of
from motion_transfer.media.pictures.photo import read_photo
from motion_transfer.people import PeopleStream
from motion_transfer.render.adapted import demo_poses
from motion_transfer.training.adaptation import adapt_model
from motion_transfer.training.adaptation_settings import AdaptationSettings
from motion_transfer.training.feature_networks import load_efficientnet_lite0
from motion_transfer.training.metrics import feature_distance, shown_pixels
from motion_transfer.training.pictures import PersonPicture
from motion_transfer.training.sources import HELD_OUT_SEED, HELD_OUT_SIZE
from motion_transfer.weights import DEFAULT_WEIGHTS, find_weights
from motion_transfer.weights.checkpoint import load_checkpoint
from nhrr_core import NeuralReRenderer

TARGETS = 6
COLUMNS = ("person", "visible", "hidden")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=("photos", "people"))
    parser.add_argument("--count", type=int, default=8, help="people")
    parser.add_argument("--photos", type=int, default=1, help="of each of them to learn from")
    parser.add_argument("--steps", type=int, default=AdaptationSettings.steps)
    arguments = parser.parse_args()
    if arguments.what == "photos":
        folder = Path(os.environ["MT_SAMPLES"]) / "deepfashion"
        photos = [path for path in sorted(folder.glob("*.png")) if find_iuv_of(path)]
        subjects = [([each], [each]) for each in map(read_picture, photos)]
    else:
        people = PeopleStream(seed=HELD_OUT_SEED, split="held-out", size=HELD_OUT_SIZE)
        subjects = [
            photograph(people, number, arguments.photos) for number in range(arguments.count)
        ]
    compare(subjects, AdaptationSettings(steps=arguments.steps))


def read_picture(path: Path) -> PersonPicture:
    photo, iuv = read_photo(path), find_iuv_of(path)
    assert iuv is not None
    person = read_person(photo, iuv, "largest", None, "photo")
    return PersonPicture(path.stem, photo.rgb, person, photo.alpha)


def photograph(
    people: PeopleStream, number: int, photos: int
) -> tuple[list[PersonPicture], list[PersonPicture]]:
    """Photos to learn from, and others."""
    dressed = people.dress(number)
    views = []
    for view in range(photos + TARGETS):
        shot = people.take(dressed, people.shot(number, view))
        views.append(PersonPicture(f"{number}/{view}", shot.rgb, shot.iuv, shot.alpha))
    return views[:photos], views[photos:]


def compare(
    subjects: Sequence[tuple[list[PersonPicture], list[PersonPicture]]],
    settings: AdaptationSettings,
) -> None:
    model, judge = load_checkpoint(find_weights(DEFAULT_WEIGHTS)), load_efficientnet_lite0()
    poses = demo_poses()
    print(f"{settings}; {torch.get_num_threads()} threads")
    print(f"{'':44} {'without: ' + ' '.join(COLUMNS):30} with, and the change")
    rows = []
    for pictures, targets in subjects:
        sources = [SourcePicture(each.as_photo(), each.iuv) for each in pictures]
        began = time.perf_counter()
        adapted = adapt_model(model, sources, poses, settings, judge)
        seconds = time.perf_counter() - began
        row = np.stack([score(each, sources, targets) for each in (model, adapted)])
        rows.append(row)
        print(f"{pictures[0].name[-43:]:44} {tell(row)}  {seconds:.0f} s", flush=True)
    print(f"{'mean':44} {tell(np.nanmean(rows, axis=0))}")


def tell(row: np.ndarray) -> str:
    before, after = (" ".join(f"{value:.4f}" for value in values) for values in row)
    change = " ".join(f"{value:+.1%}" for value in row[1] / row[0] - 1)
    return f"{before:30} {after}  {change}"


def score(
    model: NeuralReRenderer, sources: Sequence[SourcePicture], targets: Sequence[PersonPicture]
) -> np.ndarray:
    """Mean distances over the targets, by COLUMNS; NaN where no target has such a region."""
    source = unfold_source(sources, model.config.finest_texture)
    engine = TorchEngine(model, Execution("torch", "f32", "cpu"))
    renderer = NeuralRenderer(engine, engine.encode(source))
    framing, network = Framing(), open_efficientnet()
    found = []
    for target in targets:
        size = target.iuv.shape[0], target.iuv.shape[1]
        background = make_background("white", size, source, in_place=False)
        window = plan_window([bounding_box(target.iuv)])
        drawn = draw_over(background, renderer, target.iuv, window)
        real = framing.fit_target(target)
        seen = np.zeros(real.mask.shape, bool)
        for picture in sources:
            seen |= shown_pixels(picture.iuv, real.iuv)
        hidden = (real.iuv[..., 0] > 0) & ~seen
        with torch.inference_mode():
            layers = network(to_tensor([real.rgb, framing.fit(drawn)]))
        found.append(
            [
                feature_distance([m[1:] for m in layers], [m[:1] for m in layers], region)[0]
                if np.count_nonzero(region) >= 64  # as `mt eval` has it
                else np.nan
                for region in (real.mask, seen, hidden)
            ]
        )
    scores = np.ma.masked_invalid(found).mean(axis=0)
    return scores.filled(np.nan)


if __name__ == "__main__":
    main()
