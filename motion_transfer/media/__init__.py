"""Reading and writing pictures, IUV and video; nothing else in the package touches files.

`iuv` and `pictures` read, `output` writes; each has a table of its formats in `formats`.
"""
