from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from nhrr_core import (
    VARIANTS,
    IuvError,
    ModelConfig,
    NeuralReRenderer,
    ShapeError,
    extract_texture,
    fill_texture,
    load_uv_layout,
    measure_surroundings,
    mirror_texture,
    normalise_iuv,
    sample_features,
    shrink_texture,
)
from nhrr_core.clearance import pixels_per_texel
from nhrr_core.config import (
    DETAIL_FACTOR,
    MARGIN_LEVELS,
    OUTLINE_PIXELS,
    PHOTO_FEATURES,
    UNIT_PIXELS,
    UNIT_TEXELS,
)
from nhrr_core.dense_pose_transfer import DirectAndBlending
from nhrr_core.model import pixel_places
from nhrr_core.sampling import signed_distance, spread_colours

SMALL = ModelConfig(
    feature_width=2, render_width=4, residual_blocks=1, texture_size=64, image_size=32
)


def small(**changes: Any) -> NeuralReRenderer:
    return NeuralReRenderer(ModelConfig.from_dict({**SMALL.to_dict(), **changes})).eval()


@pytest.fixture
def photo() -> Tensor:
    return torch.rand(1, 3, 32, 32) * 2 - 1


@pytest.fixture
def iuv(ramp) -> Tensor:
    """One person of torso and head on 32 x 32 px."""
    torso, head = ramp(2, 24, 12, border=4), ramp(23, 24, 12, border=4)
    return torch.cat([torso, head[..., :12]], dim=3)


@pytest.fixture
def targets(iuv: Tensor) -> Tensor:
    """Three poses: as it was, moved down, moved to the right."""
    return torch.cat([iuv, iuv.roll(4, dims=2), iuv.roll(4, dims=3)])


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize(
    ("variant", "map_channels", "render_inputs"),
    [
        ("full", 16, 16),
        ("no-int", 16, 16),
        ("ip", 3, 3),
        ("warp", 3, 3),
        ("warp-cond", 3, 6),
        ("texture-features", 16, 16),
        ("cbi", 5, 8),
        ("dpt", 9, 12),
    ],
)
def test_variant(
    photo: Tensor,
    iuv: Tensor,
    targets: Tensor,
    variant: str,
    map_channels: int,
    render_inputs: int,
    alpha: bool,
) -> None:
    model = small(variant=variant, alpha=alpha)
    with torch.no_grad():
        feature_map = model.encode(photo, iuv)
        image = model.feature_image(feature_map, targets)
        frames = model.render(feature_map, targets)
    assert feature_map.shape == (1, map_channels, 64, 64)
    assert image.shape == (3, render_inputs, 32, 32)
    assert frames.shape == (3, 4 if alpha else 3, 32, 32)
    assert frames.min() >= -1 and frames.max() <= 1
    assert model.config.variant == variant


@pytest.mark.parametrize("variant", VARIANTS)
def test_first_convolutions_have_the_variant_s_channels(variant: str) -> None:
    model = small(variant=variant)
    entry = next(m for m in model.render_net.modules() if isinstance(m, nn.Conv2d))
    expected = {"full": 16, "no-int": 16, "ip": 3, "warp": 3, "warp-cond": 6}
    expected |= {"texture-features": 16, "cbi": 8, "dpt": 9}  # the direct one: no warped colours
    assert entry.in_channels == expected[variant]
    if variant.startswith("warp"):
        assert model.feature_net is None
    else:
        assert model.feature_net is not None
        read = {"texture-features": 12, "cbi": 3}
        assert model.feature_net.entry[0].in_channels == read.get(variant, 4)


def test_paper_sized_model_has_d_16() -> None:
    with torch.device("meta"):
        feature_net = NeuralReRenderer(ModelConfig()).feature_net
    assert feature_net is not None
    assert feature_net.exit.out_channels == 16


@pytest.mark.parametrize("variant", ["warp", "warp-cond"])
def test_warp_encodes_to_the_partial_texture(photo: Tensor, iuv: Tensor, variant: str) -> None:
    model = small(variant=variant)
    texture, _ = extract_texture(photo, iuv, model.charts, 64)
    assert texture.count_nonzero() > 0
    assert torch.equal(model.encode(photo, iuv), texture)


def test_encode_is_feature_net_of_texture_and_visibility(photo: Tensor, iuv: Tensor) -> None:
    model = small()
    assert model.feature_net is not None
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    expected = model.feature_net(torch.cat([texture, visibility], dim=1))
    assert torch.equal(model.encode(photo, iuv), expected)
    assert torch.equal(model.encode_texture(texture, visibility), expected)


def test_visibility_can_be_left_out(photo: Tensor, iuv: Tensor) -> None:
    model = small(visibility_input=False)
    assert model.feature_net is not None
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    expected = model.feature_net(texture)
    assert torch.equal(model.encode(photo, iuv), expected)
    assert torch.equal(model.encode_texture(texture, 1 - visibility), expected)


def test_visibility_matters_where_it_is_an_input(photo: Tensor, iuv: Tensor) -> None:
    model = small()
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    seen, unseen = (model.encode_texture(texture, v) for v in (visibility, 1 - visibility))
    assert not torch.allclose(seen, unseen)


@pytest.mark.parametrize("variant", ["full", "no-int", "ip"])
def test_the_shortcut_adds_the_texture(photo: Tensor, iuv: Tensor, variant: str) -> None:
    torch.manual_seed(0)
    model = small(variant=variant, colour_shortcut=True)
    assert model.feature_net is not None
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    inputs = torch.cat([texture, visibility], dim=1)
    found, made = model.encode_texture(texture, visibility), model.feature_net(inputs)
    hidden = (visibility == 0).expand_as(texture)
    assert torch.equal(found[:, :3][hidden], made[:, :3][hidden])
    assert torch.equal(found[:, :3][~hidden], texture[~hidden]), "what is seen stays"
    assert torch.equal(found[:, 3:], made[:, 3:])
    torch.nn.init.zeros_(model.feature_net.exit.weight)
    torch.nn.init.zeros_(model.feature_net.exit.bias)
    assert torch.equal(model.encode(photo, iuv)[:, :3], texture)


def test_a_filled_texture_is_what_feature_net_starts_from(photo: Tensor, iuv: Tensor) -> None:
    torch.manual_seed(0)
    model = small(prefilled=True, colour_shortcut=True)
    assert model.feature_net is not None
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    layout = load_uv_layout()
    mirrored, shown = mirror_texture(texture, visibility, layout.side_twin, layout.depth_twin)
    assert shown.sum() > visibility.sum()
    filled = fill_texture(mirrored, shown, layout.position, measure_surroundings(layout.position))
    assert (filled != mirrored).any()
    expected = model.feature_net(torch.cat([filled, visibility, shown], dim=1))
    expected[:, :3] = filled + expected[:, :3] * (1 - visibility)
    assert torch.allclose(model.encode_texture(texture, visibility), expected, atol=1e-6)


def test_a_finer_texture_keeps_its_detail(photo: Tensor, iuv: Tensor) -> None:
    torch.manual_seed(0)
    model = small(colour_shortcut=True)
    assert model.feature_net is not None
    size, factor = model.config.finest_texture, DETAIL_FACTOR
    assert size == factor * model.config.texture_size
    fine, visibility = extract_texture(photo, iuv, model.charts, size)
    coarse = torch.cat(shrink_texture(fine, visibility, factor), dim=1)
    change = model.feature_net(coarse)
    change[:, :3] *= 1 - nn.functional.avg_pool2d(visibility, factor)  # what is seen stays
    found, detail = model.encode_texture(fine, visibility), model.detail(fine, visibility)
    assert detail is not None
    assert torch.equal(found, change + nn.functional.pad(coarse[:, :3], (0, 0, 0, 0, 0, 13)))
    # together they are what the photo shows, and what FeatureNet changes
    where = (visibility > 0).expand_as(fine)
    shown = detail + nn.functional.interpolate(
        found[:, :3] - change[:, :3], size=size, mode="bilinear"
    )
    assert torch.allclose(shown[where], fine[where], atol=1e-6)
    assert not detail[~where].any(), "what is hidden has none"
    assert model.detail(*shrink_texture(fine, visibility, factor)) is None
    assert small().config.finest_texture == small().config.texture_size
    assert small().detail(fine, visibility) is None


def test_detail_is_looked_up_beside_the_map(targets: Tensor) -> None:
    model = small(colour_shortcut=True, geometry=True)
    feature_map = torch.rand(1, model.config.map_channels, 64, 64)
    detail = torch.rand(1, 3, 256, 256)
    plain = model.feature_image(feature_map, targets)
    image = model.feature_image(feature_map, targets, detail)
    added = sample_features(detail, targets, model.charts)
    assert torch.allclose(image[:, :3], plain[:, :3] + added, atol=1e-6)
    assert torch.equal(image[:, 3:], plain[:, 3:])
    assert not torch.equal(
        model.render(feature_map, targets), model.render(feature_map, targets, detail)
    )


def test_what_a_finer_texture_hides_is_filled_smoothly(photo: Tensor, iuv: Tensor) -> None:
    """Mirror images of single texels would show as squares."""
    model = small(prefilled=True, colour_shortcut=True)
    assert model.feature_net is not None
    torch.nn.init.zeros_(model.feature_net.exit.weight)
    torch.nn.init.zeros_(model.feature_net.exit.bias)
    fine, visibility = extract_texture(photo, iuv, model.charts, 256)
    coarse, seen = shrink_texture(fine, visibility, 4)
    layout = load_uv_layout()
    mirrored, shown = mirror_texture(coarse, seen, layout.side_twin, layout.depth_twin)
    filled = fill_texture(mirrored, shown, layout.position, measure_surroundings(layout.position))
    found, detail = model.encode_texture(fine, visibility)[:, :3], model.detail(fine, visibility)
    assert detail is not None
    assert torch.equal(found, filled)
    smooth = nn.functional.interpolate(filled, scale_factor=4, mode="bilinear")
    assert torch.allclose(smooth + detail, torch.where(visibility > 0, fine, smooth), atol=1e-6)
    assert (visibility == 0).any()
    assert (smooth != 0).all(dim=1)[visibility[:, 0] == 0].any(), "what is hidden has colours"


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("variant", VARIANTS)
def test_the_drawing_is_added_to_the_colours(variant: str, alpha: bool) -> None:
    model = small(variant=variant, alpha=alpha, colour_shortcut=True)
    feature_image = torch.rand(3, model.config.render_inputs, 32, 32) * 4 - 2
    drawn = torch.rand(3, model.config.render_outputs, 32, 32) * 2 - 1
    drawn[0, :3], drawn[1, :3], drawn[2, :3] = 0, 1, -1
    frame = model.blend(drawn, feature_image)
    assert frame.shape == drawn.shape
    assert torch.equal(frame[0, :3], feature_image[0, :3].clamp(-1, 1))
    assert (frame[1, :3] == 1).all(), "any colour can become white"
    assert (frame[2, :3] == -1).all(), "or black"
    assert torch.equal(frame[:, 3:], drawn[:, 3:])


def test_the_margin_of_the_shortcut() -> None:
    model = small(colour_shortcut=True, colour_margin=True)
    image = torch.rand(2, 16, 64, 64) * 2 - 1
    image[0, :, :, 20:] = 0
    image[0, :3, :, :20] = torch.tensor([0.2, -0.4, 0.6])[:, None, None]
    frame = model.blend(torch.zeros(2, 3, 64, 64), image)
    assert torch.allclose(frame[0, :, :, :40], image[0, :3, :, :1].expand(-1, 64, 40), atol=1e-5)
    assert torch.equal(frame[1], image[1, :3])


def test_rendering_blends(targets: Tensor) -> None:
    model = small(colour_shortcut=True, alpha=True)
    feature_map = torch.rand(1, 16, 64, 64)
    image = model.feature_image(feature_map, targets)
    expected = model.blend(model.render_net(image), image)
    assert torch.equal(model.render(feature_map, targets), expected)
    plain = small()
    assert plain.blend(image, image) is image


def test_render_net_sees_the_sampled_map(targets: Tensor) -> None:
    model = small()
    feature_map = torch.rand(1, 16, 64, 64)
    features = sample_features(feature_map, targets, model.charts)
    assert torch.equal(model.feature_image(feature_map, targets), features)
    assert torch.equal(model.render(feature_map, targets), model.render_net(features))


def test_warp_cond_sees_the_target_iuv_too(targets: Tensor) -> None:
    model = small(variant="warp-cond")
    texture = torch.rand(1, 3, 64, 64)
    image = model.feature_image(texture, targets)
    assert torch.equal(image[:, :3], sample_features(texture, targets, model.charts))
    assert torch.equal(image[:, 3:], normalise_iuv(targets))


def pictures(photo: Tensor, iuv: Tensor) -> Tensor:
    """One picture of each person, as those variants read it that look at the photo."""
    levels = ((photo + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
    return torch.cat([levels, iuv], dim=1)[:, None]


@pytest.fixture
def clearance() -> Tensor:
    """Of clothes that stand off the whole body alike, measured at some texels."""
    clearance = torch.zeros(1, 2, 128, 128)
    clearance[0, :, ::5, ::5] = torch.tensor([0.75, 1])[:, None, None]
    return clearance


@pytest.mark.parametrize("variant", VARIANTS)
def test_render_net_is_told_the_clearance_in_its_own_pixels(
    photo: Tensor, iuv: Tensor, clearance: Tensor, variant: str
) -> None:
    model = small(variant=variant, clearance=True)
    plain = small(variant=variant)
    state = model.state_dict()
    encoders = {name: state[name] for name in state if not name.startswith("render_net")}
    plain.load_state_dict(encoders, strict=False)
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    shown = pictures(photo, iuv) if model.config.reads_photo else None
    feature_map = model.encode_texture(texture, visibility, clearance, shown)
    without = plain.encode_texture(texture, visibility, pictures=shown)
    at = model.config.appearance_channels
    assert torch.equal(torch.cat([feature_map[:, :at], feature_map[:, at + 2 :]], 1), without)
    assert torch.allclose(feature_map[:, at], torch.tensor(0.75))
    assert torch.equal(feature_map[:, at + 1], torch.ones(1, 64, 64))
    for scale in (1, 2):
        target = iuv.repeat_interleave(scale, 2).repeat_interleave(scale, 3)
        image = model.feature_image(feature_map, target)[:, plain.config.sampled_channels :]
        body = target[:, 0] > 0
        pixels = 0.75 * UNIT_TEXELS * pixels_per_texel(target, model.charts) / UNIT_PIXELS
        assert torch.allclose(image[:, 0][body], pixels, rtol=1e-5)
        assert torch.allclose(image[:, 1][body], torch.tensor(1.0))
        assert not image[:, :2, ~body[0]].any()


def test_a_clearance_may_be_unknown(photo: Tensor, iuv: Tensor) -> None:
    model = small(clearance=True)
    own = extract_texture(photo, iuv, model.charts, 64)
    feature_map = model.encode_texture(*own)
    assert not feature_map[:, -2:].any()
    assert torch.equal(feature_map, model.encode_texture(*own, torch.zeros(1, 2, 128, 128)))
    assert torch.equal(feature_map, model.encode(photo, iuv))


@pytest.mark.parametrize("clearance", [False, True])
@pytest.mark.parametrize("variant", VARIANTS)
def test_geometry_tells_render_net_where_it_draws(
    photo: Tensor, iuv: Tensor, targets: Tensor, variant: str, clearance: bool
) -> None:
    model = small(variant=variant, clearance=clearance, geometry=True)
    plain = small(variant=variant, clearance=clearance)
    feature_map = model.encode(photo, iuv)
    assert feature_map.shape[1] == model.config.map_channels
    at = model.config.warped_channels
    feature_map[:, :at] = torch.rand(1, at, 64, 64)
    without = torch.cat([feature_map[:, :at], feature_map[:, at + 3 :]], dim=1)
    image = model.feature_image(feature_map, targets)
    assert image.shape == (3, model.config.render_inputs, 32, 32)
    known = plain.config.render_inputs
    assert torch.equal(image[:, :known], plain.feature_image(without, targets))
    body, around = targets[:, :1] > 0, image[:, known:]
    assert torch.equal(around[:, -1:], signed_distance(body, OUTLINE_PIXELS) / UNIT_PIXELS)
    places = sample_features(feature_map[:, at : at + 3], targets, model.charts)
    assert torch.allclose(around[:, -4:-1], spread_colours(places, body, MARGIN_LEVELS))
    assert around.shape[1] == 4 + clearance
    if clearance:
        own = image[:, plain.config.appearance_channels, None]
        assert torch.equal(around[:, :1], spread_colours(own, body, MARGIN_LEVELS))


def test_geometry_tells_feature_net_where_texels_lie(photo: Tensor, iuv: Tensor) -> None:
    torch.manual_seed(0)
    model = small(geometry=True, prefilled=True)
    assert model.feature_net is not None
    read: list[Tensor] = []
    model.feature_net.register_forward_pre_hook(lambda _, given: read.append(given[0]))
    feature_map = model.encode(photo, iuv)
    position = load_uv_layout().position[2::4, 2::4].permute(2, 0, 1)  # 64 of 256 texels
    # x to the left, y up, z to the front: each by its own largest
    largest = load_uv_layout().position.abs().amax((0, 1))[:, None, None]
    assert torch.allclose(read[0][0, -3:], position / largest)
    assert torch.equal(feature_map[:, -3:], read[0][:, -3:])
    assert read[0].shape[1] == model.config.feature_inputs == 8


@pytest.mark.parametrize("side", [64, 32])
def test_feature_net_reads_a_prior_that_learns(photo: Tensor, iuv: Tensor, side: int) -> None:
    torch.manual_seed(0)
    model = small(prior=True)
    assert model.feature_net is not None and model.prior is not None
    model.prior.data.uniform_(-1, 1)
    read: list[Tensor] = []
    model.feature_net.register_forward_pre_hook(lambda _, given: read.append(given[0]))
    texture = torch.zeros(2, 3, side, side)
    model.encode_texture(texture, texture[:, :1]).sum().backward()
    assert read[0].shape[1] == model.config.feature_inputs == 7
    factor = 64 // side
    assert torch.allclose(read[0][:, -3:], F.avg_pool2d(model.prior, factor).expand(2, -1, -1, -1))
    assert model.prior.grad is not None and model.prior.grad.any()


def test_variants_without_a_feature_net_have_no_prior() -> None:
    assert small(variant="warp", prior=True).prior is None


def test_geometry_decides_what_the_margin_is_carried_from(targets: Tensor) -> None:
    model = small(colour_shortcut=True, colour_margin=True, geometry=True)
    feature_map = torch.zeros(1, model.config.map_channels, 64, 64)  # grey is a colour, too
    image = model.feature_image(feature_map, targets)
    body = targets[:, :1] > 0
    image[:, :3] = torch.where(body, image[:, :3], 1)
    frame = model.blend(torch.zeros(3, 3, 32, 32), image)
    assert torch.equal(frame, spread_colours(image[:, :3], body, MARGIN_LEVELS))
    assert not frame[body.expand(-1, 3, -1, -1)].any()


@pytest.mark.parametrize("side", [256, 512])
def test_image_sizes(side: int, ramp) -> None:
    config = ModelConfig(
        feature_width=1, render_width=1, residual_blocks=1, texture_size=64, image_size=side
    )
    model = NeuralReRenderer(config).eval()
    iuv = ramp(2, side // 2, border=side // 4)
    with torch.no_grad():
        frame = model(torch.rand(1, 3, side, side), iuv, iuv)
    assert frame.shape == (1, 3, side, side)
    assert frame.isfinite().all()


def test_photo_and_target_may_differ_in_size(photo: Tensor, iuv: Tensor, ramp) -> None:
    frame = small()(photo, iuv, ramp(2, 8, 40, border=4))
    assert frame.shape == (1, 3, 16, 48)


def test_forward_is_encode_then_render(photo: Tensor, iuv: Tensor) -> None:
    model = small()
    target = iuv.roll(4, dims=3)
    with torch.no_grad():
        both = model.render(model.encode(photo, iuv), target)
        assert torch.equal(model(photo, iuv, target), both)


@pytest.mark.parametrize("variant", VARIANTS)
def test_rendering_a_batch_equals_one_by_one(
    photo: Tensor, iuv: Tensor, targets: Tensor, variant: str
) -> None:
    model = small(variant=variant)
    with torch.no_grad():
        feature_map = model.encode(photo, iuv)
        together = model.render(feature_map, targets)
        alone = torch.cat([model.render(feature_map, target[None]) for target in targets])
    torch.testing.assert_close(together, alone, rtol=0, atol=1e-4)
    assert not torch.allclose(together[0], together[1], atol=1e-2)


def test_each_target_may_have_its_own_source(iuv: Tensor, targets: Tensor) -> None:
    model = small()
    photos = torch.rand(3, 3, 32, 32)
    with torch.no_grad():
        maps = model.encode(photos, iuv.repeat(3, 1, 1, 1))
        together = model.render(maps, targets)
        for i in range(3):
            alone = model.render(maps[i : i + 1], targets[i : i + 1])
            torch.testing.assert_close(together[i : i + 1], alone, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("down_blocks", "shape"), [(3, (36, 32)), (3, (32, 20)), (2, (34, 32))])
def test_target_of_a_wrong_size_raises(down_blocks: int, shape: tuple[int, int]) -> None:
    model = small(down_blocks=down_blocks)
    target = torch.zeros(1, 3, *shape, dtype=torch.uint8)
    with pytest.raises(ShapeError) as raised:
        model.render(torch.rand(1, 16, 64, 64), target)
    message = f"target IUV [1, 3, {shape[0]}, {shape[1]}]: its sides must be multiples of"
    assert str(raised.value) == f"{message} {2**down_blocks}"


def test_texture_of_a_wrong_size_raises() -> None:
    with pytest.raises(ShapeError) as raised:
        small().encode_texture(torch.rand(1, 3, 40, 40), torch.ones(1, 1, 40, 40))
    message = "texture [1, 3, 40, 40]: its sides must be multiples of 16"
    assert str(raised.value) == message


@pytest.mark.usefixtures("unchecked")
def test_numbers_of_maps_and_targets_that_differ_raise(targets: Tensor) -> None:
    with pytest.raises(ShapeError, match="2 feature maps for 3 IUV images"):
        small().render(torch.rand(2, 16, 64, 64), targets)


@pytest.mark.usefixtures("unchecked")
def test_photo_and_iuv_that_differ_raise(photo: Tensor, iuv: Tensor) -> None:
    with pytest.raises(ShapeError, match="do not match"):
        small().encode(photo[..., :16], iuv)


def test_part_above_24_raises(photo: Tensor, iuv: Tensor) -> None:
    iuv[0, 0, 0, 0] = 40
    with pytest.raises(IuvError, match="part index 40"):
        small().encode(photo, iuv)


@pytest.mark.parametrize("variant", VARIANTS)
def test_state_dict_round_trip(
    photo: Tensor, iuv: Tensor, targets: Tensor, variant: str, tmp_path: Path
) -> None:
    model, other = small(variant=variant, alpha=True), small(variant=variant, alpha=True)
    torch.save(model.state_dict(), tmp_path / "state.pt")
    with torch.no_grad():
        wanted = model.render(model.encode(photo, iuv), targets)
        before = other.render(other.encode(photo, iuv), targets)
        assert not torch.allclose(before, wanted)
        other.load_state_dict(torch.load(tmp_path / "state.pt", weights_only=True))
        assert torch.equal(other.render(other.encode(photo, iuv), targets), wanted)


@pytest.mark.parametrize("variant", VARIANTS)
def test_state_dict_holds_networks_only(variant: str) -> None:
    model = small(variant=variant)
    expected = {"render_net"} | ({"feature_net"} if model.feature_net else set())
    expected |= {"photo_net"} if variant == "texture-features" else set()
    assert {key.split(".")[0] for key in model.state_dict()} == expected
    assert "charts" in dict(model.named_buffers())


def test_models_do_not_share_their_charts() -> None:
    one, two = small(), small()
    one.charts.zero_()
    assert two.charts.count_nonzero() > 0
    assert small().charts.count_nonzero() > 0


@pytest.mark.parametrize("told", [False, True])
def test_gradient_reaches_both_networks_and_the_photo(
    iuv: Tensor, targets: Tensor, clearance: Tensor, told: bool
) -> None:
    model = small(clearance=told).train()
    photo = torch.rand(1, 3, 32, 32, requires_grad=True)
    texture = extract_texture(photo, iuv, model.charts, 64)
    frames = model.render(model.encode_texture(*texture, clearance), targets)
    (frames * torch.rand_like(frames)).sum().backward()
    body = iuv[:, 0] > 0
    assert photo.grad is not None
    assert (photo.grad.abs().sum(1)[body] > 0).all()
    assert (photo.grad.abs().sum(1)[~body] == 0).all()
    for name, parameter in model.named_parameters():
        assert parameter.grad is not None, name
        if name.endswith("weight"):
            assert parameter.grad.abs().sum() > 0, name


def test_background_of_the_photo_does_not_matter(photo: Tensor, iuv: Tensor) -> None:
    model = small()
    other = torch.where(iuv[:, :1] > 0, photo, torch.rand_like(photo))
    assert torch.equal(model.encode(photo, iuv), model.encode(other, iuv))


def test_same_seed_same_weights() -> None:
    states = []
    for _ in range(2):
        torch.manual_seed(3)
        states.append(small().state_dict())
    assert all(torch.equal(states[0][key], states[1][key]) for key in states[0])


class Render(nn.Module):
    """`NeuralReRenderer.render` as a module, as export takes modules only."""

    def __init__(self, model: NeuralReRenderer) -> None:
        super().__init__()
        self.model = model

    def forward(self, feature_map: Tensor, target_iuv: Tensor) -> Tensor:
        return self.model.render(feature_map, target_iuv)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("variant", ["full", "warp-cond"])
def test_compiled_render_equals_eager(targets: Tensor, variant: str) -> None:
    """In one graph. Code generation is left out: it is torch's own and takes half a minute."""
    model = small(variant=variant)
    feature_map = torch.rand(1, model.config.map_channels, 64, 64)
    compiled = torch.compile(model.render, fullgraph=True, backend="aot_eager")
    with torch.no_grad():
        expected = model.render(feature_map, targets)
        torch.testing.assert_close(compiled(feature_map, targets), expected, rtol=0, atol=1e-5)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.filterwarnings("ignore:.isinstance.treespec, LeafSpec:FutureWarning")
@pytest.mark.parametrize("variant", ["full", "warp-cond"])
def test_onnx_export_of_render_equals_torch(targets: Tensor, variant: str, tmp_path: Path) -> None:
    onnxruntime = pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    model = small(variant=variant, alpha=True)
    feature_map = torch.rand(1, model.config.map_channels, 64, 64)
    program = torch.onnx.export(
        Render(model).eval(),
        (feature_map, targets),
        dynamo=True,
        verbose=False,
        input_names=["feature_map", "target_iuv"],
    )
    assert program is not None
    path = tmp_path / "render.onnx"
    program.save(path)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    other = targets.flip(0)
    inputs = {"feature_map": feature_map.numpy(), "target_iuv": other.numpy()}
    (frames,) = session.run(None, inputs)
    with torch.no_grad():
        expected = model.render(feature_map, other)
    torch.testing.assert_close(torch.from_numpy(frames), expected, rtol=0, atol=1e-4)


def of_ones(module: nn.Module | None) -> None:
    """Have a network write ones, whatever it reads."""
    assert isinstance(module, nn.Module) and isinstance(module.exit, nn.Conv2d)
    nn.init.zeros_(module.exit.weight)
    assert module.exit.bias is not None
    nn.init.ones_(module.exit.bias)


@pytest.mark.parametrize("variant", ["texture-features", "cbi", "dpt"])
def test_a_variant_that_reads_the_photo_asks_for_it(
    photo: Tensor, iuv: Tensor, variant: str
) -> None:
    model = small(variant=variant)
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    with pytest.raises(ShapeError, match=f"variant {variant} reads the source's picture; give it"):
        model.encode_texture(texture, visibility)
    given = model.encode_texture(texture, visibility, pictures=pictures(photo, iuv))
    assert torch.allclose(given, model.encode(photo, iuv))


def test_texels_carry_features_where_they_are_seen(photo: Tensor, iuv: Tensor) -> None:
    model = small(variant="texture-features")
    of_ones(model.photo_net)
    assert model.feature_net is not None
    read: list[Tensor] = []
    model.feature_net.register_forward_pre_hook(lambda _, given: read.append(given[0]))
    model.encode(photo, iuv)
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    features, known = read[0][:, 3:11], read[0][:, 11:]
    assert torch.equal(read[0][:, :3], texture) and torch.equal(known, visibility)
    assert torch.allclose(features, visibility.expand(-1, PHOTO_FEATURES, -1, -1))


def test_features_are_means_of_the_pictures_that_see_a_texel(photo: Tensor, iuv: Tensor) -> None:
    model = small(variant="texture-features")
    half = iuv.clone()
    half[:, :, :16] = 0
    texture, _ = extract_texture(photo, iuv, model.charts, 64)
    one = pictures(photo, iuv)
    other = pictures(-photo, half)
    together = model._features_like(texture, torch.cat([one, other], dim=1))
    alone = [model._features_like(texture, each) for each in (one, other)]
    assert together is not None and alone[0] is not None and alone[1] is not None
    seen = extract_texture(photo, half, model.charts, 64)[1] > 0
    mean = (alone[0] + alone[1]) / 2
    assert seen.any() and not seen.all()
    assert torch.allclose(together, torch.where(seen, mean, alone[0]), atol=1e-5)


def test_features_see_what_lies_around_the_body(photo: Tensor, iuv: Tensor) -> None:
    model = small(variant="texture-features")
    beside = photo.clone()
    beside[(iuv[:, :1] == 0).expand_as(photo)] *= -1  # the body's own pixels stay as they are
    texture, other = (extract_texture(p, iuv, model.charts, 64)[0] for p in (photo, beside))
    assert torch.equal(texture, other)
    seen = [model._features_like(texture, pictures(p, iuv)) for p in (photo, beside)]
    assert seen[0] is not None and seen[1] is not None
    assert not torch.allclose(*seen, rtol=1e-2)


def test_hidden_texels_have_the_colour_of_the_place_that_they_are_taken_from(
    photo: Tensor, iuv: Tensor
) -> None:
    model = small(variant="cbi")
    of_ones(model.feature_net)  # every texel is taken from the corner, x = y = 1
    feature_map = model.encode(photo, iuv)
    texture, visibility = extract_texture(photo, iuv, model.charts, 64)
    corner = ((photo[:, :, -1, -1] + 1) * 127.5).round() / 127.5 - 1
    hidden = (visibility == 0).expand_as(texture)
    assert torch.allclose(
        feature_map[:, :3][hidden], corner[0, :, None, None].expand(3, 64, 64)[hidden[0]]
    )
    assert torch.equal(feature_map[:, :3][~hidden], texture[~hidden]), "what is seen stays"
    assert torch.equal(feature_map[:, 3:], torch.ones(1, 2, 64, 64))


def test_coordinates_lead_back_to_the_photo(photo: Tensor, iuv: Tensor) -> None:
    """With the shortcut and a network that adds nothing, texels that are seen see themselves."""
    model = small(variant="cbi", colour_shortcut=True)
    of_ones(model.feature_net)
    assert model.feature_net is not None and model.feature_net.exit.bias is not None
    nn.init.zeros_(model.feature_net.exit.bias)
    feature_map = model.encode(photo, iuv)
    places, seen = extract_texture(pixel_places(photo), iuv, model.charts, 64)
    assert torch.equal(feature_map[:, 3:], places)
    found = F.grid_sample(photo, places.permute(0, 2, 3, 1), align_corners=False)
    colours = extract_texture(photo, iuv, model.charts, 64)[0]
    # a texel is a mean of pixels, and the photo at the mean of their places
    assert (found - colours)[seen.expand_as(colours) > 0].abs().median() < 0.1


def test_the_direct_network_sees_no_warped_colours(
    photo: Tensor, iuv: Tensor, targets: Tensor
) -> None:
    model = small(variant="dpt", alpha=True)
    assert isinstance(model.render_net, DirectAndBlending)
    drawn: list[Tensor] = []
    model.render_net.direct.register_forward_hook(lambda _, __, given: drawn.append(given))
    feature_map = model.encode(photo, iuv)
    other = feature_map.clone()
    other[:, :3] *= -1
    frames = [model.render(each, targets) for each in (feature_map, other)]
    assert torch.equal(*drawn) and drawn[0].shape == (3, 3, 32, 32)
    assert not torch.allclose(*frames)
    levels = (pictures(photo, iuv)[0, 0, :3].float() / 127.5 - 1)[None]
    image = model.feature_image(feature_map, targets)
    assert torch.equal(image[:1, 6:9], levels), "the photo itself, pixel for pixel"
    assert torch.equal(image[:1, 9:], normalise_iuv(iuv))
    assert torch.equal(image[:, 3:6], normalise_iuv(targets))
