"""Options written out, and read again by the commands they are written for."""

from __future__ import annotations

import shlex
from fractions import Fraction
from pathlib import Path

import pytest

from motion_transfer.batch.expand import expand
from motion_transfer.batch.manifest import read_manifest
from motion_transfer.cli.options import pair_words
from motion_transfer.cli.run import run
from motion_transfer.option import options_from_words
from motion_transfer.preview.export import command_line, manifest_text
from motion_transfer.render.options import Garment, Partner, RenderOptions

CHANGES = [
    {},
    {"renderer": "texture", "background": "#102030", "person": "1", "driver_person": "1,2,3,4"},
    {"frames": (3, None), "frame_rate": Fraction(30000, 1001), "window": "-4,5,300"},
    {"frames": (None, 9), "engine": "torch", "precision": "f32", "compare": True},
    {"crf": 20, "codec": "h265"},
    {"device": "cpu", "size": "crop", "audio": Path("none"), "weights": Path("lite")},
    {"source_iuv": (Path("in/a b_IUV.png"),), "source_iuv_order": "vui", "missing": "hold"},
    {"source": (Path("in/front.png"), Path("in/me turning.mp4"))},
    {"background": "in/street at night.mp4", "size": "background", "background_blur": 1.5},
    {
        "background": "transparent",
        "place": "0.5,0.9,1.5",
        "on_the_spot": True,
        "shadow": True,
        "output": Path("out/a.webm"),
    },
    {
        "partners": (
            Partner(photo=Path("in/bob.png"), person="1"),
            Partner(photo=Path("in/eve.png"), person="0,1,20,30", iuv=Path("in/eve_x.png")),
        )
    },
    {"sheet": Path("out/sheet.png"), "estimator": "densepose", "estimator_model": Path("m.onnx")},
    {
        "garments": (
            Garment(photo=Path("in/dress.png"), parts=(1, 2)),
            Garment(photo=Path("in/shoes.png"), iuv=Path("in/shoes_x.png"), parts=(5, 6)),
        )
    },
]


def options(**changes) -> RenderOptions:
    given = {
        "source": (Path("in/it's me.png"),),
        "driver": Path("in/dance"),
        "output": Path("out/a.mp4"),
    }
    return RenderOptions(**{**given, **changes})


@pytest.mark.parametrize("changes", CHANGES)
def test_the_command_line_means_the_same(changes: dict) -> None:
    written = options(**changes)
    words = shlex.split(command_line(written))
    assert words[:2] == ["mt", "run"]
    read = run.make_context("run", words[2:]).params
    garments = pair_words(read.pop("garments"), read.pop("garment_parts"), "garment", "parts")
    partners = pair_words(read.pop("partners"), read.pop("partner_person"), "partner", "person")
    del read["quiet"], read["as_json"]
    read |= {"garments": garments, "partners": partners}
    assert options_from_words(RenderOptions, read) == written


@pytest.mark.parametrize("changes", CHANGES)
def test_the_manifest_means_the_same(
    changes: dict, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    written, path = options(**changes), tmp_path / "jobs" / "job.yaml"
    path.parent.mkdir()
    path.write_text(manifest_text(written, path))
    (job,) = expand(*read_manifest(path))
    assert _absolute(job.options) == _absolute(written)


def test_paths_below_the_manifest_can_move_with_it(tmp_path: Path) -> None:
    text = manifest_text(
        options(source=(tmp_path / "a.png",), driver=Path("/else/d"), output=tmp_path / "o/b.mp4"),
        tmp_path / "job.yaml",
    )
    assert "source: a.png" in text
    assert "driver: /else/d" in text
    assert "output_root: o" in text
    assert "output: b.mp4" in text


def test_marks_of_globs_and_templates_in_names_are_only_names(tmp_path: Path) -> None:
    source = tmp_path / "me [1]*.png"
    source.touch()
    written = options(source=(source,), driver=Path("people:walk"), output=tmp_path / "{x}.mp4")
    path = tmp_path / "job.yaml"
    path.write_text(manifest_text(written, path))
    (job,) = expand(*read_manifest(path))
    assert job.options == written


def _absolute(options: RenderOptions) -> dict:
    words = {name: getattr(options, name) for name in RenderOptions.__dataclass_fields__}
    for name, value in words.items():
        if isinstance(value, Path) and str(value) not in ("none", "lite"):
            words[name] = value.absolute()
    for name in ("source", "source_iuv"):
        words[name] = tuple(path.absolute() for path in words[name])
    words["garments"] = [
        (g.photo.absolute(), g.iuv and g.iuv.absolute(), g.parts) for g in options.garments
    ]
    words["partners"] = [
        (p.photo.absolute(), p.iuv and p.iuv.absolute(), p.person) for p in options.partners
    ]
    if (behind := options.background_file) is not None:
        words["background"] = str(behind.absolute())
    return words
