"""The common part of the learned drivers: ten decisions a second, and steering along the last one in between."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import Control, FloatArray, Mission, Observation, Reason, VehicleLimits
from foresee_learned import settings as cfg
from foresee_learned.inputs import InputMaker, LearnedInputs
from foresee_learned.pilot import Pilot, laid_down
from foresee_learned.session import Answer, Network


class Decision(NamedTuple):
    """What the driver has decided to do until the next decision.

    Attributes:
        waypoints: [N, 2] m ahead and to the left of the ego at the time of the decision.
        target_mps: speed to reach within `within_s`.
        hardest: whether to brake as hard as the vehicle can, whatever `target_mps` is.
    """

    waypoints: FloatArray
    target_mps: float
    within_s: float
    hardest: bool = False


class _Last(NamedTuple):
    """The last decision, the input from which it was computed, and its waypoints in world coordinates."""

    observation: Observation
    inputs: LearnedInputs
    decision: Decision
    path: FloatArray


class Decisions(ABC):
    """The memory of a driver since `reset`: the others' past places, the last decision, and the pilot, which controls
    the vehicle.
    """

    def __init__(self, network: Network, mission: Mission, vehicle: VehicleLimits) -> None:
        self._network, self.mission, self.vehicle = network, mission, vehicle
        self.maker, self._pilot = InputMaker(mission, vehicle), Pilot(vehicle)
        self._measured_s: float | None = None
        self._last: _Last | None = None

    @abstractmethod
    def decide(self, observation: Observation, answer: Answer) -> Decision:
        """Return the decision for the network's answer."""

    @abstractmethod
    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:
        """Return the reasons for the last decision."""

    def step(self, observation: Observation) -> Control:
        """Decide if the object list is new (see `DECIDES_S`), and follow the last decision."""
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        if self._last is None or self._measured_s is None or measured_s - self._measured_s > cfg.DECIDES_S:
            self._measured_s = measured_s
            inputs = self.maker.make(observation)
            decision = self.decide(observation, self.answer_to(inputs))
            self._last = _Last(observation, inputs, decision, laid_down(decision.waypoints, observation.ego))
        decision = self._last.decision
        return self._pilot.follow(
            self._last.path, decision.target_mps, decision.within_s, observation.ego, hardest=decision.hardest
        )

    def answer_to(self, inputs: LearnedInputs) -> Answer:
        """Return the network's answer."""
        pictures: dict[str, NDArray[Any]] = {
            "birds_eye": inputs.birds_eye,
            "forward": inputs.forward,
            "vector": inputs.vector,
        }
        return self._network.answer(pictures)

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for its last decision."""
        return () if self._last is None else self.reasons(*self._last[:3])
