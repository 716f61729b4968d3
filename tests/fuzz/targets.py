"""What is fuzzed: small valid files of each format, and what reads them."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path

import av
import numpy as np
import torch
from hypothesis.strategies import SearchStrategy
from PIL import Image, ImageCms
from reference import densepose_dump
from studio import Studio

from fuzz import mutations
from motion_transfer.batch.run import check_batch, read_batch
from motion_transfer.drawing.engines.interface import FeatureMap
from motion_transfer.drawing.kept_source import (
    inspect_source,
    load_features,
    load_source,
    save_source,
)
from motion_transfer.drawing.source import SourcePicture, unfold_source
from motion_transfer.media.driver_kind import tell_kind
from motion_transfer.media.iuv.opening import open_reader, open_stream
from motion_transfer.media.pictures.formats import open_pictures
from motion_transfer.media.pictures.photo import Photo, read_photo
from motion_transfer.people.motion.bvh.file import read_bvh
from motion_transfer.people.motion.bvh.frames import body_frames
from motion_transfer.render.about import describe_path
from motion_transfer.training.config import build_config, read_settings
from motion_transfer.weights.checkpoint import load_checkpoint, save_checkpoint
from nhrr_core import ModelConfig, NeuralReRenderer

MOST_FRAMES = 20  # of a stream: a header may promise any number


@dataclass(frozen=True)
class Target:
    """One kind of files.

    Attributes:
        seeds: Writes valid files into a folder, which may hold what they refer to.
        change: Makes the strategy of changed files from the bytes of a valid one.
        read: Takes every step with a file that a user's command would.
    """

    seeds: Callable[[Path], Iterator[Path]]
    change: Callable[[bytes], SearchStrategy[bytes]]
    read: Callable[[Path], object]


def _iuv_pictures(folder: Path) -> Iterator[Path]:
    iuv = Studio(folder).iuv()
    for name in ("plain.png", "plain.bmp", "plain.tif"):
        yield Studio(folder).image(name, iuv)
    image = Image.fromarray(iuv)
    image.convert("RGBA").save(folder / "alpha.png")
    image.convert("P").save(folder / "palette.png")
    image.save(folder / "packed.tif", compression="tiff_lzw")
    yield from (folder / name for name in ("alpha.png", "palette.png", "packed.tif"))


def _read_iuv(path: Path) -> None:
    tell_kind(path)
    reader = open_reader(open_stream(path, missing="hold"))
    for _ in reader.read(0, min(MOST_FRAMES, reader.stream.frame_count)):
        pass
    describe_path(path)


def _dumps(folder: Path) -> Iterator[Path]:
    photos = [
        densepose_dump.photo(f, f"frame_{i}.jpg") for i, f in enumerate(Studio(folder).walk(3))
    ]
    yield densepose_dump.save(folder / "zip.pkl", photos)
    yield densepose_dump.save(folder / "legacy.pkl", photos, zipped=False)
    arrays = [
        {
            "file_name": f"frame_{i}.jpg",
            "scores": np.array([0.9]),
            "pred_boxes_XYXY": np.array([[0.0, 0.0, 64.0, 96.0]]),
            "pred_densepose": [],
        }
        for i in range(2)
    ]
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        path = folder / f"plain_{protocol}.pkl"
        path.write_bytes(pickle.dumps(arrays, protocol))
        yield path


def _arrays(folder: Path) -> Iterator[Path]:
    studio = Studio(folder)
    yield studio.array()
    yield studio.array(name="driver.npz")
    yield studio.array(np.ascontiguousarray(studio.walk(2).transpose(0, 3, 1, 2)), name="chw.npy")
    places = np.full((2, 8, 8, 2), np.nan, np.float32)
    places[:, 2:6, 2:6] = 0.1
    yield studio.array(places, name="places.npy")


def _videos(folder: Path) -> Iterator[Path]:
    studio = Studio(folder)
    for name in ("driver.mkv", "driver.avi"):
        yield studio.video(name=name)
    picture = np.random.default_rng(0).integers(0, 256, (3, 48, 64, 3), np.uint8)
    yield studio.video(picture, name="film.mp4", codec="libx264", pixels="yuv420p")
    yield studio.video(picture, name="film.webm", codec="libvpx-vp9", pixels="yuv420p")
    yield _sounding(folder / "sounding.mov")


def _sounding(path: Path) -> Path:
    with av.open(str(path), "w") as container:
        video = container.add_stream("mpeg4", rate=10)
        video.width, video.height, video.pix_fmt = 32, 32, "yuv420p"
        audio = container.add_stream("aac", rate=48_000)
        for _ in range(3):
            picture = av.VideoFrame.from_ndarray(np.full((32, 32, 3), 90, np.uint8), format="rgb24")
            container.mux(video.encode(picture))
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        sound.sample_rate, sound.pts, sound.time_base = 48_000, 0, Fraction(1, 48_000)
        container.mux(audio.encode(sound))
        container.mux(video.encode(None))
        container.mux(audio.encode(None))
    return path


def _read_video(path: Path) -> None:
    if tell_kind(path) == "iuv":
        _read_iuv(path)
    else:
        for _ in islice(open_pictures(path).read(), MOST_FRAMES):
            pass


def _photos(folder: Path) -> Iterator[Path]:
    image = Image.fromarray(np.random.default_rng(0).integers(0, 256, (24, 16, 3), np.uint8))
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    exif = Image.Exif()
    exif[0x0112] = 6
    for name in ("p.png", "p.jpg", "p.webp", "p.tif", "p.avif"):
        image.save(folder / name, icc_profile=profile, exif=exif)
        yield folder / name
    for name in ("several.png", "several.webp", "several.tif"):
        image.save(folder / name, save_all=True, append_images=[image.rotate(180)], duration=40)
        yield folder / name
    image.convert("I;16").save(folder / "grey.png")
    yield folder / "grey.png"


def _read_photo(path: Path) -> None:
    read_photo(path).on_white()
    for _ in islice(open_pictures(path).read(), MOST_FRAMES):
        pass


BVH = """HIERARCHY
ROOT Hips
{
 OFFSET 0 0 0
 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
 JOINT LeftUpLeg
 {
  OFFSET 9 0 0
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT LeftLeg
  {
   OFFSET 0 -40 0
   CHANNELS 3 Zrotation Xrotation Yrotation
   End Site
   {
    OFFSET 0 -40 0
   }
  }
 }
 JOINT RightUpLeg
 {
  OFFSET -9 0 0
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT RightLeg
  {
   OFFSET 0 -40 0
   CHANNELS 3 Zrotation Xrotation Yrotation
   End Site
   {
    OFFSET 0 -40 0
   }
  }
 }
}
MOTION
Frames: 2
Frame Time: 0.033333
0 90 0 0 0 0 1 2 3 4 5 6 7 8 9 1 2 3
1 90 0 0 0 0 1 2 3 4 5 6 7 8 9 1 2 3
"""


def _motions(folder: Path) -> Iterator[Path]:
    (folder / "walk.bvh").write_text(BVH)
    yield folder / "walk.bvh"


def _read_motion(path: Path) -> None:
    body_frames(read_bvh(path))


def _manifests(folder: Path) -> Iterator[Path]:
    studio = Studio(folder)
    studio.source("me")
    studio.driver(2)
    jobs = {
        "version": 1,
        "output_root": "out",
        "retries": 2,
        "defaults": {"renderer": "texture", "background": "#102030", "fps": "30000/1001"},
        "jobs": [{"source": "me.png", "driver": "driver", "output": "a.mp4", "priority": 3}],
        "matrix": [
            {"sources": ["m*.png"], "drivers": ["driver"], "output": "{source}/{driver}.mp4"}
        ],
    }
    (folder / "jobs.json").write_text(json.dumps(jobs, indent=1))
    yield folder / "jobs.json"
    (folder / "jobs.yaml").write_text(
        "version: 1\noutput_root: out\ndefaults: &all\n  renderer: texture\n  frames: 0:2\n"
        "jobs:\n  - source: me.png\n    driver: driver\n    output: a.mp4\n    crf: 20\n"
        "  - {source: me.png, driver: driver, output: 'b.mp4', name: second}\n"
    )
    yield folder / "jobs.yaml"
    (folder / "jobs.toml").write_text(
        'version = 1\n[defaults]\nrenderer = "texture"\n[[jobs]]\nsource = "me.png"\n'
        'driver = "driver"\noutput = "a.mp4"\nframes = "0:2"\n'
    )
    yield folder / "jobs.toml"


def _settings(folder: Path) -> Iterator[Path]:
    (folder / "train.toml").write_text(
        '[run]\nseed = 7\nsteps = 100\n[data]\npairs = "pairs.csv"\n[model]\npreset = "lite"\n'
        "[optimiser]\nlearning_rate = 0.0002\n[speed]\nworkers = 2\n"
    )
    yield folder / "train.toml"


def _weights(folder: Path) -> Iterator[Path]:
    config = ModelConfig(
        feature_width=2, render_width=2, residual_blocks=1, image_size=64, texture_size=64
    )
    path = folder / "tiny.safetensors"
    save_checkpoint(path, NeuralReRenderer(config), dtype=torch.float16)
    yield path


def _kept_sources(folder: Path) -> Iterator[Path]:
    photo = Photo(folder / "p.png", Studio(folder).dress(Studio(folder).iuv()), None, turned=False)
    source = unfold_source([SourcePicture(photo, Studio(folder).iuv())], 32)
    path = folder / "me.mtsource"
    known = FeatureMap(np.zeros((1, 4, 32, 32), np.float32), np.zeros((1, 3, 128, 128), np.float32))
    save_source(path, [source], {"0" * 64: known}, {"made of": []})
    yield path


def _read_kept(path: Path) -> None:
    load_source(path, 32)
    load_features(
        path, "0" * 64, ModelConfig(feature_channels=4, texture_size=32, colour_shortcut=True)
    )
    inspect_source(path)


TARGETS = {
    "images": Target(_iuv_pictures, mutations.png_of, _read_iuv),
    "dumps": Target(_dumps, mutations.zip_of, _read_iuv),
    "arrays": Target(_arrays, mutations.npy_of, _read_iuv),
    "bvh": Target(_motions, mutations.text_file_of, _read_motion),
    "manifests": Target(
        _manifests, mutations.text_file_of, lambda path: check_batch(read_batch(path))
    ),
    "settings": Target(
        _settings, mutations.text_file_of, lambda path: build_config(read_settings(path))
    ),
    "weights": Target(_weights, mutations.safetensors_of, load_checkpoint),
    "sources": Target(_kept_sources, mutations.safetensors_of, _read_kept),
    "videos": Target(_videos, mutations.bytes_of, _read_video),
    "photos": Target(_photos, mutations.png_of, _read_photo),
}
