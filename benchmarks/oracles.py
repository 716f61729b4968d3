"""What holds the pictures back: how near they come where an oracle tells what no photo does.

    python benchmarks/oracles.py [--weights lite] [--assets DIR] [--count 100]

Pairs of held-out synthetic people are drawn at the network's own size on white, as they are and
with the truth in place of what has to be guessed:

`alpha`: the target's own alpha instead of the drawn one: outline, hair and loose clothes.
`hidden`: texels that the source hides and the target shows are unfolded from the target.
`both`: both of these; what is left is what the network makes of things that it was told.
`target`: the whole texture is unfolded from the target: how well RenderNet draws what it is given.

The numbers are the perceptual distance of `mt eval`, of the whole picture and of the head, enlarged
to 96 px as in training (`mt eval` enlarges it to 128): mean, and share of what it is untold.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import mean

import torch
from torch import Tensor

from motion_transfer.training.config import build_config
from motion_transfer.training.faces import crop_boxes, find_heads
from motion_transfer.training.feature_networks import FeatureNetwork, load_efficientnet_lite0
from motion_transfer.training.metrics import feature_distance
from motion_transfer.training.samples import TrainingSamples
from motion_transfer.training.sources import held_out_pairs
from motion_transfer.training.step import HEAD_SIZE
from motion_transfer.weights import find_weights
from motion_transfer.weights.checkpoint import load_checkpoint
from nhrr_core import NeuralReRenderer, merge_textures

TOLD = ("as it is", "alpha", "hidden", "both", "target")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--weights", type=Path, default=Path("lite"))
    parser.add_argument("--assets", type=Path, help="free people, in these assets, not painted")
    parser.add_argument("--count", type=int, default=100, help="pairs")
    arguments = parser.parse_args()
    model = load_checkpoint(find_weights(arguments.weights)).float().eval()
    judge = load_efficientnet_lite0()
    samples = TrainingSamples(
        pairs := held_out_pairs(arguments.count, arguments.assets),
        build_config({}, model=model.config),
        textures=None,
    )
    found: dict[str, list[tuple[float, float]]] = {told: [] for told in TOLD}
    with torch.inference_mode():
        for number in range(arguments.count):
            sample = {name: value[None] for name, value in samples.load(pairs[number]).items()}
            truth = sample["target_image"]
            for told in TOLD:
                drawn = draw(model, sample, told)
                found[told].append((distance(judge, drawn, truth), head(judge, drawn, sample)))
    whole = {told: mean(each for each, _ in rows) for told, rows in found.items()}
    heads = {told: mean(h for _, h in rows if h == h) for told, rows in found.items()}
    print(f"{arguments.weights}, {pairs.name}, {arguments.count} pairs")
    for told in TOLD:
        shares = (each[told] / each[TOLD[0]] for each in (whole, heads))
        print(
            f"{told:10s} {whole[told]:.4f}  head {heads[told]:.4f}  "
            + " ".join(f"{share:.0%}" for share in shares)
        )


def draw(model: NeuralReRenderer, sample: dict[str, Tensor], told: str) -> Tensor:
    """Draw a sample, knowing what an oracle tells, 1 x 3 x S x S on the target's background."""
    source, target = (
        (sample[f"{role}_texture"], sample[f"{role}_visibility"]) for role in ("source", "target")
    )
    if told in ("hidden", "both"):
        source = merge_textures([target, source])  # where both see a texel, the source's stays
    elif told == "target":
        source = target
    feature_map = model.encode_texture(*source, sample["source_clearance"])
    feature_image = model.feature_image(feature_map, sample["target_iuv"])
    frame = model.blend(model.render_net(feature_image), feature_image)
    colours, alpha = frame[:, :3], frame[:, 3:]
    if told in ("alpha", "both", "target"):
        alpha = sample["target_alpha"]
    return torch.lerp(sample["target_background"][:, :, None, None], colours, (alpha + 1) / 2)


def distance(judge: FeatureNetwork, drawn: Tensor, truth: Tensor) -> float:
    """The perceptual distance of `mt eval`."""
    return feature_distance(judge(drawn), judge(truth))[0]


def head(judge: FeatureNetwork, drawn: Tensor, sample: dict[str, Tensor]) -> float:
    """The same of the enlarged head; NaN where there is none."""
    boxes, seen = find_heads(sample["target_iuv"])
    if not seen:
        return float("nan")
    size = (HEAD_SIZE, HEAD_SIZE)
    cut = (crop_boxes(image, boxes, size) for image in (drawn, sample["target_image"]))
    return distance(judge, *cut)


if __name__ == "__main__":
    main()
