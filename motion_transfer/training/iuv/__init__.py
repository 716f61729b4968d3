"""Training of the network that paints IUV, on synthetic people as BlazePose sees them."""
