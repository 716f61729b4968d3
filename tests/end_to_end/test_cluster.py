"""Two nodes of a Ray cluster on this machine, one of which dies in the middle of a job."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from motion_transfer import render_video
from motion_transfer.batch.events import BatchFinished, JobFrames
from motion_transfer.batch.run import BatchOptions, run_batch
from motion_transfer.render.plan import CHUNK_FRAMES

ray = pytest.importorskip("ray", reason="needs the `cluster` extra")
pytestmark = pytest.mark.filterwarnings("ignore")  # Ray's own
FRAMES = 6 * CHUNK_FRAMES


@pytest.fixture
def cluster() -> Iterator[Any]:
    """A head, which takes no work, and one node; the test adds and removes others."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    cluster.add_node(num_cpus=1)
    yield cluster
    ray.shutdown()
    cluster.shutdown()


def test_a_node_that_dies_changes_nothing(studio, cluster) -> None:
    source = studio.source("anna")
    studio.array(FRAMES, name="walk.npy")
    whole = render_video(
        source, studio.folder / "walk.npy", studio.folder / "whole.mp4", renderer="texture"
    ).output
    path: Path = studio.folder / "shoot.yaml"
    job = {"source": "anna.png", "driver": "walk.npy", "output": "anna.mp4"}
    job["renderer"] = "texture"
    path.write_text(
        yaml.safe_dump({"version": 1, "output_root": "out", "retries": 3, "jobs": [job]})
    )
    doomed = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    told: list[object] = []

    def listen(event: object) -> None:
        told.append(event)
        if isinstance(event, JobFrames) and sum(isinstance(e, JobFrames) for e in told) == 1:
            threading.Thread(target=cluster.remove_node, args=(doomed, False)).start()
            time.sleep(1)
            cluster.add_node(num_cpus=1)

    tally = run_batch(
        BatchOptions(manifest=path, engine="ray", address=cluster.address, workers=2), listen
    )
    assert (tally.done, tally.failed) == (1, 0)
    assert (studio.folder / "out/anna.mp4").read_bytes() == whole.read_bytes()
    assert next(e for e in told if isinstance(e, BatchFinished)).feature_maps == 1
