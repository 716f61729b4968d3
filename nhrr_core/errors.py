"""What the model can refuse.

NhrrError (ValueError)
├── ConfigError   a configuration field that cannot be
├── IuvError      an IUV tensor that breaks the convention
└── ShapeError    tensors whose shapes do not fit each other, or the network
"""


class NhrrError(ValueError):
    """The base of everything that `nhrr_core` raises on purpose."""


class ConfigError(NhrrError):
    """A configuration field has an impossible value; the message lists the possible ones."""


class IuvError(NhrrError):
    """A tensor is not an IUV image: wrong type, or a part index above 24."""


class ShapeError(NhrrError):
    """Tensors' shapes do not fit each other, or the network; the message names them."""
