"""The names others build on: removing or adding one has to be on purpose."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import nhrr_core

PUBLIC_NAMES = {
    "ALL_PARTS",
    "PART_COUNT",
    "PART_GROUPS",
    "PART_NAMES",
    "PRESETS",
    "VARIANTS",
    "ConfigError",
    "Discriminator",
    "FeatureNet",
    "IuvError",
    "LossWeights",
    "ModelConfig",
    "NeuralReRenderer",
    "NhrrError",
    "RenderNet",
    "ShapeError",
    "UVLayout",
    "UVTables",
    "Verdict",
    "adversarial_loss",
    "alpha_loss",
    "check_iuv",
    "discriminator_loss",
    "extract_texture",
    "face_identity_loss",
    "fill_texture",
    "generator_loss",
    "keep_parts",
    "load_uv_layout",
    "load_uv_tables",
    "matching_loss",
    "measure_surroundings",
    "merge_textures",
    "mirror_texture",
    "normalise_iuv",
    "perceptual_loss",
    "r1_penalty",
    "sample_features",
    "shrink_texture",
    "smooth_coordinates",
    "texture_coordinates",
    "texture_loss",
    "unfold_clearance",
}


def test_names_are_exactly_these() -> None:
    assert set(nhrr_core.__all__) == PUBLIC_NAMES
    assert len(nhrr_core.__all__) == len(PUBLIC_NAMES)


@pytest.mark.parametrize("name", sorted(PUBLIC_NAMES))
def test_name_exists_and_is_documented(name: str) -> None:
    value = getattr(nhrr_core, name)
    if callable(value):
        assert value.__doc__


def test_errors_are_value_errors() -> None:
    for error in (nhrr_core.ConfigError, nhrr_core.IuvError, nhrr_core.ShapeError):
        assert issubclass(error, nhrr_core.NhrrError)
    assert issubclass(nhrr_core.NhrrError, ValueError)


def test_another_name_is_refused_as_by_any_module() -> None:
    with pytest.raises(AttributeError, match="module 'nhrr_core' has no attribute 'extract'"):
        nhrr_core.extract  # noqa: B018 - looking it up is the test


def test_type_checkers_are_told_of_the_same_names_as_are_looked_up() -> None:
    module = ast.parse(Path(nhrr_core.__file__).read_text())
    told = {
        alias.name: node.module
        for node in ast.walk(module)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("nhrr_core")
        for alias in node.names
    }
    assert set(told) == PUBLIC_NAMES
    for name, home in told.items():
        assert nhrr_core._HOMES.get(name, home.rpartition(".")[2]) == home.rpartition(".")[2]


@pytest.mark.parametrize(
    "line",
    [
        "import nhrr_core",
        "from nhrr_core import ALL_PARTS, ModelConfig, ShapeError",
        "import nhrr_core; nhrr_core.load_uv_tables()",
    ],
)
def test_numbers_and_tables_do_not_wait_for_torch(line: str) -> None:
    code = f"import sys; {line}; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_only_torch_numpy_jaxtyping_and_the_standard_library_are_imported() -> None:
    allowed = {"nhrr_core", "torch", "jaxtyping"} | sys.stdlib_module_names
    folder = Path(nhrr_core.__file__).parent
    for file in sorted(folder.glob("*.py")):
        own = allowed ^ {"torch", "numpy"} if file.name == "uv_tables.py" else allowed
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            else:
                continue
            assert {name.split(".")[0] for name in names} <= own, file.name
