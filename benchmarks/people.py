"""Synthetic people: finished images a second on one core, and where the time goes.

    python benchmarks/people.py [--people 24] [--size 256] [--rounds 3]

An image is finished when photo, alpha and IUV are there (not yet compressed to PNG). Each person is
dressed once and photographed twice, as in a training pair. Everything runs in one thread, as in one
of several workers. The baseline, in the same run: the body's IUV by casting a ray through every
pixel with warp, which is what the rasteriser replaced.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before torch and NumPy

import cv2
import numpy as np
import torch
import warp as wp

from motion_transfer.people import photo as photo_module
from motion_transfer.people.dataset import PeopleStream
from motion_transfer.people.figure.body import load_body_model
from motion_transfer.people.figure.camera import frame_points
from motion_transfer.people.figure.charts import load_charts, render_iuv

STEPS = ("frame_points", "paint_background", "floor_shadow", "develop", "render_iuv")


@wp.kernel
def cast(
    mesh: wp.uint64,
    origin: wp.vec3,
    direction: wp.array(dtype=wp.vec3),
    face: wp.array(dtype=wp.int32),
    weights: wp.array(dtype=wp.vec3),
) -> None:
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, origin, direction[i], 100.0)
    face[i] = -1
    if hit.result:
        face[i] = hit.face
        weights[i] = wp.vec3(hit.u, hit.v, 1.0 - hit.u - hit.v)


def cast_iuv(points, faces, charts, camera) -> np.ndarray:
    """The baseline: as `render_iuv`, by rays."""
    rows, columns = np.mgrid[: camera.height, : camera.width] + 0.5
    across, down, into = camera.axes
    direction = (
        ((columns - camera.width / 2) / camera.focal_px)[..., None] * across
        + ((rows - camera.height / 2) / camera.focal_px)[..., None] * down
        + into
    ).reshape(-1, 3)
    mesh = wp.Mesh(
        points=wp.array(points, dtype=wp.vec3, device="cpu"),
        indices=wp.array(faces.ravel(), dtype=wp.int32, device="cpu"),
    )
    rays = wp.array(direction.astype(np.float32), dtype=wp.vec3, device="cpu")
    face = wp.empty(len(direction), dtype=wp.int32, device="cpu")
    weights = wp.zeros(len(direction), dtype=wp.vec3, device="cpu")
    origin = wp.vec3(*camera.position)
    wp.launch(cast, len(direction), [mesh.id, origin, rays], [face, weights], device="cpu")
    face, weights = face.numpy(), weights.numpy()
    seen = face >= 0
    iuv = np.zeros((len(face), 3), np.uint8)
    iuv[seen, 0] = charts.part[face[seen]]
    chart = np.einsum("pk,pkc->pc", weights[seen], charts.uv[face[seen]])
    iuv[seen, 1:] = np.rint(np.clip(chart, 0, 1) * 255)
    return iuv.reshape(camera.height, camera.width, 3)


@contextmanager
def timed_steps(times: dict[str, list[float]]) -> Iterator[None]:
    """Measure the steps of taking a photo, by name."""
    originals = {name: getattr(photo_module, name) for name in STEPS}

    def wrap(name: str, step: Callable) -> Callable:
        def measured(*arguments, **settings):
            began = time.perf_counter()
            result = step(*arguments, **settings)
            times[name].append(time.perf_counter() - began)
            return result

        return measured

    for name, step in originals.items():
        setattr(photo_module, name, wrap(name, step))
    try:
        yield
    finally:
        for name, step in originals.items():
            setattr(photo_module, name, step)


def images(size: int, people: int, rounds: int) -> None:
    stream = PeopleStream(size=(size, size))
    stream.take(stream.dress(0), stream.shot(0, 0))  # kernels are loaded or compiled here
    rates = []
    times: dict[str, list[float]] = defaultdict(list)
    with timed_steps(times):
        for _ in range(rounds):
            began = time.perf_counter()
            for number in range(people):
                start = time.perf_counter()
                dressed = stream.dress(number)
                times["dress (once a person)"].append(time.perf_counter() - start)
                for view in (0, 1):
                    start = time.perf_counter()
                    shot = stream.shot(number, view)
                    times["sample a shot"].append(time.perf_counter() - start)
                    stream.take(dressed, shot)
            rates.append(2 * people / (time.perf_counter() - began))
    print(
        f"{size} x {size}, one core: median {statistics.median(rates):.1f} finished images/s"
        f" (of {rounds} rounds of {2 * people} images: {min(rates):.1f} to {max(rates):.1f})"
    )
    for name, seconds in sorted(times.items(), key=lambda item: -sum(item[1])):
        share = sum(seconds) / (2 * people * rounds)
        print(
            f"  {name}: median {statistics.median(seconds) * 1e3:.1f} ms,"
            f" {share * 1e3:.1f} ms an image"
        )


def rasteriser(size: int, rounds: int) -> None:
    model, charts = load_body_model(), load_charts()
    body = model.template
    camera = frame_points(body.points, (size, size), distance=4.0)
    arguments = (body.points, model.faces, charts, camera)
    ours, rays = render_iuv(*arguments), cast_iuv(*arguments)
    same = (ours == rays).all(2).mean()
    ratios = []
    for _ in range(max(rounds, 9)):
        began = time.perf_counter()
        render_iuv(*arguments)
        middle = time.perf_counter()
        cast_iuv(*arguments)
        ratios.append(((time.perf_counter() - middle), middle - began))
    slow, fast = (statistics.median(column) for column in zip(*ratios, strict=True))
    print(
        f"IUV of a posed body: {fast * 1e3:.1f} ms, by rays {slow * 1e3:.1f} ms:"
        f" {statistics.median(a / b for a, b in ratios):.1f} times as fast;"
        f" {same:.2%} of the pixels equal"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--people", type=int, default=24)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    rasteriser(arguments.size, arguments.rounds)
    images(arguments.size, arguments.people, arguments.rounds)


if __name__ == "__main__":
    main()
