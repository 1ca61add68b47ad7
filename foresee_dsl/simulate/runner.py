"""Runs a compiled test case with a driver, 20 steps a second, until it is decided how it ends."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.protocol import Closing, Control, Driver, Mission
from foresee_dsl.errors import DriverError, SimulationError
from foresee_dsl.kernels.boxes import drives_on
from foresee_dsl.simulate.actors.dynamics import checked
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.results.drivable_area import squares_of
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M, Decision, Judge, off_road_points
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.sensing import STANDARD, Sensing, SensorSettings
from foresee_dsl.simulate.trace import SPEED, STEP_S
from foresee_dsl.simulate.triggers.condition_history import Expectations
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.director import Director
from foresee_dsl.simulate.world import World

FloatArray = NDArray[np.float64]

WAYPOINT_M = 2.0
"""Spacing of the trace's waypoints (asked for by the trace's layout)."""
CLOSE_AHEAD_M = 15.0
"""An actor in front that is this near is something to wait for. Ours: two car lengths and a crossing's width."""
SIGNAL_AHEAD_M = 30.0
"""A signal that is not green and this near is something to wait for. Ours: the first four cars of a queue; those
behind have another in front."""
_LONGEST_REASON = 1000
"""Characters of an exception's text that go into the reason. Ours: half of what a text in a file may have."""


def run(
    bundle: SumoBundle,
    driver: Driver,
    *,
    seed: int = 0,
    meta: Mapping[str, Any] | None = None,
    sensors: SensorSettings = STANDARD,
) -> RunResult:
    """Run a test case. The same arguments give the same trace, in any process.

    Args:
        bundle: the compiled test case.
        driver: the software under test. What it raises is the run's result (`crash`), not an exception of this call. A
            driver that can be closed is closed when the run is over, however it ended.
        seed: given to the driver, and what the sensors' noise and track numbers are drawn from.
        meta: goes into the trace's `meta`, over what is there by itself.
        sensors: what the driver's sensors can do.

    Raises:
        SimulationError: the scene cannot be set up in SUMO.
    """
    try:
        return _Run(bundle, driver, seed, dict(meta or {}), sensors).go()
    finally:
        if isinstance(driver, Closing):
            driver.close()


class _Run:
    """One run's state."""

    def __init__(
        self, bundle: SumoBundle, driver: Driver, seed: int, meta: dict[str, Any], sensors: SensorSettings
    ) -> None:
        self._bundle, self._driver, self._seed, self._meta = bundle, driver, seed, meta
        self._world = World.shared(bundle)
        self._simulation = Simulation(bundle, self._world)
        self._recorder = Recorder(bundle.scene.actors, self._simulation.state_table, bundle.signals)
        self._conditions = Conditions(self._simulation, bundle.signals)
        self._director = Director(self._simulation, self._conditions, self._recorder)
        self._expectations = Expectations(bundle.scene.expects, self._conditions)
        self._mission: Mission = mission_of(bundle)
        # A clip of an ego that hardly moved has its goal where it begins: it runs to the end of its window.
        room = bundle.scene.goal_s - self._simulation.progress.of(self._simulation.ego, 0)[0]
        self._began_at_goal = bundle.scene.clip and room < WAYPOINT_M
        others = self._simulation.actors[1:]
        self._sensing = Sensing(self._simulation, self._mission, seed, sensors)
        self._sizes = np.array([(actor.length, actor.width) for actor in others], dtype=np.float64).reshape(-1, 2)
        self._squares = squares_of(self._simulation.network)
        ego = self._simulation.ego
        self._footprint = np.array([ego.length, ego.width, *ego.motion.axles(WHEEL_INSET_M)])
        self._judge = Judge(
            ids=[actor.id for actor in others],
            # What stands for the whole run is a static object, a parked car too.
            kinds=["obstacle" if a.placed.control == "static" else a.placed.model.kind for a in others],
            sizes=self._sizes,
            ego_size=(ego.length, ego.width),
            end_s=bundle.scene.end_s,
            must_arrive=bundle.scene.must_arrive,
        )

    def go(self) -> RunResult:
        try:
            self._driver.reset(self._mission, self._simulation.ego.limits, self._seed)
        except Exception as err:  # whatever it raises is a result
            return self._finish(self._broken(err), steps=0)
        steps = 0
        while True:
            self._director.step()
            states = self._recorder.frame(self._world.signals)
            observation = self._sensing.observe(states)
            decision = self._look(states)
            if decision is not None:
                return self._finish(decision, steps)
            try:
                control = Control(*checked(self._driver.step(observation)))
            except Exception as err:  # whatever it raises is a result
                return self._finish(self._broken(err), steps)
            try:
                left = self._simulation.step(control)
            except SimulationError as err:
                World.close_shared()  # the next run begins with a fresh SUMO
                decision = Decision(Verdict.CRASH, self._simulation.time_s, "", f"the simulator broke: {err}")
                return self._finish(decision, steps)
            steps += 1
            for name in left:
                self._recorder.event(self._simulation.time_s, name, "arrived")

    def _look(self, states: FloatArray) -> Decision | None:
        simulation = self._simulation
        arrived = not self._began_at_goal and self._conditions.arrived("ego")
        decision = None
        if not arrived and self._drives_on(states):
            self._judge.moves()
        else:
            ego = simulation.ego.bicycle()
            decision = self._judge.look(
                simulation.time_s,
                ego,
                states[1:, :3],
                states[1:, SPEED],
                off_road=not self._squares.hold(off_road_points(simulation.ego.motion, ego)),
                arrived=arrived,
                may_wait=self._may_wait(),
            )
        self._expectations.look(simulation.time_s, ego_hit=decision is not None and bool(decision.with_))
        return decision

    def _drives_on(self, states: FloatArray) -> bool:
        """Whether a cheap test shows that nothing ends the run at this frame, as it nearly always does."""
        squares = self._squares
        return (
            states.item(SPEED) >= STANDS_MPS
            and self._simulation.time_s < self._bundle.scene.end_s - STEP_S / 2
            and drives_on(
                states, self._sizes, self._footprint, squares.left, squares.bottom, squares.cell, squares.known
            )
        )

    def _may_wait(self) -> bool:
        """Whether there is something to wait for: a signal that is not green, or an actor (no static object) in front.

        This judges the run, so that it depends on where all actors are, not on what the driver sees.
        """
        simulation = self._simulation
        if simulation.ego.speed >= STANDS_MPS:
            return True  # it does not wait, so the question does not arise
        for passage, room in simulation.progress.ahead(simulation.ego, simulation.frame, SIGNAL_AHEAD_M):
            tls, link = passage.movement.tls, passage.movement.link
            if room >= 0 and tls is not None and link >= 0:
                if self._world.signals.colour(tls, link) in ("red", "amber"):
                    return True
                break
        cos, sin = np.cos(simulation.ego.heading), np.sin(simulation.ego.heading)
        return any(
            other.placed.control != "static"
            and np.hypot(other.x - simulation.ego.x, other.y - simulation.ego.y) <= CLOSE_AHEAD_M
            and (other.x - simulation.ego.x) * cos + (other.y - simulation.ego.y) * sin > 0
            for other in simulation.others(simulation.ego)
        )

    def _broken(self, err: Exception) -> Decision:
        what = "the driver broke" if isinstance(err, DriverError) else f"the driver raised {type(err).__name__}"
        # A reason is one line, and goes into texts between double quotes.
        text = " ".join(str(err).split()).replace('"', "'")[:_LONGEST_REASON]
        return Decision(Verdict.CRASH, self._simulation.time_s, "", f"{what}: {text}")

    def _finish(self, decision: Decision, steps: int) -> RunResult:
        if decision.verdict is Verdict.PASS and self._conditions.arrived("ego"):
            self._recorder.event(decision.time_s, "ego", "arrived")
        elif decision.verdict.is_collision:
            detail = {"with": decision.with_, "verdict": decision.verdict.value}
            self._recorder.event(decision.time_s, "ego", "collision" if decision.with_ else "off_road", detail)
        meta = {
            "test_case": self._bundle.name,
            "driver": self._driver.name,
            "driver_version": self._driver.version,
            "seed": self._seed,
            "verdict": decision.verdict.value,
            "reason": decision.reason,
            **self._meta,
        }
        trace = self._recorder.trace(_waypoints(self._bundle), meta, self._director.record())
        return RunResult(
            verdict=decision.verdict,
            time_s=decision.time_s,
            with_=decision.with_,
            reason=decision.reason,
            duration_s=trace.duration_s,
            steps=steps,
            trace=trace,
            expectations=self._expectations.results(),
            impact=decision.impact,
        )


def _waypoints(bundle: SumoBundle) -> FloatArray:
    """The ego's route from its start to the route's end, a point each 2 m."""
    line = bundle.scene.ego.line
    if line is None:
        return np.empty((0, 2))
    marks = np.arange(bundle.scene.start_s, line.end_s + 1e-9, WAYPOINT_M)
    return np.stack([np.interp(marks, line.s, line.points[:, axis]) for axis in (0, 1)], axis=1)
