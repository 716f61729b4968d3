"""Reading and writing images, IUV streams and video; nothing else in the package touches files."""
