"""Inference: runs a network of an ONNX file on one CPU thread, with identical bits each time.

onnxruntime is imported only here, when a network is first used. A process creates one session per file hash. With one
thread in and between operators, and no provider other than the CPU, the order of all sums is fixed: answers depend only
on the inputs, the weights, the library's version and the kind of processor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.errors import DriverError, DriverUnavailableError

if TYPE_CHECKING:
    from foresee_learned.weights import Weights

Answer = Mapping[str, NDArray[np.float32]]
"""The outputs by their names (`learned.outputs`), without the axis of the batch."""
_ERRORS_ONLY = 3
"""onnxruntime's level of logging for errors: its warnings, such as a missing graphics card, are irrelevant here, and a
driver's output is stored with its run."""
_networks: dict[str, Network] = {}


class Network:
    """A network that is loaded and ready to answer."""

    def __init__(self, content: bytes, name: str = "the network") -> None:
        """Load the bytes of an ONNX file; `name`: its name in errors.

        Raises:
            DriverUnavailableError: onnxruntime is installed, but does not work here. DriverError: it cannot read the
                bytes.
        """
        try:
            import onnxruntime
        except ImportError as err:
            raise DriverUnavailableError(f"onnxruntime cannot be imported: {err}") from err
        onnxruntime.set_default_logger_severity(_ERRORS_ONLY)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
        options.use_deterministic_compute = True
        options.log_severity_level = _ERRORS_ONLY
        try:
            self._session: Any = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        except Exception as err:  # onnxruntime has a class for each of its errors, without a common base
            why = " ".join(str(err).split())
            raise DriverError(
                f"{name} is not a network that onnxruntime can read ({why}); export it again, or reinstall the package "
                "that contains it"
            ) from None
        self._inputs = tuple(value.name for value in self._session.get_inputs())
        self._outputs = tuple(value.name for value in self._session.get_outputs())

    def answer(self, inputs: Mapping[str, NDArray[Any]]) -> Answer:
        """Return the outputs for one set of inputs."""
        answers = self.answers({name: inputs[name][None] for name in self._inputs})
        return {name: np.asarray(value[0], np.float32) for name, value in answers.items()}

    def answers(self, inputs: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        """Return the unchanged outputs for a batch; inputs and outputs have the batch's axis first."""
        outputs = self._session.run(None, {name: inputs[name] for name in self._inputs})
        return dict(zip(self._outputs, outputs, strict=True))


def network_of(weights: Weights) -> Network:
    """Return the network of a file; a process loads it once."""
    if weights.sha256 not in _networks:
        _networks[weights.sha256] = Network(weights.content(), str(weights.file))
    return _networks[weights.sha256]
