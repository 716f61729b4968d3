"""What outputs say of themselves: a mark others read, and a record that follows from inputs."""

from __future__ import annotations

import getpass
import json
import socket
from pathlib import Path
from xml.etree import ElementTree

import av
import numpy as np
import pytest
from PIL import Image

from motion_transfer import render_video
from motion_transfer.media.output.segments import read_mark
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.render.options import Garment

TERM = "http://cv.iptc.org/newscodes/digitalsourcetype/"
NAMES = [
    *("out.mp4", "out.mov", "out.mkv", "out.webm"),
    *("out.gif", "out.webp", "out.apng", "out", "out.png"),
]


def first_file(output: Path) -> Path:
    return min(output.iterdir()) if output.is_dir() else output


def size_of(output: Path) -> int:
    files = output.iterdir() if output.is_dir() else [output]
    return sum(file.stat().st_size for file in files)


def make(studio, name: str, **more) -> Path:
    """Render three frames, or one picture."""
    if not (studio.folder / "person.png").exists():
        studio.source()
        studio.array(3)
    output = studio.folder / name
    more = {"frames": "1"} | more if name.endswith(".png") else more
    given = {"renderer": "texture"} | more
    render_video(studio.folder / "person.png", studio.folder / "driver.npy", output, **given)
    return output


def xmp_of(picture: Image.Image) -> dict[str, str]:
    """The properties of its XMP, as Pillow finds it; of a GIF, where the specification has it."""
    if picture.format == "GIF":
        data = Path(picture.filename).read_bytes()
        packet = data[data.index(b"XMP DataXMP") + 11 :].partition(b"\x01\xff\xfe")[0]
    else:
        packet = picture.info.get("xmp") or picture.info["XML:com.adobe.xmp"]
    tree = ElementTree.fromstring(packet)
    [described] = tree.iter("{http://www.w3.org/1999/02/22-rdf-syntax-ns#}Description")
    return {name.rpartition("}")[2]: value for name, value in described.attrib.items()}


def record_of(output: Path) -> dict:
    mark = read_mark(output)
    assert mark is not None and mark.record is not None
    return json.loads(mark.record)


@pytest.mark.parametrize("name", NAMES)
def test_every_output_says_what_it_is_and_what_made_it(studio, name: str) -> None:
    output = make(studio, name)
    record = record_of(output)
    assert record["format"] == "mt-provenance-1"
    assert (record["synthetic"], record["renderer"]) == (True, "texture")
    assert record["digital_source_type"] == TERM + "compositeSynthetic"
    assert record["sources"][0][0]["file"] == "person.png"
    count = 1 if name == "out.png" else 3
    assert (record["output"]["frames"], record["driver"]["frames"]) == (count, count)
    assert len(record["segments"]["sha256_128"]) == 1
    assert len(list(open_pictures(output).read())) == count


@pytest.mark.parametrize("name", NAMES)
def test_with_the_mark_alone_pictures_are_the_same(studio, name: str) -> None:
    full = make(studio, name)
    alone = make(studio, f"alone/{name}", provenance="mark")
    mark = read_mark(alone)
    assert mark is not None
    assert (mark.term, mark.record) == (TERM + "compositeSynthetic", None)
    frames = zip(open_pictures(full).read(), open_pictures(alone).read(), strict=True)
    assert all(np.array_equal(*pair) for pair in frames)
    assert b"person.png" not in first_file(alone).read_bytes()
    assert 0 < size_of(full) - size_of(alone) < 4096


@pytest.mark.parametrize("name", ["out.gif", "out.webp", "out.apng", "out", "out.png"])
def test_others_find_the_mark_in_pictures(studio, name: str) -> None:
    output = make(studio, name)
    for file in output.iterdir() if output.is_dir() else [output]:
        with Image.open(file) as picture:
            picture.load()
            told = xmp_of(picture)
        assert told["DigitalSourceType"] == TERM + "compositeSynthetic"
        assert told["CreatorTool"].startswith("motion-transfer ")


@pytest.mark.parametrize("name", ["out.mp4", "out.mov", "out.mkv", "out.webm"])
def test_others_find_the_mark_in_videos(studio, name: str) -> None:
    output = make(studio, name)
    with av.open(str(output), options={"export_xmp": "1"}) as container:
        told = {key.lower(): value for key, value in container.metadata.items()}
    assert TERM in told["comment"]
    if name in ("out.mp4", "out.mov"):
        assert f'DigitalSourceType="{TERM}compositeSynthetic"' in told["xmp"]
    if name != "out.mov":
        assert told["description"].startswith("Synthetic: this person did not do this. http")


def test_packets_are_those_of_a_video_that_says_nothing(studio) -> None:
    """What is told stands beside them: nothing is encoded, timed or ordered otherwise."""

    def packets(output: Path) -> list:
        with av.open(str(output)) as container:
            found = [p for p in container.demux() if p.size]
            return [(p.stream.index, p.pts, p.dts, p.duration, bytes(p)) for p in found]

    long, short = make(studio, "out.mp4"), make(studio, "alone/out.mp4", provenance="mark")
    assert packets(long) == packets(short)
    assert len(packets(long)) == 3


@pytest.mark.parametrize(
    ("more", "term"),
    [
        ({}, "trainedAlgorithmicMedia"),
        ({"background": "photo"}, "compositeWithTrainedAlgorithmicMedia"),
        ({"compare": True}, "compositeWithTrainedAlgorithmicMedia"),
        ({"renderer": "texture"}, "compositeSynthetic"),
    ],
)
def test_the_term_says_how_synthetic_it_is(studio, checkpoint, more: dict, term: str) -> None:
    weights = {} if "renderer" in more else {"weights": checkpoint, "engine": "openvino"}
    output = make(studio, "out.mp4", **{"renderer": "nhrr"} | weights | more)
    assert record_of(output)["digital_source_type"] == TERM + term


def test_no_folder_host_or_user_is_told(studio) -> None:
    behind = studio.image("private/behind.png", np.full((96, 64, 3), 90, np.uint8))
    dress = studio.source("secret/dress")
    output = make(
        *(studio, "hidden/out.mp4"),
        background=behind,
        garments=[Garment(photo=dress, parts=(2,))],
        sheet=studio.folder / "hidden/sheet.png",
    )
    record = json.dumps(record_of(output))
    content = output.read_bytes()
    for word in (str(studio.folder), studio.folder.name, "private", "secret", "hidden"):
        assert word.encode() not in content
    assert socket.gethostname() not in record
    assert f'"{getpass.getuser()}' not in record
    assert "behind.png" in record and "dress.png" in record
    with Image.open(studio.folder / "hidden/sheet.png") as sheet:
        assert xmp_of(sheet)["DigitalSourceType"] == TERM + "compositeSynthetic"


def test_the_same_inputs_give_the_same_bytes_wherever_they_lie(studio, mt) -> None:
    """In a batch as in a run, with any number of workers."""
    run = make(studio, "out.mp4", workers=1)
    again = make(studio, "elsewhere/renamed.mp4", workers=3)
    assert run.read_bytes() == again.read_bytes()
    manifest = studio.folder / "jobs.yaml"
    manifest.write_text(
        "version: 1\noutput_root: batch\ndefaults: {renderer: texture}\n"
        "jobs:\n- {source: person.png, driver: driver.npy, output: out.mp4}\n"
    )
    assert mt("batch", "run", manifest, "-q").code == 0
    assert (studio.folder / "batch/out.mp4").read_bytes() == run.read_bytes()


@pytest.mark.parametrize("command", ["info", "inspect"])
def test_it_is_printed(studio, mt, command: str) -> None:
    output = make(studio, "out.mp4")
    outcome = mt(command, output)
    assert outcome.code == 0
    assert "what                 an output of motion-transfer" in outcome.out
    assert "person.png" in outcome.out
    facts = json.loads(mt(command, output, "--json").out)
    assert facts["driver"]["file"] == "driver.npy"
    alone = make(studio, "alone.mp4", provenance="mark")
    assert "none (--provenance mark)" in mt(command, alone).out


def test_the_preview_marks_its_frame(studio, mt) -> None:
    output = studio.folder / "frame.png"
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    made = mt("preview", *inputs, "--renderer", "texture", "--frame", "1", "-o", output)
    assert made.code == 0
    mark = read_mark(output)
    assert mark is not None and mark.source_type == "compositeSynthetic"
