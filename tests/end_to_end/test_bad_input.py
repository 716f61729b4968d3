"""Whatever is wrong with the input: exit code 2, one line that says so, and nothing left behind."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

FRAMES = 5


def frame(studio, index: int = 2) -> Path:
    return studio.folder / f"driver/frame_{index}_IUV.png"


def cut_short(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def flip_a_bit(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def spoil_pixels(path: Path) -> None:
    """A PNG whose checksums are right, but whose compressed pixels end too early."""
    data = path.read_bytes()
    start = data.index(b"IDAT")
    length = int.from_bytes(data[start - 4 : start], "big")
    body = b"IDAT" + data[start + 4 : start + 4 + length // 2]
    chunk = (len(body) - 4).to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
    path.write_bytes(data[: start - 4] + chunk + data[start + 8 + length :])


def paint_part(path: Path, part: int) -> None:
    iuv = np.array(Image.open(path))
    iuv[0, 0] = (part, 0, 0)
    Image.fromarray(iuv).save(path)


def blank(studio, indices: Iterable[int]) -> None:
    for index in indices:
        studio.image(f"driver/frame_{index}_IUV.png", np.zeros((96, 64, 3), np.uint8))


def damage_checkpoint(studio, checkpoint: Path) -> Path:
    path = studio.folder / "half.safetensors"
    path.write_bytes(checkpoint.read_bytes()[:1000])
    return path


# name: what is done to a good run, which may add arguments; what the message says
CASES: dict[str, tuple[Callable | list[str], str]] = {
    "source missing": (["--source", "nobody.png"], r"source nobody\.png does not exist"),
    "source is a folder of no photos": (
        lambda s: ["--source", s.folder / "driver"],
        r"no IUV found for .*driver/frame_",
    ),
    "sources and their IUV are not as many": (
        lambda s: ["--source", s.folder / "person.png", "--source-iuv", s.folder / "person.png"],
        "1 source IUV for 2 sources; give one for each",
    ),
    "source is no picture": (
        lambda s: (s.folder / "person.png").write_text("words"),
        r"source .*person\.png is not a picture",
    ),
    "source truncated": (lambda s: cut_short(s.folder / "person.png"), r"person\.png is truncated"),
    "source IUV missing": (lambda s: (s.folder / "person_IUV.png").unlink(), "no IUV found for"),
    "source IUV named but missing": (
        ["--source-iuv", "none.png"],
        r"source IUV none\.png does not exist",
    ),
    "source IUV truncated": (lambda s: cut_short(s.folder / "person_IUV.png"), "is truncated"),
    "source IUV of another size": (
        lambda s: s.image("person_IUV.png", s.iuv()),
        r"is 64 x 96, but .* is 128 x 192",
    ),
    "source IUV is a photo": (
        lambda s: s.image("person_IUV.png", np.full((192, 128, 3), 99, np.uint8)),
        "is not an IUV image",
    ),
    "person not there": (["--person", "3"], "person 3 asked for, but only 1 found"),
    "person is a word": (["--person", "left"], "person 'left'; write largest"),
    "person box empty": (["--person", "0,0,2,2"], "nobody in the box 0,0,2,2"),
    "driver person not there": (["--driver-person", "1"], "person 1 asked for"),
    "driver missing": (["--driver", "none"], "driver none does not exist"),
    "driver empty": (
        lambda s: [file.unlink() for file in (s.folder / "driver").iterdir()] and None,
        "holds no IUV images",
    ),
    "driver is a photo and no IUV": (
        lambda s: ["--driver", s.folder / "person.png", "--driver-kind", "iuv"],
        r"person\.png is not an IUV image",
    ),
    "driver IUV and no photo": (
        ["--driver-kind", "pictures"],
        "nobody was found|mt models fetch|lacks iuv_network|raw pictures need",
    ),
    "driver too dark to tell": (
        lambda s: ["--driver", s.image("dark.png", np.full((96, 64, 3), 9, np.uint8))],
        "cannot be told whether these are IUV .*--driver-kind iuv or pictures",
    ),
    "driver kind unknown": (["--driver-kind", "film"], "driver_kind is 'film'"),
    "estimator unknown": (["--estimator", "magic"], "estimator is 'magic'"),
    "estimator without its model": (["--estimator", "densepose"], "needs --estimator-model FILE"),
    "model without its estimator": (["--estimator-model", "a.pt"], "add --estimator densepose"),
    "driver is words": (["--driver", __file__], "is not a readable video"),
    "driver lossy": (
        lambda s: ["--driver", s.video(3, name="a.mp4", codec="libx264", pixels="yuv420p")],
        r"compressed with h264.*ffv1",
    ),
    "frame truncated": (lambda s: cut_short(frame(s)), r"frame 2, .*frame_2_IUV\.png is truncated"),
    "frame with a wrong checksum": (lambda s: flip_a_bit(frame(s)), "frame 2, .*wrong checksum"),
    "frame of 16 bits": (
        lambda s: s.image("driver/frame_2_IUV.png", s.iuv()[..., 0].astype(np.uint16)),
        "frame 2, .*16 bits a channel",
    ),
    "frame grey": (
        lambda s: s.image("driver/frame_2_IUV.png", s.iuv()[..., 0]),
        "frame 2, .*is grey",
    ),
    "frame is a renamed JPEG": (
        lambda s: s.image("a.jpg", s.iuv()).rename(frame(s)) and None,
        "frame 2, .*JPEG file; lossy",
    ),
    "frame with part 25": (lambda s: paint_part(frame(s), 25), "frame 2, .*has part index 25"),
    "frame of another size": (
        lambda s: s.image("driver/frame_2_IUV.png", s.iuv(size=(90, 60))),
        "frame 2, .*is 60 x 90, but the driver began with 64 x 96",
    ),
    "frame missing": (lambda s: frame(s).unlink(), r"1 missing frame \(2\)"),
    "first frame empty": (lambda s: blank(s, [0]), "no person in the first frame; .*--frames 1:5"),
    "every frame empty": (lambda s: blank(s, range(FRAMES)), "no person in any frame"),
    "order ambiguous": (
        lambda s: ["--driver", s.array(s.walk(2) // 12)],
        "channel order cannot be told.*--iuv-order",
    ),
    "order unknown": (["--iuv-order", "bgr"], "iuv_order is 'bgr'"),
    "order wrong": (["--iuv-order", "vui"], "frame 0, .*has part index"),
    "frames beyond the end": (["--frames", "3:9"], "frames 3:9 asked for, but .* has 5"),
    "frames reversed": (["--frames", "3:1"], "frames 3:1 asked for"),
    "frames no range": (["--frames", "all"], "frames 'all'; write START:STOP"),
    "fps no number": (["--fps", "fast"], "fps 'fast'; write a number"),
    "fps zero": (["--fps", "0"], "fps '0'; it must lie between"),
    "fps too high for the codec": (
        lambda s: ["--fps", "500", "-o", s.folder / "out.webm", "--codec", "av1"],
        "cannot encode 64 x 96 at 500 frames/s",
    ),
    "background unknown": (
        ["--background", "mauve"],
        "background mauve does not exist; name a picture",
    ),
    "size unknown": (["--size", "big"], "size is 'big'; supported are driver"),
    "missing unknown": (["--missing", "skip"], "missing is 'skip'"),
    "workers zero": (["--workers", "0"], "workers is 0"),
    "renderer unknown": (["--renderer", "gan"], "renderer is 'gan'"),
    "weights missing": (
        ["--renderer", "nhrr", "--weights", "none.safetensors"],
        "weights none.* does not exist",
    ),
    "codec unknown": (["--codec", "cinepak"], "unknown codec 'cinepak'"),
    "codec in another container": (["--codec", "ffv1"], r"\.mp4 cannot hold ffv1"),
    "crf too high": (["--crf", "99"], "--crf 99: h264 takes a crf of 0 to 51"),
    "ending unknown": (lambda s: ["-o", s.folder / "out.avi"], r"unknown ending \.avi"),
    "several frames into one picture": (
        lambda s: ["-o", s.folder / "out.png"],
        "is one picture, but 5 frames",
    ),
    "odd size": (
        lambda s: ["--driver", s.array(np.pad(s.walk(2), ((0, 0), (0, 1), (0, 1), (0, 0))))],
        "odd size 65 x 97; add --size even or --size crop",
    ),
    "output in a file": (
        lambda s: ["-o", s.folder / "person.png/out.mp4"],
        r"person\.png is not a folder",
    ),
    "output is a folder of other things": (
        lambda s: ["-o", s.folder / "driver", "--force"],
        "other things than frames",
    ),
    "sheet exists": (lambda s: ["--sheet", s.folder / "person.png"], r"person\.png exists already"),
    "garment without parts": (
        lambda s: ["--garment", s.folder / "person.png"],
        "1 --garment but 0 --garment-parts",
    ),
    "parts without garment": (
        ["--garment-parts", "torso"],
        "0 --garment but 1 --garment-parts",
    ),
    "garment of an unknown part": (
        lambda s: ["--garment", s.folder / "person.png", "--garment-parts", "tie"],
        "unknown part 'tie'",
    ),
    "garment missing": (
        ["--garment", "none.png", "--garment-parts", "torso"],
        r"garment none\.png does not exist",
    ),
    "garment that shows none of its parts": (
        lambda s: [
            *("--garment", s.source("hat", parts=(23, 24)), "--garment-parts", "torso"),
        ],
        r"hat\.png shows none of torso-back, torso-front",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input(studio, draft, case: str) -> None:
    spoil, reason = CASES[case]
    arguments = ["--source", studio.source(), "--driver", studio.driver(FRAMES)]
    arguments += ["-o", studio.folder / "out.mp4"]
    more = spoil(studio) if callable(spoil) else spoil
    before = sorted(studio.folder.rglob("*"))
    result = draft(*arguments, *(more if isinstance(more, list) else []))
    assert result.code == 2
    assert result.out == ""
    (line,) = result.err.splitlines()
    assert line.startswith("mt: ")
    assert re.search(reason, line)
    assert sorted(studio.folder.rglob("*")) == before


SOME = ["--source", "a", "--driver", "b", "-o", "c"]
USAGE = {
    "no source": (["run", "--driver", "a", "-o", "b.mp4"], "missing option '--source'"),
    "no output": (["run", "--source", "a", "--driver", "b"], "missing option '-o' / '--output'"),
    "crf no number": (["run", "--crf", "good"], "'good' is not a valid integer"),
    "unknown option": (
        ["run", "--sauce", "a"],
        "no option --sauce; did you mean --source? See `mt run --help`",
    ),
    "unknown command": (["rum"], "no command 'rum'; did you mean run? See `mt --help`"),
    "a variable that was empty": (
        ["run", "--source", "", "--driver", "a", "-o", "b.mp4"],
        "mt: source: a path is empty; name a file or a folder",
    ),
    "another one": (["inspect", ""], "a path is empty; name a file or a folder"),
    "a garment's photo is empty": (
        ["run", "--garment", "", "--garment-parts", "torso", *SOME],
        "a path is empty; name a file or a folder",
    ),
    "unknown topic": (
        ["info", "hats"],
        "hats does not exist, and is no topic either; those are all and parts",
    ),
}


@pytest.mark.parametrize("case", USAGE)
def test_bad_usage(mt, case: str) -> None:
    arguments, reason = USAGE[case]
    result = mt(*arguments)
    assert result.code == 2
    assert result.err.startswith("mt: ")
    assert reason in result.err
    assert result.err.count("\n") == 1


def test_broken_weights(studio, mt, checkpoint: Path) -> None:
    half = damage_checkpoint(studio, checkpoint)
    source, driver = studio.source(), studio.driver(2)
    before = sorted(studio.folder.rglob("*"))
    result = mt(
        *("run", "--source", source, "--driver", driver),
        *("--weights", half, "-o", studio.folder / "out.mp4"),
    )
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert "half.safetensors are not a whole safetensors file" in result.err
    assert sorted(studio.folder.rglob("*")) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_an_unreadable_file(studio, draft) -> None:
    source = studio.source()
    source.chmod(0)
    result = draft("--source", source, "--driver", studio.driver(1), "-o", "out.mp4")
    assert (result.code, result.err.count("\n")) == (2, 1)
    assert "cannot be read: Permission denied" in result.err


def test_a_frame_with_too_few_pixels(studio, draft) -> None:
    """Damage that the decoder sees first: what it says of it is in our line, and only there."""
    source, driver = studio.source(), studio.driver(FRAMES)
    spoil_pixels(frame(studio))
    result = draft("--source", source, "--driver", driver, "-o", studio.folder / "out.mp4")
    assert result.code == 2
    assert re.fullmatch(r"mt: frame 2, .*frame_2_IUV\.png is truncated .*\n", result.err)


@pytest.mark.parametrize("output", ["out.mp4", "out"])
def test_an_existing_output_is_untouched_without_force(studio, draft, output: str) -> None:
    path = studio.folder / output
    if path.suffix:
        path.write_text("old")
    else:
        path.mkdir()
    before = sorted(studio.folder.rglob("*"))
    result = draft("--source", "a.png", "--driver", "b", "-o", path)
    assert result.code == 2
    assert result.err == f"mt: {path} exists already; choose another name or add --force\n"
    assert sorted(studio.folder.rglob("*")) == before
    assert path.is_dir() or path.read_text() == "old"


@pytest.mark.parametrize("old", ["file", "folder"])
def test_force_replaces_whatever_was_there(studio, draft, old: str) -> None:
    path = studio.folder / "out"
    path.mkdir() if old == "folder" else path.write_text("old")
    result = draft(
        *("--source", studio.source(), "--driver", studio.driver(2)),
        *("-o", path, "--force", "-q"),
    )
    assert (result.code, result.out, result.err) == (0, "", "")
    assert sorted(item.name for item in path.iterdir()) == ["000000.png", "000001.png"]
    assert not [item for item in studio.folder.iterdir() if item.name.startswith(".")]
