"""Neural Re-Rendering of Humans from a Single Image (Sarkar et al., ECCV 2020), in pure torch.

Tensors in, tensors out: no files, no devices chosen, nothing printed. Names are looked up when they
are first used: who asks for numbers and tables alone does not wait for torch.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from nhrr_core.config import PRESETS, VARIANTS, ModelConfig
from nhrr_core.errors import ConfigError, IuvError, NhrrError, ShapeError
from nhrr_core.parts import ALL_PARTS, PART_COUNT, PART_GROUPS, PART_NAMES

if TYPE_CHECKING:
    from nhrr_core.clearance import unfold_clearance
    from nhrr_core.discriminator import Discriminator, Verdict
    from nhrr_core.feature_net import FeatureNet
    from nhrr_core.iuv import check_iuv, keep_parts, normalise_iuv
    from nhrr_core.losses import (
        LossWeights,
        adversarial_loss,
        alpha_loss,
        discriminator_loss,
        face_identity_loss,
        generator_loss,
        matching_loss,
        perceptual_loss,
        r1_penalty,
        texture_loss,
    )
    from nhrr_core.model import NeuralReRenderer
    from nhrr_core.render_net import RenderNet
    from nhrr_core.sampling import sample_features
    from nhrr_core.texture import (
        extract_texture,
        fill_texture,
        measure_surroundings,
        merge_textures,
        mirror_texture,
        shrink_texture,
    )
    from nhrr_core.uv_layout import (
        UVLayout,
        load_uv_layout,
        smooth_coordinates,
        texture_coordinates,
    )
    from nhrr_core.uv_tables import UVTables, load_uv_tables

__all__ = [
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
]

_NAMES_OF = {
    "clearance": "unfold_clearance",
    "discriminator": "Discriminator Verdict",
    "feature_net": "FeatureNet",
    "iuv": "check_iuv keep_parts normalise_iuv",
    "losses": "LossWeights adversarial_loss alpha_loss discriminator_loss face_identity_loss"
    " generator_loss matching_loss perceptual_loss r1_penalty texture_loss",
    "model": "NeuralReRenderer",
    "render_net": "RenderNet",
    "sampling": "sample_features",
    "texture": "extract_texture fill_texture measure_surroundings merge_textures mirror_texture"
    " shrink_texture",
    "uv_layout": "UVLayout load_uv_layout smooth_coordinates texture_coordinates",
    "uv_tables": "UVTables load_uv_tables",
}
"""What is imported late, by module: the imports above, which only type checkers read."""

_HOMES = {name: home for home, names in _NAMES_OF.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value  # the next look-up finds it there
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
