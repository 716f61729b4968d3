"""What an export says of itself: `model.json` for programs, `README.md` for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import onnx

from motion_transfer.drawing.export.formats import Network
from motion_transfer.drawing.graphs.whole import (
    CLEARANCE,
    DETAIL,
    FEATURE_MAP,
    FEATURES,
    FRAME,
    IUV,
    TEXTURE,
    VISIBILITY,
)
from motion_transfer.media.work import digest_of

FACTS_FILE, WORDS_FILE = "model.json", "README.md"

PURPOSES = {
    "encoder": "makes a feature map of a person's texture, once for each source",
    "sampler": "looks target IUV up in the feature map; the painter does so itself",
    "painter": "draws a frame of target IUV",
}
MEANINGS = {
    TEXTURE: "the source's partial texture, RGB in [-1, 1], 0 where nothing is seen",
    VISIBILITY: "1 where the texture is seen, else 0",
    CLEARANCE: "how far clothes and hair stand off the body, and 1 where that is known, else 0;"
    " all 0 where nothing is",
    FEATURE_MAP: "what the encoder gives, in the layout of the texture",
    DETAIL: "what it gives besides: colours that are finer than the feature map",
    IUV: "target IUV: the part, 1 to 24, 0 for the background; U and V, [0, 1] scaled by 255",
    FEATURES: "what RenderNet reads",
    FRAME: "the picture, {channels}, 0 to 255",
}
CHANNELS = {3: "RGB", 4: "RGB and alpha, not premultiplied; RGB means nothing where alpha is 0"}


def write_card(folder: Path, networks: dict[Path, Network], facts: dict[str, Any]) -> None:
    """Write both files.

    Args:
        networks: By the file that each of them was written to.
        facts: What holds for all of them.
    """
    told = {
        **facts,
        "networks": {each.name: _interface(each) for each in networks.values()},
        "files": {
            file.name: {"network": each.name, "precision": each.precision, **_size(file)}
            for path, each in networks.items()
            for file in files_of(path)
        },
    }
    (folder / FACTS_FILE).write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
    (folder / WORDS_FILE).write_text(_tell(told), encoding="utf-8")


def files_of(path: Path) -> list[Path]:
    """List the file that names a network, and the one beside it that holds OpenVINO's numbers."""
    return [path, path.with_suffix(".bin")] if path.suffix == ".xml" else [path]


def _size(file: Path) -> dict[str, Any]:
    return {"bytes": file.stat().st_size, "sha256": digest_of(file)}


def _interface(network: Network) -> dict[str, Any]:
    graph = network.model.graph
    return {
        "purpose": PURPOSES[network.name],
        "inputs": {port.name: _tensor(port, network) for port in graph.input},
        "outputs": {port.name: _tensor(port, network) for port in graph.output},
    }


def _tensor(port: onnx.ValueInfoProto, network: Network) -> dict[str, Any]:
    kind = port.type.tensor_type
    return {
        "type": onnx.helper.tensor_dtype_to_np_dtype(kind.elem_type).name,
        "shape": [size.dim_param or size.dim_value for size in kind.shape.dim],
        "meaning": MEANINGS[port.name].format(channels=CHANNELS[network.config.render_outputs]),
    }


def _tell(told: dict[str, Any]) -> str:
    """Lay the facts out as Markdown."""
    notes, sides = told["notes"], told["sides"]
    lines = [
        f"# Networks of {notes['weights']}",
        "",
        f"Written by {notes['exported_by']}, whose docs/export.md has programs that use them.",
        f"Licence of the weights: {notes.get('licence', 'not told')}.",
        "",
        "| file | network | numbers | MB |",
        "| --- | --- | --- | --- |",
    ]
    for name, file in told["files"].items():
        size = f"{file['bytes'] / 1e6:.1f}"
        lines.append(f"| {name} | {file['network']} | {file['precision']} | {size} |")
    for name, network in told["networks"].items():
        lines += ["", f"## {name}", "", f"It {network['purpose']}.", ""]
        for way in ("inputs", "outputs"):
            for port, tensor in network[way].items():
                shape = " x ".join(map(str, tensor["shape"]))
                lines.append(
                    f"- {way[:-1]} `{port}`, {tensor['type']}, {shape}: {tensor['meaning']}"
                )
    lines += [
        "",
        "## Conventions",
        "",
        f"- Height and width are multiples of {sides['multiple_of']}; the network learned from"
        f" {sides['usual']}, and draws {sides['least']} to {sides['most']} well. Cut a square"
        " around the person.",
        "- Rows run from the top, columns from the left. Images have their channels last, maps have"
        " them first.",
        "- Left and right in IUV are the person's own; parts are DensePose's.",
        "- A picture a call.",
        "",
    ]
    return "\n".join(lines)
