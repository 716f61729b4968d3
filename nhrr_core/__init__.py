"""Neural Re-Rendering of Humans from a Single Image (Sarkar et al., ECCV 2020), in pure torch.

Tensors in, tensors out: no files, no devices chosen, nothing printed.
"""

from nhrr_core.clearance import unfold_clearance
from nhrr_core.config import PRESETS, VARIANTS, ModelConfig
from nhrr_core.discriminator import Discriminator, Verdict
from nhrr_core.errors import ConfigError, IuvError, NhrrError, ShapeError
from nhrr_core.fast_render_net import FastRenderNet
from nhrr_core.feature_net import FeatureNet
from nhrr_core.iuv import PART_COUNT, PART_GROUPS, PART_NAMES, check_iuv, keep_parts, normalise_iuv
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
from nhrr_core.uv_layout import UVLayout, load_uv_layout, texture_coordinates

__all__ = [
    "PART_COUNT",
    "PART_GROUPS",
    "PART_NAMES",
    "PRESETS",
    "VARIANTS",
    "ConfigError",
    "Discriminator",
    "FastRenderNet",
    "FeatureNet",
    "IuvError",
    "LossWeights",
    "ModelConfig",
    "NeuralReRenderer",
    "NhrrError",
    "RenderNet",
    "ShapeError",
    "UVLayout",
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
    "matching_loss",
    "measure_surroundings",
    "merge_textures",
    "mirror_texture",
    "normalise_iuv",
    "perceptual_loss",
    "r1_penalty",
    "sample_features",
    "shrink_texture",
    "texture_coordinates",
    "texture_loss",
    "unfold_clearance",
]
