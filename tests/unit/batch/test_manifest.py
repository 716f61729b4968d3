"""Manifests: three syntaxes, one meaning; what is wrong is said with its place."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest

from motion_transfer.batch.expand import Job, check_inputs, expand
from motion_transfer.batch.manifest import JobEntry, ManifestError, read_manifest, schema
from motion_transfer.media.iuv.formats import CHANNEL_ORDERS
from motion_transfer.option import list_options
from motion_transfer.render.options import RenderOptions

JOBS = Path(__file__).parents[3] / "jobs"
BATCH_WIDE = {"workers", "restart"}


def jobs_of(path: Path, *settings: str) -> list[Job]:
    return expand(*read_manifest(path, settings))


def write(folder: Path, text: str, suffix: str = ".yaml") -> Path:
    path = folder / f"shoot{suffix}"
    path.write_text(text)
    return path


def job_text(**words: str) -> str:
    words = {"source": "a.png", "driver": "d", "output": "a.mp4", **words}
    lines = "\n".join(f"    {key}: {value}" for key, value in words.items())
    return "version: 1\njobs:\n  -\n" + lines + "\n"


def refusal(path: Path, *settings: str) -> str:
    with pytest.raises(ManifestError) as caught:
        jobs_of(path, *settings)
    return str(caught.value)


def test_jobs_take_exactly_the_options_of_a_run() -> None:
    words = {entry.word for entry in list_options(RenderOptions) if entry.name not in BATCH_WIDE}
    assert set(JobEntry.model_fields) == words | {"name", "priority"}


def test_the_options_know_the_channel_orders() -> None:
    orders = [e.choices for e in list_options(RenderOptions) if e.name.endswith("iuv_order")]
    assert orders == [CHANNEL_ORDERS, CHANNEL_ORDERS]


def test_three_syntaxes_mean_the_same(tmp_path: Path) -> None:
    yaml_text = job_text(fps="30000/1001", compare="true", crf="20", frames='"3:9"')
    data = {
        "version": 1,
        "jobs": [
            {
                "source": "a.png",
                "driver": "d",
                "output": "a.mp4",
                "fps": "30000/1001",
                "compare": True,
                "crf": 20,
                "frames": "3:9",
            }
        ],
    }
    toml_text = (
        'version = 1\n[[jobs]]\nsource = "a.png"\ndriver = "d"\noutput = "a.mp4"\n'
        'fps = "30000/1001"\ncompare = true\ncrf = 20\nframes = "3:9"\n'
    )
    got = [
        jobs_of(write(tmp_path, yaml_text)),
        jobs_of(write(tmp_path, json.dumps(data), ".json")),
        jobs_of(write(tmp_path, toml_text, ".toml")),
    ]
    assert got[0] == got[1] == got[2]
    assert got[0][0].options.source == (tmp_path / "a.png",)
    assert got[0][0].options.frames == (3, 9)


def test_defaults_lie_under_jobs_and_settings_over_them(tmp_path: Path) -> None:
    text = job_text(background="black").replace(
        "jobs:", "defaults:\n  background: photo\n  size: even\njobs:"
    )
    path = write(tmp_path, text)
    options = jobs_of(path)[0].options
    assert (options.background, options.size) == ("black", "even")
    options = jobs_of(path, "background=#102030", "crf=30", "output_root=out")[0].options
    assert (options.background, options.crf) == ("#102030", 30)
    assert options.output == tmp_path / "out/a.mp4"


def test_a_matrix_and_globs_spread(tmp_path: Path) -> None:
    for name in ("b.png", "a.png", "a_IUV.png", "b_iuv.png", "walk.mkv", "run.mkv"):
        (tmp_path / name).touch()
    text = (
        "version: 1\nmatrix:\n  - sources: ['*.png']\n    drivers:"
        " ['*.mkv', 'people:wave,frames=3']\n    output: '{source}/{index}_{driver}.mp4'\n"
    )
    outputs = [str(j.options.output.relative_to(tmp_path)) for j in jobs_of(write(tmp_path, text))]
    assert outputs == [
        *("a/1_run.mp4", "a/2_walk.mp4", "a/3_wave.mp4"),
        *("b/4_run.mp4", "b/5_walk.mp4", "b/6_wave.mp4"),
    ]


def people_of(folder: Path, text: str) -> list[tuple[str, ...]]:
    """The names of each job's photos."""
    return [
        tuple(path.relative_to(folder).as_posix() for path in job.options.source)
        for job in jobs_of(write(folder, text))
    ]


def test_a_list_of_photos_is_one_person(tmp_path: Path) -> None:
    """With IUV of their own, one for each; `{source}` is the first one's name."""
    text = job_text(source="[front.png, /far/back.png]", output="'{source}.mp4'")
    text = text.replace("front.png,", "front.png, 7,")  # a name that is a number to YAML
    options = jobs_of(write(tmp_path, text))[0].options
    assert options.source == (tmp_path / "front.png", tmp_path / "7", Path("/far/back.png"))
    assert options.output == tmp_path / "front.mp4"
    words = {"source": "[a.png, b.png]", "source_iuv": "[a.npy, b/iuv.png]"}
    options = jobs_of(write(tmp_path, job_text(**words)))[0].options
    assert options.sources == [
        (tmp_path / "a.png", tmp_path / "a.npy"),
        (tmp_path / "b.png", tmp_path / "b/iuv.png"),
    ]


def test_globs_in_a_list_are_photos_of_one_person(tmp_path: Path) -> None:
    """In the order of the list, those of one glob by name, and without the IUV beside them."""
    for name in ("b.png", "a.png", "a_IUV.png", "b_iuv.png", "c.jpg"):
        (tmp_path / name).touch()
    assert people_of(tmp_path, job_text(source="'*.png'", output="'{source}.mp4'")) == [
        ("a.png",),
        ("b.png",),
    ]
    assert people_of(tmp_path, job_text(source="[c.jpg, '*.png']")) == [("c.jpg", "a.png", "b.png")]
    wrong = write(tmp_path, job_text(source="[c.jpg, '*.gif']"))
    assert refusal(wrong).startswith(f"{wrong}:4: jobs[0].source: '*.gif' matches nothing")


def test_a_list_within_a_matrix_is_one_person(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        (tmp_path / name).touch()
    text = (
        "version: 1\nmatrix:\n  - sources: ['*.png', ['*.png'], [c.jpg, a.png]]\n"
        "    drivers: [d, e]\n    output: '{index}_{source}.mp4'\n"
    )
    people = [("a.png",), ("b.png",), ("a.png", "b.png"), ("c.jpg", "a.png")]
    assert people_of(tmp_path, text) == [one for one in people for _ in "de"]
    outputs = [job.options.output.name for job in jobs_of(write(tmp_path, text))]
    assert outputs[::2] == ["1_a.mp4", "3_b.mp4", "5_a.mp4", "7_c.mp4"]


def test_every_photo_of_a_list_has_to_be_there(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    (tmp_path / "d").mkdir()
    jobs = jobs_of(write(tmp_path, job_text(source="[a.png, gone.png]")))
    assert list(check_inputs(jobs)) == [f"job 0 (a.mp4): source {tmp_path}/gone.png does not exist"]


def test_the_schema_takes_one_photo_or_a_list() -> None:
    """What editors check with; an empty list, or a list within a job's list, is none."""
    jsonschema = pytest.importorskip("jsonschema")
    published = json.loads((JOBS / "manifest.schema.json").read_text())
    for sources, valid in (
        (["a.png"], True),
        ([["a.png", "b.png"], "c.png"], True),
        ([[]], False),
        ([], False),
        ([[["a.png"]]], False),
        ("a.png", False),
    ):
        entry = {"sources": sources, "drivers": ["d"], "output": "o"}
        found = jsonschema.Draft202012Validator(published).is_valid(
            {"version": 1, "matrix": [entry]}
        )
        assert found == valid, sources
    for source, valid in (("a.png", True), (["a.png", "b"], True), ([], False), ([["a"]], False)):
        entry = {"source": source, "driver": "d", "output": "o"}
        found = jsonschema.Draft202012Validator(published).is_valid({"version": 1, "jobs": [entry]})
        assert found == valid, source


WRONG = {
    "field": ({"ouput": "x.mp4"}, "shoot.yaml:7: jobs[0].ouput: unknown field; did you mean outpu"),
    "choice": ({"size": "huge"}, "shoot.yaml:7: jobs[0].size: 'huge': Input should be 'driver', "),
    "value": ({"fps": "fast"}, "shoot.yaml:7: jobs[0].fps: 'fast': fps 'fast'; write a number"),
    "number": ({"crf": "low"}, "shoot.yaml:7: jobs[0].crf: 'low': Input should be a valid integ"),
    "parts": (
        {"garments": "[{photo: x.png, parts: hat}]"},
        "shoot.yaml:7: jobs[0].garments: [{'photo': 'x.png', 'parts': 'hat'}]: unknown part 'hat'",
    ),
    "template": ({"output": "'{who}.mp4'"}, "shoot.yaml:6: jobs[0].output: '{who}.mp4' is no te"),
    "glob": ({"source": "'*.gif'"}, "shoot.yaml:4: jobs[0].source: '*.gif' matches nothing"),
    "nobody": ({"source": "[]"}, "shoot.yaml:4: jobs[0].source: []: write a path, or a list of"),
    "nested": ({"source": "[[a.png]]"}, "shoot.yaml:4: jobs[0].source: [['a.png']]: write a path"),
    "iuv": (
        {"source": "[a.png, b.png]", "source_iuv": "a.npy"},
        "shoot.yaml:4: jobs[0]: 1 source IUV for 2 sources; give one for each, in their order",
    ),
    "together": ({"renderer": "texture", "weights": "w"}, "shoot.yaml:4: jobs[0]: the texture r"),
    "ending": ({"output": "a.xyz"}, "shoot.yaml:4: jobs[0]: cannot write FOLDER/a.xyz: un"),
    "codec": ({"codec": "vp8"}, "shoot.yaml:4: jobs[0]: unknown codec 'vp8'; supported are h264"),
    "dots": ({"output": "../a.mp4"}, "shoot.yaml:6: jobs[0].output: '../a.mp4' leaves the output"),
    "absolute": ({"output": "/a.mp4"}, "shoot.yaml:6: jobs[0].output: '/a.mp4' leaves the output"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, case: str) -> None:
    words, message = WRONG[case]
    said = refusal(write(tmp_path, job_text(**words)))
    assert said.startswith(f"{tmp_path}/{message.replace('FOLDER', str(tmp_path))}")
    assert "\n" not in said


def test_settings_are_checked(tmp_path: Path) -> None:
    path = write(tmp_path, job_text(crf="20").replace("jobs:", "defaults:\njobs:"))
    assert jobs_of(path, "crf=30")[0].options.crf == 30
    assert jobs_of(path, "size=crop")[0].options.size == "crop"
    assert refusal(path, "crf") == "--set 'crf'; write key=value"
    assert refusal(path, "siez=crop").startswith(
        "--set siez=crop: unknown field; did you mean size? allowed are output_root, "
    )
    assert refusal(path, "size=huge").startswith(
        "--set size=huge: Input should be 'driver', 'crop', 'even' or 'background'"
    )
    assert refusal(path, "crf=low").splitlines() == [
        "--set crf=low: Input should be a valid integer, unable to parse string as an integer"
    ]
    path = write(tmp_path, job_text())
    assert refusal(path, "retries=99") == (
        "--set retries=99: Input should be less than or equal to 10"
    )
    path = write(tmp_path, "version: 1\njobs:\n")
    assert "jobs: None: Input should be a valid list" in refusal(path, "size=crop")


def test_dots_in_the_root_do_not_reach_the_outputs(tmp_path: Path) -> None:
    (tmp_path / "jobs").mkdir()
    path = write(tmp_path / "jobs", job_text())
    assert jobs_of(path, "output_root=../out")[0].options.output == tmp_path / "out/a.mp4"


def test_links_do_not_lead_out_of_the_root(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out/away").symlink_to("/tmp")
    (tmp_path / "out/link.mp4").symlink_to("/tmp/x.mp4")
    for output in ("away/a.mp4", "link.mp4"):
        path = write(tmp_path, job_text(output=output))
        assert "leaves the output root" in refusal(path, "output_root=out")
        assert jobs_of(path, "output_root=out", "outside_outputs=true")


def test_links_do_not_hide_that_two_outputs_are_one(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    text = job_text(output="real/a.mp4")
    for other in ("link/a.mp4", f"{tmp_path}/real/b/../a.mp4"):
        path = write(tmp_path, text + f"  - {{source: b.png, driver: d, output: {other}}}\n")
        assert "is also the output of" in refusal(path, "outside_outputs=true")
    assert "leaves the output root" in refusal(path)
    path = write(tmp_path, text + "  - {source: b.png, driver: d, output: link/a.mp4}\n")
    assert "is also the output of" in refusal(path)


def test_outputs_do_not_lie_in_each_other(tmp_path: Path) -> None:
    path = write(
        tmp_path, job_text(output="frames") + "  - {source: b.png, driver: d, output: frames/a.mp4}"
    )
    assert refusal(path).startswith(
        f"{path}:7: jobs[1].output: lies in {tmp_path}/frames, the output of {path}:4: jobs[0]"
    )


def test_outputs_outside_are_allowed_when_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, job_text(output="/elsewhere/a.mp4"))
    job = jobs_of(path, "outside_outputs=true")[0]
    assert (job.options.output, job.name) == (Path("/elsewhere/a.mp4"), "/elsewhere/a.mp4")


def test_two_jobs_cannot_have_one_output(tmp_path: Path) -> None:
    text = job_text() + "  - {source: b.png, driver: d, output: ./a.mp4}\n"
    assert "shoot.yaml:7: jobs[1].output:" in refusal(write(tmp_path, text))
    assert "shoot.yaml:4: jobs[0]" in refusal(write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "suffix", "words"),
    [
        ("version: 1\njobs: [", ".yaml", "shoot.yaml:"),
        ('{"version": 1,', ".json", "shoot.json:1: Expecting property name"),
        ("version = ]", ".toml", "line 1"),
        ("version: 2\njobs: []\n", ".yaml", "shoot.yaml:1: version: 2: Input should be 1"),
        ("jobs: []\n", ".yaml", "version: is missing"),
        ("version: 1\n", ".yaml", "no jobs"),
        ("- a\n", ".yaml", "a manifest is a mapping"),
        ("", ".ini", "unknown ending; supported are .yaml"),
        ("version = 1\n[[jobs]]\n\nsource = 3\nsize = 1\n", ".toml", "shoot.toml:5: jobs[0].size"),
    ],
)
def test_files_that_are_no_manifest(tmp_path: Path, text: str, suffix: str, words: str) -> None:
    assert words in refusal(write(tmp_path, text, suffix))


def test_missing_inputs_are_named_once(tmp_path: Path) -> None:
    text = job_text() + "  - {source: a.png, driver: d, output: b.mp4}\n"
    assert list(check_inputs(jobs_of(write(tmp_path, text)))) == [
        f"job 0 (a.mp4): source {tmp_path}/a.png does not exist",
        f"job 0 (a.mp4): driver {tmp_path}/d does not exist",
    ]


def test_a_missing_estimator_model_is_named(tmp_path: Path) -> None:
    text = job_text(estimator="densepose", estimator_model="m.pt")
    problems = list(check_inputs(jobs_of(write(tmp_path, text))))
    assert problems[-1] == f"job 0 (a.mp4): estimator model {tmp_path}/m.pt does not exist"


@pytest.mark.parametrize("name", ["demo.yaml", "matrix.yaml", "cluster.toml"])
def test_the_manifests_of_the_project_are_valid(name: str, tmp_path: Path) -> None:
    manifest, text = read_manifest(JOBS / name)
    if name == "demo.yaml":
        assert list(check_inputs(expand(manifest, text))) == []
    else:
        assert manifest.matrix


def test_the_published_schema_is_current() -> None:
    assert json.loads((JOBS / "manifest.schema.json").read_text()) == schema()


def test_many_jobs_are_read_quickly(tmp_path: Path) -> None:
    lines = [{"source": f"{i % 9}.png", "driver": "d", "output": f"{i}.mp4"} for i in range(10_000)]
    path = write(tmp_path, json.dumps({"version": 1, "jobs": lines}), ".json")
    began = time.process_time()
    assert len(jobs_of(path)) == 10_000
    # it takes 1 s of an idle core, and three times that beside another test on a slow one
    assert time.process_time() - began < 8


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"x" * 900: "1"}, "unknown field; allowed are"),
        ({"frames": "3:9"}, ""),  # no quotes: YAML 1.1 would read 189
        ({"output": "'{source.__class__}.mp4'"}, "is no template"),
        ({"output": "'{index:999999999}.mp4'"}, "is no template"),
        ({"output": "'{index!r}.mp4'"}, "is no template"),
        ({"output": "'{}.mp4'"}, "is no template"),
        ({"output": "'{index:04}.mp4'"}, ""),
        ({"output": "n" * 300 + "/a/b.mp4"}, "cannot be an output: File name too long"),
        ({"output": "loop/a.mp4"}, "cannot be an output: its links go in circles"),
        ({"source": "'**x'"}, "is no glob that can be used"),
        ({"fps": "1e400"}, "shoot.yaml:7: '1e400' is no number that can be used"),
        ({"fps": ".nan"}, "fps '.nan'; write a number"),
        ({"priority": "9" * 5000}, "shoot.yaml:7: '99999"),
        ({"crf": "³"}, "Input should be a valid integer"),
        ({"crf": "18\n    crf: 20"}, "shoot.yaml:8: crf stands here, and in line 7, too"),
        ({"'a\\nb'": "1"}, r"jobs[0].'a\\nb': unknown field"),
        ({"size": "x" * 5000}, "'" + "x" * 56 + "...: Input should be"),
    ],
)
def test_odd_values_are_one_line(tmp_path: Path, words: dict[str, str], message: str) -> None:
    (tmp_path / "loop").symlink_to("loop")
    path = write(tmp_path, job_text(**words))
    if not message:
        assert len(jobs_of(path)) == 1
        return
    assert message in refusal(path)
    assert len(refusal(path).splitlines()) == 1


def test_frames_need_no_quotes(tmp_path: Path) -> None:
    assert jobs_of(write(tmp_path, job_text(frames="3:9")))[0].options.frames == (3, 9)


def test_a_matrix_too_large_is_refused(tmp_path: Path) -> None:
    names = ", ".join(f"n{number}" for number in range(400))
    text = (
        f"version: 1\nmatrix:\n  - sources: [{names}]\n    drivers: [{names}]\n"
        "    output: '{index}.mp4'\n"
    )
    assert refusal(write(tmp_path, text)).endswith(
        "matrix[0]: 400 sources with 400 drivers are more than 100,000 jobs; split them"
    )


def test_inputs_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    text = job_text(source="pipe", driver="n" * 300)
    assert list(check_inputs(jobs_of(write(tmp_path, text)))) == [
        f"job 0 (a.mp4): source {tmp_path}/pipe is a device or a pipe; write its content to a file,"
        " and name that",
        f"job 0 (a.mp4): driver {tmp_path}/{'n' * 300} cannot be read: File name too long",
    ]
