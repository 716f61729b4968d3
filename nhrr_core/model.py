"""The whole method: encode a source once, render it in any pose."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from jaxtyping import Float, Shaped, UInt8
from torch import Tensor, nn

from nhrr_core.clearance import detail_share, pixels_per_texel, spread_clearance
from nhrr_core.config import (
    CLEARANCE_CHANNELS,
    CLEARANCE_SIZE,
    COLOUR_CHANNELS,
    MARGIN_LEVELS,
    OUTLINE_PIXELS,
    POSITION_CHANNELS,
    UNIT_PIXELS,
    UNIT_TEXELS,
    ModelConfig,
)
from nhrr_core.dense_pose_transfer import DirectAndBlending
from nhrr_core.errors import ShapeError
from nhrr_core.feature_net import FeatureNet, PhotoNet
from nhrr_core.iuv import normalise_iuv
from nhrr_core.render_net import RenderNet
from nhrr_core.sampling import sample_features, signed_distance, spread_colours
from nhrr_core.texture import (
    extract_texture,
    fill_texture,
    measure_surroundings,
    mirror_texture,
    shrink_texture,
)
from nhrr_core.uv_layout import load_uv_layout, smooth_coordinates


class NeuralReRenderer(nn.Module):
    """g(r(f(T_s), P_t)): FeatureNet, sampler and RenderNet of one variant.

    Convention: photos are RGB in [-1, 1], IUV is uint8 (I, U, V), frames are RGB in [-1, 1]; with
    `config.alpha` a fourth channel holds the coverage, in [-1, 1], 1 being the person. A feature
    map has D channels, a feature image C, a frame K.
    Source: the paper, Sec. 3, Eq. 4. Departs from it: what `ModelConfig` says.

    Example:
        >>> model = NeuralReRenderer(ModelConfig.preset("lite")).eval()
        >>> feature_map = model.encode(photo, photo_iuv)      # once per source
        >>> frames = model.render(feature_map, target_iuv)    # any number of target poses
    """

    charts: Tensor
    side_twin: Tensor
    depth_twin: Tensor
    position: Tensor
    surroundings: Tensor
    places: Tensor

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.feature_net = (
            FeatureNet(
                inputs=config.feature_inputs,
                outputs=config.feature_outputs,
                width=config.feature_width,
            )
            if config.has_feature_net
            else None
        )
        self.photo_net = PhotoNet() if config.variant == "texture-features" else None
        self.render_net = (
            DirectAndBlending(config) if config.variant == "dpt" else RenderNet(config.render_sizes)
        )
        side = config.texture_size
        self.prior = (
            nn.Parameter(torch.zeros(1, COLOUR_CHANNELS, side, side))
            if config.prior and config.has_feature_net
            else None
        )
        layout = load_uv_layout()
        tables = {"charts": layout.charts.clone()}
        if config.prefilled or config.clearance:
            for name in ("side_twin", "depth_twin", "position"):
                tables[name] = getattr(layout, name).clone()
            tables["surroundings"] = measure_surroundings(layout.position)
        if config.geometry:
            position = layout.position.permute(2, 0, 1)[None]
            tables["places"] = position / position.abs().amax((2, 3), keepdim=True)
        for name, table in tables.items():  # constants: they move with the model, unsaved
            self.register_buffer(name, table, persistent=False)

    def encode(
        self, photo: Float[Tensor, "B 3 H W"], iuv: UInt8[Tensor, "B 3 H W"]
    ) -> Float[Tensor, "B D T T"]:
        """Compute the UV feature map F_s of a photo of any size. Raises: ShapeError, IuvError."""
        texture, visibility = extract_texture(photo, iuv, self.charts, self.config.texture_size)
        levels = ((photo + 1) * 127.5).round().clamp(0, 255).to(torch.uint8)
        pictures = torch.cat([levels, iuv], dim=1)[:, None] if self.config.reads_photo else None
        return self.encode_texture(texture, visibility, pictures=pictures)

    def encode_texture(
        self,
        texture: Float[Tensor, "B 3 t t"],
        visibility: Float[Tensor, "B 1 t t"],
        clearance: Float[Tensor, "B 2 128 128"] | None = None,
        pictures: UInt8[Tensor, "B P 6 S S"] | None = None,
    ) -> Float[Tensor, "B D T T"]:
        """Compute the UV feature map of a partial texture; for the warp variants it is the texture.

        With `config.has_detail` the texture may be a multiple of `config.texture_size`: FeatureNet
        works at its own size, and `detail` tells what is finer.

        Args:
            visibility: 1 where the texture shows something, else 0.
            clearance: What `unfold_clearance` made; None: nothing is known of it.
            pictures: What the texture was unfolded from, where `config.reads_photo`: features are
                means of all pictures, other variants read the first.
        Raises: ShapeError if its side is not a multiple of 16, or if pictures are lacking.
        """
        if self.config.reads_photo and pictures is None:
            raise ShapeError(f"variant {self.config.variant} reads the source's picture; give it")
        factor = self._factor(texture)
        share = F.avg_pool2d(visibility, factor)
        texture, visibility = shrink_texture(texture, visibility, factor)
        carried = [self._complete(texture, visibility, share, pictures)]
        if self.config.clearance:
            if clearance is None:
                clearance = texture.new_zeros(
                    len(texture), CLEARANCE_CHANNELS, CLEARANCE_SIZE, CLEARANCE_SIZE
                )
            filled = self._mirror_and_fill(*clearance.split(1, 1))
            carried.append(spread_clearance(*filled, texture.shape[-1]))
        if self.config.geometry:
            carried.append(self._places_like(texture))
        if self.config.variant == "dpt":
            assert pictures is not None
            picture = normalise_picture(pictures[:, 0]).to(texture.dtype)
            carried.append(F.interpolate(picture, texture.shape[2:], mode="nearest-exact"))
        return torch.cat(carried, dim=1)

    def detail(
        self, texture: Float[Tensor, "B 3 T T"], visibility: Float[Tensor, "B 1 T T"]
    ) -> Float[Tensor, "B 3 T T"] | None:
        """Tell what a texture finer than the feature map shows: what its colours differ by.

        What is hidden is no finer than the map, where this is 0: guesses gain nothing by it.

        Returns: What is added to the map's first three channels; None for a texture of its size.
        """
        factor = self._factor(texture)
        if factor == 1:
            return None
        carried, *_ = self._filled(*shrink_texture(texture, visibility, factor))
        enlarged = F.interpolate(carried, scale_factor=factor, mode="bilinear")
        return (texture - enlarged) * visibility

    def _factor(self, texture: Float[Tensor, "B 3 T T"]) -> int:
        """How many times as fine as FeatureNet's a texture is, or 1: a size of its own."""
        factor, rest = divmod(texture.shape[-1], self.config.texture_size)
        return factor if self.config.has_detail and not rest else 1

    def _places_like(self, texture: Float[Tensor, "B C T T"]) -> Float[Tensor, "B 3 T T"]:
        """The position of each texel on the body, each axis in [-1, 1]."""
        places = F.interpolate(self.places, texture.shape[2:], mode="nearest-exact")
        return places.to(texture.dtype).expand(len(texture), -1, -1, -1)

    def _complete(
        self,
        texture: Float[Tensor, "B 3 T T"],
        visibility: Float[Tensor, "B 1 T T"],
        share: Float[Tensor, "B 1 T T"],
        pictures: UInt8[Tensor, "B P 6 S S"] | None,
    ) -> Float[Tensor, "B D T T"]:
        """Complete a partial texture.

        Args:
            share: How much of each texel is seen; that much of its colour is known, and stays.
        """
        if self.feature_net is None:
            return texture
        if texture.shape[-1] % 16 or texture.shape[-2] % 16:
            raise ShapeError(f"texture {list(texture.shape)}: its sides must be multiples of 16")
        if self.config.variant == "cbi":
            assert pictures is not None
            return self._complete_coordinates(texture, visibility, pictures[:, 0])
        own = self._filled(texture, visibility, self._features_like(texture, pictures))
        feature_map = self.feature_net(torch.cat(own, dim=1))
        if not self.config.colour_shortcut:
            return feature_map
        colours, others = feature_map.tensor_split([COLOUR_CHANNELS], dim=1)
        return torch.cat([own[0][:, :COLOUR_CHANNELS] + colours * (1 - share), others], dim=1)

    def _features_like(
        self,
        texture: Float[Tensor, "B 3 T T"],
        pictures: UInt8[Tensor, "B P 6 S S"] | None,
    ) -> Float[Tensor, "B E T T"] | None:
        """Unfold what PhotoNet sees in each picture; the mean of those that see a texel."""
        if self.photo_net is None or pictures is None:
            return None
        features = self.photo_net(normalise_picture(pictures.flatten(0, 1))).float()
        iuv = pictures[:, :, COLOUR_CHANNELS:].flatten(0, 1)
        unfolded, seen = extract_texture(features, iuv, self.charts, texture.shape[-1])
        total, count = (each.unflatten(0, pictures.shape[:2]).sum(1) for each in (unfolded, seen))
        return (total / count.clamp_min(1)).to(texture.dtype)

    def _complete_coordinates(
        self,
        texture: Float[Tensor, "B 3 T T"],
        visibility: Float[Tensor, "B 1 T T"],
        picture: UInt8[Tensor, "B 6 S S"],
    ) -> Float[Tensor, "B 5 T T"]:
        """Colour each hidden texel as the place in the picture that FeatureNet takes it from.

        Returns: The colours; and those places, x and y in [-1, 1] from edge to edge.
        """
        assert self.feature_net is not None
        photo, iuv = picture.tensor_split([COLOUR_CHANNELS], dim=1)
        side = texture.shape[-1]
        own = self._filled(*extract_texture(pixel_places(photo), iuv, self.charts, side))
        places = self.feature_net(torch.cat(own, dim=1)).float()
        if self.config.colour_shortcut:  # what it starts from is a guess as good as its colours
            places = places + own[0]
        found = F.grid_sample(
            normalise_rgb(photo),
            places.permute(0, 2, 3, 1),
            padding_mode="border",
            align_corners=False,
        )
        colours = torch.where(visibility > 0, texture, found.to(texture.dtype))
        return torch.cat([colours, places.to(texture.dtype)], dim=1)

    def _filled(
        self,
        texture: Float[Tensor, "B C T T"],
        visibility: Float[Tensor, "B 1 T T"],
        features: Float[Tensor, "B E T T"] | None = None,
    ) -> list[Tensor]:
        """What FeatureNet reads: the texture, filled if it is to be, and what is known of it.

        Args:
            features: Carried beside the texture, and filled with it.
        """
        if features is not None:
            texture = torch.cat([texture, features], dim=1)
        known = [visibility] if self.config.visibility_input else []
        if self.config.prefilled:
            texture, shown = self._mirror_and_fill(texture, visibility)
            known.append(shown)
        if self.config.geometry:
            known.append(self._places_like(texture))
        if self.prior is not None:
            prior = F.adaptive_avg_pool2d(self.prior, (texture.shape[2], texture.shape[3]))
            known.append(prior.to(texture.dtype).expand(len(texture), -1, -1, -1))
        return [texture, *known]

    def _mirror_and_fill(
        self, texture: Float[Tensor, "B C T T"], visibility: Float[Tensor, "B 1 T T"]
    ) -> tuple[Float[Tensor, "B C T T"], Float[Tensor, "B 1 T T"]]:
        """The texture without holes, and 1 where it or its mirror image was seen."""
        texture, shown = mirror_texture(texture, visibility, self.side_twin, self.depth_twin)
        return fill_texture(texture, shown, self.position, self.surroundings), shown

    def feature_image(
        self,
        feature_map: Float[Tensor, "M D T T"],
        target_iuv: UInt8[Tensor, "B 3 H W"],
        detail: Float[Tensor, "M 3 t t"] | None = None,
    ) -> Float[Tensor, "B C H W"]:
        """Compute the feature image R_s->t that RenderNet reads.

        Its channels are the sampled map, where `config.told_iuv` the target IUV, for `dpt` the
        source's picture, and with `config.geometry` clearance and position of the place that is
        nearest, and the distance to the outline, in UNIT_PIXELS.
        """
        config = self.config
        looked_up, picture = feature_map.tensor_split([config.sampled_channels], dim=1)
        places = smooth_coordinates(target_iuv, self.charts)
        features = sample_features(looked_up, target_iuv, self.charts, places)
        scale = features.new_ones(len(features))
        if config.told_scale:
            scale = pixels_per_texel(target_iuv, self.charts)
        if detail is not None:
            finer = sample_features(detail, target_iuv, self.charts, places)
            share = detail_share(scale, detail.shape[-1])
            features[:, :COLOUR_CHANNELS] += finer * share[:, None, None, None]
        own, places = features, features[:, :0]
        if config.geometry:
            own, places = features[:, :-POSITION_CHANNELS], features[:, -POSITION_CHANNELS:]
        clearance = own[:, config.appearance_channels :][:, :1]
        if config.clearance:
            unit = scale * (UNIT_TEXELS / UNIT_PIXELS)
            clearance *= unit[:, None, None, None]  # in place, so that `own` has it as well
        image = [own]
        if config.told_iuv:
            image.append(normalise_iuv(target_iuv))
        if picture.shape[1]:
            picture = F.interpolate(picture, target_iuv.shape[2:], mode="nearest-exact")
            image.append(picture.expand(len(target_iuv), -1, -1, -1))
        if config.geometry:
            body = target_iuv[:, :1] > 0
            nearest = torch.cat([clearance, places], dim=1)
            image.append(spread_colours(nearest, body, MARGIN_LEVELS))
            image.append(signed_distance(body, OUTLINE_PIXELS) / UNIT_PIXELS)
        return torch.cat(image, dim=1) if len(image) > 1 else own

    def render(
        self,
        feature_map: Float[Tensor, "M D T T"],
        target_iuv: UInt8[Tensor, "B 3 H W"],
        detail: Float[Tensor, "M 3 t t"] | None = None,
    ) -> Float[Tensor, "B K H W"]:
        """Render frames of the source in the target poses, one feature map for all or one for each.

        Args:
            detail: Of the source, where it has any, see `detail`.
        Raises: ShapeError if H or W is not a multiple of 2**down_blocks.
        """
        multiple = 2**self.config.down_blocks
        if target_iuv.shape[-1] % multiple or target_iuv.shape[-2] % multiple:
            raise ShapeError(
                f"target IUV {list(target_iuv.shape)}: its sides must be multiples of {multiple}"
            )
        feature_image = self.feature_image(feature_map, target_iuv, detail)
        return self.blend(self.render_net(feature_image), feature_image)

    def blend(
        self, drawn: Float[Tensor, "B K H W"], feature_image: Float[Tensor, "B C H W"]
    ) -> Float[Tensor, "B K H W"]:
        """Make the frame of what RenderNet drew of a feature image.

        With `config.colour_shortcut` the drawing is added to the image's colours, with
        `config.colour_margin` also to those carried beyond the body's outline.
        """
        if not self.config.colour_shortcut:
            return drawn
        painted, alpha = drawn.tensor_split([COLOUR_CHANNELS], dim=1)
        colours = feature_image[:, :COLOUR_CHANNELS].clamp(-1, 1)
        if self.config.colour_margin:
            # where the distance to the outline is negative, or else anything was sampled at all
            body = (
                feature_image[:, -1:] < 0
                if self.config.geometry
                else (feature_image[:, : self.config.warped_channels] != 0).any(1, keepdim=True)
            )
            colours = spread_colours(colours, body, MARGIN_LEVELS)
        # twice: tanh lies in [-1, 1], the difference of two colours in [-2, 2]
        return torch.cat([(colours + 2 * painted).clamp(-1, 1), alpha], dim=1)

    def forward(
        self,
        photo: Float[Tensor, "B 3 H W"],
        photo_iuv: UInt8[Tensor, "B 3 H W"],
        target_iuv: UInt8[Tensor, "B 3 Ht Wt"],
    ) -> Float[Tensor, "B K Ht Wt"]:
        """Encode and render in one go, as in training."""
        return self.render(self.encode(photo, photo_iuv), target_iuv)


def normalise_picture(picture: UInt8[Tensor, "B 6 S S"]) -> Float[Tensor, "B 6 S S"]:
    """Bring RGB, I, U and V to [-1, 1] each, as network input."""
    photo, iuv = picture.tensor_split([COLOUR_CHANNELS], dim=1)
    return torch.cat([normalise_rgb(photo), normalise_iuv(iuv)], dim=1)


def normalise_rgb(photo: UInt8[Tensor, "B 3 S S"]) -> Float[Tensor, "B 3 S S"]:
    """Bring 0..255 to [-1, 1]."""
    return photo.float() / 127.5 - 1


def pixel_places(photo: Shaped[Tensor, "B _ H W"]) -> Float[Tensor, "B 2 H W"]:
    """Where each pixel's centre lies: x and y, -1 and 1 being the photo's edges."""
    height, width = photo.shape[2:]
    y, x = (
        (torch.arange(count, device=photo.device) + 0.5) * (2 / count) - 1
        for count in (height, width)
    )
    grid = torch.stack(torch.meshgrid(x, y, indexing="xy"))
    return grid.expand(len(photo), -1, -1, -1)
