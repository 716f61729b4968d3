"""What more than one photo of a person gives, on people whom the networks never saw.

    python benchmarks/views.py [--weights lite] [--assets DIR] [--count 100] [--people-cache DIR]
        [--renderer texture] [--target-light source] [--save DIR] [--workers 2]

Held-out synthetic people are photographed as users photograph themselves: from the front, the back
and both sides, standing, in the same light, but with a camera that sets exposure and white balance
anew for each photo, in slightly different poses, with DensePose's faults in the IUV; and in a clip
in which they turn once. Each set of photos is drawn in other poses of the same person, whose turns
are spread evenly over the circle, and compared with the real picture.

`oracle`: the front photo, and the target's own texture wherever that photo hides it: what photos of
everything else could give at most.

Besides the numbers of `mt eval` (`visible` and `hidden` are what the front photo sees and hides)
it prints how each set differs from the front photo alone, in pairs: share of its mean, and standard
error. Sources are read as `mt run` reads them. People are photographed once where `--people-cache`
names a folder: another merge is then scored in less time.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from motion_transfer.drawing.source import Source, unfold_source
from motion_transfer.drawing.textures import merge_textures
from motion_transfer.evaluation.candidates import Draw, OpenedSource, RenderedCandidate
from motion_transfer.evaluation.framing import Framing, Image
from motion_transfer.evaluation.measures import EFFICIENTNET, choose_measures
from motion_transfer.evaluation.report import summarise, summarise_methods, table
from motion_transfer.evaluation.scoring import PairScores, Scorer
from motion_transfer.media.growing import MakeItem, claim_folder, make_items
from motion_transfer.media.pictures.photo import encode_png, write_png
from motion_transfer.media.publish import publish
from motion_transfer.people import IuvNoise, PeopleStream, PersonPhoto
from motion_transfer.people.motion.motions import MOTIONS
from motion_transfer.people.motion.poses import Arm, Pose
from motion_transfer.people.picture.light import Colour, Light
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.source_pictures import read_pictures
from motion_transfer.training.pairs import Pair, PairList
from motion_transfer.training.pictures import PersonPicture, PhotoFile
from motion_transfer.training.sources import HELD_OUT_SEED, HELD_OUT_SIZE
from motion_transfer.weights import find_weights

SIDES = {"front": 0.0, "back": math.pi, "left": math.pi / 2, "right": -math.pi / 2}
"""The photos, and how far the person turns for each, radians, as `Pose.turn` counts."""

SETS = {
    "front": ("front.png",),
    "and back": ("front.png", "back.png"),
    "four sides": tuple(f"{side}.png" for side in SIDES),
    "turn": ("turn",),
}
"""What is compared: sources as `mt run` takes them, files or a folder; the first is the basis."""

COMPARED = (EFFICIENTNET, f"{EFFICIENTNET}-masked", "ssim", "visible", "hidden")
PHOTO_SIZE = (512, 512)  # px: a person in a phone's picture is larger than what is drawn of them
EXPOSURE, WARMTH = 0.15, 0.04  # standard deviations of the logarithm; by eye, of phones' photos
DRIFT = 0.05  # likewise of the exposure along a clip, as its automatic follows what it sees
TURN_SPREAD, HEAD_SPREAD, ARM_SPREAD = np.radians([8, 6, 6])  # of somebody asked to stand alike


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--weights", type=Path, default=Path("lite"))
    parser.add_argument("--renderer", choices=("nhrr", "texture"), default="nhrr")
    parser.add_argument("--assets", type=Path, help="free people, in these assets, not painted")
    parser.add_argument("--count", type=int, default=100, help="people")
    parser.add_argument("--targets", type=int, default=2, help="of each person")
    parser.add_argument("--frames", type=int, default=36, help="of the turn of 3 s")
    parser.add_argument(
        "--target-light", choices=("own", "source"), default="own", help="as in `mt eval`, or alike"
    )
    parser.add_argument("--people-cache", type=Path, help="keeps the photos")
    parser.add_argument("--save", type=Path, help="folder for every picture that is drawn")
    parser.add_argument("--workers", type=int, help="processes; one for each core")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        album = Album(
            arguments.people_cache or Path(folder) / "people",
            arguments.assets,
            arguments.targets,
            arguments.frames,
        )
        album.complete(arguments.count, arguments.workers)
        weights = find_weights(arguments.weights) if arguments.renderer == "nhrr" else None
        drawn = RenderedCandidate(arguments.renderer, weights, "white")
        compare(album, drawn, arguments)


def compare(album: Album, drawn: RenderedCandidate, arguments: argparse.Namespace) -> None:
    candidates = [DrawnSet(label, album, names, drawn) for label, names in SETS.items()]
    candidates.append(Oracle("oracle", album, SETS["front"], drawn))
    measures = choose_measures(["ssim", EFFICIENTNET, "hidden"])
    workers = arguments.workers or 2
    with Scorer(candidates, measures, Framing(), workers=workers, save=arguments.save) as scorer:
        scored = scorer.score(album.pairs(arguments.count, arguments.target_light))
    kind = "free" if arguments.assets else "painted"
    print(f"{drawn.label}, {arguments.count} {kind} people, target light: {arguments.target_light}")
    print(table(measures.columns, summarise_methods(candidates, measures, scored), len(scored)))
    for where in ("anywhere", "the front", "the sides", "the back"):
        chosen = [each for each in scored if where in ("anywhere", album.facing(each.pair))]
        if not chosen:
            continue
        print(f"\nagainst the front photo alone, {len(chosen)} targets seen from {where}")
        for place, candidate in enumerate(candidates[1:], start=1):
            changes = [f"{name} {relate(chosen, place, name)}" for name in COMPARED]
            print(f"{candidate.label:10s}  {'  '.join(changes)}")


def relate(scored: Sequence[PairScores], place: int, column: str) -> str:
    """How a candidate's number differs from the first one's, as a share of its mean."""
    groups = [entry.pair.group for entry in scored]
    first, other = ([entry.scores[i][column] for entry in scored] for i in (0, place))
    mean = summarise(first, groups).mean
    change = summarise([b - a for a, b in zip(first, other, strict=True)], groups)
    return f"{change.mean / mean:+.1%} ±{(change.standard_error or math.nan) / mean:.1%}"


@dataclass(frozen=True)
class Album:
    """People's photos in a folder: NUMBER/SIDE.png, turn/FRAME.png and TARGET-LIGHT.png, with IUV.

    Attributes:
        assets: Free people in these; None: painted ones.
        targets: Of each person.
        frames: Of each turn.
    """

    folder: Path
    assets: Path | None
    targets: int
    frames: int

    def complete(self, count: int, workers: int | None) -> None:
        """Photograph whoever of so many people is missing."""
        settings: dict[str, Any] = {"targets": self.targets, "frames": self.frames}
        settings["kind"] = "free" if self.assets else "painted"
        claim_folder(self.folder / "views.json", settings, "people")
        missing = [n for n in range(count) if not self.of(n).exists()]
        make_items(missing, partial(_open_photographer, self), workers, int)

    def of(self, number: int) -> Path:
        return self.folder / f"{number:06d}"

    def turn(self, number: int, target: int) -> float:
        """How far a target is turned, radians in [-pi, pi]: spread evenly for each person."""
        start = np.random.default_rng((HELD_OUT_SEED, number)).random()
        return math.remainder(2 * math.pi * (start + target / self.targets), 2 * math.pi)

    def facing(self, pair: Pair) -> str:
        """From where a target is seen."""
        target = int(Path(pair.target.name).stem.split("-")[0])
        turn = abs(self.turn(int(pair.group), target))
        sideways = "the sides" if turn < math.pi * 3 / 4 else "the back"
        return "the front" if turn < math.pi / 4 else sideways

    def pairs(self, count: int, light: str) -> PairList:
        """Each person's front photo with each of the targets."""
        pairs = [
            Pair(
                self.open(self.of(number) / "front.png"),
                self.open(self.of(number) / f"{target}-{light}.png"),
                str(number),
            )
            for number in range(count)
            for target in range(self.targets)
        ]
        return PairList("views", pairs, "")

    def open(self, path: Path) -> PhotoFile:
        return PhotoFile(str(path.relative_to(self.folder)), path, "vui")


def _open_photographer(album: Album) -> MakeItem:
    share = 1.0 if album.assets else None
    stream = partial(
        PeopleStream,
        seed=HELD_OUT_SEED,
        split="held-out",
        framing="full",
        assets=album.assets,
        free_share=share,
    )
    sources = stream(size=PHOTO_SIZE, noise=IuvNoise.densepose())
    return partial(photograph, album, sources, stream(size=HELD_OUT_SIZE))


def photograph(album: Album, sources: PeopleStream, targets: PeopleStream, number: int) -> None:
    """Take all photos of one person."""
    dressed = sources.dress(number)
    rng = np.random.default_rng((HELD_OUT_SEED, number, 1))
    shots = (sources.shot(number, view) for view in range(1000))  # of any pose, camera and room
    light = next(shots).light
    final = album.of(number)
    folder = Path(tempfile.mkdtemp(prefix=f".{final.name}.work-", dir=album.folder))
    for name, turn in SIDES.items():
        seen = light if name == "front" else expose(light, *rng.normal(0, (EXPOSURE, WARMTH)))
        shot = replace(next(shots), pose=stand(rng, turn), light=seen)
        write_photo(folder / f"{name}.png", sources.take(dressed, shot))
    clip, pose = next(shots), stand(rng, 0.0)
    (folder / "turn").mkdir()
    for frame in range(album.frames):
        phase = 2 * math.pi * frame / album.frames
        seen = expose(light, DRIFT * math.sin(phase), 0.0)
        turned = replace(pose, turn=pose.turn + phase)
        shot = replace(clip, pose=turned, light=seen, seed=clip.seed ^ frame)
        write_photo(folder / "turn" / f"{frame:03d}.png", sources.take(dressed, shot))
    for target in range(album.targets):
        shot = next(shots)
        shot = replace(shot, pose=replace(shot.pose, turn=album.turn(number, target)))
        for kind, seen in (("own", shot.light), ("source", light)):
            photo = targets.take(dressed, replace(shot, light=seen))
            write_photo(folder / f"{target}-{kind}.png", photo)
    publish(folder, final)


def stand(rng: np.random.Generator, turn: float) -> Pose:
    """Stand with the arms a little away, as nearly alike as people do."""
    pose = MOTIONS["turntable"].pose(0.0)

    def move(arm: Arm) -> Arm:
        swing, abduction, elbow = rng.normal((arm.swing, arm.abduction, arm.elbow), ARM_SPREAD)
        return replace(arm, swing=swing, abduction=abduction, elbow=elbow)

    return replace(
        pose,
        turn=rng.normal(turn, TURN_SPREAD),
        left_arm=move(pose.left_arm),
        right_arm=move(pose.right_arm),
        head=replace(pose.head, turn=rng.normal(pose.head.turn, HEAD_SPREAD)),
    )


def expose(light: Light, exposure: float, warmth: float) -> Light:
    """Change exposure and white balance, which is as if all light had changed."""
    gains = np.exp(exposure + warmth * np.array([1.0, 0.0, -1.0]))

    def tint(colour: Colour) -> Colour:
        red, green, blue = (gains * colour).tolist()
        return red, green, blue

    lamps = tuple(replace(lamp, colour=tint(lamp.colour)) for lamp in light.lamps)
    return replace(light, lamps=lamps, sky=tint(light.sky), ground=tint(light.ground))


def write_photo(path: Path, photo: PersonPhoto) -> None:
    path.write_bytes(encode_png(np.dstack([photo.rgb, photo.alpha])))
    write_png(path.with_name(f"{path.stem}_IUV.png"), photo.iuv[..., ::-1])


class OpenedViews(OpenedSource):
    """Several photos of one person, and perhaps a picture that tells what they hide."""

    def __init__(
        self, front: PersonPicture, paths: Sequence[Path], told: PersonPicture | None
    ) -> None:
        super().__init__(front)
        options = SourceOptions(source=tuple(paths), source_iuv_order="vui")
        self._pictures = [found.picture for found in read_pictures(options, lambda _event: None)]
        self._told = told and OpenedSource(told)

    def prepare(self, texels: int) -> Source:
        source = unfold_source(self._pictures, texels, Path(self.picture.name))
        if self._told is None:
            return source
        told = self._told.prepare(texels)
        layers = [(each.texture, each.visibility) for each in (told, source)]
        texture, visibility = merge_textures(layers)  # where both see a texel, the source's stays
        return replace(source, texture=texture, visibility=visibility)


class DrawnSet:
    """What is drawn of a set of a person's photos."""

    def __init__(
        self, label: str, album: Album, names: Sequence[str], drawn: RenderedCandidate
    ) -> None:
        self.label, self.takes_turns = label, drawn.takes_turns
        self._album, self._names, self._drawn = album, names, drawn

    def describe(self) -> dict[str, Any]:
        return {**self._drawn.describe(), "label": self.label}

    def open_source(self, source: OpenedSource) -> Draw:
        return self._open(source, told=None)

    def _open(self, source: OpenedSource, told: PersonPicture | None) -> Draw:
        folder = (self._album.folder / source.picture.name).parent
        paths = [folder / name for name in self._names]
        return self._drawn.open_source(OpenedViews(source.picture, paths, told))


class Oracle(DrawnSet):
    """The same, told by the target what the photos hide."""

    def open_source(self, source: OpenedSource) -> Draw:
        def draw(pair: Pair, target: PersonPicture) -> Image:
            return self._open(source, told=target)(pair, target)

        return draw


if __name__ == "__main__":
    main()
