"""`mt export`: files that give what the engines give, whole or not at all."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import openvino
import pytest

from motion_transfer.drawing.engines import Execution, open_engine
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.openvino_engine import OpenVinoEngine
from motion_transfer.drawing.export import run
from motion_transfer.drawing.export.options import FORMATS
from motion_transfer.drawing.export.tensorrt_plan import simplify
from motion_transfer.drawing.graphs.whole import build_painter, build_sampler
from motion_transfer.version import __version__
from motion_transfer.weights.checkpoint import RANGES, copy_with_notes, read_checkpoint
from motion_transfer.weights.checkpoint import inspect_checkpoint as inspect

COARSE = 2.0
"""Levels that 8 bits may cost this network, on average: it is 1.7, and 18 with half the ranges."""

NETWORKS = {"encoder", "sampler", "painter-f32", "painter-int8"}


@pytest.fixture(scope="module")
def noise(checkpoint: Path) -> dict[str, np.ndarray]:
    return run.make_noise(inspect(checkpoint).config)


@pytest.fixture(scope="module")
def ranged(
    checkpoint: Path, noise: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The checkpoint, with what its convolutions read of noise."""
    engine = OpenVinoEngine(checkpoint, Execution("openvino", "f32", "cpu"))
    known = FeatureMap(noise["feature_map"])
    read = engine.read_by_convolutions(known, noise["iuv"][0])
    ranges = {name: (float(each.min()), float(each.max())) for name, each in read.items()}
    path = tmp_path_factory.mktemp("weights") / "ranged.safetensors"
    copy_with_notes(checkpoint, path, {RANGES: json.dumps(ranges)})
    return path


@pytest.fixture
def exported(mt, ranged: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "networks"
    words = ("--format", "onnx,openvino", "--precision", "f32", "--precision", "int8")
    result = mt("export", ranged, "-o", folder, *words, "-q")
    assert (result.code, result.out, result.err) == (0, "", "")
    return folder


def compute(file: Path | bytes, inputs: dict[str, np.ndarray]) -> np.ndarray:
    """What a file gives, or an ONNX graph in memory, by a library's own means."""
    if isinstance(file, Path) and file.suffix == ".xml":
        exact = {"INFERENCE_PRECISION_HINT": "f32"}
        compiled = openvino.Core().compile_model(file, "CPU", exact)
        return compiled({name: inputs[name] for port in compiled.inputs for name in port.names})[0]
    given = file if isinstance(file, bytes) else str(file)
    session = onnxruntime.InferenceSession(given, providers=["CPUExecutionProvider"])
    read = {port.name: inputs[port.name] for port in session.get_inputs()}
    return np.asarray(session.run(None, read)[0])


def draw_exactly(weights: Path, inputs: dict[str, np.ndarray]) -> np.ndarray:
    """The frame that torch draws, which is the specification."""
    engine = open_engine(weights, Execution("torch", "f32", "cpu"))
    return engine.draw(engine.take(FeatureMap(inputs["feature_map"])), inputs["iuv"])


def levels_off(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs(one.astype(int) - other)


def test_an_export_holds_every_network(exported: Path) -> None:
    names = {f"{name}{ending}" for name in NETWORKS for ending in (".onnx", ".xml", ".bin")}
    assert {file.name for file in exported.iterdir()} == names | {"README.md", "model.json"}
    assert [file.name for file in exported.parent.iterdir()] == ["networks"]


def test_painters_draw_what_engines_draw(exported: Path, ranged: Path, noise) -> None:
    exact = draw_exactly(ranged, noise)
    for ending in (".onnx", ".xml"):
        assert levels_off(compute(exported / f"painter-f32{ending}", noise), exact).max() <= 1
        coarse = levels_off(compute(exported / f"painter-int8{ending}", noise), exact)
        assert coarse.max() > 1
        assert coarse.mean() < COARSE


def test_encoder_and_sampler_are_torchs(exported: Path, checkpoint: Path, noise) -> None:
    import torch

    from motion_transfer.weights.checkpoint import load_checkpoint

    model = load_checkpoint(checkpoint)
    inputs = {name: torch.from_numpy(array) for name, array in noise.items()}
    with torch.inference_mode():
        feature_map = model.encode_texture(inputs["texture"], inputs["visibility"]).numpy()
        iuv = inputs["iuv"].permute(0, 3, 1, 2)
        features = model.feature_image(inputs["feature_map"], iuv).numpy()
    for ending in (".onnx", ".xml"):
        found = compute(exported / f"encoder{ending}", noise)
        np.testing.assert_allclose(found, feature_map, rtol=0, atol=1e-4)
        found = compute(exported / f"sampler{ending}", noise)
        np.testing.assert_allclose(found, features, rtol=0, atol=1e-4)


def test_what_is_finer_than_the_map_is_given_and_read(mt, tmp_path: Path) -> None:
    import torch

    from motion_transfer.weights.checkpoint import save_checkpoint
    from nhrr_core import ModelConfig, NeuralReRenderer

    torch.manual_seed(0)
    small = {"feature_width": 4, "render_width": 4, "residual_blocks": 1, "texture_size": 32}
    model = NeuralReRenderer(ModelConfig.preset("lite", image_size=64, **small)).eval()
    save_checkpoint(tmp_path / "lite.safetensors", model)
    folder = tmp_path / "networks"
    assert mt("export", tmp_path / "lite.safetensors", "-o", folder, "-q").code == 0
    networks = json.loads((folder / "model.json").read_text())["networks"]
    gives = {name: each["shape"] for name, each in networks["encoder"]["outputs"].items()}
    assert gives == {"feature_map": [1, 21, 32, 32], "detail": [1, 3, 128, 128]}
    inputs = run.make_noise(model.config)
    frames = [
        compute(folder / "painter-f32.onnx", {**inputs, "detail": inputs["detail"] * share})
        for share in (0, 1)
    ]
    with torch.inference_mode():
        known, detail, iuv = (
            torch.from_numpy(inputs[name]) for name in ("feature_map", "detail", "iuv")
        )
        drawn = model.render(known, iuv.permute(0, 3, 1, 2), detail)
    expected = ((drawn + 1) * 127.5).permute(0, 2, 3, 1).numpy()
    assert np.abs(frames[1] - expected).max() < 0.6
    assert levels_off(*frames).max() > 8


def test_bf16_is_stored_in_half(mt, checkpoint: Path, tmp_path: Path, noise) -> None:
    folder = tmp_path / "networks"
    words = ("--format", "openvino", "--precision", "bf16,f32")
    result = mt("export", checkpoint, "-o", folder, *words)
    assert result.code == 0
    assert result.out.startswith(f"wrote {folder}: 10 files, ")
    half, whole = (folder / f"painter-{name}.bin" for name in ("bf16", "f32"))
    table_bytes = 24 * 256 * 256 * 4
    assert half.stat().st_size < table_bytes + 0.6 * (whole.stat().st_size - table_bytes)
    frames = [compute(file.with_suffix(".xml"), noise) for file in (half, whole)]
    assert 0 < levels_off(*frames).max() <= 3


def test_convolutions_of_8_bits_run_as_such(exported: Path, noise) -> None:
    core = openvino.Core()
    if "INT8" not in core.get_property("CPU", "OPTIMIZATION_CAPABILITIES"):
        pytest.skip("this CPU multiplies no 8-bit numbers")
    compiled = core.compile_model(exported / "painter-int8.xml", "CPU", {"PERF_COUNT": True})
    request = compiled.create_infer_request()
    request.infer({name: noise[name] for name in ("feature_map", "iuv")})
    ran = [node for node in request.profiling_info if "Convolution" in node.node_type]
    assert len(ran) == 10
    # transposed ones have no kernel of bytes where the CPU has no VNNI
    plain = [node.exec_type for node in ran if node.node_type == "Convolution"]
    assert len(plain) >= 7
    assert all(how.lower().endswith("i8") for how in plain), " ".join(plain)


def test_files_say_what_they_are(exported: Path, ranged: Path) -> None:
    digest = hashlib.sha256(ranged.read_bytes()).hexdigest()
    told = {
        "format": "nhrr-export-1",
        "weights": "ranged.safetensors",
        "weights_sha256": digest,
        "licence": "CC0",
        "exported_by": f"motion-transfer {__version__}",
    }
    for name in NETWORKS:
        model = onnx.load(exported / f"{name}.onnx")
        assert {entry.key: entry.value for entry in model.metadata_props} == told
        graph = openvino.Core().read_model(exported / f"{name}.xml")
        assert {key: graph.get_rt_info(["notes", key]).value for key in told} == told
    facts = json.loads((exported / "model.json").read_text())
    assert facts["notes"] == told
    for name, file in facts["files"].items():
        content = (exported / name).read_bytes()
        assert (file["bytes"], file["sha256"]) == (
            len(content),
            hashlib.sha256(content).hexdigest(),
        )
    assert set(facts["files"]) == {file.name for file in exported.iterdir()} - {
        *("README.md", "model.json"),
    }
    assert facts["sides"] == {"least": 48, "usual": 64, "most": 160, "multiple_of": 8}
    painter = facts["networks"]["painter"]
    assert painter["inputs"]["iuv"]["shape"] == [1, "height", "width", 3]
    assert painter["outputs"]["frame"]["meaning"] == "the picture, RGB, 0 to 255"
    words = (exported / "README.md").read_text()
    assert "- input `iuv`, uint8, 1 x height x width x 3: target IUV" in words
    assert "| painter-int8.onnx | painter | int8 | " in words


ERRORS = {
    "int8 without ranges": (["--precision", "int8"], "--precision int8: weights {weights} do not "),
    "no such numbers": (["--precision", "bf16"], "--precision bf16: onnx has int8, f32; choose "),
    "no such format": (["--format", "coreml"], "format is 'coreml'; supported are onnx, openvino"),
    "no such precision": (["--precision", "int4"], "precision is 'int4'; supported are int8, "),
}


@pytest.mark.parametrize("name", ERRORS)
def test_what_cannot_be_exported_is_one_line(mt, checkpoint: Path, tmp_path: Path, name) -> None:
    words, message = ERRORS[name]
    result = mt("export", checkpoint, "-o", tmp_path / "networks", "-q", *words)
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("mt: " + message.format(weights=checkpoint))
    assert result.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_format_whose_library_is_missing_is_refused(
    mt, checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    row = replace(FORMATS["tensorrt"], package="no_such_library")
    monkeypatch.setitem(FORMATS, "tensorrt", row)
    result = mt("export", checkpoint, "-o", tmp_path / "networks", "--format", "tensorrt")
    assert result.code == 2
    assert result.err == (
        "mt: --format tensorrt needs no_such_library; pip install no_such_library, or choose"
        " another\n"
    )


def test_a_file_that_gives_something_else_is_not_published(
    mt, checkpoint: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "run_file", lambda _path, _inputs: [np.zeros(1)])
    result = mt("export", checkpoint, "-o", tmp_path / "new" / "networks", "-q")
    assert result.code == 1
    assert result.err.startswith("mt: encoder.onnx gives ")
    assert not list(tmp_path.iterdir())


def test_an_earlier_export_is_replaced_by_force_alone(mt, checkpoint: Path, tmp_path: Path) -> None:
    folder = tmp_path / "networks"
    folder.mkdir()
    (folder / "painter-int8.onnx").write_bytes(b"old")
    result = mt("export", checkpoint, "-o", folder, "-q")
    assert (result.code, result.err) == (
        2,
        f"mt: {folder} exists already; choose another name or add --force\n",
    )
    assert mt("export", checkpoint, "-o", folder, "-q", "--force").code == 0
    assert not (folder / "painter-int8.onnx").exists()
    (folder / "thesis.tex").write_text("three years")
    result = mt("export", checkpoint, "-o", folder, "-q", "--force")
    assert result.code == 2
    assert "other things than those of an export in it" in result.err
    assert (folder / "thesis.tex").exists()


@pytest.mark.parametrize("name", ["sampler", "painter"])
def test_what_tensorrt_is_given_says_the_same(ranged: Path, noise, name: str) -> None:
    config, tensors = read_checkpoint(ranged)
    model = build_sampler(config) if name == "sampler" else build_painter(config, tensors)
    simple = simplify(model)
    onnx.checker.check_model(simple, full_check=True)
    kinds = {tensor.data_type for tensor in simple.graph.initializer}
    assert not kinds & {onnx.TensorProto.UINT8, onnx.TensorProto.UINT16}
    readers = [node.op_type for node in simple.graph.node if "iuv" in node.input]
    assert readers == ["Cast"]
    one, other = (compute(each.SerializeToString(), noise) for each in (simple, model))
    np.testing.assert_array_equal(one, other)


def test_tensorrts_8_bits_have_a_sign(ranged: Path, noise) -> None:
    networks = run.list_networks(ranged, ("int8",), {}, signed=True)
    (painter,) = (each.model for each in networks if each.name == "painter")
    simple = simplify(painter)
    held = {tensor.name: tensor.data_type for tensor in simple.graph.initializer}
    zeros = [held[node.input[2]] for node in simple.graph.node if "Linear" in node.op_type]
    assert len(zeros) == 30
    assert set(zeros) == {onnx.TensorProto.INT8}
    frame = compute(simple.SerializeToString(), noise)
    assert levels_off(frame, draw_exactly(ranged, noise)).mean() < COARSE


def test_tensorrt_builds_plans(mt, ranged: Path, tmp_path: Path) -> None:
    pytest.importorskip("tensorrt")
    import torch

    if not torch.cuda.is_available():
        pytest.skip("TensorRT builds plans for the GPU at hand")
    folder = tmp_path / "networks"
    words = ("--format", "tensorrt", "--precision", "f32,int8")
    assert mt("export", ranged, "-o", folder, *words).code == 0
    assert {file.stem for file in folder.glob("*.plan")} == NETWORKS
