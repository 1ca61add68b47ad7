"""Runs a compiled test case with a driver, in steps of 0.05 s, until its end is decided."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.drivers.deadlines import DEADLINES, RESET_VARIABLE, STEP_VARIABLE, Deadlines
from foresee_dsl.drivers.following import Follower
from foresee_dsl.drivers.parts import DriverPart, PlannedMotion, Planning, WithParts, parts_of
from foresee_dsl.drivers.protocol import Closing, Control, Driver, EgoState, Trajectory
from foresee_dsl.errors import DriverError, DriverLateError, SimulationError
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.compiling import ensure
from foresee_dsl.language.campaign_values import RULES_MODE, RulesMode
from foresee_dsl.measuring import Part, count_run
from foresee_dsl.simulate.actors.dynamics import checked
from foresee_dsl.simulate.actors.simulation import Simulation
from foresee_dsl.simulate.driver_faults import DriverHangs, fault_of, one_line, place_of
from foresee_dsl.simulate.driver_watch import DriverWatch
from foresee_dsl.simulate.ground_truth import GroundTruth, control_for
from foresee_dsl.simulate.judging import Frame, Judging
from foresee_dsl.simulate.mission import mission_of
from foresee_dsl.simulate.printed import printed_here
from foresee_dsl.simulate.recorder import Recorder
from foresee_dsl.simulate.rest_of_run import RestOfRun
from foresee_dsl.simulate.results.infraction import Infraction
from foresee_dsl.simulate.results.outcome import RunEnd
from foresee_dsl.simulate.results.verdict import NO_NOTES, DriverNotes, Hang, RunResult, Verdict
from foresee_dsl.simulate.sensing import STANDARD, Sensing, SensorSettings
from foresee_dsl.simulate.trace import STEP_S, WAYPOINT_M, Trace
from foresee_dsl.simulate.triggers.condition_history import Expectations
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.director import Director
from foresee_dsl.simulate.world import World

_CLOSE_FAILED = "the driver could not be closed after the run (the result of the run stands)"
"""The beginning of a run's traceback if the driver's `close` raised an exception or hung."""


def run(
    bundle: SumoBundle,
    driver: Driver,
    *,
    seed: int = 0,
    meta: Mapping[str, Any] | None = None,
    sensors: SensorSettings = STANDARD,
    deadlines: Deadlines | None = DEADLINES,
    rules: RulesMode = RULES_MODE,
    goal: str = "",
    ends_early: bool = False,
    ideal: frozenset[DriverPart] = frozenset(),
    futures: Trace | None = None,
) -> RunResult:
    """Run a test case with a driver and return the result. The same arguments give the same trace, in any process.

    Args:
        bundle: the compiled test case.
        driver: the software under test. An exception of the driver becomes the result `crash`, not an exception of this
            call. A driver with `close` is closed after the run, regardless of its outcome.
        seed: passed to the driver, and the seed of the sensors' noise and of the track numbers.
        meta: entries of the trace's `meta`, which replace the standard ones.
        sensors: settings of the driver's sensors.
        deadlines: a driver that exceeds one is interrupted; the result is a `timeout`, with the `hang` in its notes.
            None: without a limit.
        rules: whether a run that passes otherwise, but in which the ego breaks a traffic rule, fails (`fail`), passes
            (`report`), or is not examined for that (`off`).
        goal: label of the expectation that is the goal of a search: a run that passes otherwise, but breaks it, fails,
            and the trace's `meta` has its margin at every frame; "" for none.
        ends_early: the run ends as soon as it can only pass (see `rest_of_run`).
        ideal: parts of the driver that are replaced by ideal ones; ideal perception also needs ideal `sensors`.
        futures: the run from which an ideal prediction knows what the others do.

    Raises:
        SimulationError: the scene cannot be set up in SUMO.
    """
    ensure()
    files = printed_here()
    if files is not None:
        files.begin()
    with Part.LOOP, DriverWatch(deadlines, bundle.scene.end_s) as watch:
        try:
            with Part.PLACING:
                prepared = Run(bundle, driver, seed, dict(meta or {}), sensors, watch, rules, goal)
                if ends_early and not ideal:  # ideal control is faster than the vehicle
                    prepared.end_early()
                prepared.idealise(ideal, futures)
            result = prepared.go()
        finally:
            closing = _closed(driver, watch)
    count_run(result.duration_s)
    printed = files.text() if files is not None else ""
    if not closing.not_closed and not printed:
        return result
    trace = result.notes.traceback or closing.traceback
    notes = replace(result.notes, output=printed, traceback=trace, not_closed=closing.not_closed)
    return replace(result, notes=notes)


def _closed(driver: Driver, watch: DriverWatch) -> DriverNotes:
    """Close a driver that has a method `close`; return notes on its exception, which does not change the verdict."""
    if not isinstance(driver, Closing):
        return NO_NOTES
    try:
        with watch.call("close"):
            driver.close()
    except (Exception, SystemExit, DriverHangs) as err:
        fault = fault_of(err)
        text = str(err) if isinstance(err, DriverHangs) else fault.text
        why = f"{_CLOSE_FAILED}: {text}"
        return DriverNotes(traceback=f"{why}\n{fault.traceback}".rstrip(), not_closed=why)
    return NO_NOTES


class Run:
    """One run and its state. `go` calls its steps in turn; a caller that moves the ego itself calls them one by one."""

    def __init__(
        self, bundle: SumoBundle, driver: Driver, seed: int, meta: dict[str, Any], sensors: SensorSettings,
        watch: DriverWatch, rules: RulesMode, goal: str = "",
    ) -> None:  # fmt: skip
        """Set the scene up in this process's SUMO; raises `SimulationError` if SUMO refuses it."""
        self._bundle, self._driver, self._seed, self._meta = bundle, driver, seed, meta
        self._watch = watch
        self._notes = DriverNotes()
        self._world = World.shared(bundle)
        self._number = self._world.runs
        self._simulation = Simulation(bundle, self._world)
        self._recorder = Recorder(bundle.scene.actors, self._simulation.state_table, bundle.signals)
        for patch in bundle.scene.slippery:  # a clip needs their positions
            at = {"x": patch.x, "y": patch.y, "radius_m": patch.radius_m, "friction": patch.friction}
            self._recorder.event(0.0, patch.name, "slippery", at)
        self._mission = mission_of(bundle)
        self._sensing = Sensing(self._simulation, self._mission, seed, sensors)
        self._conditions = Conditions(self._simulation, bundle.signals, self._sensing)
        self._director = Director(self._simulation, self._conditions, self._recorder)
        self._judging = Judging(self._simulation, self._recorder, driver)
        self._expectations = Expectations(bundle.scene.expects, self._conditions, goal)
        self._fails = rules is RulesMode.FAIL
        self._rules = self._conditions.rules(self._simulation.ego) if rules is not RulesMode.OFF else None
        self._rest: RestOfRun | None = None
        self._ideal: frozenset[DriverPart] = frozenset()
        self._truth: GroundTruth | None = None
        self._follower: Follower | None = None
        recorded = bundle.scene.ego.recorded
        self._watches_until_s = recorded[-1].time_s if recorded else 0.0
        self._steps = 0
        # What happens at each frame, in this order.
        self._order = Part.DIRECTOR.timed(self._director.step)
        self._record = Part.RECORDING.timed(self._recorder.frame)
        self._sense = Part.SENSING.timed(self._sensing.observe)
        self._judge = Part.JUDGING.timed(self._decide)
        self._advance = Part.ACTORS.timed(self._simulation.step)

    @property
    def has_the_world(self) -> bool:
        """Whether this process's SUMO still simulates this run: a later run in the process takes it over."""
        return self._world.is_shared and self._world.runs == self._number

    def end_early(self) -> None:
        """End the run as soon as it can only pass."""
        self._rest = RestOfRun(self._simulation, self._judging.outcome_judge, self._rules, self._expectations)

    def idealise(self, ideal: frozenset[DriverPart], futures: Trace | None) -> None:
        """Replace parts of the driver by ideal ones from its `reset` on."""
        if ideal:
            self._ideal, self._truth = ideal, GroundTruth(self._simulation, self._sensing, futures)

    def go(self) -> RunResult:
        """Let each part of the run process frame after frame, in this order, until one of them decides that the run
        ends.
        """
        run_end = self.reset()
        while run_end is None:
            frame = self.next_frame()
            if frame.run_end is None:
                self._drive(frame)
            if frame.run_end is None:
                self.move(frame)
            run_end = frame.run_end
        return self.finish(run_end)

    def next_frame(self) -> Frame:
        """Return the next frame: recorded, sensed and judged, without a control."""
        frame = Frame(self._simulation.time_s)
        self._order()  # evaluates the triggers and carries out their orders; it needs no field of the frame
        frame.states = self._record(self._world.signals)
        if self._follower is not None and frame.time_s > self._watches_until_s + STEP_S / 2:
            x, y = frame.states[0, :2].tolist()
            self._follower.measure(x, y, frame.time_s)
        frame.observation = self._sense(frame.states)
        self._judge(frame)
        return frame

    def reset(self) -> RunEnd | None:
        """Reset the driver; return the run's end if that fails."""
        try:
            with self._watch.call("reset"):
                if self._truth is not None and isinstance(self._driver, WithParts):
                    self._driver.idealise(self._ideal, self._truth)
                self._driver.reset(self._mission, self._simulation.ego.limits, self._seed)
                if missing := self._ideal - frozenset(parts_of(self._driver)):
                    raise DriverError(f"the driver does not declare its {', '.join(sorted(missing))}")
        except (Exception, SystemExit, DriverHangs) as err:  # any exception of the driver is a result of the run
            failed = self._broken(err)
            self._order()
            self._record(self._world.signals)  # a trace must have at least one frame
            return failed
        self._watch.starts()
        return None

    def _decide(self, frame: Frame) -> None:
        """Set the frame's `run_end` from the states, then evaluate the scenario's expectations."""
        self._judging.step(frame)
        if self._rules is not None:
            self._rules.look()
        if frame.run_end is None and self._rest is not None and self._rest.can_only_pass(frame.states):
            ends = f"no failure is possible any more before the end at {self._simulation.scene.end_s:.2f} s"
            frame.run_end = RunEnd(Verdict.PASS, frame.time_s, "", f"drove to {frame.time_s:.2f} s: {ends}")
        if frame.run_end is not None:
            self._conditions.end_rules(frame.run_end)
        hit = frame.run_end is not None and bool(frame.run_end.with_)
        self._expectations.look(frame.time_s, ego_hit=hit)

    def _drive(self, frame: Frame) -> None:
        """Set the control from the driver's answer; if the driver fails, set the frame's `run_end`, which ends the
        run."""
        try:
            with self._watch.call("step"):
                answer = self._driver.step(frame.observation)
            if isinstance(answer, Trajectory):
                frame.control = self._follow(answer, frame)
            else:
                frame.control = Control(*checked(answer))
                if DriverPart.CONTROL in self._ideal:
                    frame.control = self._exactly(frame.control)
        except (Exception, SystemExit, DriverHangs) as err:  # any exception of the driver is a result of the run
            frame.run_end = self._broken(err)

    def _follow(self, trajectory: Trajectory, frame: Frame) -> Control:
        """Return the control with which the ego follows its driver's trajectory; with ideal control it does so from its
        true state, and without delay.
        """
        ideal, ego = DriverPart.CONTROL in self._ideal, frame.observation.ego
        if self._follower is None:
            self._follower = Follower(self._simulation.ego.limits, at_once=ideal)
        if ideal:
            ego = EgoState(*frame.states[0].tolist())
        control = self._control_for(self._follower.motion(trajectory, ego, frame.time_s))
        if ideal:
            self._simulation.ego.follow_at_once(control)
        return control

    def _exactly(self, answer: Control) -> Control:
        """Return the control that carries out the driver's plan (without a plan, its answer) at once: the vehicle
        follows it without delay.
        """
        plan = self._driver.planned() if isinstance(self._driver, Planning) else None
        control = answer if plan is None else self._control_for(plan)
        self._simulation.ego.follow_at_once(control)
        return control

    def _control_for(self, plan: PlannedMotion) -> Control:
        ego = self._simulation.ego
        return Control(*checked(control_for(plan, ego.limits, float(ego.speed))))

    def move(self, frame: Frame) -> None:
        """Move all actors to the next frame with the frame's control; set its `run_end` if SUMO fails."""
        try:
            left = self._advance(frame.control)
        except SimulationError as err:
            World.close_shared()  # SUMO may be in an undefined state, so the next run starts a new one
            frame.run_end = RunEnd(Verdict.CRASH, self._simulation.time_s, "", f"the simulator failed: {err}")
            return
        self._steps += 1
        for name in left:
            self._recorder.event(self._simulation.time_s, name, "arrived")

    def _broken(self, err: BaseException) -> RunEnd:
        time_s, fault = self._simulation.time_s, fault_of(err)
        self._notes = DriverNotes(traceback=fault.traceback)
        if isinstance(err, DriverHangs):
            self._notes = replace(self._notes, hang=err.hang)
            at = f", at {place}" if (place := place_of(err)) else ""
            return RunEnd(Verdict.TIMEOUT, time_s, "", f"timeout: {err.what}{at}; {err.allows} allows more")
        if isinstance(err, DriverLateError):
            starting = self._recorder.frames == 0
            self._notes = replace(self._notes, hang=Hang("reset" if starting else "step", err.deadline_s))
            allows = RESET_VARIABLE if starting else f"--step-deadline or {STEP_VARIABLE}"
            reason = f"timeout: the driver hangs: {one_line(err)}; {allows} allows more"
            return RunEnd(Verdict.TIMEOUT, time_s, "", reason)
        return RunEnd(Verdict.CRASH, time_s, "", fault.text)

    def finish(self, run_end: RunEnd) -> RunResult:
        """Return the run's result, with the trace, after the end that a frame or `reset` decided."""
        infractions = self._rules.end(run_end) if self._rules is not None else ()
        if run_end.verdict is Verdict.PASS and self._conditions.arrived("ego"):
            self._recorder.event(run_end.time_s, "ego", "arrived")
        elif run_end.verdict.is_collision:
            detail = {"with": run_end.with_, "verdict": run_end.verdict.value}
            self._recorder.event(run_end.time_s, "ego", "collision" if run_end.with_ else "off_road", detail)
        expectations = self._expectations.results()
        broken = [result for result in expectations if not result.held]
        series = self._expectations.goal()
        goal = series.margin(held=all(result.name != series.name for result in broken)) if series is not None else None
        failing = tuple(infraction for infraction in infractions if infraction.rule.fails)
        if run_end.verdict is Verdict.PASS and goal is not None and not goal.held:
            run_end = replace(run_end, verdict=Verdict.GOAL)
        elif self._fails and failing and run_end.verdict is Verdict.PASS:
            run_end = _of_rules(run_end, failing)
        reason = run_end.reason
        if run_end.verdict in (Verdict.PASS, Verdict.GOAL):
            begins = "goal: " if run_end.verdict is Verdict.GOAL else ""
            sentences = "; ".join((*(result.broken_sentence for result in broken), reason))
            # A mutant's file quotes the reason, and a text of the language cannot contain double quotes.
            reason = f"{begins}{sentences}".replace('"', "'")
        deviation = self._follower.deviation if self._follower is not None else None
        if deviation is not None and deviation.is_large:
            reason = f"{reason}; the ego did not follow its driver's plan: it was {deviation.sentence}"
        meta = {
            "test_case": self._bundle.name,
            "driver": self._driver.name,
            "driver_version": self._driver.version,
            "seed": self._seed,
            "verdict": run_end.verdict.value,
            "reason": reason,
            "infractions": [asdict(infraction) for infraction in infractions],
            **({"tracking": asdict(deviation)} if deviation is not None else {}),
            **({"goal": series.as_meta()} if series is not None else {}),
            **self._meta,
        }
        with Part.DIRECTOR:
            record = self._director.record()
        trace = self._recorder.trace(_waypoints(self._bundle), meta, record)
        return RunResult(
            verdict=run_end.verdict,
            time_s=run_end.time_s,
            with_=run_end.with_,
            reason=reason,
            duration_s=trace.duration_s,
            steps=self._steps,
            trace=trace,
            expectations=expectations,
            infractions=infractions,
            goal=goal,
            impact=run_end.impact,
            notes=self._notes,
            tracking=deviation,
        )


def _of_rules(run_end: RunEnd, infractions: tuple[Infraction, ...]) -> RunEnd:
    """Return the result of a run that passed but broke a traffic rule: it fails by that rule."""
    first, *others = infractions
    more = f" ({len(others)} more)" if others else ""
    reason = f"rule: ego {first.clause} at {first.time_s:.2f} s{more}; {run_end.reason}"
    return replace(run_end, verdict=Verdict.RULE, with_=first.other, reason=reason)


def _waypoints(bundle: SumoBundle) -> FloatArray:
    """Return points of the ego's route from its start to the route's end, one every 2 m."""
    line = bundle.scene.ego.line
    if line is None:
        return np.empty((0, 2))
    marks = np.arange(bundle.scene.start_s, line.end_s + 1e-9, WAYPOINT_M)
    return np.stack([np.interp(marks, line.s, line.points[:, axis]) for axis in (0, 1)], axis=1)
