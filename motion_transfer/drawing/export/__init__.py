"""A checkpoint as files that other programs run: ONNX, OpenVINO's, TensorRT's."""
