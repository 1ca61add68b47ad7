"""The expert that advises during a run: `pdm` with ideal sensors, and its plan for the next 3 s.

It sees the others exactly, without latency and through walls, up to 80 m (`sensing.IDEAL`). It sees signals like the
standard sensors: a body that hides a signal from the pupil hides it from the expert too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from foresee_dsl.compile.bundle import ModelSpec
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import ego_record, signal_brakings, write_state
from foresee_dsl.drivers.protocol import Control, EgoState, Mission, Observation, SeenActor, VehicleLimits
from foresee_dsl.drivers.tracking import SignalMemory, Tracker
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.compiling import FLOATS, TABLE, compiled
from foresee_dsl.kernels.pdm import proposals
from foresee_dsl.kernels.pdm import records as r
from foresee_dsl.kernels.pdm.decision import choose, hold
from foresee_dsl.kernels.pdm.prediction import FRAMES, TIMES_S
from foresee_dsl.kernels.pdm.records import ROLLED
from foresee_dsl.kernels.pdm.route import place_ego
from foresee_dsl.kernels.tracks import TRACKS
from foresee_dsl.simulate.trace import HEADING, SPEED, X, Y
from training.samples import POINT_S, POINTS, SIGNAL_STATES

REACH_M = 80.0
"""Range of the ideal sensors, m."""
TARGET_S = 1.0
NO_STOP_M = 100.0
BINDS_M = 60.0
"""Distance up to which a stop line applies, m. Ours: comfortable braking from 50 km/h takes 50 m."""
_TIMES: FloatArray = (np.arange(POINTS) + 1) * POINT_S


@compiled(r.EGOS, TRACKS, r.ROUTE, TABLE, r.FOES, r.PATHS, r.JUNCTIONS, FLOATS, r.ROLLOUT)
def decide_in_full(
    egos: Records,
    tracks: Records,
    route: Records,
    coarse: FloatArray,
    foes: Records,
    paths: Records,
    junctions: Records,
    braking: FloatArray,
    chosen: Records,
) -> tuple[float, float, float]:
    """Choose the best proposal as `kernels.pdm.decision.decide` does.

    Returns:
        Its offset, m, its acceleration, and the position that the front bumper may not pass (infinite: no limit). The
            proposal is written into `chosen`, [1, T].
    """
    place_ego(egos, route, coarse)
    motions, best, wall_s = choose(egos, tracks, route, foes, paths, junctions, braking, np.empty((0, 0, 4)))
    proposals.roll(egos[0], motions, best, chosen[0])
    proposals.place_footprints(egos[0], route, chosen[0])
    return motions.heads_for[best], motions.acceleration[motions.of[best]], wall_s


class Advice(NamedTuple):
    """The expert's advice; see `samples.Labels`. `outside_m`: distance of the ego from its own lanes."""

    control: Control
    trajectory: FloatArray
    acceleration_mps2: float
    target_speed_mps: float
    stop_m: float
    signal: int
    outside_m: float

    @property
    def stop(self) -> bool:
        """Whether a stop line applies to the ego."""
        return self.stop_m < BINDS_M


class Expert:
    """`pdm` with ideal sensors on one mission. Call it at least ten times a second, in the order of time."""

    def __init__(self, mission: Mission, vehicle: VehicleLimits, others: tuple[ModelSpec, ...]) -> None:
        """Begin a run; `others`: the models of the other actors in their order."""
        self._mission = mission
        self._route, self._egos = build_route(mission, vehicle), ego_record(vehicle)
        self._numbers, self._strongest = self._egos.view(np.float64), float(self._egos["strongest"][0])
        self._tracker, self._signals = Tracker(), SignalMemory()
        self._others, self._chosen = others, np.empty((1, FRAMES), ROLLED)
        self._offset = self._acceleration = 0.0

    def advise(self, observation: Observation, pose: tuple[float, float, float], states: FloatArray) -> Advice:
        """Make a new decision.

        Args:
            observation: of the standard sensors.
            pose: true place of the ego.
            states: [N, 7] true states of the others, as in a trace.
        """
        self._place(observation.ego, pose)
        route = self._route
        now = Observation(observation.time_s, observation.ego, self._seen(pose, states), observation.signals)
        tracks = self._tracker.update(now)
        braking = signal_brakings(route, self._strongest, self._signals.update(now))
        road = route.points, route.coarse, route.foes, route.paths, route.junctions
        self._offset, self._acceleration, wall_s = decide_in_full(
            self._egos, tracks.table, *road, braking, self._chosen
        )
        control = Control(*hold(self._egos, route.points, route.coarse, self._offset, self._acceleration))
        ego, plan = self._egos[0], self._chosen[0]
        c, s = math.cos(pose[2]), math.sin(pose[2])
        dx, dy = plan["x"] - pose[0], plan["y"] - pose[1]
        ahead, left = c * dx + s * dy, c * dy - s * dx
        # The route is smoothed: the error of the first frame (centimetres) is subtracted from all frames.
        trajectory = np.stack([np.interp(_TIMES, TIMES_S, axis - axis[0]) for axis in (ahead, left)], axis=1)
        return Advice(
            control,
            trajectory,
            float(self._acceleration),
            float(np.interp(TARGET_S, TIMES_S, plan["speed"])),
            min(max(float(wall_s) - float(ego["front_s"]), 0.0), NO_STOP_M),
            self._next_signal(observation, float(ego["s"])),
            self._outside_m(float(ego["s"]), float(ego["d"]), float(ego["heading_error"])),
        )

    def hold(self, observation: Observation, pose: tuple[float, float, float]) -> Control:
        """Return the control that holds the last decision."""
        self._place(observation.ego, pose)
        route = self._route
        return Control(*hold(self._egos, route.points, route.coarse, self._offset, self._acceleration))

    def _place(self, ego: EgoState, pose: tuple[float, float, float]) -> None:
        write_state(
            self._numbers,
            EgoState(*pose, ego.speed_mps, ego.acceleration_mps2, ego.yaw_rate_rad_s, ego.steer_rad),
        )

    def _outside_m(self, s: float, d: float, turned: float) -> float:
        """Return the distance of the rear axle or the front bumper from the ego's own lanes, m; 0 inside."""
        road, half = self._route.points[self._route.index(s)], float(self._egos["width"][0]) / 2
        front = d + float(self._egos["front"][0]) * math.sin(turned)
        return max(max(d, front) + half - float(road["left"]), half - min(d, front) - float(road["right"]), 0.0)

    def _seen(self, pose: tuple[float, float, float], states: FloatArray) -> tuple[SeenActor, ...]:
        away = np.hypot(states[:, X] - pose[0], states[:, Y] - pose[1])
        near = np.flatnonzero(away <= REACH_M)  # NaN is not
        seen = []
        for k in near[np.argsort(away[near], kind="stable")].tolist():
            x, y, heading, speed = states[k, [X, Y, HEADING, SPEED]].tolist()
            model = self._others[k]
            seen.append(SeenActor(k, model.kind, x, y, heading, speed, model.length_m, model.width_m))
        return tuple(seen)

    def _next_signal(self, observation: Observation, s: float) -> int:
        for junction in self._mission.junctions:
            if junction.signal is not None and junction.stop_s > s and junction.signal in observation.signals:
                colour = observation.signals[junction.signal]
                return SIGNAL_STATES.index(colour) if colour in SIGNAL_STATES else len(SIGNAL_STATES) - 1
        return len(SIGNAL_STATES) - 1
