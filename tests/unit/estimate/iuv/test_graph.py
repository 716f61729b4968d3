"""The graph of the IUV network is the network, and gives the same bytes however it is called."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import torch

from motion_transfer.errors import WeightsError
from motion_transfer.estimate.inference import CpuNetwork
from motion_transfer.estimate.iuv.body import COARSE, FINE, BodyArrays
from motion_transfer.estimate.iuv.features import BodyInput
from motion_transfer.estimate.iuv.graph import build_graph, read_painted
from motion_transfer.estimate.iuv.network import IuvNetwork, load_weights, save_weights
from motion_transfer.estimate.iuv.weights import IuvNetworkConfig, shipped_file


def somebody(seed: int) -> BodyArrays:
    rng = np.random.default_rng(seed)
    shapes = ((1, 33, 3), (1, 33, 3), (1, 33), (1, 1, 256, 256), (1, *COARSE), (1, *FINE))
    body = BodyArrays(*(rng.random(shape, np.float32) for shape in shapes))
    return body._replace(world=body.world - 0.5)


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    """Weights in which everything counts: statistics and FiLM are not those of a new network."""
    torch.manual_seed(0)
    network = IuvNetwork(IuvNetworkConfig(widths=(8, 12, 10), code=8))
    for name, value in network.state_dict().items():
        if "norm" in name and value.is_floating_point():
            value.copy_(torch.rand_like(value) + 0.5)
        if "film" in name:
            value.normal_(std=0.3)
    save_weights(tmp_path / "w.safetensors", network, {})
    return tmp_path / "w.safetensors"


@pytest.mark.parametrize("shipped", [True, False])
def test_the_graph_is_the_network(trained: Path, shipped: bool) -> None:
    weights = shipped_file() if shipped else trained
    graph, network = CpuNetwork(build_graph(weights)), load_weights(weights).fused()
    for seed in range(3):
        body = somebody(seed)
        if seed == 2:  # a trunk without length: bones are as thin as they get
            body.points[:] = body.points[:, :1]
        parts, uv = read_painted(*graph.run(*body))
        with torch.inference_mode():
            true = network(BodyInput(*map(torch.from_numpy, body)))
        largest = true.parts.abs().max()
        assert np.abs(parts - true.parts[0].numpy()).max() < 1e-5 * largest
        assert np.abs(uv - true.uv[0].numpy()).max() < 1e-4


def test_bytes_do_not_depend_on_how_many_run(monkeypatch: pytest.MonkeyPatch) -> None:
    people = [somebody(seed) for seed in range(4)] * 3
    found = []
    for cores in (1, 2, 3):
        monkeypatch.setattr("motion_transfer.cores._share", cores)
        network = CpuNetwork(build_graph(shipped_file()), at_once=3)
        for threads in (1, 3):
            with ThreadPoolExecutor(threads) as pool:
                found.append(list(pool.map(lambda body: network.run(*body)[0].tobytes(), people)))  # noqa: B023
    assert all(each == found[0] for each in found[1:])
    assert len(set(found[0])) == 4


def test_weights_that_do_not_fit_are_refused(trained: Path) -> None:
    network = load_weights(shipped_file()).fused()
    network.config = IuvNetworkConfig(widths=(8, 8))
    save_weights(trained, network, {})
    with pytest.raises(WeightsError, match="do not fit their own configuration"):
        build_graph(trained)


def test_estimating_needs_no_torch() -> None:
    code = (
        "import sys, motion_transfer.estimate.blazepose, motion_transfer.estimate.run;"
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
