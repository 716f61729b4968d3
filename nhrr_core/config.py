"""The networks' sizes and the paper's variants, as one frozen value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal, get_args

from nhrr_core.errors import ConfigError

Variant = Literal["full", "no-int", "ip", "warp", "warp-cond", "texture-features", "cbi", "dpt"]
VARIANTS: tuple[str, ...] = get_args(Variant)

COLOUR_CHANNELS = IUV_CHANNELS = 3
POSITION_CHANNELS = 3  # x, y, z on the body in T-pose
CLEARANCE_CHANNELS = 2  # the clearance, and whether any is known
COORDINATE_CHANNELS = 2  # x, y in a photo
PICTURE_CHANNELS = COLOUR_CHANNELS + IUV_CHANNELS

PHOTO_FEATURES = 8
"""Learned features of a photo's pixel, besides its colour."""

BLENDING_BLOCKS = 3
"""Residual blocks of the network that blends; from Neverova et al."""

CLEARANCE_SIZE = 128
"""Side of the clearance's texture, texels. Few will do: it is known along outlines only."""

UNIT_TEXELS = 4.0
"""A clearance of 1, in texels of CLEARANCE_SIZE: about the thickness of clothes."""

UNIT_PIXELS = 8.0
"""A clearance of 1 as RenderNet is told it, in pixels of its image."""

MARGIN_LEVELS = 5
"""Colours reach at least 16 pixels beyond the body, and 48 at most: loose clothes and hair."""

OUTLINE_PIXELS = 24
"""RenderNet is told distances to the outline up to this; clothes and hair seldom reach further."""

DETAIL_FACTOR = 4
"""How many times as fine as FeatureNet's texture the one is whose colours are carried past it."""

DETAIL_FULL, DETAIL_NONE = 3.0, 6.0
"""Texels of detail from pixel to pixel: all of it is drawn up to the first, none beyond the second.

Pixels farther apart would pick single texels out of it, others in each frame.
"""

FILL_FROM, FILL_TO = 32, 64
"""How many places along a side of the texture colours are spread from, and how many to."""

FILL_METRES = 0.02
"""Distances on the body below this count about alike."""

PLACE_METRES = 0.12
"""Texels of a place lie within that of its middle on the body, unless they are of another part."""


@dataclass(frozen=True, kw_only=True)
class RenderSizes:
    """What decides the shape of one `RenderNet`; its arguments."""

    inputs: int
    outputs: int
    width: int
    down_blocks: int
    residual_blocks: int
    shortcut: bool
    even: bool
    bilinear: bool


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """Everything that decides the shape of the networks, and nothing else.

    Attributes:
        variant: `full`; `no-int` (the same networks, trained without the texture loss); `ip` (the
            map is an inpainted RGB texture); `warp` (the partial texture itself); `warp-cond` (that
            and the target IUV); `texture-features` (`full`, but texels carry learned features of
            the photo besides colours); and two other methods: `cbi` (FeatureNet completes where in
            the photo each texel is seen, and the map has the colours from there) and `dpt` (the map
            is that of `ip`; RenderNet blends what is warped with what is drawn directly of photo
            and both IUV).
        feature_channels: d, channels of the feature map for `full` and `no-int`.
        feature_width: Channels of FeatureNet's first block; they double down to 8 times that.
        render_width: Channels of RenderNet's first convolution; they double at each down block.
        down_blocks, residual_blocks: How many RenderNet has.
        texture_size: Side of the UV texture, texels; a multiple of 16.
        image_size: Side of the image that RenderNet works on, px; a multiple of 2**down_blocks.
        alpha: RenderNet has a fourth output, the person's coverage.
        visibility_input: FeatureNet reads the visibility as a fourth channel: an unseen texel and a
            mid-grey one are otherwise the same input.
        prefilled: Hidden texels of what FeatureNet reads show their mirror image on the body
            (`mirror_texture`) or else the colours around them (`fill_texture`), and one more
            channel tells which of the two.
        colour_shortcut: Colours are carried past both networks: FeatureNet's first three channels
            are added to its input's, and RenderNet's drawing to the feature image's first three.
        colour_margin: Those three are carried beyond the body's outline (`spread_colours`), where
            clothes and hair are.
        clearance: RenderNet is told how far those stand off the body in the source
            (`unfold_clearance`).
        geometry: Both networks are told where on the body they are, which convolutions cannot see:
            FeatureNet the position of each texel; RenderNet, on the body and around it, position
            and clearance of the place that is nearest, and the distance to the outline
            (`signed_distance`). RenderNet's last convolution reads its input, too: what is as fine
            as a finger is lost in the layers before.
        prior: FeatureNet reads a texture that is learned with it and is the same for everybody:
            what people look like where a photo does not show them, in the face above all.
        even: RenderNet's up-sampling can draw no checkerboard (`UpConvolution`).
        bilinear: Its last one draws no lines at the outlines of what the layers before mean,
            either: it is bilinear.
    Source: the paper, Sec. 3 and 4.4; `texture-features` its Sec. 4.6, as future work; `cbi` from
        Grigorev et al., "Coordinate-based texture inpainting" (CVPR 2019); `dpt` from Neverova et
        al., "Dense pose transfer" (ECCV 2018); widths from Pix2PixHD's global generator (RenderNet)
        and U-Net (FeatureNet). Departs from it: the last ten. `visibility_input` is on; those
        after it are off, and but for `bilinear` on in `lite`, so that networks learn in hours what
        to change instead of learning in days to copy.
    """

    variant: Variant = "full"
    feature_channels: int = 16
    feature_width: int = 64
    render_width: int = 64
    down_blocks: int = 3
    residual_blocks: int = 6
    texture_size: int = 256
    image_size: int = 256
    alpha: bool = False
    visibility_input: bool = True
    prefilled: bool = False
    colour_shortcut: bool = False
    colour_margin: bool = False
    clearance: bool = False
    geometry: bool = False
    prior: bool = False
    even: bool = False
    bilinear: bool = False

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise ConfigError(f"variant is {self.variant!r}; supported are {', '.join(VARIANTS)}")
        for name in (field.name for field in fields(self) if field.type == "bool"):
            if not isinstance(getattr(self, name), bool):
                raise ConfigError(f"{name} is {getattr(self, name)!r}; it must be true or false")
        for name, low, high, multiple in (
            ("feature_channels", COLOUR_CHANNELS, 1024, 1),
            ("feature_width", 1, 1024, 1),
            ("render_width", 1, 1024, 1),
            ("down_blocks", 1, 6, 1),
            ("residual_blocks", 1, 64, 1),
            ("texture_size", 16, 4096, 16),
            ("image_size", 16, 4096, 0),
        ):
            value = getattr(self, name)
            multiple = multiple or 2**self.down_blocks  # which was checked by then
            if type(value) is not int or not low <= value <= high or value % multiple:
                rule = f"an integer from {low} to {high}"
                rule += f", a multiple of {multiple}" if multiple > 1 else ""
                raise ConfigError(f"{name} is {value!r}; it must be {rule}")

    @classmethod
    def preset(cls, name: str, **changes: Any) -> ModelConfig:
        """Take a preset, with changes; `PRESETS` lists them.

        RenderNet has 31.5 M parameters and takes 80.3 GFLOP at 256 x 256 as in the `paper`, 7.9 M
        and 23.9 in `lite`.
        Raises: ConfigError on an unknown name.
        """
        if name not in PRESETS:
            raise ConfigError(f"preset is {name!r}; supported are {', '.join(PRESETS)}")
        return replace(PRESETS[name], **changes)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> ModelConfig:
        """Invert `to_dict`. Raises: ConfigError on unknown fields or impossible values."""
        unknown = sorted(set(values) - {field.name for field in fields(cls)})
        if unknown:
            raise ConfigError(f"unknown configuration field {', '.join(unknown)}")
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Give plain values, ready for JSON or TOML."""
        return asdict(self)

    @property
    def has_feature_net(self) -> bool:
        """Whether a network completes the partial texture (all variants but the warps)."""
        return not self.variant.startswith("warp")

    @property
    def reads_photo(self) -> bool:
        """Whether a source is encoded from its photo as well, not from its texture alone."""
        return self.variant in ("texture-features", "cbi", "dpt")

    @property
    def learns_features(self) -> bool:
        """Whether the map holds more than colours: d channels, the first three of them colours."""
        return self.variant in ("full", "no-int", "texture-features")

    @property
    def inpaints_first(self) -> bool:
        """Whether FeatureNet is trained first, then fixed."""
        return self.variant in ("ip", "cbi", "dpt")

    @property
    def supervises_texture(self) -> bool:
        """Whether a loss holds the map's colours to what the photos show."""
        return self.has_feature_net and self.variant != "no-int"

    @property
    def told_iuv(self) -> bool:
        """Whether RenderNet reads the target IUV."""
        return self.variant in ("warp-cond", "cbi", "dpt")

    @property
    def has_detail(self) -> bool:
        """Whether a finer texture than FeatureNet's is of use: its colours are carried past it."""
        return self.colour_shortcut and self.has_feature_net and self.variant != "cbi"

    @property
    def told_scale(self) -> bool:
        """Whether it matters how large a body is in its image."""
        return self.clearance or self.has_detail

    @property
    def finest_texture(self) -> int:
        """Side of the largest partial texture that is of use, texels."""
        return self.texture_size * (DETAIL_FACTOR if self.has_detail else 1)

    @property
    def feature_inputs(self) -> int:
        """Channels that FeatureNet reads: what texels carry, and what is known of each."""
        carried = {"cbi": COORDINATE_CHANNELS, "texture-features": COLOUR_CHANNELS + PHOTO_FEATURES}
        known = int(self.visibility_input) + int(self.prefilled)
        learned = COLOUR_CHANNELS * self.prior + POSITION_CHANNELS * self.geometry
        return carried.get(self.variant, COLOUR_CHANNELS) + known + learned

    @property
    def feature_outputs(self) -> int:
        """Channels that FeatureNet writes: d, or 3 of a colour texture, or 2 of coordinates."""
        if self.learns_features:
            return self.feature_channels
        return COORDINATE_CHANNELS if self.variant == "cbi" else COLOUR_CHANNELS

    @property
    def appearance_channels(self) -> int:
        """Channels of the map that say what somebody looks like: they come first."""
        if self.learns_features:
            return self.feature_channels
        return COLOUR_CHANNELS + COORDINATE_CHANNELS * (self.variant == "cbi")

    @property
    def sampled_channels(self) -> int:
        """Channels of the feature map that target IUV looks up: appearance, and what is carried."""
        carried = CLEARANCE_CHANNELS * self.clearance + POSITION_CHANNELS * self.geometry
        return self.appearance_channels + carried

    @property
    def map_channels(self) -> int:
        """Channels of the feature map; the last ones of `dpt` are the source's picture."""
        return self.sampled_channels + PICTURE_CHANNELS * (self.variant == "dpt")

    @property
    def render_inputs(self) -> int:
        """Channels of the feature image, which RenderNet reads, see `feature_image`."""
        around = int(self.clearance) + 1 if self.geometry else 0  # positions are in the map
        return self.map_channels + IUV_CHANNELS * self.told_iuv + around

    @property
    def render_outputs(self) -> int:
        """Channels of a frame: RGB, and alpha where the configuration has it."""
        return COLOUR_CHANNELS + int(self.alpha)

    @property
    def render_sizes(self) -> RenderSizes:
        """Those of RenderNet; `dpt` has the two below in its place."""
        return RenderSizes(
            inputs=self.render_inputs,
            outputs=self.render_outputs,
            width=self.render_width,
            down_blocks=self.down_blocks,
            residual_blocks=self.residual_blocks,
            shortcut=self.geometry,
            even=self.even,
            bilinear=self.bilinear,
        )

    @property
    def direct_sizes(self) -> RenderSizes:
        """Those of the network of `dpt` that draws without warping: it reads no colours of R."""
        inputs = self.render_inputs - self.warped_channels
        return replace(self.render_sizes, inputs=inputs, outputs=COLOUR_CHANNELS)

    @property
    def blending_sizes(self) -> RenderSizes:
        """Those of the network of `dpt` that blends what is warped with what is drawn directly."""
        return replace(
            self.render_sizes,
            inputs=self.render_inputs - PICTURE_CHANNELS + COLOUR_CHANNELS,
            down_blocks=1,
            residual_blocks=BLENDING_BLOCKS,
        )

    @property
    def warped_channels(self) -> int:
        """Channels of the feature image that were sampled, but for positions: they come first."""
        return self.sampled_channels - POSITION_CHANNELS * self.geometry


PRESETS = {
    "paper": ModelConfig(),
    "lite": ModelConfig(
        feature_width=32,
        render_width=32,
        prefilled=True,
        colour_shortcut=True,
        colour_margin=True,
        clearance=True,
        geometry=True,
        prior=True,
        even=True,
    ),
}
