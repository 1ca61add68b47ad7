"""The bundled driver `pdm`: proposals of the Intelligent Driver Model, rolled out, scored, and the best one tracked.

In the manner of PDM-Closed (Dauner et al. 2023), on sensed objects. Between steps it keeps its tracker (the others'
places and speeds, smoothed) and the colours of signals for a second, both made of what it saw since `reset`. Its
decisions keep nothing: a run taken up again in the middle goes on in the same way as soon as the tracker has settled.
"""

from __future__ import annotations

from typing import NamedTuple

from foresee_dsl.drivers.pdm_prediction import match_foes, predict
from foresee_dsl.drivers.pdm_proposals import leaders, offsets, passable, roll_out
from foresee_dsl.drivers.pdm_route import Route, build_route
from foresee_dsl.drivers.pdm_rules import wall
from foresee_dsl.drivers.pdm_scoring import choose, score
from foresee_dsl.drivers.pdm_signals import SignalMemory
from foresee_dsl.drivers.pdm_situation import EgoPose, pose_on, read_situation
from foresee_dsl.drivers.pdm_tracking import control, smoothed, steering
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.drivers.tracking import Tracker
from foresee_dsl.errors import DriverError


class _Plan(NamedTuple):
    """What was decided on an object list of `measured_s`: the offset to steer for, m, and the acceleration."""

    measured_s: float
    offset_m: float
    acceleration_mps2: float


class PdmDriver:
    """IDM proposals along the route, scored against constant-velocity predictions (after PDM-Closed, 2023).

    Its answer is a function of the observations since `reset`, the mission and the vehicle; `seed` changes nothing.
    """

    name = "pdm"
    version = "2"

    def __init__(self) -> None:
        self._route: Route | None = None
        self._vehicle: VehicleLimits | None = None
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._plan: _Plan | None = None

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:  # noqa: ARG002  the protocol's
        """Forget everything and take up a new mission; the seed is not used."""
        self._route = build_route(mission, vehicle)
        self._vehicle = vehicle
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._plan = None

    def step(self, observation: Observation) -> Control:
        """Answer one observation: decide where its object list is new (the standard sensors make one every second step,
        and PDM plans at 10 Hz), and steer.

        Raises:
            DriverError: `reset` was not called.
        """
        if self._route is None or self._vehicle is None:
            raise DriverError("the driver pdm was stepped before reset")
        measured_s = observation.time_s if observation.measured_s is None else observation.measured_s
        ego = observation.ego
        pose = pose_on(self._route, ego, self._vehicle)
        if self._plan is None or measured_s != self._plan.measured_s:
            self._plan = self._decide(self._route, self._vehicle, observation, measured_s, pose)
        angle = steering(self._route, pose, self._plan.offset_m, self._vehicle)
        return control(angle, smoothed(self._plan.acceleration_mps2, ego), ego, self._vehicle)

    def _decide(
        self, route: Route, vehicle: VehicleLimits, observation: Observation, measured_s: float, pose: EgoPose
    ) -> _Plan:
        """Try the proposals and take the best."""
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        situation = read_situation(route, vehicle, observation, tracks, signals, pose)
        matches = match_foes(situation, tuple([f for k in situation.near_junctions for f in route.foes_of[k]]))
        prediction = predict(situation, matches)
        can_pass = passable(situation)
        tried = offsets(situation, can_pass)
        lead = leaders(situation, prediction, tried, can_pass)
        rollout = roll_out(situation, tried, lead, wall(situation, matches, can_pass))
        best = choose(rollout, score(situation, rollout, prediction))
        return _Plan(measured_s, float(rollout.offset[best]), float(rollout.acceleration[best]))
