"""Judges each frame of a run: whether the run ends there, and how. It also describes in words what an ego waits for.

Judgements use the true positions of all actors, not the driver's observation.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.drivers.protocol import Control, Driver, Observation, Waiting
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import drives_on
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.printer import quotable
from foresee_dsl.simulate.actors.moved_actors import PathActor
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M, OutcomeJudge, RunEnd, off_road_points, squares_of
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import SPEED, STEP_S
from foresee_dsl.simulate.waiting import Leader, WayAhead

NEAR_GOAL_M = 2.0
"""Distance to the goal below which a clip runs to the end of its window, m. Ours: the spacing of trace waypoints."""
_LONGEST_WORDS = 200
"""Maximum number of characters of the driver's own explanation in the reason."""
JUNCTION_M = 10.0
"""An ego that stands at most this far before a junction is said to wait at that junction, m. Ours: two cars'
lengths."""


@dataclass(slots=True)
class Frame:
    """One frame of a run, which the run's loop passes from part to part; each part sets a field for the next parts.

    Attributes:
        time_s: time since the run began; the director gives its orders before any other field is set.
        states: [1 + N, 7] the columns of `Trace.states` for the ego and the others, NaN where absent; the recorder sets
            it.
        observation: the driver's input; the sensors set it.
        run_end: how the run ends at this frame, None if it goes on; set by the judge, or on a fault of the driver or
            of SUMO.
        control: the driver's answer.
    """

    time_s: float
    states: FloatArray = field(init=False)
    observation: Observation = field(init=False)
    run_end: RunEnd | None = None
    control: Control = field(init=False)


class Judging:
    """Judges each frame of one run.

    Attributes: outcome_judge: decides whether and how the run ends, from what this class measures.
    """

    def __init__(self, simulation: Simulation, recorder: Recorder, driver: Driver) -> None:
        self._simulation, self._recorder, self._driver = simulation, recorder, driver
        scene, others, ego = simulation.scene, simulation.actors[1:], simulation.ego
        # A clip of an ego that hardly moves has its goal at its start. Such a run must not end at once, but at the end
        # of its window.
        room = scene.goal_s - simulation.progress.of(ego, 0)[0]
        self._began_at_goal = scene.clip and room < NEAR_GOAL_M
        sizes = np.array([(actor.length, actor.width) for actor in others], dtype=np.float64).reshape(-1, 2)
        squares = self._squares = squares_of(simulation.network)
        footprint = np.array([ego.length, ego.width, *ego.motion.axles(WHEEL_INSET_M)])
        self._around = sizes, footprint, squares.left, squares.bottom, squares.cell, squares.states
        self.outcome_judge = OutcomeJudge(
            ids=[actor.id for actor in others],
            # An actor that the scenario makes stand for the whole run is a static object, even if it is a parked car.
            kinds=["obstacle" if a.placed.control == "static" else a.placed.model.kind for a in others],
            sizes=sizes,
            ego_size=(ego.length, ego.width),
            end_s=scene.end_s,
            must_arrive=scene.must_arrive,
        )

    def step(self, frame: Frame) -> None:
        """Decide whether the run ends at this frame, and set its `run_end`."""
        simulation = self._simulation
        along_m, left_m = simulation.progress.of(simulation.ego, simulation.frame)
        arrived = not self._began_at_goal and along_m >= simulation.scene.goal_s
        if not arrived and self._drives_on(frame):
            self.outcome_judge.moves()
            return
        ego = simulation.ego.bicycle()
        way = WayAhead(simulation.scene, frame.states, along_m, left_m, partial(_signalled, simulation))
        run_end = self.outcome_judge.look(
            frame.time_s,
            ego,
            frame.states[1:, :3],
            frame.states[1:, SPEED],
            off_road=not self._squares.hold(off_road_points(simulation.ego.motion, ego)),
            arrived=arrived,
            may_wait=way.may_wait(),
        )
        if run_end is not None and run_end.verdict is Verdict.F1 and not run_end.with_:
            run_end = self._of_the_map(run_end)
        if run_end is not None and run_end.verdict in (Verdict.STUCK, Verdict.TIMEOUT):
            run_end = replace(run_end, reason=f"{run_end.reason}; {self._waits_for(way)}")
        frame.run_end = run_end

    def _drives_on(self, frame: Frame) -> bool:
        """Return whether a cheap test shows that the run goes on at this frame, which is nearly always so."""
        return (
            frame.states.item(SPEED) >= STANDS_MPS
            and frame.time_s < self._simulation.scene.end_s - STEP_S / 2
            and bool(drives_on(frame.states, *self._around))
        )

    def _of_the_map(self, run_end: RunEnd) -> RunEnd:
        """Return the end of the run; it is an invalid run instead of F1 if the ego left the road where the map is
        defective.
        """
        ego = self._simulation.ego
        fault = self._simulation.network.fault_near(ego.x, ego.y)
        if not fault:
            return run_end
        reason = f"invalid: the ego left the drivable area at {run_end.time_s:.2f} s where the map is broken: {fault}"
        return replace(run_end, verdict=Verdict.INVALID, reason=reason)

    def _waits_for(self, way: WayAhead) -> str:
        """Return what the ego waits for, as the scene shows it and, if the driver explains itself, in the driver's
        words.
        """
        scene = _waits_for(self._simulation, self._recorder, way)
        own = self._driver.waits_for if isinstance(self._driver, Waiting) else ""
        own = quotable(own, _LONGEST_WORDS) if isinstance(own, str) else ""
        return f"{scene} (the driver: {own})" if own else scene


def _signalled(simulation: Simulation, movement: Movement) -> str:
    """Return the present colour of a movement's signal; "" without a signal."""
    if movement.tls is None or movement.link < 0:
        return ""
    return simulation.world.signals.colour(movement.tls, movement.link)


def _waits_for(simulation: Simulation, recorder: Recorder, way: WayAhead) -> str:
    """Return a clause about where and for how long the ego stands, such as `the ego stands since 9.10 s, 41 m before
    its goal, 3.1 m behind walker (pedestrian), ...`.
    """
    ego, leader = simulation.ego, way.leader()
    goal_m = simulation.scene.goal_s - way.along_m
    before = f", {goal_m:.0f} m before its goal" if goal_m > 0 else ""
    behind = _behind(simulation, recorder, leader) if leader is not None else ""
    if ego.speed >= STANDS_MPS:
        return f"the ego still drives at {ego.speed * 3.6:.0f} km/h{before}" + (behind and f", {behind}")
    stands = f"the ego stands since {recorder.stands_since(0, STANDS_MPS):.2f} s{before}"
    signal = way.stop_signal()
    if signal is not None and (leader is None or signal[1] <= leader.gap_m):
        return f"{stands}, before the {signal[2]} signal of {signal[0].junction}"
    if behind:
        return f"{stands}, {behind}"
    for passage, room in way.junctions():
        if room <= JUNCTION_M:
            where = "inside junction" if room < 0 else f"{room:.1f} m before junction"
            near = _nearest(simulation)
            return f"{stands}, {where} {passage.junction}{f'; nearest to it is {near}' if near else ''}"
    return f"{stands}, and no actor is ahead on its route"


def _behind(simulation: Simulation, recorder: Recorder, leader: Leader) -> str:
    """Return a clause that names the actor ahead and says why that actor does not drive on."""
    actor = simulation.actors[leader.column]
    name = f"{max(leader.gap_m, 0.0):.1f} m behind {actor.id} ({actor.placed.model.kind})"
    if actor.placed.control == "static":
        return f"{name}, which the scenario parks there"
    if actor.speed >= STANDS_MPS:
        return f"{name}, which moves at {actor.speed * 3.6:.0f} km/h"
    since_s = recorder.stands_since(leader.column, STANDS_MPS)
    if isinstance(actor, PathActor) and actor.follower.arrived:
        return (
            f"{name}, which came to the end of its path in the ego's way after {since_s:.2f} s and stays there: "
            "extend its path in the scenario beyond the lane"
        )
    return f"{name}, which stands since {since_s:.2f} s"


def _nearest(simulation: Simulation) -> str:
    """Return the nearest actor that is not a static object, in words; "" without one."""
    ego = simulation.ego
    apart = [
        (((other.x - ego.x) ** 2 + (other.y - ego.y) ** 2) ** 0.5, other)
        for other in simulation.others(ego)
        if other.placed.control != "static"
    ]
    if not apart:
        return ""
    metres, other = min(apart, key=lambda pair: (pair[0], pair[1].id))
    return f"{other.id} ({other.placed.model.kind}), {metres:.0f} m away at {other.speed * 3.6:.0f} km/h"
