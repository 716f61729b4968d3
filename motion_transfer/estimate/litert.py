"""Running a TensorFlow Lite model on the CPU."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from motion_transfer.errors import InputError
from motion_transfer.estimate.extra import require_estimate


class LiteModel:
    """A model with one input; keeps its own buffers, so that one object serves one thread.

    Raises: InputError if the file is no such model, or the package that runs it is missing.
    """

    def __init__(self, path: Path, threads: int) -> None:
        require_estimate()
        from ai_edge_litert.interpreter import Interpreter

        try:
            with _quiet():
                self._interpreter = Interpreter(model_path=str(path), num_threads=threads)
                self._interpreter.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            raise InputError(
                f"{path} is not a model that can be run ({error}); `mt models fetch --force`"
                " fetches it anew"
            ) from error
        self._input = self._interpreter.get_input_details()[0]["index"]
        self._outputs = self._interpreter.get_output_details()

    def run(self, image: Float32[np.ndarray, "H W 3"]) -> list[np.ndarray]:
        """All outputs, without their first axis (the batch of one), in the model's order."""
        self._interpreter.set_tensor(self._input, image[None])
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(output["index"])[0] for output in self._outputs]


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the run-time's remark about its kernels, which native code writes, off stderr."""
    stderr, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)
