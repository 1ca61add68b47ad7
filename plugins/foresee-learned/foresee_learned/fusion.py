"""The driver `fusion`: a network's waypoints and target speed, and PID control (the role of TransFuser)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foresee_dsl.drivers.protocol import Observation, Reason
from foresee_learned import settings as cfg
from foresee_learned.decisions import Decision, Decisions
from foresee_learned.inputs import LearnedInputs
from foresee_learned.outputs import TARGET_SPEED_S, target_speed
from foresee_learned.session import Answer


class FusionState(Decisions):
    """The driver's memory since `reset`."""

    def decide(self, observation: Observation, answer: Answer) -> Decision:
        """Return the network's waypoints and target speed; if they need hard braking, brake as hard as the car can."""
        decision = _decision(answer)
        wanted_mps2 = (decision.target_mps - observation.ego.speed_mps) / decision.within_s
        return decision._replace(hardest=wanted_mps2 < -cfg.FUSION_HARD_MPS2)

    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:
        """Return the reasons for a decision; to compute them, query the network again without each of the objects and
        without the stop lines.
        """
        from foresee_learned.reasons import reasons_by_erasing

        return reasons_by_erasing(observation, inputs, decision, lambda seen: _decision(self.answer_to(seen)))


def _decision(answer: Answer) -> Decision:
    return Decision(answer["waypoints"].astype(np.float64), target_speed(answer["target_speed"]), TARGET_SPEED_S)
