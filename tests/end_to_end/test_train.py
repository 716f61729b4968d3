"""`mt train` from files to weights that render, stopped and gone on with as a process."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image
from safetensors.torch import load_file

from motion_transfer.errors import InputError
from motion_transfer.estimate.models import MODEL_FILES, find_model
from motion_transfer.weights.checkpoint import inspect_checkpoint

pytest.importorskip("accelerate", reason="needs the `train` extra")

TINY = [
    f"--set={assignment}"
    for assignment in (
        *("model.feature_width=4", "model.render_width=4", "model.residual_blocks=1"),
        *("model.image_size=64", "model.texture_size=64", "losses.discriminator_width=4"),
        *("losses.discriminator_scales=1", "optimiser.batch_size=2", "keeping.log_every=1"),
    )
]
QUICK = (*TINY, "--no-perceptual", "--no-identity", "--workers", "0")


@pytest.fixture(autouse=True)
def fresh_accelerate():
    """Its state outlives a run; other settings would be refused."""
    yield
    from accelerate.state import AcceleratorState

    AcceleratorState._reset_state(reset_partial_state=True)


@pytest.fixture
def photos(studio) -> Path:
    """One person's frames, each with its IUV."""
    for number in range(5):
        iuv = studio.iuv(3 * number - 6, number)
        studio.image(f"frames/{number}_IUV.png", iuv)
        studio.image(f"frames/{number}.png", studio.dress(iuv))
    return studio.folder / "frames"


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as file:
        return np.array(file)


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "motion_transfer", "train", *map(str, arguments)]


def test_photos_to_weights_to_a_rendering(studio, mt, photos: Path) -> None:
    run, out = studio.folder / "run", studio.folder / "out.png"
    result = mt("train", "--data", photos, "-o", run, "--steps", 3, *QUICK, "--licence", "CC0")
    assert result.code == 0, result.err
    assert result.out.startswith(f"{run}/weights.safetensors: 3 steps, ")
    assert result.out.endswith("of the time waiting for data\n")
    assert (run / "train.toml").read_text() in result.err
    assert "step 3/3: texture " in result.err
    notes = inspect_checkpoint(run / "weights.safetensors").notes
    assert (notes["licence"], notes["step"]) == ("CC0", "3")
    assert notes["data"] == "20 pairs: photos of one person in frames"
    assert list((run / "tensorboard").iterdir())
    assert pixels(run / "samples/step_000003.png").shape == (4 * 64 + 3 * 4, 3 * 64 + 2 * 4, 3)
    rendered = mt(
        *("run", "--source", photos / "0.png", "--driver", photos / "3_IUV.png"),
        *("--weights", run / "weights.safetensors", "-o", out),
    )
    assert rendered.code == 0, rendered.err
    assert pixels(out).shape[:2] == (96, 64)


def test_killed_and_resumed_as_a_process(studio, photos: Path) -> None:
    whole, cut = studio.folder / "whole", studio.folder / "cut"
    settings = ("--data", photos, *QUICK, "--set=keeping.tensorboard=false")
    with subprocess.Popen(
        command(*settings, "--steps", 100_000, "-o", cut),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("step 2/"):
                break
        process.send_signal(signal.SIGTERM)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 143
    assert errors.splitlines()[-1].endswith(f"go on with mt train --resume {cut}")
    assert "Traceback" not in errors
    (kept,) = (cut / "checkpoints").iterdir()
    last = json.loads((kept / "state.json").read_text())["step"] + 3
    assert last >= 5
    for which in (("--resume", cut), (*settings, "-o", whole)):
        subprocess.run(command(*which, "--steps", last), check=True, capture_output=True)
    ours, theirs = (load_file(run / "weights.safetensors") for run in (cut, whole))
    assert all(bool((ours[name] == theirs[name]).all()) for name in theirs)


def test_everything_wrong_is_said_before_the_first_step(studio, mt, photos: Path) -> None:
    (photos / "1_IUV.png").unlink()
    (photos / "2.png").write_bytes(b"broken")
    path = photos / "pairs.csv"
    path.write_text("from,to\n0.png,1.png\n2.png,3.png\n0.png,9.png\n3.png,\n0.png,4.png\n")
    run = studio.folder / "run"
    result = mt("train", "--data", path, "-o", run, *QUICK, "--steps", 1)
    assert result.code == 2
    for words in ("4 problems", "1.png has no IUV", "2.png is not a picture", "9.png", "`to` is"):
        assert words in result.err
    left = mt("train", "--data", path, "-o", run, *QUICK, "--steps", 1, "--skip-broken")
    assert left.code == 2  # its folder is there by now
    assert "--resume" in left.err
    other = studio.folder / "other"
    skipped = mt("train", "--data", path, "-o", other, *QUICK, "--steps", 1, "--skip-broken")
    assert skipped.code == 0, skipped.err
    assert skipped.err.count("mt: note: left out:") == 4


def test_clips(studio, mt) -> None:
    folder = studio.folder / "clips"
    folder.mkdir()
    iuv = studio.walk(4)
    studio.video(iuv, name="clips/a_IUV.mkv")
    with av.open(str(folder / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.height, stream.width = iuv.shape[1:3]
        stream.pix_fmt = "yuv420p"
        for frame in iuv:
            picture = av.VideoFrame.from_ndarray(studio.dress(frame), format="rgb24")
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    run = studio.folder / "run"
    quick = (*TINY, "--no-perceptual", "--no-identity", "--workers", "1")
    result = mt("train", "--data", folder, "-o", run, "--steps", 1, *quick)
    assert result.code == 0, result.err
    notes = inspect_checkpoint(run / "weights.safetensors").notes
    assert notes["data"] == "3 pairs: clips in clips"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--data", "nowhere"), "data nowhere does not exist"),
        (("--init", "paper"), "no such weights ship with the program"),
        (("--no-perceptual",), "--sphereface FILE"),
        (("--no-identity", "--perceptual", "vgg19", "--vgg19", "no.pth"), "--no-perceptual"),
        (("--set", "model.image_size=60"), "image_size is 60"),
        (("--set", "losses.textur_weight=1"), "unknown key 'textur_weight'"),
        (("--vgg19", "a.pth", "--no-perceptual"), "contradict each other"),
        (("--no-perceptual", "--no-identity", "--set", "model.alpha=true"), "no alpha"),
    ],
)
def test_what_cannot_be_used(
    studio, mt, photos: Path, arguments: tuple[str, ...], message: str
) -> None:
    data = () if "--data" in arguments else ("--data", photos)
    extra = ("--no-perceptual", "--no-identity") if "--data" in arguments else ()
    result = mt("train", *data, "-o", studio.folder / "run", "--steps", 1, *arguments, *extra)
    assert result.code == 2
    assert message in result.err
    assert "Traceback" not in result.err


def test_without_the_extra(studio, mt, photos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motion_transfer.extras.find_spec", lambda _name: None)
    result = mt("train", "--data", photos, "-o", studio.folder / "run", *QUICK)
    assert result.code == 2
    assert "pip install 'motion-transfer[train]'" in result.err


def test_synthetic_people(studio, mt, body_model) -> None:
    run = studio.folder / "run"
    people = ("--data", "people", "--people", 2, "--set=data.views=2", "--set=data.size_px=64")
    result = mt("train", *people, "-o", run, "--steps", 1, *TINY, "--no-perceptual")
    assert result.code == 0, result.err
    assert 'identity = "none"' in (run / "train.toml").read_text()
    assert "alpha " in result.err
    again = ("--people-cache", run / "people", "--set=run.seed=5")
    result = mt(
        *("train", *people, *again, "-o", studio.folder / "again"),
        *("--steps", 1, *TINY, "--no-perceptual"),
    )
    assert result.code == 0, result.err
    stream = studio.folder / "stream"
    endless = (
        "--data",
        "people",
        "--people",
        0,
        "--set=data.size_px=64",
        "--set=keeping.samples=1",
    )
    result = mt("train", *endless, "-o", stream, "--steps", 1, *QUICK)
    assert result.code == 0, result.err
    notes = inspect_checkpoint(stream / "weights.safetensors").notes
    assert notes["data"] == "ever new synthetic people"


@pytest.fixture
def blazepose() -> None:
    """BlazePose's files are fetched once a machine."""
    try:
        for file in MODEL_FILES:
            find_model(file)
    except InputError as error:
        pytest.skip(str(error))


def test_the_network_that_paints_iuv(studio, mt, body_model, blazepose) -> None:
    data, run = studio.folder / "samples", studio.folder / "iuv"
    make = ("train", "iuv", "make", data, "--people", 2, "--workers", 1)
    assert mt(*make).out == f"{data}: 2 of 2 people added\n"
    assert mt(*make).out == f"{data}: 0 of 2 people added\n"
    fit = ("train", "iuv", "fit", data, run, "--batch-size", 2)
    fitted = mt(*fit, "--steps", 2)
    assert fitted.out == f"{run}/weights.safetensors: 2 steps\n", fitted.err
    assert fitted.err.startswith("step 2/2: parts ")
    longer = mt(*fit, "--steps", 3, "-q")
    assert (longer.out, longer.err) == (f"{run}/weights.safetensors: 3 steps\n", "")
    scored = mt("train", "iuv", "score", data, run / "weights.safetensors")
    assert [line.split()[0] for line in scored.out.splitlines()] == [
        *("iou", "part_agreement", "uv_error", "swapped", "turned"),
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--steps", 3, "iuv", "make", "data", "--people", 1), "mean nothing to `mt train iuv`"),
        (("iuv", "make", "data"), "missing option '--people'"),
        (("iuv", "fit", "nowhere", "run"), "make some by `mt train iuv make`"),
        (("iuv", "score", "nowhere", "w"), "nowhere holds no samples"),
    ],
)
def test_what_cannot_be_used_for_iuv(mt, arguments: tuple[str, ...], message: str) -> None:
    result = mt("train", *arguments)
    assert result.code == 2
    assert message in result.err
    assert "Traceback" not in result.err
