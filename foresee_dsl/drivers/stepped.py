"""The base class of drivers whose state is created anew by each `reset` and answers the observations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

from foresee_dsl.drivers.protocol import Control, Mission, Observation, Reason, VehicleLimits
from foresee_dsl.errors import DriverError


class SteppedState(Protocol):
    """The state of a driver from one `reset` to the next."""

    def step(self, observation: Observation) -> Control:
        """Answer one observation."""
        ...

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer, the strongest first."""
        ...


S = TypeVar("S", bound=SteppedState)


class SteppedDriver(ABC, Generic[S]):
    """A driver whose answer depends only on the observations since `reset`, the mission and the vehicle."""

    name: str
    version: str

    _state: S | None = None

    @abstractmethod
    def begin(self, mission: Mission, vehicle: VehicleLimits) -> S:
        """Return the state at the beginning of a mission."""

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and start a new mission; the seed is not used."""
        self._state = self.begin(mission, vehicle)

    def step(self, observation: Observation) -> Control:
        """Answer one observation.

        Raises:
            DriverError: `reset` was not called.
        """
        state = self._state
        return (self.state if state is None else state).step(observation)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer, the strongest first; they are computed in this call."""
        return self.state.explain()

    @property
    def state(self) -> S:
        """The driver's state since `reset`."""
        if self._state is None:
            raise DriverError(f"the driver {self.name} was stepped before reset")
        return self._state
