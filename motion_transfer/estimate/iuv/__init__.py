"""The network that paints a person's IUV from landmarks and mask."""
