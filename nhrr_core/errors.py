"""What the model can refuse.

NhrrError (ValueError)
├── ConfigError   a configuration field that cannot be
├── IuvError      an IUV tensor that breaks the convention
└── ShapeError    tensors whose shapes do not fit each other, or the network
"""


class NhrrError(ValueError):
    """Base of everything `nhrr_core` raises on purpose."""


class ConfigError(NhrrError):
    """A configuration field has an impossible value; the message lists the possible ones."""


class IuvError(NhrrError):
    """A tensor is not an IUV image: wrong type, or a part index above 24."""


class ShapeError(NhrrError):
    """Tensor shapes do not fit; the message names the shapes."""
