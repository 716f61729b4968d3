"""`mt verify` through the real command: edits, inputs that changed, what is drawn again."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image

from motion_transfer.media.output.segments import read_mark
from motion_transfer.render.plan import CHUNK_FRAMES

FRAMES = CHUNK_FRAMES + 6
BLUE = {(2,): (10, 20, 250)}


@pytest.fixture
def made(studio, draft) -> Path:
    """A video of two segments."""
    output = studio.folder / "out.mp4"
    run = draft("--source", studio.source(), "--driver", studio.array(FRAMES), "-o", output)
    assert run.code == 0
    return output


@pytest.fixture
def check(studio, mt):
    """`mt verify --json` with the inputs of `made`, or others."""

    def call(output: Path, *more: object, source: str = "person.png", driver="driver.npy"):
        inputs = ("--source", studio.folder / source, "--driver", studio.folder / driver)
        outcome = mt("verify", output, *inputs, "--json", *more)
        return outcome.code, json.loads(outcome.out) if outcome.out else outcome.err

    return call


def copy_without(video: Path, output: Path, dropped: int | None = None) -> Path:
    """Copy a video's packets and its metadata, but one packet."""
    with av.open(str(video)) as source, av.open(str(output), "w") as target:
        target.metadata.update(source.metadata)
        stream = target.add_stream_from_template(source.streams.video[0])
        packets = [packet for packet in source.demux(video=0) if packet.size]
        for number, packet in enumerate(packets):
            if number != dropped:
                packet.stream = stream
                target.mux(packet)
    return output


def changed(facts: dict) -> dict[str, str]:
    return {each["option"]: each["state"] for each in facts["inputs"]}


def test_same_inputs_give_the_same_bytes(made, check) -> None:
    code, facts = check(made)
    assert (code, facts["verified"], facts["edited"], facts["here"]) == (0, True, [], [])
    assert [each["same_bytes"] for each in facts["rendered"]] == [True, True]
    assert changed(facts) == {"--source": "same", "--driver": "same"}


def test_alone_it_says_whether_pictures_are_those_that_were_written(made, mt) -> None:
    outcome = mt("verify", made)
    assert outcome.code == 0
    assert "pictures          as they were written" in outcome.out
    assert outcome.out.endswith("verified\n")
    assert "give --source, --driver as well" in outcome.err


def test_copied_packets_are_the_same_in_another_container(studio, made, mt) -> None:
    assert mt("verify", copy_without(made, studio.folder / "copied.mkv")).code == 0


def test_a_packet_that_is_changed_is_found(studio, made, mt) -> None:
    data = bytearray(made.read_bytes())
    with av.open(str(made)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    last = packets[-1]
    data[last.pos + last.size - 2] ^= 1
    made.write_bytes(data)
    outcome = mt("verify", made)
    assert outcome.code == 1
    assert f"frames {CHUNK_FRAMES}:{FRAMES} are not what was written" in outcome.out


def test_a_frame_that_is_left_out_is_found(studio, made, mt) -> None:
    outcome = mt("verify", copy_without(made, studio.folder / "cut.mp4", FRAMES - 1), "--json")
    facts = json.loads(outcome.out)
    assert outcome.code == 1
    assert facts["edited"] == [[CHUNK_FRAMES, FRAMES]]


def test_another_source_is_named_and_nothing_is_drawn(studio, made, check) -> None:
    studio.source("other", colours=BLUE)
    code, facts = check(made, source="other.png")
    assert (code, facts["rendered"]) == (1, [])
    assert changed(facts) == {"--source": "changed", "--driver": "same"}
    assert "is another picture" in facts["inputs"][0]["detail"]


def test_another_iuv_of_the_same_photo_is_named(studio, made, check) -> None:
    iuv = studio.folder / "person_IUV.png"
    pixels = np.asarray(Image.open(iuv)).copy()
    pixels[-1, -1] = (5, 1, 1)
    Image.fromarray(pixels).save(iuv)
    code, facts = check(made)
    assert code == 1
    assert "IUV" in facts["inputs"][0]["detail"]


def test_another_driver_is_named(studio, made, check) -> None:
    studio.array(studio.walk(FRAMES)[::-1], name="other.npy")
    code, facts = check(made, driver="other.npy")
    assert (code, facts["rendered"]) == (1, [])
    assert changed(facts)["--driver"] == "changed"


def test_another_file_with_the_same_frames_is_the_same_driver(studio, made, check) -> None:
    studio.array(FRAMES, name="packed.npz")
    code, facts = check(made, "--segments", 1, "--seed", 3, driver="packed.npz")
    assert (code, len(facts["rendered"]), facts["seed"]) == (0, 1, 3)
    assert "the same frames" in facts["inputs"][1]["detail"]


def test_other_weights_are_named(studio, mt, check, checkpoint) -> None:
    output = studio.folder / "out.mp4"
    network = ("--weights", checkpoint, "--engine", "openvino", "--precision", "f32")
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    assert mt("run", *inputs, "-o", output, *network).code == 0
    other = studio.folder / checkpoint.name
    data = bytearray(checkpoint.read_bytes())
    data[-1] ^= 1
    other.write_bytes(data)
    code, facts = check(output, "--weights", other)
    assert (code, changed(facts)["--weights"], facts["rendered"]) == (1, "changed", [])
    code, facts = check(output, "--weights", checkpoint, *network[2:])
    assert (code, [each["same_bytes"] for each in facts["rendered"]]) == (0, [True])


def test_another_engine_draws_what_looks_the_same(studio, mt, check, checkpoint) -> None:
    output = studio.folder / "out.mkv"
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    network = ("--weights", checkpoint, "--engine", "openvino", "--precision", "f32")
    assert mt("run", *inputs, "-o", output, "--codec", "ffv1", *network).code == 0
    code, facts = check(output, "--weights", checkpoint, "--engine", "torch")
    assert code == 0
    assert any("torch" in words for words in facts["here"])
    [rendered] = facts["rendered"]
    assert rendered["same_bytes"] is True or rendered["least_psnr_db"] > 40


@pytest.mark.parametrize("name", ["out.mkv", "out.mov", "out.webm", "out", "out.png", "out.apng"])
def test_every_output_is_verified(studio, draft, check, name: str) -> None:
    output = studio.folder / name
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    few = ("--frames", "1") if name.endswith(".png") else ()
    assert draft(*inputs, "-o", output, *few).code == 0
    code, facts = check(output)
    assert (code, facts["rendered"][0]["same_bytes"]) == (0, True)


@pytest.mark.parametrize("name", ["out.gif", "out.webp"])
def test_what_is_encoded_at_once_is_compared_by_its_pixels(studio, draft, check, name) -> None:
    output = studio.folder / name
    inputs = ("--source", studio.source(), "--driver", studio.array(FRAMES))
    assert draft(*inputs, "-o", output).code == 0
    code, facts = check(output)
    assert (code, [each["same_bytes"] for each in facts["rendered"]]) == (0, [None, None])
    assert all((each["least_psnr_db"] or 99) > 30 for each in facts["rendered"])


def test_a_frame_of_a_folder_that_was_painted_over_is_found(studio, draft, mt) -> None:
    output = studio.folder / "out"
    inputs = ("--source", studio.source(), "--driver", studio.array(FRAMES))
    draft(*inputs, "-o", output)
    assert mt("verify", output).code == 0
    Image.new("RGB", (64, 96)).save(output / f"{CHUNK_FRAMES:06d}.png")
    outcome = mt("verify", output)
    assert outcome.code == 1
    assert f"frames {CHUNK_FRAMES}:{FRAMES} are not" in outcome.out


def test_scenes_partners_and_garments_are_asked_for_by_name(studio, draft, mt) -> None:
    output = studio.folder / "out.mp4"
    dress = studio.source("dress", colours=BLUE)
    behind = studio.image("behind.png", np.full((96, 64, 3), 90, np.uint8))
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    scene = ("--garment", dress, "--background", behind)
    assert draft(*inputs, *scene, "--garment-parts", "torso", "-o", output).code == 0
    lacking = mt("verify", output, *inputs)
    assert "give --garment, --background as well" in lacking.err
    assert mt("verify", output, *inputs, *scene).code == 0
    Image.new("RGB", (64, 96)).save(behind)
    outcome = mt("verify", output, *inputs, *scene)
    assert outcome.code == 1
    assert "behind.png: changed" in outcome.out


def test_without_a_record_there_is_nothing_to_compare(studio, draft, mt) -> None:
    output = studio.folder / "out.mp4"
    inputs = ("--source", studio.source(), "--driver", studio.array(3))
    draft(*inputs, "-o", output, "--provenance", "mark")
    mark = read_mark(output)
    assert mark is not None and mark.record is None
    assert "no more, as --provenance mark has it" in mt("verify", output).err
    plain = studio.video(3, name="plain.mp4", codec="libx264", pixels="yuv420p")
    outcome = mt("verify", plain)
    assert (outcome.code, "says nothing of what made it" in outcome.err) == (2, True)


@pytest.mark.parametrize(
    "record", ['{"format": "mt-provenance-9"}', "[" * 100_000, '{"format": 1, "output": []}']
)
def test_a_record_that_cannot_be_used_is_one_line(studio, made, mt, record: str) -> None:
    output = studio.folder / "odd.mkv"
    with av.open(str(made)) as source, av.open(str(output), "w") as target:
        target.metadata["comment"] = record if record[0] == "{" else '{"a":' + record
        target.metadata["comment"] += " http://cv.iptc.org/newscodes/digitalsourcetype/composite"
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.size:
                packet.stream = stream
                target.mux(packet)
    outcome = mt("verify", output)
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1 and "its record cannot be used" in outcome.err
