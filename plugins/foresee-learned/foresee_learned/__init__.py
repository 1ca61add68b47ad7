"""The learned drivers `fusion` and `fusion_safe`: networks whose inputs are pictures (docs/background/learned.md).

All other drivers work without the package onnxruntime (the extra `learned`) and without weights: onnxruntime and the
networks are imported only at a learned driver's first `reset`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING

from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, VehicleLimits
from foresee_dsl.errors import DriverError, DriverUnavailableError

if TYPE_CHECKING:
    from foresee_learned.decisions import Decisions
    from foresee_learned.weights import Weights

HANDOVER_S = 1.0
"""Time for which a driver watches at a clip's beginning before it drives, s: its pictures show where the others were up
to 1.0 s ago (`inputs.PAST_S`)."""


class _LearnedDriver:
    """A driver with a network and a controller that turns the network's answers into pedals.

    `seed` has no effect; the same observations after the same `reset` give the same answers.
    """

    name: str
    version = "1"
    handover_s = HANDOVER_S
    _state: Decisions | None = None

    def __init__(self) -> None:
        self._weights = self._packaged_weights()
        self.weights_hash = self._weights.sha256
        self.version = f"{type(self).version} (weights {self._weights.short})"

    @classmethod
    def check(cls) -> None:
        """Raise a `DriverError` if the driver cannot drive: if onnxruntime or the weights are missing, or the weights
        are damaged.
        """
        weights = cls._packaged_weights()
        if not weights.named:  # opening the file is the only way to find out whether it is complete
            from foresee_learned.session import network_of

            network_of(weights)

    @classmethod
    def _packaged_weights(cls) -> Weights:
        from foresee_learned.weights import find_weights

        if find_spec("onnxruntime") is None:
            raise DriverUnavailableError(
                f"the driver {cls.name} needs the package onnxruntime, which is not installed: "
                "pip install 'foresee-dsl[learned]'"
            )
        return find_weights(cls.name)

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and start a new mission; the seed is not used."""
        self._state = self._begin(mission, vehicle)

    def step(self, observation: Observation) -> Control:
        """Answer one observation.

        Raises:
            DriverError: `reset` was not called.
        """
        return self.state.step(observation)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last decision, the strongest first; they are computed in this call."""
        return self.state.explain()

    @property
    def state(self) -> Decisions:
        """Return the driver's memory since `reset`."""
        if self._state is None:
            raise DriverError(f"the driver {self.name} was stepped before reset")
        return self._state

    def _begin(self, mission: Mission, vehicle: VehicleLimits) -> Decisions:
        raise NotImplementedError


class FusionDriver(_LearnedDriver):
    """Learned: a network's waypoints and target speed from two pictures, PID control (the role of TransFuser)."""

    name = "fusion"

    def _begin(self, mission: Mission, vehicle: VehicleLimits) -> Decisions:
        from foresee_learned.fusion import FusionState
        from foresee_learned.session import network_of

        return FusionState(network_of(self._weights), mission, vehicle)


class FusionSafeDriver(_LearnedDriver):
    """Learned: a network's waypoints, objects and stop line, and a safety controller (the role of InterFuser)."""

    name = "fusion_safe"

    def _begin(self, mission: Mission, vehicle: VehicleLimits) -> Decisions:
        from foresee_learned.fusion_safe import FusionSafeState
        from foresee_learned.session import network_of

        return FusionSafeState(network_of(self._weights), mission, vehicle)
