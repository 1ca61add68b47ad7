"""The driver `fusion_safe`: a network's waypoints, objects and stop line, and a safety controller (the role of
InterFuser)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from foresee_dsl.drivers.learned import settings as cfg
from foresee_dsl.drivers.learned.decisions import Decision, Decisions
from foresee_dsl.drivers.learned.free_way import Basis, free_way
from foresee_dsl.drivers.learned.inputs import LearnedInputs
from foresee_dsl.drivers.learned.objects import Objects
from foresee_dsl.drivers.learned.outputs import FUSION_SAFE_TIMES_S, SIGNALS, road_users
from foresee_dsl.drivers.learned.pilot import lengths
from foresee_dsl.drivers.learned.safe_speed import Speeds, fastest_safe_speed
from foresee_dsl.drivers.learned.session import Answer, Network
from foresee_dsl.drivers.protocol import FloatArray, JunctionPassage, Mission, Observation, Reason, VehicleLimits

_STOPS = SIGNALS.index("red"), SIGNALS.index("amber")


class FusionSafeState(Decisions):
    """What the driver knows since `reset`."""

    def __init__(self, network: Network, mission: Mission, vehicle: VehicleLimits) -> None:
        super().__init__(network, mission, vehicle)
        self._objects = Objects()
        self._basis: Basis | None = None

    def decide(self, observation: Observation, answer: Answer) -> Decision:
        """Drive as fast as the waypoints say, but no faster than is safe."""
        now_mps, waypoints = observation.ego.speed_mps, answer["waypoints"].astype(np.float64)
        planned_mps = planned_speed(waypoints)
        seen = list(road_users(answer["density"][None], cfg.LEAST_OCCUPIED))
        others = self._objects.update(seen, observation.ego, observation.time_s)
        way = free_way(waypoints, others, self.vehicle)
        stop = self._stop(answer)
        free_m = way.free_m if stop is None else np.minimum(way.free_m, stop[1])
        bounds = Speeds(cfg.STEP_S, cfg.MOST_MPS, self.vehicle.acceleration_mps2, cfg.BRAKING_MPS2)
        safe_mps = fastest_safe_speed(now_mps, free_m, bounds)
        self._basis = Basis(planned_mps, safe_mps, way, stop)
        if safe_mps is None:
            return Decision(waypoints, 0.0, cfg.STEP_S, hardest=True)
        if (safe_mps - now_mps) / cfg.STEP_S < (planned_mps - now_mps) / cfg.PLANNED_S:
            return Decision(waypoints, safe_mps, cfg.STEP_S)
        return Decision(waypoints, planned_mps, cfg.PLANNED_S)

    def reasons(self, observation: Observation, inputs: LearnedInputs, decision: Decision) -> Sequence[Reason]:  # noqa: ARG002
        """Name the waypoints, the object that binds, and the stop line."""
        from foresee_dsl.drivers.learned.reasons import reasons_of_basis

        return () if self._basis is None else reasons_of_basis(observation, self._basis, self.vehicle)

    def _stop(self, answer: Answer) -> tuple[JunctionPassage, float] | None:
        """Return the route's next stop line and how far the front is from it, m, where the network sees that it
        binds."""
        shows = float(answer["signal"][list(_STOPS)].sum())
        if min(float(answer["stop_line"][0]), shows) < cfg.STOP_PROBABILITY:
            return None
        front_s = self.maker.place_s + self.vehicle.length_m / 2
        for passage in self.mission.junctions:
            room_m = passage.stop_s - cfg.STOP_MARGIN_M - front_s
            if room_m > -cfg.STOP_PASSED_M:
                return passage, max(room_m, 0.0)
        return None


def planned_speed(waypoints: FloatArray) -> float:
    """Return the speed in waypoints of `FUSION_SAFE_TIMES_S`, m/s."""
    first, last = cfg.PLANNED_BETWEEN
    along = lengths(waypoints[first : last + 1])
    return along.item(-1) / (FUSION_SAFE_TIMES_S[last] - FUSION_SAFE_TIMES_S[first])
