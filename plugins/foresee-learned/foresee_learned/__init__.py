"""The learned drivers `fusion` and `fusion_safe`: networks whose inputs are pictures (docs/background/learned.md).

All other drivers work without the package onnxruntime (the extra `learned`) and without weights: onnxruntime and the
networks are imported only at a learned driver's first `reset`.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from foresee_dsl.drivers.protocol import Mission, VehicleLimits
from foresee_dsl.drivers.stepped import SteppedDriver
from foresee_dsl.errors import DriverUnavailableError

if TYPE_CHECKING:
    from foresee_learned.decisions import Decisions
    from foresee_learned.weights import Weights

HANDOVER_S = 1.0
"""Time for which a driver watches at a clip's beginning before it drives, s: its pictures show where the others were up
to 1.0 s ago (`inputs.PAST_S`)."""


class _LearnedDriver(SteppedDriver["Decisions"]):
    """A driver with a network and a controller that turns the network's answers into pedals.

    `seed` has no effect; the same observations after the same `reset` give the same answers.
    """

    version = "1"
    handover_s = HANDOVER_S

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


class FusionDriver(_LearnedDriver):
    """Learned: a network's waypoints and target speed from two pictures, PID control (the role of TransFuser)."""

    name = "fusion"

    def begin(self, mission: Mission, vehicle: VehicleLimits) -> Decisions:
        """Return the state at the beginning of a mission."""
        from foresee_learned.fusion import FusionState
        from foresee_learned.session import network_of

        return FusionState(network_of(self._weights), mission, vehicle)


class FusionSafeDriver(_LearnedDriver):
    """Learned: a network's waypoints, objects and stop line, and a safety controller (the role of InterFuser)."""

    name = "fusion_safe"

    def begin(self, mission: Mission, vehicle: VehicleLimits) -> Decisions:
        """Return the state at the beginning of a mission."""
        from foresee_learned.fusion_safe import FusionSafeState
        from foresee_learned.session import network_of

        return FusionSafeState(network_of(self._weights), mission, vehicle)
