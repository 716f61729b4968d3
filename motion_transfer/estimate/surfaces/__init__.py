"""Surfaces of the body drawn where finer networks than BlazePose's see it: hands and heads."""
