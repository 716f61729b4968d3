"""Every engine draws what the specification draws, and says what it cannot."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
import torch

from motion_transfer.cores import multiplies_bytes
from motion_transfer.drawing.engines import (
    ENGINES,
    Execution,
    Wish,
    choose_execution,
    open_engine,
    torch_engine,
)
from motion_transfer.drawing.engines.graph_engine import GraphEngine
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.engines.lookup import FeatureRows
from motion_transfer.drawing.engines.openvino_engine import OpenVinoEngine, fast_precisions
from motion_transfer.drawing.engines.outline import signed_distance
from motion_transfer.drawing.engines.torch_engine import BATCHES, choose_batch, cut_pictures
from motion_transfer.drawing.source import dress, unfold_source
from motion_transfer.drawing.unfolding import pixels_per_texel
from motion_transfer.errors import InputError, WeightsError
from motion_transfer.evaluation.calibration import measure_ranges
from motion_transfer.render.options import SourceOptions
from motion_transfer.render.plan import CHUNK_FRAMES
from motion_transfer.render.source import read_source
from motion_transfer.weights.checkpoint import (
    RANGES,
    copy_with_notes,
    inspect_checkpoint,
    load_checkpoint,
    read_ranges,
    save_checkpoint,
)
from nhrr_core import ModelConfig, NeuralReRenderer, clearance, load_uv_layout, sampling

SIDE = 64
EXACT = Execution("torch", "f32", "cpu")


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small model with all that `lite` has."""
    torch.manual_seed(0)
    small = {"feature_width": 4, "render_width": 8, "texture_size": 64}
    config = ModelConfig.preset("lite", alpha=True, **small)
    model = NeuralReRenderer(config)
    path = tmp_path_factory.mktemp("weights") / "small.safetensors"
    save_checkpoint(path, model)
    return path


@pytest.fixture
def source(studio):
    return read_source(SourceOptions(source=(studio.source(),)), 256)


@pytest.fixture
def crops(studio) -> np.ndarray:
    return np.stack([studio.iuv(4 * i, -20 * i, size=(SIDE, SIDE)) for i in range(3)])


@pytest.fixture
def calibrated(weights: Path, source, crops, tmp_path: Path) -> Path:
    engine = OpenVinoEngine(weights, Execution("openvino", "f32", "cpu"))
    feature_map = engine.encode(source)
    ranges = measure_ranges(engine, ((feature_map, crop) for crop in crops))
    copy_with_notes(weights, tmp_path / "calibrated.safetensors", {RANGES: json.dumps(ranges)})
    return tmp_path / "calibrated.safetensors"


def arrays(feature_map: FeatureMap) -> list[np.ndarray]:
    return [each for each in (feature_map.features, feature_map.detail) if each is not None]


def skip_what_is_slow(how: Execution) -> None:
    """OpenVINO emulates what the CPU cannot multiply, and then neither exactly nor repeatably."""
    if how.engine == "openvino" and how.precision not in fast_precisions("cpu"):
        pytest.skip(f"this CPU does not multiply {how.precision}")


@pytest.mark.parametrize(
    ("how", "levels"),
    [
        (Execution("openvino", "f32", "cpu"), 1),
        (Execution("onnx", "f32", "cpu"), 1),
        (Execution("torch", "bf16", "cpu"), 16),
        (Execution("openvino", "bf16", "cpu"), 16),
        (Execution("openvino", "int8", "cpu"), 64),
        (Execution("onnx", "int8", "cpu"), 64),
    ],
    ids=str,
)
def test_engines_draw_what_torch_draws(
    calibrated: Path, source, crops: np.ndarray, how: Execution, levels: int
) -> None:
    skip_what_is_slow(how)
    exact, engine = open_engine(calibrated, EXACT), open_engine(calibrated, how)
    expected = exact.draw(exact.take(exact.encode(source)), crops)
    feature_map = engine.encode(source)
    for one, other in zip(arrays(feature_map), arrays(exact.encode(source)), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-4)
    drawn = engine.draw(engine.take(feature_map), crops)
    assert (drawn.dtype, drawn.shape) == (np.uint8, (3, SIDE, SIDE, 4))
    away = np.abs(drawn.astype(int) - expected)
    assert away.max() <= levels
    assert away.mean() <= levels / 10  # weights at random exaggerate


@pytest.fixture(params=["texture-features", "cbi", "dpt"])
def reading(request, tmp_path: Path) -> Path:
    """Weights of a variant that reads the photo itself."""
    torch.manual_seed(0)
    small = {"feature_width": 4, "render_width": 8, "texture_size": 64, "image_size": SIDE}
    config = ModelConfig.preset("lite", alpha=True, variant=request.param, **small)
    path = tmp_path / f"{request.param}.safetensors"
    save_checkpoint(path, NeuralReRenderer(config))
    return path


def test_variants_that_read_the_photo(reading: Path, source, crops: np.ndarray) -> None:
    exact = open_engine(reading, EXACT)
    source = unfold_source(source.pictures, exact.config.finest_texture)
    feature_map = exact.encode(source)
    expected = exact.draw(exact.take(feature_map), crops)
    assert expected.shape == (3, SIDE, SIDE, 4)
    how = choose_execution(Wish(precision="f32", device="cpu"), inspect_checkpoint(reading))
    engine = open_engine(reading, how)
    for one, other in zip(arrays(engine.encode(source)), arrays(feature_map), strict=True):
        np.testing.assert_array_equal(one, other)
    away = np.abs(engine.draw(engine.take(feature_map), crops).astype(int) - expected)
    assert away.max() <= 1
    if reading.stem != "dpt":
        assert how.engine == "openvino"
        return
    assert how.engine == "torch"
    message = f"--engine openvino does not run variant dpt of weights {reading}; choose"
    with pytest.raises(InputError, match=message):
        choose_execution(Wish(engine="openvino"), inspect_checkpoint(reading))


def test_a_garment_hides_what_the_person_wore(reading: Path, source, studio) -> None:
    """Texels of the parts that it gives are no longer seen in the person's photo."""
    engine = open_engine(reading, EXACT)
    person, garment = source.pictures[0], replace(source.pictures[0], parts=(2,))
    rest = tuple(part for part in person.parts if part != 2)
    whole, cut = (
        cut_pictures(source, engine.config),
        cut_pictures(
            dress(unfold_source([replace(person, parts=rest)], 128), [garment]), engine.config
        ),
    )
    assert whole is not None and cut is not None
    assert (
        (whole[:, 3] == 2).any() and (cut[0, 3] != 2).all() and set(np.unique(cut[1, 3])) == {0, 2}
    )


def test_photos_that_a_kept_source_lacks_are_asked_for(reading: Path, source) -> None:
    engine = open_engine(reading, EXACT)
    kept = replace(source, pictures=(), kept=Path("me.mtsource"))
    with pytest.raises(InputError, match=r"source me\.mtsource does not hold all of its photos"):
        engine.encode(kept)


@pytest.mark.parametrize("name", ["openvino", "onnx"])
def test_graphs_give_the_features_that_torch_gives(
    weights: Path, source, crops: np.ndarray, name: str
) -> None:
    exact, engine = (
        open_engine(weights, Execution(each, "f32", "cpu")) for each in ("torch", name)
    )
    feature_map = exact.encode(source)
    features = engine.feature_image(engine.take(feature_map), crops)
    expected = exact.feature_image(exact.take(feature_map), crops)
    np.testing.assert_allclose(features, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize("precision", ["bf16", "int8"])
def test_calls_side_by_side_draw_the_same(
    calibrated: Path, source, crops: np.ndarray, precision: str
) -> None:
    skip_what_is_slow(Execution("openvino", precision, "cpu"))
    engine = open_engine(calibrated, Execution("openvino", precision, "cpu"))
    feature_map = engine.take(engine.encode(source))
    alone = [engine.draw(feature_map, crops[i : i + 1]) for i in range(3)]
    with ThreadPoolExecutor(3) as threads:
        calls = [
            threads.submit(engine.draw, feature_map, crops[i % 3 : i % 3 + 1]) for i in range(9)
        ]
    for number, call in enumerate(calls):
        np.testing.assert_array_equal(call.result(), alone[number % 3])


@pytest.mark.parametrize("finest", [None, 64, 600, 1024], ids=["without", "all", "some", "none"])
@pytest.mark.parametrize("size", [16, 100, 512])
def test_the_look_up_is_torchs(size: int, finest: int | None) -> None:
    """Of all parts, and of places at the texture's edges."""
    rng = np.random.default_rng(0)
    iuv = rng.integers(0, 256, (40, 56, 3), np.uint8)
    iuv[..., 0] = rng.integers(0, 25, (40, 56))
    iuv[:4, :, 1:] = rng.choice(np.array([0, 255], np.uint8), (4, 56, 2))
    features = rng.normal(size=(1, 7, size, size)).astype(np.float32)
    detail = finest and rng.normal(size=(1, 3, finest, finest)).astype(np.float32)
    looked_up = FeatureRows(FeatureMap(features, detail)).look_up(iuv, pixels_per_texel(iuv))
    target, charts = torch.from_numpy(iuv).permute(2, 0, 1)[None], load_uv_layout().charts
    expected = sampling.sample_features(torch.from_numpy(features), target, charts)
    if detail is not None:
        share = clearance.detail_share(clearance.pixels_per_texel(target, charts), finest)
        finer = sampling.sample_features(torch.from_numpy(detail), target, charts)
        expected[:, :3] += share * finer
    np.testing.assert_allclose(looked_up, expected.permute(0, 2, 3, 1).numpy(), rtol=0, atol=2e-4)


def test_nobody_is_looked_up() -> None:
    ones = np.ones((1, 3, 16, 16), np.float32)
    assert not FeatureRows(FeatureMap(ones, ones)).look_up(np.zeros((8, 8, 3), np.uint8), 1).any()


def test_the_outline_is_torchs(crops: np.ndarray) -> None:
    iuv = torch.from_numpy(crops).permute(0, 3, 1, 2)
    distances = sampling.signed_distance(iuv[:, :1] > 0, 24)[:, 0].numpy()
    scales = clearance.pixels_per_texel(iuv, load_uv_layout().charts).numpy()
    for crop, distance, scale in zip(crops, distances, scales, strict=True):
        np.testing.assert_allclose(signed_distance(crop), distance, rtol=0, atol=1e-5)
        assert pixels_per_texel(crop) == pytest.approx(scale)


@pytest.mark.parametrize("blank", [0, 1], ids=["nobody", "everywhere"])
def test_an_outline_that_is_not_there(blank: int) -> None:
    iuv = np.full((SIDE, SIDE, 3), blank, np.uint8)
    expected = sampling.signed_distance(torch.from_numpy(iuv[None, None, ..., 0] > 0), 24)
    np.testing.assert_allclose(signed_distance(iuv), expected[0, 0].numpy())


def test_ranges_hold_what_is_read(weights: Path, source, crops: np.ndarray) -> None:
    """As torch's own convolutions read it."""
    engine = OpenVinoEngine(weights, Execution("openvino", "f32", "cpu"))
    feature_map = engine.encode(source)
    ranges = measure_ranges(engine, ((feature_map, crop) for crop in crops))
    model, read = load_checkpoint(weights), {}
    for name, layer in model.render_net.named_modules():
        if isinstance(layer, torch.nn.Conv2d | torch.nn.ConvTranspose2d):
            layer.register_forward_pre_hook(
                lambda _layer, inputs, name=name: read.setdefault(name, []).append(inputs[0])
            )
    with torch.inference_mode():
        iuv = torch.from_numpy(crops).permute(0, 3, 1, 2)
        features, detail = map(torch.from_numpy, arrays(feature_map))
        model.render(features, iuv, detail)
    assert {name.removeprefix("render_net.") for name in ranges} == set(read)
    for name, values in read.items():
        least, largest = ranges[f"render_net.{name}"]
        assert least == pytest.approx(float(values[0].min()), abs=1e-3)
        assert largest == pytest.approx(float(values[0].max()), abs=1e-3)


def test_eight_bits_are_taken_where_the_ranges_are_known(weights: Path, calibrated: Path) -> None:
    wish = Wish(engine="openvino")
    assert choose_execution(wish, inspect_checkpoint(weights)).precision in ("bf16", "f32")
    fastest = fast_precisions("cpu")[0]
    assert choose_execution(wish, inspect_checkpoint(calibrated)).precision == fastest
    assert (fastest == "int8") == multiplies_bytes()
    wish = Wish(engine="onnx")  # which is not faster in them
    assert choose_execution(wish, inspect_checkpoint(calibrated)).precision == "f32"


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (Wish(precision="int8"), "do not say of which ranges .* mt calibrate"),
        (Wish(engine="torch", precision="int8"), "torch has bf16, f32; choose one of them"),
        (Wish(engine="openvino", device="cuda"), "openvino runs on CPUs; choose --engine torch"),
        (Wish(device="cuda:7"), "torch finds .*; choose another, or cpu"),
        (Wish(engine="onnx", device="mps"), "only torch runs there; choose --engine torch"),
    ],
    ids=str,
)
def test_what_cannot_be_is_said(weights: Path, wish: Wish, words: str) -> None:
    with pytest.raises(InputError, match=words):
        choose_execution(wish, inspect_checkpoint(weights))


def test_apples_gpus_run_torch_in_32_bits(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motion_transfer.devices._has_mps", lambda: True)
    how = choose_execution(Wish(device="mps"), inspect_checkpoint(weights))
    assert how == Execution("torch", "f32", "mps")


def test_a_torch_that_tells_nothing_of_the_cpu_multiplies_32_bits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in torch_engine.BF16_CPUS:
        monkeypatch.delattr(torch.cpu, name, raising=False)
    assert torch_engine.fast_precisions("cpu") == ["f32"]


def test_a_missing_library_is_named(weights: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(InputError, match="--engine onnx needs onnxruntime; pip install"):
        choose_execution(Wish(engine="onnx"), inspect_checkpoint(weights))
    assert not ENGINES["openvino"].installed


@pytest.mark.parametrize(
    "ranges",
    [
        *("{", "[]", "{}", '{"other": [0, 1]}', '{"render_net.layers.1": [1, 0]}'),
        *('{"render_net.layers.1": [0]}', '{"render_net.layers.1": ["a", 1]}', '{"a": NaN}'),
    ],
)
def test_broken_ranges_are_refused(weights: Path, tmp_path: Path, ranges: str) -> None:
    path = tmp_path / "broken.safetensors"
    copy_with_notes(weights, path, {RANGES: ranges})
    with pytest.raises(WeightsError, match="broken ranges of their numbers; measure them again"):
        read_ranges(inspect_checkpoint(path))


def test_notes_are_added_and_tensors_stay(weights: Path, tmp_path: Path) -> None:
    path = tmp_path / "copy.safetensors"
    copy_with_notes(weights, path, {"licence": "CC0"})
    assert inspect_checkpoint(path).notes == {"licence": "CC0"}
    one, other = load_checkpoint(weights), load_checkpoint(path)
    assert one.config == other.config
    for name, tensor in one.state_dict().items():
        assert torch.equal(tensor, other.state_dict()[name])


def test_batches_divide_a_chunk_and_fit_the_memory() -> None:
    assert all(CHUNK_FRAMES % batch == 0 for batch in BATCHES)
    config = ModelConfig.preset("paper")
    sizes = [choose_batch(config, 256, free << 30) for free in (0, 4, 16, 80)]
    assert sizes == sorted(sizes)
    assert (sizes[0], sizes[-1]) == (1, CHUNK_FRAMES)
    assert choose_batch(config, 512, 16 << 30) < choose_batch(config, 256, 16 << 30)


def test_a_lane_draws_the_source_and_the_crops_that_it_is_given(
    weights: Path, source, crops: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With stand-ins for CUDA, of which a graph that is replayed draws anew."""
    for name in ("Stream", "CUDAGraph", "synchronize"):
        monkeypatch.setattr(torch.cuda, name, MagicMock())
    for name in ("stream", "graph"):
        monkeypatch.setattr(torch.cuda, name, lambda *_, **__: nullcontext())
    monkeypatch.setattr(torch_engine, "pinned", partial(torch.empty, dtype=torch.uint8))
    engine = open_engine(weights, EXACT)
    assert isinstance(engine, torch_engine.TorchEngine)
    device = torch.device("cpu")
    lane = torch_engine._CudaLane(engine._frames, engine.config, len(crops), SIDE, device)

    def replay() -> None:
        with torch.inference_mode():
            lane._frames.copy_(engine._frames(lane._known, lane._iuv))

    monkeypatch.setattr(lane._graph, "replay", replay)
    one = engine.take(engine.encode(source))
    features, detail = arrays(engine.encode(source))
    other, plain = (
        engine.take(FeatureMap(np.ascontiguousarray(features[..., ::-1]), detail)),
        engine.take(FeatureMap(features, np.zeros_like(detail))),
    )
    for feature_map, shown in (
        *((one, crops), (one, crops[::-1]), (other, crops), (plain, crops), (one, crops)),
    ):
        drawn, expected = lane.draw(feature_map, shown), engine.draw(feature_map, shown.copy())
        np.testing.assert_array_equal(drawn, expected)
    for each in (other, plain):
        assert not np.array_equal(engine.draw(one, crops), engine.draw(each, crops))


def test_graph_engines_take_an_image_a_call(weights: Path) -> None:
    engine = open_engine(weights, Execution("openvino", "f32", "cpu"))
    assert isinstance(engine, GraphEngine)
    assert engine.batch_size(SIDE) == 1
