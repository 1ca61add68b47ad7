"""The bundled driver `pdm`: proposals of the Intelligent Driver Model, rolled out, scored, and the best one tracked.

In the manner of PDM-Closed (Dauner et al. 2023). It keeps nothing between steps but what follows from its mission, so
that a run taken up again in the middle goes on in the same way.
"""

from __future__ import annotations

from foresee_dsl.drivers.pdm_prediction import match_foes, predict
from foresee_dsl.drivers.pdm_proposals import leaders, offsets, passable, roll_out
from foresee_dsl.drivers.pdm_route import Route, build_route
from foresee_dsl.drivers.pdm_rules import near_junctions, wall
from foresee_dsl.drivers.pdm_scoring import choose, score
from foresee_dsl.drivers.pdm_situation import read_situation
from foresee_dsl.drivers.pdm_tracking import control, smoothed, steering
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.errors import DriverError


class PdmDriver:
    """IDM proposals along the route, scored against constant-velocity predictions (after PDM-Closed, 2023).

    Its answer is a function of the observation, the mission and the vehicle alone; `seed` changes nothing.
    """

    name = "pdm"
    version = "1"

    def __init__(self) -> None:
        self._route: Route | None = None
        self._vehicle: VehicleLimits | None = None

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and take up a new mission; the seed is not used."""
        self._route = build_route(mission, vehicle)
        self._vehicle = vehicle

    def step(self, observation: Observation) -> Control:
        """Answer one observation.

        Raises:
            DriverError: `reset` was not called.
        """
        if self._route is None or self._vehicle is None:
            raise DriverError("the driver pdm was stepped before reset")
        situation = read_situation(self._route, self._vehicle, observation)
        near = near_junctions(situation)
        matches = match_foes(situation, tuple(f for f in self._route.foes if f.passage in near))
        prediction = predict(situation, matches)
        can_pass = passable(situation)
        tried = offsets(situation, can_pass)
        lead = leaders(situation, prediction, tried, can_pass)
        rollout = roll_out(situation, tried, lead, wall(situation, matches, can_pass))
        best = choose(rollout, score(situation, rollout, prediction))
        angle = steering(self._route, situation.pose, float(rollout.offset[best]), self._vehicle)
        acceleration = smoothed(float(rollout.acceleration[best]), observation.ego)
        return control(angle, acceleration, observation.ego, self._vehicle)
