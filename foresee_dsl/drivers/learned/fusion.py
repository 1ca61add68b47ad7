"""The driver `fusion`: a network's waypoints and target speed, and PID control (the role of TransFuser)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foresee_dsl.drivers.learned.decisions import Decision, Decisions
from foresee_dsl.drivers.learned.inputs import LearnedInputs
from foresee_dsl.drivers.learned.outputs import TARGET_SPEED_S, target_speed
from foresee_dsl.drivers.learned.session import Answer
from foresee_dsl.drivers.protocol import Observation, Reason


class FusionState(Decisions):
    """What the driver knows since `reset`."""

    def decide(self, observation: Observation, answer: Answer) -> Decision:  # noqa: ARG002  the pictures show all
        """Take both as the network gives them."""
        return _decision(answer)

    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:
        """Ask the network again without each of the objects and without the stop lines."""
        from foresee_dsl.drivers.learned.reasons import reasons_by_erasing

        return reasons_by_erasing(observation, inputs, decision, lambda seen: _decision(self.answer_to(seen)))


def _decision(answer: Answer) -> Decision:
    return Decision(answer["waypoints"].astype(np.float64), target_speed(answer["target_speed"]), TARGET_SPEED_S)
