"""Which triggers of a run never fired, and how near they came."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.execution.runs import case_run, with_unfired
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.compile import compile_test_case
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import When
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.report.terminal.runs import print_case_run, print_case_runs
from foresee_dsl.simulate.results.verdict import RunResult, UnfiredTrigger
from foresee_dsl.simulate.trace import SPEED
from foresee_dsl.simulate.triggers.condition_history import Watch
from foresee_dsl.simulate.triggers.conditions import Conditions
from foresee_dsl.simulate.triggers.unfired import ConditionReplay

TEXT = """foresee 1

scenario never {
  use network "%s/networks/town.foresee"

  ego: car.sedan {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 90 m along ego.route
    start speed 40 km/h
  }
  vehicle lead: car.compact {
    route from mill_west straight over mill_oak straight over mill_elm
    start at 26 m ahead of ego
    start speed 30 km/h
  }
  pedestrian walker: pedestrian.adult {
    path [20 m past mill_oak on ego.route offset -5 m, 20 m past mill_oak on ego.route offset 9 m]
  }

  when late: ego.eta(mill_elm) < 2 s { walker starts }
  when ttc(ego, lead) < 0.1 s or lead.speed > 60 km/h { lead stops }
  when lead.speed > 9 m/s for 3 s and time > 0.5 s { lead stops }
  when lead.speed < 8.1 m/s and time < 0.5 s and ego.speed > 1 m/s { lead stops }
  when ego.signal(mill_elm) is amber and not ego behind lead { lead stops }
  when time > 0.5 s {
    lead changes speed to 8 m/s over 1 s
    then when ego within 1 m of walker { lead stops }
  }
  when time > 99 s { lead stops }
  when lead.speed > 9 m/s { lead changes speed to 9.5 m/s over 1 s }
  when ego ahead of lead or lead in junction mill_oak { walker starts }
  when ego sees walker { lead stops }
  when collision(lead) { lead stops }
  when arrived(ego) { lead stops }
  when ego runs red at mill_elm or ego yields to lead at mill_elm { lead stops }

  end after 4 s
}
"""


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory, scenarios: Path) -> tuple[TestCase, RunResult]:
    file = tmp_path_factory.mktemp("never") / "never.foresee"
    file.write_text(TEXT % scenarios)
    case = load_test_case(str(file))
    result = run_test_case(case, "idm", 0)
    assert result.unfired == ()  # a campaign's runs are not looked at again
    return case, with_unfired(case, "idm", result)


def by_text(result: RunResult) -> dict[str, UnfiredTrigger]:
    return {one.text: one for one in result.unfired}


def test_what_never_fired_and_what_could_not(driven: tuple[TestCase, RunResult]) -> None:
    case, result = driven
    assert result.trace.director is not None
    silent = {k for k, states in enumerate(result.trace.director.triggers) if states[-1].fired_s is None}
    after_the_end = 6
    steps = [one for one in result.unfired if one.where]
    assert {one.index for one in result.unfired if not one.where} == silent - {after_the_end}
    assert [(one.index, one.where, one.text) for one in steps] == [(5, (1,), "ego within 1 m of walker")]
    assert steps[0].since_s == pytest.approx(1.55, abs=0.1)
    assert by_text(result)["ego.eta(mill_elm) < 2 s"].name == "late"
    assert len(case.scenario.all(When)) == len(silent) + 2 + (8 not in silent)


def test_how_near_it_came_is_what_the_trace_says(driven: tuple[TestCase, RunResult]) -> None:
    _, result = driven
    trace, found = result.trace, by_text(driven[1])
    (held,) = found["lead.speed > 9 m/s for 3 s and time > 0.5 s"].nearest
    fast = trace.states[:, trace.index("lead"), SPEED] > 9.0
    runs = np.split(np.arange(len(fast)), np.flatnonzero(np.diff(fast.astype(int))) + 1)
    longest = max((r for r in runs if fast[r[0]]), key=len)
    assert held.held_s == pytest.approx((len(longest) - 1) * 0.05)
    together = found["lead.speed < 8.1 m/s and time < 0.5 s and ego.speed > 1 m/s"]
    if fast.any() and (trace.states[:, trace.index("lead"), SPEED] < 8.1).any():
        assert together.together
        assert [n.held for n in together.nearest] == [True]
    either = found["ttc(ego, lead) < 0.1 s or lead.speed > 60 km/h"].nearest[0]
    assert either.text in ("ttc(ego, lead) < 0.1 s", "lead.speed > 60 km/h")
    seen, hit, there = (found[fact].nearest[0] for fact in ("ego sees walker", "collision(lead)", "arrived(ego)"))
    assert "hidden" in seen.words or "too far" in seen.words
    assert hit.note == "ego"
    gaps = np.hypot(*(trace.states[:, 0, :2] - trace.states[:, trace.index("lead"), :2]).T)
    assert hit.value == pytest.approx(gaps.min() - (trace.actors[0].length_m + trace.actors[1].length_m) / 2, abs=0.05)
    assert there.time_s == pytest.approx(trace.duration_s)
    assert there.words.endswith(", to go")
    signal = found["ego.signal(mill_elm) is amber and not ego behind lead"].nearest
    assert signal[0].value is None
    assert signal[0].words == "it never held"
    assert signal[1].short is not None and signal[1].short > 5.0


def test_a_replay_is_the_run(driven: tuple[TestCase, RunResult]) -> None:
    """Conditions that are asked of the trace fire at the very frames of the run."""
    case, result = driven
    bundle = compile_test_case(case)
    replay = ConditionReplay(bundle, result.trace)
    watches = [Watch(when.condition, conditions) for conditions in [Conditions(replay, bundle.signals)]
               for when in bundle.scene.whens]  # fmt: skip
    first: dict[int, float] = {}
    for frame in range(result.trace.frames):
        replay.go_to(frame)
        for signal in bundle.signals.values():  # the rules of giving way read whole states
            assert replay.world.signals.state(signal.tls) in {phase.state for phase in signal.phases}
        for index, watch in enumerate(watches):
            said = watch.look()
            assert watch.held() is (None if said is None else said.held)
            if watch.holds():
                first.setdefault(index, replay.time_s)
    fired = {e.detail["index"]: e.time_s for e in reversed(result.trace.events) if e.what == "trigger"}
    assert first == fired
    assert not math.isnan(replay.ego.x)


def test_it_is_printed_within_eighty_columns(driven: tuple[TestCase, RunResult]) -> None:
    case, result = driven
    console = Console(width=80, force_terminal=True, color_system=None, record=True)
    with console.capture() as printed:
        print_case_run(console, case_run(case, result), None)
    lines = printed.get().splitlines()
    never = [line for line in lines if line.startswith("  never ")]
    assert len(never) == len(result.unfired)
    assert any(line.startswith("  never   when late: `ego.eta(mill_elm) < 2 s`; nearest ") for line in never)
    assert max(map(len, lines[1:])) <= 80
    with console.capture() as printed:
        print_case_runs(console, [case_run(case, result)] * 2, 2, {})
    assert "in none of 2 cases of never.foresee:" in printed.get()


def test_a_clip_does_not_nag(driven: tuple[TestCase, RunResult]) -> None:
    case, result = driven
    point = RiskyPoint(1, 40, 2.0, "", "none", float("nan"), float("nan"), 0.0, "a test")
    file = case.source.parent / "clip.foresee"
    made = clip_around(case, result.trace, point, file, before_s=0.0, after_s=1.0)
    _, clip, run, _ = measure_clip(made, case, result.trace, file, DriverSetup("idm"))
    run = with_unfired(clip, "idm", run)
    assert run.unfired  # it is known, and not printed
    console = Console(width=80, color_system=None)
    with console.capture() as printed:
        print_case_run(console, case_run(clip, run), None)
    assert "never   when" not in printed.get()
