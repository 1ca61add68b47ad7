"""Runs a compiled test case with a driver, 20 steps a second, until it is decided how it ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.deadlines import DEADLINES, RESET_VARIABLE, STEP_VARIABLE, Deadlines
from foresee_dsl.drivers.protocol import Closing, Control, Driver, Mission
from foresee_dsl.errors import DriverLateError, SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import drives_on
from foresee_dsl.kernels.compiling import ensure
from foresee_dsl.measuring import Part, count_run
from foresee_dsl.simulate.actors.dynamics import checked
from foresee_dsl.simulate.actors.moved_actors import STANDS_MPS
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.driver_faults import DriverHangs, Fault, fault_of, one_line, place_of
from foresee_dsl.simulate.driver_watch import Watch
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.printed import printed_here
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.results.drivable_area import squares_of
from foresee_dsl.simulate.results.outcome import WHEEL_INSET_M, Decision, Judge, off_road_points
from foresee_dsl.simulate.results.verdict import DriverNotes, Hang, RunResult, Verdict
from foresee_dsl.simulate.sensing import STANDARD, Sensing, SensorSettings
from foresee_dsl.simulate.sensing.line_of_sight import LinesOfSight
from foresee_dsl.simulate.trace import SPEED, STEP_S
from foresee_dsl.simulate.triggers.condition_history import Expectations
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.director import Director
from foresee_dsl.simulate.waiting import waits_for
from foresee_dsl.simulate.world import World

WAYPOINT_M = 2.0
"""Spacing of the trace's waypoints (asked for by the trace's layout)."""
CLOSE_AHEAD_M = 15.0
"""An actor in front that is this near is something to wait for. Ours: two car lengths and a crossing's width."""
SIGNAL_AHEAD_M = 30.0
"""A signal that is not green and this near is something to wait for. Ours: the first four cars of a queue; those
behind have another in front."""
_LONGEST_WORDS = 200
"""Characters of what a driver says itself that go into the reason."""


def run(
    bundle: SumoBundle,
    driver: Driver,
    *,
    seed: int = 0,
    meta: Mapping[str, Any] | None = None,
    sensors: SensorSettings = STANDARD,
    deadlines: Deadlines | None = DEADLINES,
) -> RunResult:
    """Run a test case. The same arguments give the same trace, in any process.

    Args:
        bundle: the compiled test case.
        driver: the software under test. What it raises is the run's result (`crash`), not an exception of this call. A
            driver that can be closed is closed when the run is over, however it ended.
        seed: given to the driver, and what the sensors' noise and track numbers are drawn from.
        meta: goes into the trace's `meta`, over what is there by itself.
        sensors: what the driver's sensors can do.
        deadlines: a driver that takes longer is interrupted, which is a result as well (`timeout`, with the `hang` in
            its notes). None: it takes as long as it takes.

    Raises:
        SimulationError: the scene cannot be set up in SUMO.
    """
    ensure()
    files = printed_here()
    if files is not None:
        files.begin()
    with Part.LOOP, Watch(deadlines, bundle.scene.end_s) as watch:
        try:
            with Part.PLACING:
                prepared = _Run(bundle, driver, seed, dict(meta or {}), sensors, watch)
            result = prepared.go()
        finally:
            fault = _closed(driver, watch)
    count_run(result.duration_s)
    printed = files.text() if files is not None else ""
    if fault is None and not printed:
        return result
    trace = result.notes.traceback or (fault.traceback if fault is not None else "")
    return replace(result, notes=replace(result.notes, output=printed, traceback=trace))


def _closed(driver: Driver, watch: Watch) -> Fault | None:
    """Close a driver that can be closed; what it raises then changes no verdict."""
    if not isinstance(driver, Closing):
        return None
    try:
        with watch.call("close"):
            driver.close()
    except (Exception, SystemExit, DriverHangs) as err:
        return fault_of(err)
    return None


class _Run:
    """One run's state."""

    def __init__(
        self, bundle: SumoBundle, driver: Driver, seed: int, meta: dict[str, Any], sensors: SensorSettings,
        watch: Watch,
    ) -> None:  # fmt: skip
        self._bundle, self._driver, self._seed, self._meta = bundle, driver, seed, meta
        self._watch = watch
        self._notes = DriverNotes()
        self._world = World.shared(bundle)
        self._simulation = Simulation(bundle, self._world)
        self._recorder = Recorder(bundle.scene.actors, self._simulation.state_table, bundle.signals)
        for patch in bundle.scene.slippery:  # a clip has them at these places
            at = {"x": patch.x, "y": patch.y, "radius_m": patch.radius_m, "friction": patch.friction}
            self._recorder.event(0.0, patch.name, "slippery", at)
        self._conditions = Conditions(self._simulation, bundle.signals)
        self._director = Director(self._simulation, self._conditions, self._recorder)
        self._expectations = Expectations(bundle.scene.expects, self._conditions)
        self._mission: Mission = mission_of(bundle)
        # A clip of an ego that hardly moved has its goal where it begins: it runs to the end of its window.
        room = bundle.scene.goal_s - self._simulation.progress.of(self._simulation.ego, 0)[0]
        self._began_at_goal = bundle.scene.clip and room < WAYPOINT_M
        others = self._simulation.actors[1:]
        self._sensing = Sensing(self._simulation, self._mission, seed, sensors)
        self._conditions.eyes, self._conditions.sightlines = self._sensing, LinesOfSight(self._simulation)
        sizes = np.array([(actor.length, actor.width) for actor in others], dtype=np.float64).reshape(-1, 2)
        squares = self._squares = squares_of(self._simulation.network)
        ego = self._simulation.ego
        footprint = np.array([ego.length, ego.width, *ego.motion.axles(WHEEL_INSET_M)])
        self._around = sizes, footprint, squares.left, squares.bottom, squares.cell, squares.known
        self._judge = Judge(
            ids=[actor.id for actor in others],
            # What stands for the whole run is a static object, a parked car too.
            kinds=["obstacle" if a.placed.control == "static" else a.placed.model.kind for a in others],
            sizes=sizes,
            ego_size=(ego.length, ego.width),
            end_s=bundle.scene.end_s,
            must_arrive=bundle.scene.must_arrive,
        )

    def go(self) -> RunResult:
        watch, steps = self._watch, 0
        try:
            with watch.call("reset"):
                self._driver.reset(self._mission, self._simulation.ego.limits, self._seed)
        except (Exception, SystemExit, DriverHangs) as err:  # whatever it raises is a result
            failed = self._broken(err)
            self._director.step()
            self._recorder.frame(self._world.signals)  # a trace has a frame at least
            return self._finish(failed, steps)
        watch.starts()
        while True:
            with Part.DIRECTOR:
                self._director.step()
            with Part.RECORDING:
                states = self._recorder.frame(self._world.signals)
            with Part.SENSING:
                observation = self._sensing.observe(states)
            with Part.JUDGING:
                decision = self._look(states)
            if decision is not None:
                return self._finish(decision, steps)
            try:
                with watch.call("step"):
                    answer = self._driver.step(observation)
                control = Control(*checked(answer))
            except (Exception, SystemExit, DriverHangs) as err:  # whatever it raises is a result
                return self._finish(self._broken(err), steps)
            try:
                with Part.ACTORS:
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
        time_s = simulation.time_s
        arrived = not self._began_at_goal and self._conditions.arrived("ego")
        # A cheap test shows that nothing ends the run at this frame, as it nearly always does.
        if (
            not arrived
            and states.item(SPEED) >= STANDS_MPS
            and time_s < self._bundle.scene.end_s - STEP_S / 2
            and drives_on(states, *self._around)
        ):
            self._judge.moves()
            self._expectations.look(time_s, ego_hit=False)
            return None
        ego = simulation.ego.bicycle()
        decision = self._judge.look(
            time_s,
            ego,
            states[1:, :3],
            states[1:, SPEED],
            off_road=not self._squares.hold(off_road_points(simulation.ego.motion, ego)),
            arrived=arrived,
            may_wait=self._may_wait(),
        )
        if decision is not None and decision.verdict is Verdict.F1 and not decision.with_:
            decision = self._of_the_map(decision)
        if decision is not None and decision.verdict in (Verdict.STUCK, Verdict.TIMEOUT):
            decision = replace(decision, reason=f"{decision.reason}; {self._waits_for()}")
        self._expectations.look(time_s, ego_hit=decision is not None and bool(decision.with_))
        return decision

    def _of_the_map(self, decision: Decision) -> Decision:
        """Who leaves the road where the map is broken is not to blame for it."""
        ego = self._simulation.ego
        fault = self._simulation.network.fault_near(ego.x, ego.y)
        if not fault:
            return decision
        reason = f"invalid: the ego left the drivable area at {decision.time_s:.2f} s where the map is broken: {fault}"
        return replace(decision, verdict=Verdict.INVALID, reason=reason)

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

    def _waits_for(self) -> str:
        """What the ego waits for: by its driver's own words, if it has any, and by the scene."""
        scene = waits_for(self._simulation, self._recorder, self._world.signals)
        own = getattr(self._driver, "waits_for", "")
        own = " ".join(own.split()).replace('"', "'")[:_LONGEST_WORDS] if isinstance(own, str) else ""
        return f"{scene} (the driver: {own})" if own else scene

    def _broken(self, err: BaseException) -> Decision:
        time_s, fault = self._simulation.time_s, fault_of(err)
        self._notes = DriverNotes(traceback=fault.traceback)
        if isinstance(err, DriverHangs):
            self._notes = replace(self._notes, hang=err.hang)
            at = f", at {place}" if (place := place_of(err)) else ""
            return Decision(Verdict.TIMEOUT, time_s, "", f"timeout: {err.what}{at}; {err.allows} allows more")
        if isinstance(err, DriverLateError):
            starting = self._recorder.frames == 0
            self._notes = replace(self._notes, hang=Hang("reset" if starting else "step", err.deadline_s))
            allows = RESET_VARIABLE if starting else f"--step-deadline or {STEP_VARIABLE}"
            reason = f"timeout: the driver hangs: {one_line(err)}; {allows} allows more"
            return Decision(Verdict.TIMEOUT, time_s, "", reason)
        return Decision(Verdict.CRASH, time_s, "", fault.text)

    def _finish(self, decision: Decision, steps: int) -> RunResult:
        if decision.verdict is Verdict.PASS and self._conditions.arrived("ego"):
            self._recorder.event(decision.time_s, "ego", "arrived")
        elif decision.verdict.is_collision:
            detail = {"with": decision.with_, "verdict": decision.verdict.value}
            self._recorder.event(decision.time_s, "ego", "collision" if decision.with_ else "off_road", detail)
        expectations = self._expectations.results()
        reason = decision.reason
        if decision.verdict is Verdict.PASS:
            broken = [one.broken_sentence for one in expectations if not one.held]
            reason = "; ".join((*broken, reason)).replace('"', "'")  # a mutant's file has it in double quotes
        meta = {
            "test_case": self._bundle.name,
            "driver": self._driver.name,
            "driver_version": self._driver.version,
            "seed": self._seed,
            "verdict": decision.verdict.value,
            "reason": reason,
            **self._meta,
        }
        with Part.DIRECTOR:
            record = self._director.record()
        trace = self._recorder.trace(_waypoints(self._bundle), meta, record)
        return RunResult(
            verdict=decision.verdict,
            time_s=decision.time_s,
            with_=decision.with_,
            reason=reason,
            duration_s=trace.duration_s,
            steps=steps,
            trace=trace,
            expectations=expectations,
            impact=decision.impact,
            notes=self._notes,
        )


def _waypoints(bundle: SumoBundle) -> FloatArray:
    """The ego's route from its start to the route's end, a point each 2 m."""
    line = bundle.scene.ego.line
    if line is None:
        return np.empty((0, 2))
    marks = np.arange(bundle.scene.start_s, line.end_s + 1e-9, WAYPOINT_M)
    return np.stack([np.interp(marks, line.s, line.points[:, axis]) for axis in (0, 1)], axis=1)
