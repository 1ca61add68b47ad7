"""The driver `gym`: a trained policy drives, `--driver gym:policy.onnx`, `gym:policy.zip` or `gym:policy.py:FUNCTION`.

Policies that Stable-Baselines3 wrote, and functions of a module, are programs: a file that names one starts it only
with the user's consent, like any driver with a colon in its address.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from foresee_bridges.gym.observations import ObjectList, control_of
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.python_file import module_of_file
from foresee_dsl.errors import DriverError, DriverUnavailableError
from foresee_dsl.files import read_outside, short_hash

Policy = Callable[[NDArray[np.float32]], NDArray[np.floating]]
"""A policy: from the vector of `ObjectList`, [SIZE] float32, to an action, [2]."""
USAGE = "write gym:POLICY.onnx, gym:POLICY.zip (Stable-Baselines3), gym:FILE.py:FUNCTION or gym:MODULE:FUNCTION"


class PolicyDriver:
    """A policy trained on foresee_bridges.gym: --driver gym:policy.onnx, gym:policy.zip or gym:policy.py:FUNCTION."""

    name, version = "gym", "1"

    def __init__(self, policy: Policy, name: str, version: str) -> None:
        self.name, self.version = name, version
        self._policy = policy

    @classmethod
    def from_argument(cls, argument: str) -> Self:
        """Create the driver of the address `gym:ARGUMENT`.

        Raises:
            DriverError: there is no such file, module or function, it is not a policy for this observation, or a
                package that it needs is not installed.
        """
        file = Path(argument)
        readers = {".onnx": _onnx, ".zip": _stable_baselines}
        if file.suffix not in readers:
            policy, version = _function(argument)
            return cls(policy, f"gym:{argument}", version)
        try:
            content = read_outside(file)
        except OSError as err:
            raise DriverError(
                f"gym:{argument}: {err.strerror or err}; {USAGE}"
            ) from None  # an address that names nothing is an error of the command, not of the driver
        version = short_hash(content)
        return cls(readers[file.suffix](file), f"gym:{argument}", version)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Start at the beginning of the mission; a policy with `reset(seed)` forgets what it remembers."""
        self._objects = ObjectList(mission, vehicle)
        self._place_s: float | None = None
        forget = getattr(self._policy, "reset", None)
        if forget is not None:
            forget(seed)

    def step(self, observation: Observation) -> Control:
        """Return the control of the policy's action."""
        self._place_s = self._objects.place(observation, self._place_s)
        return control_of(self._policy(self._objects.vector(observation, self._place_s)))


def _onnx(file: Path) -> Policy:
    """Return the policy of a network with one input [1, SIZE] and, as its first output, an action [1, 2]."""
    try:
        import onnxruntime
    except ModuleNotFoundError:
        raise DriverUnavailableError(f"gym:{file} needs onnxruntime: pip install 'foresee-bridges[onnx]'") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # sums in one order: the same bits in every process
    options.use_deterministic_compute = True
    try:
        session: Any = onnxruntime.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
    except Exception as err:  # onnxruntime's exceptions have no common class
        raise DriverError(
            f"gym:{file} is not a network that onnxruntime can read: {' '.join(str(err).split())}"
        ) from None
    inputs, outputs = session.get_inputs(), session.get_outputs()
    width = inputs[0].shape[-1] if inputs and inputs[0].shape else None
    if len(inputs) != 1 or (isinstance(width, int) and width != ObjectList.SIZE):
        raise DriverError(
            f"gym:{file} has {len(inputs)} inputs, the first with {width} numbers; a policy for "
            f"foresee_bridges.gym has one input of [1, {ObjectList.SIZE}] numbers"
        )

    def policy(vector: NDArray[np.float32]) -> NDArray[np.floating]:
        return np.asarray(session.run([outputs[0].name], {inputs[0].name: vector[None]})[0])

    return policy


def _stable_baselines(file: Path) -> Policy:
    """Return the policy that Stable-Baselines3 saved, of any of its algorithms; its most probable action is taken."""
    try:
        from stable_baselines3.common.save_util import load_from_zip_file
    except ModuleNotFoundError:
        raise DriverUnavailableError(
            f"gym:{file} needs Stable-Baselines3: pip install 'foresee-bridges[sb3]'"
        ) from None
    try:
        data, parameters, _ = load_from_zip_file(str(file), device="cpu")
        policy = data["policy_class"](
            data["observation_space"], data["action_space"], lambda _: 0.0, **(data["policy_kwargs"] or {})
        )
        policy.load_state_dict(parameters["policy"])
    except Exception as err:  # the file may be anything
        raise DriverError(
            f"gym:{file} is not a model that Stable-Baselines3 saved: {type(err).__name__}: {err}"
        ) from None
    if policy.observation_space.shape != (ObjectList.SIZE,):
        raise DriverError(
            f"gym:{file} takes observations of shape {policy.observation_space.shape}; a policy for "
            f"foresee_bridges.gym takes {ObjectList.SIZE} numbers"
        )
    policy.set_training_mode(False)

    def predict(vector: NDArray[np.float32]) -> NDArray[np.floating]:
        return np.asarray(policy.predict(vector, deterministic=True)[0])

    return predict


def _function(argument: str) -> tuple[Policy, str]:
    """Return a function of an installed module or of a file that ends with `.py`, and its version."""
    place, _, name = argument.rpartition(":")
    if not place or not name.isidentifier():
        raise DriverError(f"gym:{argument} names no policy; {USAGE}")
    try:
        if place.endswith(".py"):
            module, version = module_of_file(Path(place), USAGE)
        else:
            module, version = importlib.import_module(place), "function"
        policy = getattr(module, name)
    except DriverError:
        raise
    except Exception as err:  # the module may raise anything
        raise DriverError(f"gym:{argument} cannot be loaded: {type(err).__name__}: {err}; {USAGE}") from err
    if not callable(policy):
        raise DriverError(f"gym:{argument} is not a function; {USAGE}")
    ready: Policy = policy() if isinstance(policy, type) else policy
    return ready, version
