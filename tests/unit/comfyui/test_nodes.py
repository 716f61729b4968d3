"""The nodes inside a stand-in of ComfyUI, which runs a workflow as it does: by content, once."""

from __future__ import annotations

import json
import sys
import threading
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import torch
from comfyui_host import ComfyUI, InterruptedRunError
from PIL import Image

from motion_transfer import comfyui
from motion_transfer.comfyui import NODE_CLASS_MAPPINGS, NODE_DISPLAY_NAME_MAPPINGS, host, nodes
from motion_transfer.comfyui.tensors import to_bytes
from motion_transfer.errors import InputError
from motion_transfer.render.memory import MotionTransfer

HERE = Path(comfyui.__path__[0])
WORKFLOW = HERE / "dance_api.json"
ON_THE_PAGE = HERE / "example_workflows" / "dance.json"


@pytest.fixture
def comfy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ComfyUI:
    host_program = ComfyUI(tmp_path / "ComfyUI")
    for name, module in host_program.modules().items():
        monkeypatch.setitem(sys.modules, name, module)
    return host_program


@pytest.fixture
def small(studio, comfy: ComfyUI, checkpoint: Path) -> dict[str, Any]:
    """The workflow that ships, with a small person, driver and network."""
    workflow = json.loads(WORKFLOW.read_text())
    photo = studio.source("source")
    for path in (photo, photo.with_name("source_IUV.png"), studio.video(5)):
        path.rename(comfy.input / path.name)
    (comfy.models / "motion_transfer" / "tiny.safetensors").symlink_to(checkpoint)
    workflow["1"]["inputs"]["file"] = "source.png"
    workflow["2"]["inputs"]["weights"] = "tiny.safetensors"
    workflow["3"]["inputs"]["file"] = "driver.mkv"
    return workflow


PLAIN = {"size": "driver", "window": "auto", "place": "", "on_the_spot": False, "shadow": False}


def given(comfy: ComfyUI) -> tuple[str | Path, ...]:
    """The input of the small workflow, for `mt run`."""
    return "--source", comfy.input / "source.png", "--driver", comfy.input / "driver.mkv"


def numbered(folder: Path) -> np.ndarray:
    return np.stack([np.asarray(Image.open(path)) for path in sorted(folder.iterdir())])


def test_the_workflow_that_ships_runs(comfy: ComfyUI, small: dict[str, Any]) -> None:
    outputs = comfy.run(small)
    images, masks, rate = outputs["5"]
    assert images.shape == (5, 96, 64, 3)
    assert masks.shape == (5, 96, 64)
    assert rate == pytest.approx(30000 / 1001)
    with av.open(str(comfy.temp / "saved.mkv")) as saved:
        assert sum(1 for _ in saved.decode(video=0)) == 5
    grey = to_bytes(images)[to_bytes(masks) == 0]
    assert (grey == 240).all()
    assert masks.max() > 0.9
    assert [5, 5] in comfy.bars


def test_it_needs_no_file_of_ones_own(comfy: ComfyUI) -> None:
    """What the workflow names comes with the package, and is on the nodes' lists."""
    workflow = json.loads(WORKFLOW.read_text())
    for number in ("1", "3"):
        kind = comfy.kinds[workflow[number]["class_type"]]
        name = workflow[number]["inputs"]["file"]
        assert name in kind.INPUT_TYPES()["required"]["file"][0]
        assert host.find_input(name).is_file()
        assert host.key_of_input(name) == name
    assert comfy.kinds.keys() >= {node["class_type"] for node in workflow.values()}


def test_the_page_shows_the_same_workflow(comfy: ComfyUI) -> None:
    """ComfyUI's list of templates takes its page's format alone, and a picture beside it."""
    page = json.loads(ON_THE_PAGE.read_text())
    links = {number: [str(source), slot] for number, source, slot, *_ in page["links"]}
    workflow = json.loads(WORKFLOW.read_text())
    assert {str(node["id"]): node["type"] for node in page["nodes"]} == {
        number: node["class_type"] for number, node in workflow.items()
    }
    for node in page["nodes"]:
        inputs = workflow[str(node["id"])]["inputs"]
        linked = {i["name"]: links[i["link"]] for i in node["inputs"] if i["link"] is not None}
        assert linked == {name: v for name, v in inputs.items() if isinstance(v, list)}
        if not hasattr(kind := comfy.kinds[node["type"]], "INPUT_TYPES"):
            continue
        widgets = [
            name
            for group in kind.INPUT_TYPES().values()
            for name, (wanted, _) in group.items()
            if isinstance(wanted, list) or wanted in ("STRING", "BOOLEAN", "FLOAT")
        ]
        shown = dict(zip(widgets, node["widgets_values"], strict=False))
        assert shown.items() >= {k: v for k, v in inputs.items() if k not in linked}.items()
    with Image.open(ON_THE_PAGE.with_suffix(".jpg")) as picture:
        assert picture.size == (360, 240)


def test_the_lists_are_what_lies_in_the_input_folder(comfy: ComfyUI) -> None:
    usable = ("me.png", "me_IUV.png", "me.mtsource", "clip.mp4", "walk.bvh", "body.npy")
    for name in (*usable, "notes.txt", ".hidden.png"):
        (comfy.input / name).touch()
    (comfy.input / "album").mkdir()
    [sources, uploads], [drivers, _] = (
        node.INPUT_TYPES()["required"]["file"] for node in (nodes.LoadSource, nodes.LoadDriver)
    )
    assert sources == ["nothing", "album", "clip.mp4", "me.mtsource", "me.png", "Example person"]
    assert uploads["image_upload"]
    given = ["album", "body.npy", "clip.mp4", "me.png", "me_IUV.png", "people:walk.bvh"]
    assert drivers[:8] == ["nothing", *given, "Example dance"]
    assert "people:walk" in drivers


def test_what_is_unlisted_counts_instead(comfy: ComfyUI) -> None:
    (comfy.input / "album").mkdir()
    (comfy.input / "album" / "me.png").touch()
    chosen = ("nothing", "album/me.png")
    assert nodes.LoadSource.VALIDATE_INPUTS(*chosen) is True
    assert nodes.LoadSource.IS_CHANGED(*chosen, person="largest") == host.key_of_input(chosen[1])
    [source] = nodes.LoadSource().load("Example person", "largest", unlisted="album/me.png")
    assert source.photo == comfy.input / "album" / "me.png"
    walk = "people:walk,azimuth=30"
    [driver] = nodes.LoadDriver().load("nothing", "largest", "", "auto", unlisted=walk)
    assert driver.frames == Path(walk)


def test_a_person_is_encoded_once(
    comfy: ComfyUI, small: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    encode, calls = MotionTransfer.encode, []
    monkeypatch.setattr(
        MotionTransfer, "encode", lambda *a, **k: calls.append(1) or encode(*a, **k)
    )
    comfy.run(small)
    small["3"]["inputs"]["frames"] = "1:3"
    assert len(comfy.run(small)["5"][0]) == 2
    small["5"]["inputs"]["shadow"] = False
    comfy.run(small)
    assert comfy.runs.count("MotionTransferRender") == 3
    assert (len(calls), comfy.runs.count("MotionTransferEncode")) == (1, 1)
    (comfy.input / "driver.mkv").touch()
    comfy.run(small)
    assert comfy.runs.count("MotionTransferDriver") == 3


@pytest.mark.parametrize("shadow", [False, True])
def test_image_and_mask_are_those_of_mt_run(
    studio, mt, comfy: ComfyUI, small: dict[str, Any], checkpoint: Path, shadow: bool
) -> None:
    out = studio.folder / "out"
    words = (*given(comfy), "-o", out, "--weights", checkpoint)
    told = mt("run", *words, "--background", "transparent", *(["--shadow"] if shadow else []))
    assert told.code == 0, told.err
    small["5"]["inputs"]["shadow"] = shadow
    del small["5"]["inputs"]["background"], small["4"]
    images, masks, _ = comfy.run(small)["5"]
    rgba = numbered(out)
    np.testing.assert_array_equal(to_bytes(masks), rgba[..., 3])
    np.testing.assert_array_equal(to_bytes(images), rgba[..., :3])


def test_over_a_background_it_is_what_mt_run_lays_there(
    studio, mt, comfy: ComfyUI, small: dict[str, Any], checkpoint: Path
) -> None:
    out = studio.folder / "out"
    words = (*given(comfy), "-o", out, "--weights", checkpoint)
    assert mt("run", *words, "--background", "#f0f0f0").code == 0
    small["5"]["inputs"]["shadow"] = False
    np.testing.assert_array_equal(to_bytes(comfy.run(small)["5"][0]), numbered(out))


def test_a_background_plays(comfy: ComfyUI, small: dict[str, Any]) -> None:
    images = comfy.run(small)["5"]
    [encoded], [driver] = comfy.run(small)["2"], comfy.run(small)["3"]
    two = torch.stack([torch.zeros(48, 32, 3), torch.ones(48, 32, 3)])
    images, _, _ = nodes.RenderFrames().render(encoded, driver, **PLAIN, background=two)
    assert images[:, 0, 0, 0].tolist() == [0, 1, 0, 1, 0]


def test_iuv_passes_through_an_image_unchanged(studio, comfy: ComfyUI) -> None:
    """Also every number there is, and IUV in the other order of channels."""
    every = torch.arange(256).repeat(3, 1).T.reshape(1, 16, 16, 3).float() / 255
    np.testing.assert_array_equal(to_bytes(every)[0].reshape(-1, 3)[:, 0], np.arange(256))
    walk = studio.walk(3)
    image = torch.from_numpy(walk).float() / 255
    [driver] = nodes.LoadDriver().load("", "largest", "", "auto", image)
    np.testing.assert_array_equal(driver.frames, walk)
    iuv = studio.iuv(scale=2, size=(192, 128))
    draws = []
    for order in (slice(None), slice(None, None, -1)):
        body = torch.from_numpy(iuv[None, ..., order].copy()).float() / 255
        photo = torch.from_numpy(studio.dress(iuv))[None].float() / 255
        [source] = nodes.LoadSource().load("", "largest", photo, iuv=body)
        [encoded] = nodes.EncodeSource().encode(source, nodes.DRAFT_WEIGHTS)
        draws.append(encoded.person.source.texture)
    np.testing.assert_array_equal(*draws)


def test_a_mask_is_the_photos_alpha(studio, comfy: ComfyUI) -> None:
    iuv = studio.iuv(scale=2, size=(192, 128))
    photo = torch.from_numpy(studio.dress(iuv))[None].float() / 255
    mask = torch.from_numpy((iuv[..., 0] > 0).astype(np.float32))[None]
    [source] = nodes.LoadSource().load("", "largest", photo, mask)
    assert source.photo.shape == (192, 128, 4)
    np.testing.assert_array_equal(source.photo[..., 3] == 255, iuv[..., 0] > 0)
    with pytest.raises(InputError, match="mask is 64 x 64, and the image 128 x 192; leave"):
        nodes.LoadSource().load("", "largest", photo, torch.zeros(1, 64, 64))


def test_cancelling_ends_a_render(comfy: ComfyUI, small: dict[str, Any]) -> None:
    [encoded] = comfy.run(small)["2"]
    [driver] = comfy.run(small)["3"]
    comfy.bars.clear()
    comfy.cancel_after = 5  # the driver is looked through, and two frames are drawn
    with pytest.raises(InterruptedRunError):
        nodes.RenderFrames().render(encoded, driver, **PLAIN)
    assert comfy.bars[-1][1] < 5
    assert not [t for t in threading.enumerate() if t.name.startswith("draw")]


@pytest.mark.parametrize("name", ["../secret.png", "/etc/hostname", "people:../../x.bvh", "."])
def test_nothing_outside_the_input_folder_is_read(comfy: ComfyUI, name: str) -> None:
    (comfy.input.parent / "secret.png").touch()
    assert "is not in ComfyUI's input folder" in str(nodes.LoadSource.VALIDATE_INPUTS(name))


def test_what_is_in_the_input_folder_is_found(comfy: ComfyUI, tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    (comfy.input / "clips").symlink_to(tmp_path / "clips")
    (tmp_path / "clips" / "me.mp4").touch()
    assert host.find_input("clips/me.mp4") == comfy.input / "clips" / "me.mp4"
    assert nodes.LoadDriver.VALIDATE_INPUTS("people:walk,frames=9") is True
    assert nodes.LoadDriver.VALIDATE_INPUTS("") is True
    assert "does not exist" in str(nodes.LoadDriver.VALIDATE_INPUTS("clips/you.mp4"))


def test_a_source_is_one_thing(comfy: ComfyUI) -> None:
    load = nodes.LoadSource().load
    with pytest.raises(InputError, match="connect the one, or name the other"):
        load("", "largest")
    with pytest.raises(InputError, match="connect the one, or name the other"):
        load("nothing", "largest")
    with pytest.raises(InputError, match="connect the one, or name the other"):
        load("me.png", "largest", torch.zeros(1, 8, 8, 3))


def test_the_estimator_that_is_chosen_looks(studio, comfy: ComfyUI) -> None:
    """One that nobody knows tells that the choice arrived; all that can be chosen are known."""
    clip = torch.zeros(2, 32, 32, 3)
    Image.fromarray(to_bytes(clip)[0]).save(comfy.input / "me.png")
    unknown = pytest.raises(InputError, match="'nobody'; supported are blazepose")
    with unknown:
        nodes.EstimateIuv().estimate(clip, 30.0, "all", "empty", estimator="nobody")
    [source] = nodes.LoadSource().load("", "largest", clip, estimator="nobody")
    with unknown:
        nodes.EncodeSource().encode(source, nodes.DRAFT_WEIGHTS)
    [driver] = nodes.LoadDriver().load("me.png", "largest", "", "auto", estimator="nobody")
    model = MotionTransfer(renderer=nodes.DRAFT)
    encoded = nodes.Encoded(model, model.encode(studio.source("source")))
    with unknown:
        nodes.RenderFrames().render(encoded, driver, **PLAIN)
    for node in (nodes.EstimateIuv, nodes.LoadSource, nodes.LoadDriver):
        choices, _ = node.INPUT_TYPES()["optional"]["estimator"]
        assert set(choices) == {"blazepose", "blazepose-heavy"}


def test_every_node_says_what_it_is(comfy: ComfyUI) -> None:
    assert NODE_CLASS_MAPPINGS.keys() == NODE_DISPLAY_NAME_MAPPINGS.keys()
    for kind in NODE_CLASS_MAPPINGS.values():
        assert callable(getattr(kind, kind.FUNCTION))
        assert len(kind.RETURN_NAMES) == len(kind.RETURN_TYPES)
        assert kind.CATEGORY == "motion transfer"
        assert kind.DESCRIPTION.endswith(".")
        for group in kind.INPUT_TYPES().values():
            for _, settings in group.values():
                assert settings["tooltip"].endswith(".")


def test_the_folder_can_be_linked_into_comfyui(tmp_path: Path) -> None:
    """ComfyUI imports it by its path, under a name that is none of Python's."""
    link = tmp_path / "custom_nodes" / "motion-transfer"
    link.parent.mkdir()
    link.symlink_to(HERE)
    name = str(link).replace(".", "_x_")
    spec = spec_from_file_location(name, link / "__init__.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.NODE_CLASS_MAPPINGS is NODE_CLASS_MAPPINGS
