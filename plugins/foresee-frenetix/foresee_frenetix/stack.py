"""The loop of the stack: perceive, predict, decide, plan, track; and its reaction if no trajectory is feasible."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from foresee_dsl.drivers.bundled import NO_FUTURES, Memory
from foresee_dsl.drivers.parts import PlannedMotion
from foresee_dsl.drivers.pdm.route import build_route
from foresee_dsl.drivers.pdm.situation import RoadSituation, ego_record, read_situation, write_state
from foresee_dsl.drivers.protocol import (
    Control,
    EgoState,
    Mission,
    Observation,
    Reason,
    SignalColour,
    VehicleLimits,
)
from foresee_dsl.drivers.tracking import Tracks
from foresee_dsl.kernels.arrays import FloatArray, Records
from foresee_dsl.kernels.constants import GRAVITY_MPS2
from foresee_dsl.kernels.pdm import settings as pdm_settings
from foresee_dsl.kernels.pdm.decision import pedals
from foresee_dsl.kernels.pdm.prediction import TIMES_S, know, match, predict
from foresee_dsl.kernels.pdm.proposals import decay_length
from foresee_dsl.kernels.pdm.route import near_foes
from foresee_frenetix import settings as cfg
from foresee_frenetix.behaviour import FOLLOWS_S, Behaviour, Patience, State, decide
from foresee_frenetix.choice import at_frames, choose, is_free, joined
from foresee_frenetix.plan import Frenet, Plan, Pose, angle_between, braking_plan
from foresee_frenetix.planner import Planner, ends

STOPS_MPS2 = 0.3
"""Braking that is added to what a stop or a leader requires, m/s^2. Ours: with it, a standing ego that must stop
differs from one on a free road."""


@dataclass
class Count:
    """The number of plans, and the number of those for which the library had no feasible trajectory: the last plan was
    kept, or the car made an emergency stop.
    """

    plans: int = 0
    kept: int = 0
    emergencies: int = 0


class Stack:
    """The driver's state from one `reset` to the next.

    Attributes:
        state: state of the behaviour layer. plan: the driven trajectory, None before the first step.
        count: numbers of plans, and of plans without a feasible trajectory.
    """

    def __init__(self, mission: Mission, vehicle: VehicleLimits, memory: Memory) -> None:
        self._vehicle = vehicle
        self._route = build_route(mission, vehicle)
        self._planner = Planner(self._route, vehicle)
        self._tracker, self._signals, self._memory = memory.tracker, memory.signals, memory
        self._futures = NO_FUTURES
        self._controller = TrackingController(vehicle, mission.step_s)
        self._patience, self._steps = Patience(), 0
        self.state, self.count = State.CRUISE, Count()
        self.plan: Plan | None = None
        self._last: tuple[RoadSituation, Tracks] | None = None
        self._waited = 0

    def step(self, observation: Observation) -> Control:
        """Replan when it is due, and track the plan."""
        tracks, signals = self._tracker.update(observation), self._signals.update(observation)
        if self.plan is None or self._steps % cfg.REPLAN_STEPS == 0:
            situation = read_situation(self._route, self._vehicle, observation, tracks, signals)
            self._last, self._waited = (situation, tracks), self._patience.times
            self._futures = self._memory.futures(tracks, TIMES_S)
            self.plan = self._replan(situation)
        self._steps += 1
        return self._controller.follow(self.plan, observation.ego, observation.time_s)

    def planned(self) -> PlannedMotion | None:
        """Return the acceleration and the wheel angle with which the controller follows the plan."""
        return self._controller.wanted

    def explain(self) -> Sequence[Reason]:
        """Return the reasons for the last answer, the strongest first.

        They are the behaviour's state, an emergency stop if there is one, and the signals and objects that by
        themselves make the behaviour layer stop or follow; see `drivers.pdm.reasons`.
        """
        from foresee_dsl.drivers.pdm.reasons import (  # imported here, because driving does not need it
            FREE_ROAD,
            Wish,
            reasons_alone,
            situation_of,
        )

        if self._last is None:
            return ()
        now, tracks = self._last

        def decided(others: Tracks, colours: Mapping[str, SignalColour]) -> Wish:
            return Wish(
                _required_acceleration(
                    self._behaviour(situation_of(now, others, colours), Patience(self._waited))[0], now
                )
            )

        plan = self.plan
        emergency = plan is not None and plan.emergency
        doing = (
            "brakes along its path, because every trajectory would collide"
            if emergency
            else f"state {self.state.value}"
        )
        planned = plan.pose(now.observation.time_s).acceleration if plan is not None else None
        others = (r for r in reasons_alone(now, tracks, decided) if r.rule != FREE_ROAD)
        return Reason("behaviour", doing, acceleration_mps2=planned), *others

    def _replan(self, situation: RoadSituation) -> Plan:
        behaviour, prediction = self._behaviour(situation, self._patience, self._futures)
        self.state = behaviour.state
        self.count.plans += 1
        frames = at_frames(situation, prediction)
        plan = self._sampled(situation, behaviour, frames)
        return self._without(situation, behaviour, frames) if plan is None else plan

    @staticmethod
    def _behaviour(
        situation: RoadSituation, patience: Patience, futures: FloatArray = NO_FUTURES
    ) -> tuple[Behaviour, Records]:
        """Return the task from the behaviour layer, and the prediction on which it is based.

        `futures`: the others' true motion for an ideal prediction.
        """
        route = situation.route
        foes = near_foes(situation.egos, route.foes, route.junctions)
        matches = match(situation.actors, foes, route.paths)
        prediction = predict(situation.egos, situation.actors, foes, route.paths, matches, route.points)
        if len(futures):
            know(situation.egos, situation.actors, futures, route.points, prediction)
        return decide(situation, foes, matches, prediction, patience), prediction

    def _sampled(self, situation: RoadSituation, behaviour: Behaviour, prediction: Records) -> Plan | None:
        """Return the best plan among the library's candidates and, at low speed, the plans to a stop; None if no plan
        is free of collisions.
        """
        now = situation.observation.time_s
        start, heading = self._start(situation)
        if start is None:
            return None
        candidates = self._planner.sample(start, heading, ends(situation, behaviour, start, self.plan))
        brakings = cfg.CREEP_BRAKING_MPS2 if start.s_dot < cfg.CREEP_MPS else ()
        rests = [braking_plan(self._route, now, start, braking, self.plan, emergency=False) for braking in brakings]
        best = choose(situation, behaviour, prediction, joined(candidates, rests), self.plan)
        if best is None:
            return None
        count = len(candidates.samples)
        return self._planner.plan(candidates, best, now) if best < count else rests[best - count]

    def _start(self, situation: RoadSituation) -> tuple[Frenet | None, float]:
        """Return the initial state and heading of the next plan: those of the last plan, or of the car."""
        state, now = situation.observation.ego, situation.observation.time_s
        if self.plan is not None and not self.plan.emergency:
            wanted = self.plan.pose(now)
            along, side, turned = deviation(wanted, state, self._vehicle)
            near = abs(along) < cfg.OFF_PLAN_M and abs(side) < cfg.OFF_PLAN_SIDE_M and abs(turned) < cfg.OFF_PLAN_RAD
            if near and abs(state.speed_mps - wanted.speed) < cfg.OFF_PLAN_MPS:
                return _standing(self.plan.frenet(now)), wanted.heading
        try:
            return _standing(self._planner.begin(situation)), state.heading_rad
        except (ValueError, RuntimeError):  # the car is outside the library's coordinates, or heads against the route
            return None, state.heading_rad

    def _without(self, situation: RoadSituation, behaviour: Behaviour, prediction: Records) -> Plan:
        """Return a plan if no trajectory is feasible: the last plan while it is free of collisions, otherwise an
        emergency stop.
        """
        now = situation.observation.time_s
        last = self.plan
        young = last is not None and not last.emergency and now - last.begins_s <= cfg.OLD_PLAN_S
        if last is not None and young and is_free(situation, behaviour, prediction, last.from_now(now)):
            self.count.kept += 1
            return last
        self.count.emergencies += 1
        ego = situation.ego
        slope, strongest = math.tan(max(-1.0, min(1.0, ego.heading_error))), ego.strongest
        start = Frenet(ego.s, ego.forward, 0.0, ego.d, slope * ego.forward, 0.0)
        for braking in cfg.EMERGENCY_BRAKING_MPS2:
            plan = braking_plan(self._route, now, start, min(braking, strongest), last, emergency=True)
            if is_free(situation, behaviour, prediction, plan):
                return plan
        return braking_plan(self._route, now, start, strongest, last, emergency=True)


def _required_acceleration(behaviour: Behaviour, now: RoadSituation) -> float:
    """Return the acceleration that a behaviour requires, m/s^2: to its stop, or to the speed of its leader."""
    ego = now.ego
    acceleration = 0.0
    if behaviour.stop_s is not None:
        acceleration = -(ego.forward**2) / (2 * max(behaviour.stop_s - ego.front_s, 0.1)) - STOPS_MPS2
    leader = behaviour.leaders[0, 0]
    room, closing = float(leader["s"]) - ego.front_s, ego.forward - float(leader["speed"])
    if room < cfg.MINIMUM_GAP_M + FOLLOWS_S * ego.forward:
        acceleration = min(
            acceleration, -(max(closing, 0.0) ** 2) / (2 * max(room - cfg.MINIMUM_GAP_M, 0.1)) - STOPS_MPS2
        )
    return max(acceleration, -ego.strongest)


def _standing(start: Frenet) -> Frenet:
    """Return a state in which the braking of a standing car is zero; otherwise the car could not set off again."""
    return (
        start._replace(s_dot=0.0, s_ddot=0.0) if start.s_dot < pdm_settings.COAST_MPS and start.s_ddot <= 0.0 else start
    )


class TrackingController:
    """Follows plans at 20 Hz; between steps it keeps the integral of the speed error."""

    def __init__(self, vehicle: VehicleLimits, step_s: float) -> None:
        self._vehicle, self._step_s = vehicle, step_s
        self._integral = 0.0
        self.wanted: PlannedMotion | None = None
        """The acceleration and the wheel angle of the last step."""
        self._egos = ego_record(vehicle)
        self._numbers = self._egos.view(np.float64).data

    def follow(self, plan: Plan, state: EgoState, time_s: float) -> Control:
        """Return the control that keeps the car on the plan."""
        here = plan.pose(time_s)
        ahead = plan.pose(time_s + cfg.LAG_S)
        along, side, turned = deviation(here, state, self._vehicle)
        angle = self._steering(ahead, side, turned, state)
        write_state(self._numbers, state)
        acceleration = self._acceleration(plan, here, ahead, along, state)
        self.wanted = PlannedMotion(acceleration, angle)
        return Control(*pedals(self._egos, angle, acceleration))

    def _acceleration(self, plan: Plan, here: Pose, ahead: Pose, along: float, state: EgoState) -> float:
        if plan.emergency:
            self._integral = 0.0
            return min(here.acceleration, 0.0) if here.speed > 0.0 else -1.0
        wanted = here.speed - state.speed_mps
        moving = state.speed_mps > pdm_settings.COAST_MPS or ahead.speed > pdm_settings.COAST_MPS
        if not moving:
            self._integral = 0.0
            return -1.0  # the car stands and should stay
        most = cfg.INTEGRAL_LIMIT_MPS2
        self._integral = max(-most, min(most, self._integral + cfg.INTEGRAL_GAIN * wanted * self._step_s))
        place = max(-cfg.OFF_PLAN_M, min(cfg.OFF_PLAN_M, -along))
        return ahead.acceleration + cfg.SPEED_GAIN * wanted + cfg.PLACE_GAIN * place + self._integral

    def _steering(self, ahead: Pose, side: float, turned: float, state: EgoState) -> float:
        """Return the front-wheel angle, rad: the error decays critically damped over the distance travelled."""
        car = self._vehicle
        length = decay_length(state.speed_mps, side, math.tan(car.steer_max_rad) / car.wheelbase_m)
        slope = math.tan(max(-1.0, min(1.0, turned)))
        curvature = ahead.curvature - side / length**2 - 2.0 * slope / length
        grip = pdm_settings.FRICTION_SHARE * car.friction * GRAVITY_MPS2 / max(state.speed_mps, 1.0) ** 2
        angle = math.atan(car.wheelbase_m * max(-grip, min(grip, curvature)))
        return max(-car.steer_max_rad, min(car.steer_max_rad, angle))


def deviation(wanted: Pose, state: EgoState, vehicle: VehicleLimits) -> tuple[float, float, float]:
    """Return the rear axle's deviation from the plan: ahead (m), to the left (m), and turned to the left (rad)."""
    back = vehicle.rear_axle_m
    dx = state.x - back * math.cos(state.heading_rad) - wanted.x
    dy = state.y - back * math.sin(state.heading_rad) - wanted.y
    cos, sin = math.cos(wanted.heading), math.sin(wanted.heading)
    return dx * cos + dy * sin, dy * cos - dx * sin, angle_between(state.heading_rad, wanted.heading)
