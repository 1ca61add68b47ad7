"""The base class of the drivers `pdm`, `idm` and `frenetix`, whose whole state is created anew by `reset`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

from foresee_dsl.drivers.ideal import Memory, memory_of
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion, Truth
from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, VehicleLimits
from foresee_dsl.errors import DriverError


class Steps(Protocol):
    """The state of a bundled driver from one `reset` to the next, which answers the observations."""

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None: ...

    def step(self, observation: Observation) -> Control:
        """Answer one observation."""
        ...

    def planned(self) -> PlannedMotion | None:
        """Return the acceleration and wheel angle that the last step planned; None before the first step."""
        ...

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer, the strongest first."""
        ...


S = TypeVar("S", bound=Steps)


class BundledDriver(Generic[S]):
    """A driver whose answer depends only on the observations since `reset`, the mission and the vehicle."""

    name: str
    version: str
    state_type: type[S]
    """Type of the state; each `reset` creates one from the mission, the vehicle and a memory."""
    parts: tuple[DriverPart, ...]
    """The parts of the driver that can be replaced by ideal ones."""

    _state: S | None = None
    _ideal: tuple[frozenset[DriverPart], Truth | None] = (frozenset(), None)

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Replace these parts by ideal ones from the next `reset` on."""
        self._ideal = ideal, truth

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and start a new mission; the seed is not used."""
        self._state = self.state_type(mission, vehicle, memory_of(*self._ideal))

    def step(self, observation: Observation) -> Control:
        """Answer one observation.

        Raises:
            DriverError: `reset` was not called.
        """
        state = self._state
        return (self.state if state is None else state).step(observation)

    def planned(self) -> PlannedMotion | None:
        """Return what the last step planned, before it is converted to pedals and wheel."""
        return self.state.planned()

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer, the strongest first; they are computed in this call."""
        return self.state.explain()

    @property
    def state(self) -> S:
        """The driver's state since `reset`."""
        if self._state is None:
            raise DriverError(f"the driver {self.name} was stepped before reset")
        return self._state
