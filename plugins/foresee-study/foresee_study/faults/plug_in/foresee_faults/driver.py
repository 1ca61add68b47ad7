"""The driver `fault`: a healthy driver with one seeded fault, which its address names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Self

from foresee_dsl.drivers.bundled import BundledDriver
from foresee_dsl.drivers.idm import IdmDriver
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion, Truth
from foresee_dsl.drivers.pdm import PdmDriver
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, VehicleLimits
from foresee_dsl.errors import DriverError
from foresee_faults.catalogue import KINDS
from foresee_faults.fault import Actors, DriverState, Fault, Spoilt

HEALTHY = {"pdm": PdmDriver, "idm": IdmDriver}
"""The drivers into which faults are seeded."""
SHAPE = "write DRIVER/KIND@STRENGTH, such as pdm/late_objects@0.4"


class FaultyDriver:
    """A bundled driver with one seeded fault: `fault:pdm/late_objects@0.4`."""

    version = "1"

    def __init__(self, base: str, kind: str, strength: float) -> None:
        self.name = f"{base} with {kind}@{strength:g}"
        self.fault: Fault = KINDS[kind](strength)
        self._healthy: BundledDriver[Any] = HEALTHY[base]()
        self._actors: tuple[float | None, Actors] = (None, ())
        self.parts = self._healthy.parts
        self._ideal: frozenset[DriverPart] = frozenset()

    @classmethod
    def from_argument(cls, text: str) -> Self:
        """Create the driver from an argument such as `pdm/late_objects@0.4`.

        Raises:
            DriverError: there is no such driver or kind, or the strength is not a number from 0 to 1.
        """
        base, slash, rest = text.partition("/")
        kind, at, strength = rest.partition("@")
        if not (slash and at):
            raise DriverError(f"{text!r} is not the argument of a faulty driver: {SHAPE}")
        if base not in HEALTHY:
            raise DriverError(f"faults cannot be seeded into {base!r}; write one of {', '.join(HEALTHY)}")
        if kind not in KINDS:
            raise DriverError(f"there is no kind of fault {kind!r}; write one of {', '.join(KINDS)}")
        try:
            value = float(strength)
        except ValueError:
            value = math.nan
        if not 0 <= value <= 1:
            raise DriverError(f"{strength!r} is not a strength from 0 to 1: {SHAPE}")
        return cls(base, kind, value)

    @property
    def _replaced(self) -> bool:
        """Return whether an ideal part replaces the part with the fault, so that the fault has no effect."""
        return self.fault.part in self._ideal

    @property
    def _after_tracking(self) -> bool:
        """Return whether ideal tracking comes before the part with the fault; the fault then changes the tracks."""
        before = (DriverPart.PERCEPTION, DriverPart.TRACKING)
        return DriverPart.TRACKING in self._ideal and self.fault.part not in before

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Replace these parts of the healthy driver by ideal ones, with the fault in them."""
        self._ideal = ideal
        self._healthy.idealise(ideal, truth)

    def planned(self) -> PlannedMotion | None:
        """Return the healthy driver's plan; None for a fault of the planning that shows only in the answer."""
        spoilt = self.fault.part is None and self.fault.overrides("change_control")
        return None if spoilt else self._healthy.planned()

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        """Start a new mission, with the mission and the vehicle as the fault changes them."""
        self.fault.begin(mission, vehicle, seed)
        self._actors = (None, ())
        if self._replaced:
            self._healthy.reset(mission, vehicle, seed)
            return
        self._healthy.reset(self.fault.change_mission(mission), self.fault.change_vehicle(vehicle), seed)
        self.fault.settle(self._healthy.state)
        if self._after_tracking and self.fault.overrides("change_actors"):
            state: DriverState = self._healthy.state
            state.tracker = Spoilt(state.tracker, self.fault.change_actors)

    def step(self, observation: Observation) -> Control:
        """Let the healthy driver answer the changed observation, and return its answer as the fault changes it."""
        control = self._healthy.step(self._changed(observation))
        changes = self.fault.overrides("change_control") and not self._replaced
        return self.fault.change_control(control, observation) if changes else control

    def explain(self) -> Sequence[Reason]:
        """Return the healthy driver's reasons, which refer to the changed observation."""
        return self._healthy.explain()

    def _changed(self, observation: Observation) -> Observation:
        """Return the changed observation; parts that the fault does not change are measured only when they are read."""
        fault = self.fault
        methods = ("change_actors", "change_signals", "change_ego")
        if self._replaced or not any(fault.overrides(method) for method in methods):
            return observation
        actors = fault.overrides("change_actors") and not self._after_tracking
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        if actors and measured_s != self._actors[0]:
            self._actors = measured_s, fault.change_actors(observation.actors, observation)
        return Observation(
            time_s=observation.time_s,
            ego=fault.change_ego(observation.ego, observation),
            actors=self._actors[1] if actors else observation.actors,
            signals=fault.change_signals(observation.signals, observation),
            measured_s=observation.measured_s,
        )
