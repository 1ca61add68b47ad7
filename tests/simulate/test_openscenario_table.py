"""docs/reference/openscenario-table.md: every action and condition of OpenSCENARIO XML 1.3 is in it, and what it says
is run: the trace of one scenario, in which all its statements stand, shows the effect of each."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.kernels.boxes import Box, box_distance
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, Event, Trace, X, Y
from tests.support.openscenario_files import BY_VALUE, GLOBAL, OF_ENTITY, PRIVATE

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "openscenario-table.md").read_text(encoding="utf-8")
SCENARIO = Path(__file__).parent / "openscenario" / "table.foresee"
ROWS = dict(re.findall(r"^\| `(\w+)` \| (.+?) \| .*\|$", PAGE, flags=re.M))
SAID = {name: re.findall(r"`([^`]+)`", how) for name, how in ROWS.items() if how != "no"}


class Run:
    """The run of the scenario, and what the checks ask of it."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace

    def of(self, actor: str, field: int, at_s: float) -> float:
        return float(self.trace.states[self.trace.frame_at(at_s), self.trace.index(actor), field])

    def front(self, actor: str, at_s: float) -> float:
        """Where the front is of an actor that drives east, x, m."""
        return self.of(actor, X, at_s) + self.trace.actors[self.trace.index(actor)].length_m / 2

    def stage(self, at_s: float) -> int:
        return int(self.trace.stages[self.trace.frame_at(at_s), 0])

    def fired(self, label: str) -> float:
        """When a trigger fired, by its label."""
        whens = [when.name for when in load_test_case(str(SCENARIO)).scenario.all(_when())]
        event = next(e for e in self.trace.events if e.what == "trigger" and e.detail["index"] == whens.index(label))
        return event.time_s

    def event(self, what: str, actor: str = "") -> Event:
        return next(e for e in self.trace.events if e.what == what and e.actor == actor)

    def apart(self, one: str, other: str, at_s: float) -> float:
        """How far two footprints are from each other."""
        frame = self.trace.frame_at(at_s)
        boxes = [Box(*self.trace.boxes(self.trace.index(name))[frame]) for name in (one, other)]
        return float(box_distance(*boxes))

    def along(self, one: str, other: str, at_s: float) -> float:
        """How far the rear of another is beyond the front of one; both drive east."""
        return self.front(other, at_s) - self.trace.actors[self.trace.index(other)].length_m - self.front(one, at_s)

    def begins(self, label: str, holds: Callable[[float], bool]) -> bool:
        """Whether a trigger fired at the first frame at which something holds."""
        at = self.trace.frame_at(self.fired(label))
        times = self.trace.time_s[: at + 1].tolist()
        return holds(times[-1]) and not any(holds(t) for t in times[:-1])


def _when():  # type: ignore[no-untyped-def]  # the class, imported where it is needed
    from foresee_dsl.language.model import When

    return When


@cache
def the_run() -> Run:
    return Run(run_test_case(load_test_case(str(SCENARIO)), "idm", 0).trace)


def near(value: float, wanted: float, by: float) -> bool:
    return abs(value - wanted) <= by


def _synchronised(run: Run) -> bool:
    """Both fronts come within 3 m of the junction at the same time."""
    reached = []
    for actor, column, line in (("crossing", Y, 22.1), ("lead", X, -14.6)):
        k = run.trace.index(actor)
        front = np.abs(run.trace.states[:, k, column]) - run.trace.actors[k].length_m / 2
        reached.append(float(run.trace.time_s[np.flatnonzero(front <= abs(line))[0]]))
    return near(*reached, by=0.3) and near(run.of("crossing", SPEED, reached[0]), 7.0, 0.5)


def _lateral(run: Run) -> bool:
    """The flanker's right side is 0.8 m from the lead's left one."""
    trace = run.trace
    widths = sum(trace.actors[trace.index(name)].width_m for name in ("flanker", "lead")) / 2
    return near(run.of("flanker", Y, 3.4) - run.of("lead", Y, 3.4) - widths, 0.8, 0.05)


CHECKS: dict[str, Callable[[Run], bool]] = {
    "SpeedAction": lambda run: (
        near(run.of("slower", SPEED, 4.3), 4.0, 0.1)
        and near(run.of("slower", SPEED, 3.05), 7.0, 0.3)
        and near(run.of("matcher", SPEED, 9.0), run.of("lead", SPEED, 9.0) + 1.0, 0.1)
    ),
    "SpeedProfileAction": lambda run: (
        near(run.of("profiled", SPEED, 3.2), 5.0, 0.3) and near(run.of("profiled", SPEED, 6.3), 9.0, 0.3)
    ),
    "LongitudinalDistanceAction": lambda run: (
        near(run.apart("tail", "lead", 14.0), 1.5 * run.of("tail", SPEED, 14.0), 0.3)
        and near(run.apart("leader", "ego", 8.0), 25.0, 1.0)
    ),
    "LaneChangeAction": lambda run: near(run.of("mover", Y, 5.0) - run.of("mover", Y, 0.0), -3.3, 0.1),
    "LaneOffsetAction": lambda run: near(run.of("shifted", Y, 3.5) - run.of("shifted", Y, 0.0), 0.5, 0.05),
    "LateralDistanceAction": _lateral,
    "SynchronizeAction": _synchronised,
    "TeleportAction": lambda run: near(run.front("tail", 0.0), -210.0, 0.1),
    "AssignRouteAction": lambda run: run.trace.actors[run.trace.index("lead")].route == ("west", "east_back"),
    "FollowTrajectoryAction": lambda run: (
        near(run.of("bumper", Y, 5.0), -16.0, 0.1) and run.of("bumper", Y, 18.0) < -20
    ),
    "AcquirePositionAction": lambda run: run.trace.actors[run.trace.index("halts")].route == ("west", "north_back"),
    "AnimationAction": lambda run: (
        math.isnan(run.of("parked_door", X, 2.9)) and near(run.apart("parked", "parked_door", 3.1), 0.0, 0.01)
    ),
    "EnvironmentAction": lambda run: _friction() < 0.8,
    "AddEntityAction": lambda run: run.of("walker", SPEED, 5.9) == 0.0 and run.of("walker", SPEED, 8.0) > 1.0,
    "DeleteEntityAction": lambda run: not math.isnan(run.of("gone", X, 2.9)) and math.isnan(run.of("gone", X, 3.1)),
    "TrafficSignalControllerAction": lambda run: (
        int(run.trace.stages[run.trace.frame_at(9.9), 0]) == 0
        and int(run.trace.stages[run.trace.frame_at(10.1), 0]) == 1
    ),
    "TrafficSwarmAction": lambda run: sum(info.id.startswith("others_") for info in run.trace.actors) == 2,
    "EndOfRoadCondition": lambda run: near(run.fired("at_the_end"), run.event("arrived", "short").time_s, 0.06),
    "CollisionCondition": lambda run: run.begins("hit", lambda t: run.apart("bumper", "bin", t) <= 0.0),
    "TimeHeadwayCondition": lambda run: run.begins(
        "near_in_time", lambda t: run.apart("tail", "lead", t) < 2 * run.of("tail", SPEED, t)
    ),
    "TimeToCollisionCondition": lambda run: (
        run.begins(
            "will_hit",
            lambda t: 0 < run.apart("tail", "lead", t) < 9 * (run.of("tail", SPEED, t) - run.of("lead", SPEED, t)),
        )
        and run.begins(
            "will_pass",
            lambda t: run.along("tail", "flanker", t) < 9 * (run.of("tail", SPEED, t) - run.of("flanker", SPEED, t)),
        )
    ),
    "AccelerationCondition": lambda run: run.begins("brakes", lambda t: run.of("slower", ACCELERATION, t) < -1.0),
    "StandStillCondition": lambda run: run.begins(
        "stands", lambda t: t >= 1.0 and max(run.of("halts", SPEED, t - k / 20) for k in range(21)) < 0.1
    ),
    "SpeedCondition": lambda run: run.begins("slow", lambda t: run.of("slower", SPEED, t) < 6.0),
    "TraveledDistanceCondition": lambda run: near(
        run.of("lead", X, run.fired("came_far")) - run.of("lead", X, 0.0), 59.0, 0.6
    ),
    "ReachPositionCondition": lambda run: near(run.front("lead", run.fired("reached")), -102.0, 0.6),
    "DistanceCondition": lambda run: near(
        run.of("lead", X, run.fired("near_junction")) + run.trace.actors[run.trace.index("lead")].length_m / 2,
        -51.6,
        1.0,
    ),
    "RelativeDistanceCondition": lambda run: (
        run.begins("near", lambda t: run.apart("tail", "lead", t) < 25.0) and 0.5 < run.fired("beside") < 3.5
    ),
    "RelativeSpeedCondition": lambda run: run.begins(
        "as_fast", lambda t: run.of("tail", SPEED, t) - run.of("lead", SPEED, t) < 2.0
    ),
    "SimulationTimeCondition": lambda run: near(run.fired("by_time"), 2.05, 1e-6),
    "StoryboardElementStateCondition": lambda run: near(run.event("starts", "walker").time_s, 6.05, 1e-6),
    "TrafficSignalCondition": lambda run: near(run.fired("sees_red"), 10.0, 1e-6),
    "TrafficSignalControllerCondition": lambda run: near(run.fired("is_side"), 10.0, 1e-6),
}
"""What the trace shows of each row."""


def _friction() -> float:
    from foresee_dsl.compile import compile_test_case

    return compile_test_case(load_test_case(str(SCENARIO))).scene.friction


def test_every_action_and_condition_of_the_standard_has_its_row() -> None:
    assert set(ROWS) == {*PRIVATE, *GLOBAL, *OF_ENTITY, *BY_VALUE}
    reasons = dict(re.findall(r"^\| `(\w+)` \| no \| (.*) \|$", PAGE, flags=re.M))
    assert set(reasons) == set(ROWS) - set(SAID)
    assert all(reasons.values())


@pytest.mark.parametrize("name", SAID)
def test_what_the_table_says_stands_in_the_scenario_and_has_its_effect(name: str) -> None:
    text = " ".join(print_model(load_test_case(str(SCENARIO)).document.model).split())  # type: ignore[union-attr]  # a file
    assert [how for how in SAID[name] if " ".join(re.sub(r"; ", " ", how).split()) not in text] == []
    assert CHECKS[name](the_run())
