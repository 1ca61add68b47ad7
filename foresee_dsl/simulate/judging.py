"""The judge's step of a run: whether the run ends at a frame, and how."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.kernels.boxes import drives_on
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.frame import Frame
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.results.drivable_area import squares_of
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M, Decision, Judge, off_road_points
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.simulate.trace import SPEED, STEP_S
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.waiting import may_wait, waits_for

NEAR_GOAL_M = 2.0
"""A clip whose goal is nearer than this runs to the end of its window. Ours: the spacing of the trace's waypoints."""
_LONGEST_WORDS = 200
"""Characters of what a driver says itself that go into the reason."""


class Judging:
    """Judges each frame of one run."""

    def __init__(self, simulation: Simulation, conditions: Conditions, recorder: Recorder, driver: Driver) -> None:
        self._simulation, self._conditions, self._recorder, self._driver = simulation, conditions, recorder, driver
        scene, others, ego = simulation.scene, simulation.actors[1:], simulation.ego
        # A clip of an ego that hardly moved has its goal where it begins: it runs to the end of its window.
        room = scene.goal_s - simulation.progress.of(ego, 0)[0]
        self._began_at_goal = scene.clip and room < NEAR_GOAL_M
        sizes = np.array([(actor.length, actor.width) for actor in others], dtype=np.float64).reshape(-1, 2)
        squares = self._squares = squares_of(simulation.network)
        footprint = np.array([ego.length, ego.width, *ego.motion.axles(WHEEL_INSET_M)])
        self._around = sizes, footprint, squares.left, squares.bottom, squares.cell, squares.known
        self._judge = Judge(
            ids=[actor.id for actor in others],
            # What stands for the whole run is a static object, a parked car too.
            kinds=["obstacle" if a.placed.control == "static" else a.placed.model.kind for a in others],
            sizes=sizes,
            ego_size=(ego.length, ego.width),
            end_s=scene.end_s,
            must_arrive=scene.must_arrive,
        )

    def step(self, frame: Frame) -> None:
        """Reads the states; writes the decision."""
        arrived = not self._began_at_goal and self._conditions.arrived("ego")
        if not arrived and self._drives_on(frame):
            self._judge.moves()
            return
        ego = self._simulation.ego.bicycle()
        decision = self._judge.look(
            frame.time_s,
            ego,
            frame.states[1:, :3],
            frame.states[1:, SPEED],
            off_road=not self._squares.hold(off_road_points(self._simulation.ego.motion, ego)),
            arrived=arrived,
            may_wait=may_wait(self._simulation),
        )
        if decision is not None and decision.verdict is Verdict.F1 and not decision.with_:
            decision = self._of_the_map(decision)
        if decision is not None and decision.verdict in (Verdict.STUCK, Verdict.TIMEOUT):
            decision = replace(decision, reason=f"{decision.reason}; {self._waits_for()}")
        frame.decision = decision

    def _drives_on(self, frame: Frame) -> bool:
        """Return whether a cheap test shows that nothing ends the run at this frame, as it nearly always does."""
        return (
            frame.states.item(SPEED) >= STANDS_MPS
            and frame.time_s < self._simulation.scene.end_s - STEP_S / 2
            and bool(drives_on(frame.states, *self._around))
        )

    def _of_the_map(self, decision: Decision) -> Decision:
        """An ego that leaves the road where the map is broken is not to blame for it."""
        ego = self._simulation.ego
        fault = self._simulation.network.fault_near(ego.x, ego.y)
        if not fault:
            return decision
        reason = f"invalid: the ego left the drivable area at {decision.time_s:.2f} s where the map is broken: {fault}"
        return replace(decision, verdict=Verdict.INVALID, reason=reason)

    def _waits_for(self) -> str:
        """What the ego waits for: by its driver's own words, if it has any, and by the scene."""
        scene = waits_for(self._simulation, self._recorder)
        own = getattr(self._driver, "waits_for", "")
        own = " ".join(own.split()).replace('"', "'")[:_LONGEST_WORDS] if isinstance(own, str) else ""
        return f"{scene} (the driver: {own})" if own else scene
