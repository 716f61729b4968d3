"""`mt people`: motion from clips, drivers from motion, and photos of synthetic people."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from motion_transfer.cli.options import FILE, CommandGroup, SectionCommand, section
from motion_transfer.cli.progress import CountBar, long_wait
from motion_transfer.cli.terminal import counted, note, tell
from motion_transfer.estimate.opening import landmark_estimators
from motion_transfer.option import parse_rate, parse_size

SHARE = click.FloatRange(0, 1)
BODY_OPTIONS = ("gender", "age", "height", "weight", "muscle", "proportions")

input_option = section("Input")
motion_option = section("Motion")
body_option = section("Body")
camera_option = section("Camera")
people_option = section("People")
picture_option = section("Pictures")
output_option = section("Output")


@click.group(cls=CommandGroup)
def people() -> None:
    """Synthetic people: photos with exact IUV, drivers from motion, and motion from clips.

    \b
    mt people drive walk -o walk.mkv
    mt people track dance.mp4 -o dance.bvh
    mt run --source photo.png --driver people:dance -o out.mp4
    mt people render --count 100 --out people/
    """


@people.command(cls=SectionCommand)
@click.argument("motion", metavar="MOTION|FILE.bvh")
@motion_option(
    "--frames",
    "frame_count",
    type=int,
    metavar="N",
    help="Default: one loop at its pace, or the whole file.",
)
@motion_option("--fps", default="30", metavar="RATE", help="Such as 25 or 30000/1001; default 30.")
@motion_option("--travel", is_flag=True, help="Go where a BVH file goes, not on the spot.")
@body_option("--gender", type=SHARE, metavar="0..1", help="0 male, 1 female.")
@body_option("--age", type=SHARE, metavar="0..1", help="0.67 young adult, 1 old.")
@body_option("--height", type=SHARE, metavar="0..1", help="Short to tall.")
@body_option("--weight", type=SHARE, metavar="0..1", help="Thin to heavy.")
@body_option("--muscle", type=SHARE, metavar="0..1", help="Slack to muscular.")
@body_option("--proportions", type=SHARE, metavar="0..1", help="Uncommon to ideal.")
@camera_option(
    "--framing", default="full", metavar="PART", help="full (default), three-quarters or upper."
)
@camera_option(
    "--azimuth",
    type=float,
    metavar="DEGREES",
    default=0.0,
    help="Around, to the person's left; default 0.",
)
@camera_option("--elevation", type=float, metavar="DEGREES", default=4.0, help="Up; default 4.")
@camera_option("--distance", type=float, metavar="METRES", default=4.0, help="Default 4.")
@output_option("--size", default="512x512", metavar="WxH", help="Pixels; default 512x512.")
@output_option(
    "-o", "--output", type=FILE, required=True, help="A folder for PNG, or a lossless .mkv."
)
@output_option("--force", is_flag=True, help="Replace an existing output.")
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def drive(
    motion: str, output: Path, fps: str, size: str, force: bool, quiet: bool, **options: Any
) -> None:
    """Make a driver (IUV frames) from a motion.

    Motions are walk, turntable, dance, wave and jumping-jacks, each a smooth loop, or a BVH file.
    A driver can also be made on the fly: mt run --driver people:walk.

    \b
    mt people drive walk -o walk_iuv/
    mt people drive turntable --frames 120 --azimuth 30 -o turn.mkv
    mt people drive capture.bvh --fps 25 --gender 1 --size 384x512 -o capture.mkv
    """
    from motion_transfer.people import MotionOptions, Shape, check_motion, record_motion

    check_motion(motion)  # before the body model is prepared, which may take minutes
    body = {name: options.pop(name) for name in BODY_OPTIONS}
    shape = Shape(**{name: value for name, value in body.items() if value is not None})
    settings = MotionOptions(
        motion=motion, frame_rate=parse_rate(fps), size=parse_size(size), shape=shape, **options
    )
    prepare_body_model(quiet)
    with CountBar("drawing", unit="frame", quiet=quiet) as bar:
        driver = record_motion(settings, output, force=force, done=bar.advance)
    if not quiet:
        seconds = float(driver.frame_count / driver.frame_rate)
        click.echo(f"{output}: {counted(driver.frame_count, 'frame')}, {seconds:.2f} s of {motion}")


@people.command(cls=SectionCommand)
@click.argument("source", metavar="VIDEO|DIR|PHOTO", type=FILE)
@input_option(
    "--person",
    default="largest",
    metavar="WHO",
    help="largest (default), an index from the left (0 first), or a box x0,y0,x1,y1.",
)
@input_option(
    "--estimator",
    default="blazepose",
    metavar="|".join(landmark_estimators()),
    help="blazepose (default), or blazepose-heavy (nearer, slower; `mt models fetch --heavy`).",
)
@output_option("-o", "--output", type=FILE, required=True, help="A .bvh file.")
@output_option("--force", is_flag=True, help="Replace an existing output.")
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def track(source: Path, quiet: bool, **options: Any) -> None:
    """Fit a body to a person of a clip, and write its motion.

    BlazePose finds the person's landmarks (`mt models fetch`, once); a body is fitted to those of
    all frames at once. The motion is BVH, in metres, y up, with the body's proportions: a driver
    from any side, or for other programs.

    \b
    mt people track dance.mp4 -o dance.bvh
    mt run --source me.jpg --driver people:dance.bvh,azimuth=45 -o out.mp4
    """
    from motion_transfer.render.plan import list_stretches
    from motion_transfer.tracking import TrackOptions, track_motion

    settings = TrackOptions(source=source, **options)
    prepare_body_model(quiet)
    with CountBar("finding the person", unit="frame", quiet=quiet) as bar:
        found = track_motion(settings, bar.advance)
    if quiet:
        return
    if unseen := found.unseen:
        count = sum(stop - start for start, stop in unseen)
        times = list_stretches(unseen, 0, found.frame_rate)
        note(f"nobody found in {counted(count, 'frame')}, filled in: {times}")
    seconds = float(len(found) / found.frame_rate)
    shots = f", {len(found.shots)} shots" if len(found.shots) > 1 else ""
    tell(f"wrote {settings.output}: {counted(len(found), 'frame')}, {seconds:.2f} s{shots}")


@people.command(cls=SectionCommand)
@people_option("--count", type=int, metavar="N", required=True, help="How many people.")
@people_option("--views", type=int, metavar="N", default=2, help="Photos of each; default 2.")
@people_option("--seed", type=int, metavar="N", default=0, help="Same seed, same bytes; default 0.")
@people_option(
    "--split", default="train", metavar="NAME", help="train (default) or held-out: never the same."
)
@people_option(
    "--assets",
    type=FILE,
    metavar="DIR",
    help="MakeHuman's assets: people in photographed skins, clothes and hair; else MT_ASSETS.",
)
@people_option(
    "--free",
    "free_share",
    type=float,
    metavar="SHARE",
    help="How many of the people those are, 0 to 1; default 0.5 with assets.",
)
@picture_option("--size", default="256x256", metavar="WxH", help="Pixels; default 256x256.")
@picture_option("--framing", metavar="PART", help="full, three-quarters or upper; default: mixed.")
@picture_option(
    "--noise",
    type=float,
    is_flag=False,
    flag_value=1.0,
    default=0.0,
    metavar="[SHARE]",
    help="Put DensePose's usual faults into the IUV of all photos, or of a share of them.",
)
@output_option("-o", "--out", type=FILE, required=True, help="A folder; completed if it has some.")
@output_option("--workers", type=int, metavar="N", help="Processes; default: one for each core.")
@output_option("-q", "--quiet", is_flag=True, help="Say nothing but errors.")
def render(quiet: bool, size: str, assets: Path | None, **options: Any) -> None:
    """Photograph synthetic people into a folder.

    Each person gets a folder with photos, their IUV and alpha, and a JSON description; pairs.csv
    lists pictures of the same person. A run that was stopped goes on where it was.

    \b
    mt people render --count 100 --out people/
    mt people render --count 20 --views 4 --size 512x512 --framing upper --out heads/
    mt people render --count 100 --assets makehuman/ --free 1 --out free/
    """
    from motion_transfer.people import AlbumOptions, find_assets, load_assets, write_album

    settings = AlbumOptions(size=parse_size(size), assets=find_assets(assets), **options)
    if settings.assets:
        load_assets(settings.assets)  # what is wrong with them is said at once
    prepare_body_model(quiet, settings.assets)
    with CountBar("photographing", unit="person", total=settings.count, quiet=quiet) as bar:
        added = write_album(settings, bar.advance)
    if not quiet:
        there = f" ({settings.count - added} were there)" if added < settings.count else ""
        photos = counted(settings.views, "photo")
        click.echo(f"{settings.out}: {counted(added, 'person')} added{there}, {photos} each")


def prepare_body_model(quiet: bool, assets: Path | None = None) -> None:
    """Let the body model compute its cache if it has none yet, and say so while it does.

    Args:
        assets: Of free people, whose garments need more of it.
    Raises: InputError for assets that cannot be used.
    """
    from motion_transfer.people import FIRST_USE, is_cached, load_body_model

    if not is_cached():
        with long_wait(FIRST_USE, quiet=quiet):
            load_body_model()
    if assets:
        from motion_transfer.people import (
            HELPERS_FIRST_USE,
            are_helpers_cached,
            load_assets,
            load_helpers,
        )

        if not are_helpers_cached():
            with long_wait(HELPERS_FIRST_USE, quiet=quiet):
                load_helpers(load_assets(assets))
