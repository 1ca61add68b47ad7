"""Traffic rules: what the ego breaks, when and where; and what it could not help."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.steps.explanations import explained
from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Control, Mission, Observation, VehicleLimits
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.infraction import Rule
from foresee_dsl.simulate.results.verdict import RunResult, Verdict
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.trace import SPEED, STEP_S, X
from foresee_dsl.story.story import ContactClass
from tests.support.scenes import LaneKeeper

SIGNALS = """
  network cross {
    junction middle at (0 m, 0 m) signals {
      stage ew_go for 30 s green [west, east]
      stage ns_go for 30 s green [south, north]
    }
    junction west_end at (-150 m, 0 m)
    junction east_end at (150 m, 0 m)
    junction south_end at (0 m, -150 m)
    junction north_end at (0 m, 150 m)
    road west from west_end to middle
    road east from east_end to middle
    road south from south_end to middle
    road north from north_end to middle
  }
"""
STOPS = SIGNALS.replace(
    """signals {
      stage ew_go for 30 s green [west, east]
      stage ns_go for 30 s green [south, north]
    }""",
    "stop",
)
PRIORITY = SIGNALS.replace(
    """signals {
      stage ew_go for 30 s green [west, east]
      stage ns_go for 30 s green [south, north]
    }""",
    "right_before_left",
)
STREET = """
  network street {
    junction west_end at (-150 m, 0 m)
    junction east_end at (150 m, 0 m)
    road west from west_end to east_end { sidewalk 2 m }
    zebra school on west at 150 m
  }
"""
EGO = "ego: car.sedan { route from west straight over middle; start at 40 m along west; start speed 36 km/h }\n"
ALONE = EGO.replace(" straight over middle", "")
EMPTY_STREET = STREET.replace("    zebra school on west at 150 m\n", "")
WALKER = """
  pedestrian walker: pedestrian.adult {
    path [150 m along west offset SIDE m, 150 m along west offset END m]
    speed 5 km/h
  }
"""


class Stopping(LaneKeeper):
    """Follows its lane, and stands from one time to another, s."""

    def __init__(self, speed_mps: float, from_s: float, until_s: float = 1e9) -> None:
        super().__init__(speed_mps)
        self._from_s, self._until_s, self._cruise_mps = from_s, until_s, speed_mps

    def step(self, observation: Observation) -> Control:
        stands = self._from_s <= observation.time_s < self._until_s
        self.speed_mps = 0.0 if stands else self._cruise_mps
        return super().step(observation)


def drive(folder: Path, text: str, driver: LaneKeeper, rules: RulesMode = RulesMode.FAIL) -> RunResult:
    file = folder / "small.foresee"
    file.write_text(f"foresee 1\n\nscenario small {{\n{text}\n  end after 20 s anywhere\n}}\n", encoding="utf-8")
    result = run(compile_test_case(load_test_case(str(file))), driver, rules=rules)
    assert result.verdict is not Verdict.CRASH, result.reason
    return result


def broken(result: RunResult) -> list[tuple[Rule, str, str]]:
    return [(infraction.rule, infraction.place, infraction.other) for infraction in result.infractions]


def test_a_red_light_is_run_when_the_front_passes_the_line(tmp_path: Path) -> None:
    text = SIGNALS + EGO + "  signal middle stage ns_go elapsed 2 s"
    result = drive(tmp_path, text, LaneKeeper(10.0))
    assert broken(result) == [(Rule.RED, "middle", "")]
    assert result.infractions[0].sentence == f"ego runs red at middle, {result.infractions[0].time_s:.2f} s"
    assert drive(tmp_path, text, Stopping(10.0, 7.0)).infractions == ()
    assert (
        drive(tmp_path, text.replace("stage ns_go elapsed", "stage ew_go elapsed"), LaneKeeper(10.0)).infractions == ()
    )


def test_a_light_that_turns_red_too_late_to_stop_is_not_run(tmp_path: Path) -> None:
    """The ego is 30 m before the line and would need 37 m; the run begins with 1 s of amber left."""
    ego = EGO.replace("40 m", "108 m").replace("36 km/h", "48 km/h")
    text = SIGNALS + ego + "  signal middle stage ew_go elapsed 32 s"
    assert drive(tmp_path, text, LaneKeeper(13.3)).infractions == ()
    assert broken(drive(tmp_path, text.replace("108 m", "80 m"), LaneKeeper(13.3))) == [(Rule.RED, "middle", "")]


def test_a_stop_sign_asks_for_a_stop_near_the_line(tmp_path: Path) -> None:
    result = drive(tmp_path, STOPS + EGO, LaneKeeper(10.0))
    assert broken(result) == [(Rule.STOP, "middle", "")]
    assert result.infractions[0].value == pytest.approx(10.0, abs=0.5)
    assert result.verdict is Verdict.PASS  # the driver is not told where stop signs are


@pytest.mark.parametrize(
    ("path", "ego_at", "way_taken"),
    [
        ((-8, 9), 100, True),
        ((-13, 9), 100, False),  # it is still far from the crossing
        ((-4, 9), 100, False),  # it has crossed
        ((-8, 9), 90, True),  # it is in the ego's way when the ego comes
        ((9, -8), 90, True),
        ((9, -8), 100, True),  # it walks towards the ego's way
        ((9, -8), 110, False),  # the ego has passed when it comes
    ],
)
def test_a_zebra_crossing_belongs_to_who_walks_towards_the_ego_s_way(
    tmp_path: Path, path: tuple[int, int], ego_at: int, way_taken: bool
) -> None:
    walker = WALKER.replace("SIDE", str(path[0])).replace("END", str(path[1]))
    result = drive(tmp_path, STREET + ALONE.replace("40 m", f"{ego_at} m") + walker, LaneKeeper(10.0))
    assert broken(result) == ([(Rule.CROSSING, "school", "walker")] if way_taken else [])


@pytest.mark.parametrize(
    ("arm", "at", "way_taken"), [("south", 20, True), ("south", 2, False), ("north", 30, False), ("north", 12, False)]
)
def test_who_comes_from_the_right_goes_first(tmp_path: Path, arm: str, at: int, way_taken: bool) -> None:
    other = (
        f"vehicle other: car.compact {{ route from {arm} straight over middle; start at {at} m along {arm}; "
        "start speed 40 km/h; speed 40 km/h; ignores priority }\n"
    )
    result = drive(tmp_path, PRIORITY + EGO + other, LaneKeeper(10.0))
    assert broken(result) == ([(Rule.PRIORITY, "middle", "other")] if way_taken else [])


@pytest.mark.parametrize(
    ("elapsed", "start_m", "way_taken"),
    [(0, 20, True), (0, 10, False), (24, 20, False)],
)
def test_who_turns_left_on_green_lets_oncoming_vehicles_pass_if_they_have_green(
    tmp_path: Path, elapsed: int, start_m: int, way_taken: bool
) -> None:
    """From 24 s elapsed, both have red when they meet: then the oncoming vehicle has no right of way."""
    text = SIGNALS + EGO.replace("straight", "left").replace("40 m along", "60 m along")
    other = (
        f"vehicle oncoming: car.compact {{ route from east straight over middle; start at {start_m} m along east; "
        "start speed 40 km/h; speed 40 km/h; ignores priority }\n"
    )
    result = drive(tmp_path, text + other + f"  signal middle stage ew_go elapsed {elapsed} s", LaneKeeper(8.0))
    taken = [infraction for infraction in broken(result) if infraction[0] is Rule.PRIORITY]
    assert taken == ([(Rule.PRIORITY, "middle", "oncoming")] if way_taken else [])


def test_the_limit_is_exceeded_as_long_as_it_is(tmp_path: Path) -> None:
    text = SIGNALS + EGO + "  signal middle stage ew_go elapsed 2 s"
    (infraction,) = drive(tmp_path, text, LaneKeeper(18.0)).infractions
    assert (infraction.rule, infraction.place) == (Rule.SPEED, "west")
    assert infraction.value == pytest.approx(18.0 - 50 / 3.6, abs=0.3)
    assert infraction.until_s > infraction.time_s + 1.0


class Pulse(LaneKeeper):
    """Drives at 10 m/s, and from 1 s on at up to 15.6 m/s for a time, s."""

    def __init__(self, for_s: float) -> None:
        super().__init__(10.0)
        self._until_s = 1.0 + for_s

    def step(self, observation: Observation) -> Control:
        self.speed_mps = 15.6 if 1.0 <= observation.time_s < self._until_s else 10.0
        return super().step(observation)


TOLERATED_MPS = 53 / 3.6
"""The limit and 3 km/h."""


@pytest.mark.parametrize(("for_s", "faster"), [(3.0, False), (3.5, True)])
def test_who_is_faster_for_less_than_a_second_is_not_reported(tmp_path: Path, for_s: float, faster: bool) -> None:
    result = drive(tmp_path, EMPTY_STREET + ALONE, Pulse(for_s))
    above_s = np.count_nonzero(result.trace.states[:, 0, SPEED] > TOLERATED_MPS) * STEP_S
    assert above_s == pytest.approx(1.35 if faster else 0.85, abs=0.16)
    assert broken(result) == [(Rule.SPEED, "west", "")] * faster


@pytest.mark.parametrize(("speed_mps", "faster"), [(14.6, False), (14.8, True)])
def test_three_km_h_over_the_limit_are_not_reported(tmp_path: Path, speed_mps: float, faster: bool) -> None:
    result = drive(tmp_path, EMPTY_STREET + ALONE, LaneKeeper(speed_mps))
    assert broken(result) == [(Rule.SPEED, "west", "")] * faster


class Slowing(LaneKeeper):
    """Slows from 72 km/h with a deceleration, m/s^2."""

    def __init__(self, slows_mps2: float) -> None:
        super().__init__(20.0)
        self._slows_mps2 = slows_mps2

    def step(self, observation: Observation) -> Control:
        self.speed_mps = 20.0 - self._slows_mps2 * observation.time_s
        wanted = super().step(observation)
        brake = self._slows_mps2 / self._vehicle.emergency_braking_mps2 if observation.time_s < 6 else 0.0
        return Control(wanted.steer, 0.0, brake)


@pytest.mark.parametrize(("slows_mps2", "faster"), [(1.1, False), (0.85, True)])
def test_who_begins_above_the_limit_has_to_slow_down_by_1_m_s2(tmp_path: Path, slows_mps2: float, faster: bool) -> None:
    result = drive(tmp_path, EMPTY_STREET + ALONE.replace("36 km/h", "72 km/h"), Slowing(slows_mps2))
    assert broken(result) == [(Rule.SPEED, "west", "")] * faster


class Left(LaneKeeper):
    """Follows a line 3.3 m to the left of its own."""

    def reset(self, mission: Mission, vehicle: VehicleLimits, seed: int) -> None:
        super().reset(mission, vehicle, seed)
        along = np.gradient(self._line, axis=0)
        self._line = self._line + 3.3 * np.stack([-along[:, 1], along[:, 0]], 1) / np.hypot(*along.T)[:, None]


def test_the_wrong_side_counts_where_there_is_nothing_to_pass(tmp_path: Path) -> None:
    (infraction,) = drive(tmp_path, EMPTY_STREET + ALONE, Left(10.0)).infractions
    assert (infraction.rule, infraction.place) == (Rule.SIDE, "west")
    assert infraction.until_s - infraction.time_s > 10.0
    parked = "\n".join(f"obstacle car_{k}: obstacle.crate {{ start at {k} m along west }}" for k in range(60, 300, 15))
    assert drive(tmp_path, EMPTY_STREET + ALONE + parked, Left(10.0)).infractions == ()


def test_what_stands_up_to_15_m_away_may_be_passed_on_the_other_side(tmp_path: Path) -> None:
    crate = "obstacle crate: obstacle.crate { start at 150 m along west }\n"
    result = drive(tmp_path, EMPTY_STREET + ALONE + crate, Left(10.0))
    before, behind = result.infractions
    trace = result.trace
    lengths_m = (trace.actors[0].length_m + trace.actors[1].length_m) / 2
    for at_s, sign in ((before.until_s, -1), (behind.time_s, 1)):
        away_m = sign * (trace.states[trace.frame_at(at_s), 0, X] - trace.states[0, 1, X])
        assert away_m == pytest.approx(15.0 + lengths_m, abs=0.6)  # a frame is 0.5 m


RIGHT = (
    "vehicle right: car.compact { route from south straight over middle; start at 10 m along south;"
    " start speed 40 km/h }\n"
)


def test_a_junction_is_blocked_where_another_waits_for_it_for_5_s(tmp_path: Path) -> None:
    result = drive(tmp_path, PRIORITY + EGO + RIGHT, Stopping(10.0, 10.6))
    (blocked,) = (infraction for infraction in result.infractions if infraction.rule is Rule.BLOCKED)
    assert drive(tmp_path, PRIORITY + EGO, Stopping(10.0, 10.6)).infractions == ()
    for for_s, broken_rules in ((4.8, []), (5.3, [(Rule.BLOCKED, "middle", "")])):
        driver = Stopping(10.0, 10.6, blocked.time_s + for_s)
        assert broken(drive(tmp_path, PRIORITY + EGO + RIGHT, driver)) == broken_rules


def test_a_run_that_breaks_a_rule_fails_passes_or_is_not_examined(tmp_path: Path) -> None:
    text = SIGNALS + EGO + "  signal middle stage ns_go elapsed 2 s"
    failed, reported, off = (drive(tmp_path, text, LaneKeeper(10.0), mode) for mode in RulesMode)
    at = failed.infractions[0].time_s
    assert (failed.verdict, failed.passed) == (Verdict.RULE, False)
    assert failed.reason == f"rule: ego runs red at middle at {at:.2f} s; drove to the end at {failed.time_s:.2f} s"
    assert failed.trace.meta["verdict"] == "rule"
    assert (reported.verdict, reported.passed, reported.infractions) == (Verdict.PASS, True, failed.infractions)
    assert (off.verdict, off.infractions) == (Verdict.PASS, ())
    assert failed.trace.digest == reported.trace.digest == off.trace.digest


def test_the_story_of_a_broken_rule_ends_where_it_is_broken(tmp_path: Path) -> None:
    text = SIGNALS + EGO + "  signal middle stage ns_go elapsed 2 s"
    result = drive(tmp_path, text, LaneKeeper(10.0))
    case = load_test_case(str(tmp_path / "small.foresee"))
    told = explained(case, result)
    at = result.infractions[0].time_s
    assert told.story is not None
    assert told.story.sentence == f"the ego runs red at 'middle' at {at:.2f} s; it drives on at 36 km/h then"
    assert (told.story.contact, told.story.ego_manoeuvre) == (ContactClass.RULE, "red light")
    assert (at, "rule", "the ego runs red at 'middle'") in {(m.time_s, m.kind, m.text) for m in told.story.moments}
    assert all("broke a traffic rule" in judgement.why for judgement in told.judgements)


@pytest.mark.parametrize(
    ("driver", "held", "eventually"), [(LaneKeeper(10.0), False, False), (Stopping(10.0, 3.3, 9.0), True, True)]
)
def test_giving_way_is_a_condition(tmp_path: Path, driver: LaneKeeper, held: bool, eventually: bool) -> None:
    ego = EGO.replace(" straight over middle", "").replace("40 m", "100 m")
    lines = """
  expect always ego yields to walker at crossing of school
  expect eventually ego yields to walker at crossing
  expect never ego runs red
"""
    result = drive(tmp_path, STREET + ego + WALKER.replace("SIDE", "-8").replace("END", "9") + lines, driver)
    assert [line.held for line in result.expectations] == [held, eventually, True]


@pytest.mark.parametrize(("stage", "held"), [("ns_go", False), ("ew_go", True)])
def test_running_red_is_a_condition_of_any_actor_with_a_route(tmp_path: Path, stage: str, held: bool) -> None:
    other = """
  vehicle rude: car.compact {
    route from south straight over middle
    start at 60 m along south
    start speed 40 km/h
    ignores signals
  }
"""
    lines = f"  signal middle stage {stage} elapsed 2 s\n  expect never rude runs red at middle\n"
    result = drive(tmp_path, SIGNALS + EGO.replace("36 km/h", "0 km/h") + other + lines, LaneKeeper(0.0))
    assert [line.held for line in result.expectations] == [not held]
