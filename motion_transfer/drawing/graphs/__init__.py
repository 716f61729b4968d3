"""The model as ONNX graphs, which engines run without torch.

`nhrr_core` is the specification; what is built here, from the same weights, is held to it.
"""
