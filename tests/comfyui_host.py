"""A stand-in of ComfyUI: what nodes import of it, some of its own, and how it runs a workflow."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import av
import torch

from motion_transfer.comfyui import NODE_CLASS_MAPPINGS
from motion_transfer.comfyui.tensors import to_bytes


class InterruptedRunError(Exception):
    """What the stand-in raises when somebody cancels."""


class ComfyUI:
    """What the nodes ask of their host, and an executor of workflows.

    Attributes:
        bars: Length and steps so far of each bar of progress.
        cancel_after: Questions whether somebody cancelled, that are still answered by no.
        runs: The nodes that were run, by kind, in order.
    """

    def __init__(self, folder: Path) -> None:
        self.input, self.models, self.temp = (folder / n for n in ("input", "models", "temp"))
        for each in (self.input, self.models / "motion_transfer", self.temp):
            each.mkdir(parents=True)
        self.bars: list[list[int]] = []
        self.cancel_after = 10**9
        self.runs: list[str] = []
        self.kinds = {
            **NODE_CLASS_MAPPINGS,
            "EmptyImage": self._core(("IMAGE",), self.empty_image),
            "CreateVideo": self._core(("VIDEO",), lambda images, fps: ((images, fps),)),
            "SaveVideo": self._core((), self.save_video),
        }
        self._kept: dict[str, tuple[str, tuple]] = {}

    def modules(self) -> dict[str, ModuleType]:
        """Make what nodes import of it."""
        folders, utils, management = (
            ModuleType(name) for name in ("folder_paths", "comfy.utils", "comfy.model_management")
        )
        listed: dict[str, tuple[list[str], set[str]]] = {}

        def add(name: str, path: str) -> None:
            listed[name] = ([path], set())

        def names(name: str) -> list[str]:
            return sorted(file.name for file in Path(listed[name][0][0]).iterdir())

        def full(name: str, file: str) -> str | None:
            path = Path(listed[name][0][0]) / file
            return str(path) if path.exists() else None

        folders.__dict__.update(
            get_input_directory=lambda: str(self.input),
            get_temp_directory=lambda: str(self.temp),
            models_dir=str(self.models),
            folder_names_and_paths=listed,
            add_model_folder_path=add,
            get_filename_list=names,
            get_full_path=full,
        )
        bars, lock = self.bars, threading.Lock()

        class ProgressBar:
            def __init__(self, total: int) -> None:
                self._steps = [total, 0]
                bars.append(self._steps)

            def update(self, value: int) -> None:
                with lock:
                    self._steps[1] += value

        def ask() -> None:
            self.cancel_after -= 1
            if self.cancel_after < 0:
                raise InterruptedRunError

        utils.__dict__["ProgressBar"] = ProgressBar
        management.__dict__["throw_exception_if_processing_interrupted"] = ask
        return {
            "comfy": ModuleType("comfy"),
            **{m.__name__: m for m in (folders, utils, management)},
        }

    def run(self, workflow: dict[str, Any]) -> dict[str, tuple]:
        """Run what has changed, or depends on what has; give the outputs of all nodes."""
        done: dict[str, tuple[str, tuple]] = {}

        def result(number: str) -> tuple[str, tuple]:
            if number in done:
                return done[number]
            node = workflow[number]
            kind = self.kinds[node["class_type"]]
            linked = {k: result(v[0]) for k, v in node["inputs"].items() if isinstance(v, list)}
            plain = {k: v for k, v in node["inputs"].items() if k not in linked}
            self._check(kind, node["inputs"], workflow)
            if validate := getattr(kind, "VALIDATE_INPUTS", None):
                told = validate(**{k: plain[k] for k in ("file", "unlisted") if k in plain})
                assert told is True, told
            links = {k: (done[node["inputs"][k][0]][0], node["inputs"][k][1]) for k in linked}
            changed = getattr(kind, "IS_CHANGED", lambda **_: "")
            seen = changed(**plain, **dict.fromkeys(linked))
            key = repr((node["class_type"], sorted(plain.items()), sorted(links.items()), seen))
            if number not in self._kept or self._kept[number][0] != key:
                given = {k: v[1][node["inputs"][k][1]] for k, v in linked.items()}
                self.runs.append(node["class_type"])
                with torch.inference_mode():
                    made = getattr(kind(), kind.FUNCTION)(**plain, **given)
                assert isinstance(made, tuple)
                assert len(made) == len(kind.RETURN_TYPES)
                for value, name in zip(made, kind.RETURN_TYPES, strict=True):
                    self._check_type(value, name)
                self._kept[number] = key, made
            done[number] = self._kept[number]
            return done[number]

        return {number: result(number)[1] for number in workflow}

    def _check(self, kind: Any, inputs: dict[str, Any], workflow: dict[str, Any]) -> None:
        """Hold a node's inputs to what it declares, as ComfyUI does before it runs anything."""
        if not hasattr(kind, "INPUT_TYPES"):
            return
        declared = kind.INPUT_TYPES()
        every = {**declared["required"], **declared.get("optional", {})}
        assert set(declared["required"]) <= set(inputs) <= set(every)
        for name, value in inputs.items():
            wanted = every[name][0]
            if isinstance(value, list):
                source = self.kinds[workflow[value[0]]["class_type"]]
                assert source.RETURN_TYPES[value[1]] == wanted
            elif isinstance(wanted, list):
                # whatever a node validates itself may be beside its list
                assert value in wanted or hasattr(kind, "VALIDATE_INPUTS")
            else:
                assert isinstance(value, {"STRING": str, "BOOLEAN": bool, "FLOAT": float}[wanted])

    def _check_type(self, value: Any, name: str) -> None:
        if name in ("IMAGE", "MASK"):
            assert value.dtype == torch.float32
            assert value.ndim == {"IMAGE": 4, "MASK": 3}[name]
            assert 0 <= value.min() <= value.max() <= 1
            assert value.device.type == "cpu"
        if name == "FLOAT":
            assert isinstance(value, float)

    def _core(self, types: tuple[str, ...], call: Callable[..., Any]) -> type:
        def run(_self: object, **inputs: Any) -> Any:
            return call(**inputs)

        return type("Core", (), {"RETURN_TYPES": types, "FUNCTION": "run", "run": run})

    def empty_image(self, width: int, height: int, batch_size: int, color: int):
        channels = [color >> 16 & 255, color >> 8 & 255, color & 255]
        plain = torch.tensor(channels).float() / 255
        return (plain.expand(batch_size, height, width, 3).clone(),)

    def save_video(self, video: Any, **_others: Any) -> tuple[()]:
        images, fps = video
        with av.open(str(self.temp / "saved.mkv"), "w") as container:
            stream = container.add_stream("ffv1", rate=round(fps))
            stream.height, stream.width = images.shape[1:3]
            stream.pix_fmt = "bgr0"
            for picture in to_bytes(images):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            container.mux(stream.encode(None))
        return ()
