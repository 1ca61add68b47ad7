"""Conditions on a recording: each measure and fact is that which the core computes in the run that was recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from foresee_recordings.exporting.runs import recording_of
from foresee_recordings.mining.conditions import FAILS, HOLDS, UNKNOWN, truths
from foresee_recordings.mining.measures import values
from foresee_recordings.mining.query import Query
from foresee_recordings.mining.rows import Rows
from foresee_recordings.mining.traffic import Traffic
from foresee_recordings.recording import RecordedMap, RecordingError

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.language import model as m
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.simulate.triggers.condition_history import Watch
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.measures import measured
from foresee_dsl.simulate.triggers.unfired import ConditionReplay

TEXT = """foresee 1

scenario recorded {
  use network "%s/networks/town.foresee"

  ego: car.sedan {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 60 m along ego.route
    start speed 45 km/h
  }
  vehicle lead: car.compact {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 22 m ahead of ego
    start speed 25 km/h
  }
  bicycle cyclist: bicycle.city {
    path [4 m ahead of ego offset 6 m, 40 m ahead of ego offset 6 m, 70 m ahead of ego offset 2 m]
    start speed 5 m/s
  }
  pedestrian walker: pedestrian.adult {
    path [30 m ahead of ego offset -6 m, 30 m ahead of ego offset 9 m]
  }

  when time > 0.5 s { lead stops }

  end after 5 s
}
"""
PAIRS = [("ego", "lead"), ("lead", "ego"), ("ego", "walker"), ("walker", "ego"), ("cyclist", "ego"), ("ego", "cyclist")]


@dataclass(frozen=True)
class Recorded:
    """A run of the core, and the same run as a recording."""

    trace: Trace
    replay: ConditionReplay
    conditions: Conditions
    rows: Rows


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, scenarios: Path) -> Recorded:
    file = tmp_path_factory.mktemp("recorded") / "recorded.foresee"
    file.write_text(TEXT % scenarios)
    case = load_test_case(str(file))
    trace = run_test_case(case, "idm", 0).trace
    bundle = compile_test_case(case)
    replay = ConditionReplay(bundle, trace)
    traffic = Traffic(recording_of(trace, roads=RecordedMap(bundle.net_file.read_text(), ".net.xml")))
    frames = np.arange(trace.frames)
    actors = {name: np.full(len(frames), number) for name, number in traffic.ids.items()}
    states = {name: traffic.rows(number, frames) for name, number in traffic.ids.items()}
    rows = Rows(traffic, frames, actors, states, np.zeros(len(frames), np.int64))
    return Recorded(trace, replay, Conditions(replay, bundle.signals), rows)


@pytest.mark.parametrize("what", ["distance", "ttc", "headway", "lateral", "overlap", "ttc_along", "relative_speed"])
def test_measures_between_actors_are_those_of_the_run(recorded: Recorded, what: str) -> None:
    for actor, other in PAIRS:
        measure = m.Measure(what=what, actor=actor, other=other)
        ours, theirs = values(measure, recorded.rows), []
        bound = measured(measure, recorded.conditions)
        for frame in range(recorded.trace.frames):
            recorded.replay.go_to(frame)
            theirs.append(bound.value())
        finite = np.isfinite(theirs)
        assert (np.isfinite(ours) == finite).mean() > 0.99, (actor, other)
        exact = what in ("distance", "ttc", "headway", "relative_speed")
        # Along a way: the way of a run is its route, that of a recording the line that was driven.
        tolerance = 1e-9 if exact else 0.12
        np.testing.assert_allclose(ours[finite], np.array(theirs)[finite], rtol=1e-6 if exact else 0.03, atol=tolerance)


def test_measures_of_an_actor_are_those_of_the_run(recorded: Recorded) -> None:
    trace = recorded.trace
    for k, actor in enumerate(("ego", "lead")):
        assert trace.index(actor) == k
        speed = values(m.Measure(what="speed", actor=actor), recorded.rows)
        np.testing.assert_allclose(speed, trace.states[:, k, 3], atol=1e-9)
        acceleration = values(m.Measure(what="acceleration", actor=actor), recorded.rows)
        # The slope over 0.6 s follows a change of the acceleration later, but has the same mean.
        assert acceleration.mean() == pytest.approx(trace.states[1:, k, 4].mean(), abs=0.15)
    np.testing.assert_allclose(values(m.Measure(what="time"), recorded.rows), trace.time_s, atol=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        "distance(ego, lead) < 12 m",
        "ttc(ego, lead) < 3 s and lead ahead of ego",
        "ttc(ego, walker) < 2 s or ttc(ego, lead) < 2 s",
        "not headway(ego, lead) < 1.5 s",
        "ego.speed > 8 m/s for 1 s",
        "not (lead.speed > 3 m/s for 0.5 s) and ego behind lead",
        "(distance(ego, lead) < 15 m and ego.speed > 2 m/s) for 0.6 s",
        "ego behind lead",
        "walker ahead of ego",
        "cyclist behind ego",
        "lead in lane of ego",
        "cyclist in lane of ego",
        "ego within 8 m of walker",
        "ego within 20 m of (0 m, 0 m)",
        "collision(ego)",
        "collision(walker)",
        "ego in junction",
        "ego in junction mill_oak",
        "ego in lane 1 of mill_west",
        "walker in lane 1",
    ],
)
def test_a_condition_holds_at_the_frames_of_the_run(recorded: Recorded, text: str) -> None:
    condition = Query.of(text).condition
    watch, theirs = Watch(condition, recorded.conditions), []
    for frame in range(recorded.trace.frames):
        recorded.replay.go_to(frame)
        outcome = watch.look()
        theirs.append(UNKNOWN if outcome is None else HOLDS if outcome.held else FAILS)
    ours = truths(condition, recorded.rows)
    differ = np.flatnonzero(ours != np.array(theirs))
    # Facts along a way may begin a frame earlier or later.
    assert len(differ) <= (2 if "ahead" in text or "behind" in text else 0), differ


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("ttc(ego, other) < 2 m", "compares a time with a length"),
        ("arrived(ego)", "no goal"),
        ("ego.signal(j4) is red", "cannot be searched for"),
        ("ego.eta(j4) < 2 s", "no planned route"),
        ("ego sees walker", "cannot be searched for"),
        ("ego.offset > 1 m", "no planned route"),
        ("ego.speed", "is not a condition"),
        ("ego.speed > 3 m/s }", "is not"),
        ("ego.speed > 3 m/s\n  end after 3 s", "is not one condition"),
    ],
)
def test_what_cannot_be_searched_for_is_said(text: str, why: str) -> None:
    with pytest.raises(RecordingError, match=why):
        Query.of(text)
