from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from nhrr_core import PRESETS, VARIANTS, ConfigError, ModelConfig

pytestmark = pytest.mark.usefixtures("unchecked")


def test_defaults_are_the_papers() -> None:
    assert ModelConfig().to_dict() == {
        "variant": "full",
        "feature_channels": 16,
        "feature_width": 64,
        "render_width": 64,
        "down_blocks": 3,
        "residual_blocks": 6,
        "texture_size": 256,
        "image_size": 256,
        "alpha": False,
        "visibility_input": True,
        "prefilled": False,
        "colour_shortcut": False,
        "clearance": False,
        "geometry": False,
        "colour_margin": False,
        "prior": False,
        "even": False,
        "bilinear": False,
    }


def test_presets() -> None:
    assert set(PRESETS) == {"paper", "lite"}
    assert ModelConfig.preset("paper") == ModelConfig()
    assert ModelConfig.preset("lite") == ModelConfig(
        feature_width=32,
        render_width=32,
        prefilled=True,
        colour_shortcut=True,
        colour_margin=True,
        clearance=True,
        geometry=True,
        prior=True,
        even=True,
    )


def test_preset_takes_changes() -> None:
    config = ModelConfig.preset("lite", alpha=True, image_size=512)
    assert (config.render_width, config.alpha, config.image_size) == (32, True, 512)
    assert not PRESETS["lite"].alpha


def test_preset_with_an_impossible_change_raises() -> None:
    with pytest.raises(ConfigError, match="render_width is 0"):
        ModelConfig.preset("lite", render_width=0)


def test_unknown_preset_raises() -> None:
    with pytest.raises(ConfigError, match="preset is 'huge'; supported are paper, lite"):
        ModelConfig.preset("huge")


def test_unknown_variant_raises() -> None:
    message = "variant is 'fast'; supported are full, no-int, ip, warp, warp-cond"
    with pytest.raises(ConfigError, match=message):
        ModelConfig(variant="fast")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "value", "rule"),
    [
        ("feature_channels", 2, "an integer from 3 to 1024"),
        ("feature_channels", 1025, "an integer from 3 to 1024"),
        ("feature_width", 0, "an integer from 1 to 1024"),
        ("render_width", -1, "an integer from 1 to 1024"),
        ("render_width", 64.0, "an integer from 1 to 1024"),
        ("render_width", "64", "an integer from 1 to 1024"),
        ("render_width", True, "an integer from 1 to 1024"),
        ("down_blocks", 0, "an integer from 1 to 6"),
        ("down_blocks", 7, "an integer from 1 to 6"),
        ("residual_blocks", 0, "an integer from 1 to 64"),
        ("residual_blocks", 65, "an integer from 1 to 64"),
        ("texture_size", 100, "an integer from 16 to 4096, a multiple of 16"),
        ("texture_size", 0, "an integer from 16 to 4096, a multiple of 16"),
        ("texture_size", 8192, "an integer from 16 to 4096, a multiple of 16"),
        ("image_size", 100, "an integer from 16 to 4096, a multiple of 8"),
        ("image_size", 4104, "an integer from 16 to 4096, a multiple of 8"),
        ("alpha", 1, "true or false"),
        ("alpha", None, "true or false"),
        ("visibility_input", "yes", "true or false"),
    ],
)
def test_impossible_value_raises(field: str, value: Any, rule: str) -> None:
    with pytest.raises(ConfigError) as raised:
        ModelConfig(**{field: value})
    assert str(raised.value) == f"{field} is {value!r}; it must be {rule}"


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("feature_channels", 3),
        ("feature_channels", 1024),
        ("down_blocks", 1),
        ("residual_blocks", 64),
        ("texture_size", 16),
        ("texture_size", 4096),
        ("image_size", 4096),
    ],
)
def test_limits_are_possible(field: str, value: int) -> None:
    assert getattr(ModelConfig(**{field: value}), field) == value  # type: ignore[arg-type]


def test_image_size_follows_down_blocks() -> None:
    assert ModelConfig(image_size=36, down_blocks=2).image_size == 36
    with pytest.raises(ConfigError, match="multiple of 16"):
        ModelConfig(image_size=72, down_blocks=4)


@pytest.mark.parametrize("variant", VARIANTS)
def test_dict_round_trip(variant: Any) -> None:
    config = ModelConfig(variant=variant, alpha=True, texture_size=64)
    assert ModelConfig.from_dict(json.loads(json.dumps(config.to_dict()))) == config


def test_from_dict_fills_in_defaults() -> None:
    assert ModelConfig.from_dict({"variant": "ip"}) == ModelConfig(variant="ip")


def test_from_dict_names_unknown_fields() -> None:
    with pytest.raises(ConfigError, match="unknown configuration field depth, norm"):
        ModelConfig.from_dict({"norm": "batch", "alpha": True, "depth": 3})


def test_from_dict_checks_values() -> None:
    with pytest.raises(ConfigError, match="texture_size is 17"):
        ModelConfig.from_dict({"texture_size": 17})


def test_is_frozen_keyword_only_and_hashable() -> None:
    config = ModelConfig()
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.alpha = True  # type: ignore[misc]
    with pytest.raises(TypeError):
        ModelConfig("full")  # type: ignore[misc]
    assert len({config, ModelConfig(), ModelConfig(alpha=True)}) == 2


@pytest.mark.parametrize(
    ("variant", "has_feature_net", "map_channels", "render_inputs"),
    [
        ("full", True, 16, 16),
        ("no-int", True, 16, 16),
        ("ip", True, 3, 3),
        ("warp", False, 3, 3),
        ("warp-cond", False, 3, 6),
        ("texture-features", True, 16, 16),
        ("cbi", True, 5, 8),
        ("dpt", True, 9, 12),
    ],
)
def test_channels_of_a_variant(
    variant: Any, has_feature_net: bool, map_channels: int, render_inputs: int
) -> None:
    config = ModelConfig(variant=variant)
    assert config.has_feature_net is has_feature_net
    assert config.map_channels == map_channels
    assert config.render_inputs == render_inputs
    assert config.render_outputs == 3
    assert ModelConfig(variant=variant, alpha=True).render_outputs == 4


def test_feature_channels_reach_the_map_of_full_only() -> None:
    assert ModelConfig(feature_channels=24).map_channels == 24
    assert ModelConfig(variant="no-int", feature_channels=24).render_inputs == 24
    assert ModelConfig(variant="ip", feature_channels=24).map_channels == 3
