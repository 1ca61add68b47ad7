"""Whether conditions hold, since when, and by how much: cases worked out by hand."""

from __future__ import annotations

import math

import pytest

from foresee_dsl.language.model import Expect, Scenario, When
from foresee_dsl.language.parser import parse
from foresee_dsl.simulate.results.verdict import ExpectationResult
from foresee_dsl.simulate.runner import run
from foresee_dsl.simulate.triggers.conditions import ConditionOutcome, every, some
from tests.support.scenes import Cruise, LaneKeeper, Town

EAST = ("n01_n11", "n11_n21", "n21_n31")
STANDS = ("n30_n20", "n20_n10")


def expects(*lines: str) -> tuple[Expect, ...]:
    body = "\n".join(f"  {line}" for line in lines)
    model = parse(f"foresee 1\n\nscenario s {{\n{body}\n}}\n", "s.foresee").model
    assert isinstance(model, Scenario)
    return model.all(Expect)


def judge(town: Town, *lines: str, speed: float = 8.0, end_s: float = 3.0) -> list[ExpectationResult]:
    """An ego that keeps a speed, and a lead that stands 60 m ahead of its start."""
    ego = town.ego(EAST, 20.0, speed=speed)
    lead = town.vehicle("lead", EAST, 82.0, speed=0.0, waits=True)
    bundle = town.bundle([ego, lead], end_s=end_s, clip=True, expects=expects(*lines))
    return list(run(bundle, LaneKeeper(speed)).expectations)


def metres(margin: float) -> ConditionOutcome:
    return ConditionOutcome(margin > 0, margin, "m", None, "length")


def seconds(margin: float) -> ConditionOutcome:
    return ConditionOutcome(margin > 0, margin, "s", None, "time")


def fact(*, held: bool) -> ConditionOutcome:
    return ConditionOutcome(held)


def test_within_one_dimension_and_is_the_least_and_or_the_most() -> None:
    assert every((metres(3), metres(1), metres(2))) == metres(1)
    assert every((metres(3), metres(-1), metres(-4))) == metres(-4)
    assert some((metres(3), metres(-1), metres(5))) == metres(5)
    assert some((metres(-3), metres(-1))) == metres(-1)


def test_across_dimensions_what_decides_is_told_and_the_first_of_several() -> None:
    assert every((metres(0.1), seconds(-5))) == seconds(-5)
    assert every((seconds(9), metres(0.1))) == seconds(9)
    assert some((metres(-0.1), seconds(2))) == seconds(2)
    assert some((metres(-3), seconds(-0.1), metres(-1))) == metres(-1)


def test_a_fact_without_a_number_gives_way_to_one_that_has_one() -> None:
    assert every((fact(held=True), metres(2))) == metres(2)
    assert every((fact(held=False), metres(2))) is not None
    assert math.isnan(every((fact(held=False), metres(2))).margin)  # type: ignore[union-attr]  # asserted above


def test_what_cannot_be_said_decides_nothing() -> None:
    assert every((None, metres(-1))) == metres(-1)
    assert every((None, metres(1))) is None
    assert some((None, metres(1))) == metres(1)
    assert some((None, metres(-1))) is None
    assert every((metres(1),), unknown=True) is None


def test_a_condition_over_a_time_is_judged_where_it_can_be_said(town: Town) -> None:
    found = judge(
        town,
        "expect always ego.speed < 10 m/s for 2 s",
        "expect never ego.speed < 10 m/s for 2 s",
        "expect eventually ego.speed < 10 m/s for 2 s",
        "expect eventually within 1.9 s ego.speed < 10 m/s for 2 s",
        "expect eventually within 2 s ego.speed < 10 m/s for 2 s",
        "expect always ego.speed < 36 km/h and distance(ego, lead) > 1 m for 1 s",
    )
    assert [e.held for e in found] == [True, False, True, False, True, True]
    assert found[0].unit == "m/s"
    assert found[0].margin == pytest.approx(2.0, abs=0.2)
    assert found[3].margin is None  # it was too early to say
    assert found[5].unit == "km/h"
    assert found[5].decides == "ego.speed < 36 km/h"


def test_margins_are_in_the_unit_that_decides(town: Town) -> None:
    found = judge(
        town,
        "expect near: never ego within 5 m of lead",
        "expect always headway(ego, lead) > 1 s",
        "expect never ego.acceleration < -4 m/s^2 or ego in junction",
        "expect eventually ego in junction n11",
        "expect never arrived(ego)",
        end_s=2.0,
    )
    apart = 82.0 - 4.0 - 20.0 - 16.0  # 16 m driven, the lead is 4 m long
    assert found[0].margin == pytest.approx(apart - 5.0, abs=0.3)
    assert (found[0].unit, found[0].name, found[0].decides) == ("m", "near", "ego within 5 m of lead")
    assert found[0].text == "expect near: never ego within 5 m of lead"
    assert found[1].margin == pytest.approx(apart / 8.0 - 1.0, abs=0.1)
    assert (found[2].unit, found[2].held) == ("m/s^2", True)
    assert (found[3].held, found[3].unit) == (False, "m")
    assert found[3].margin is not None
    assert found[3].margin < -10.0
    assert (found[4].margin, found[4].unit, found[4].held) == (None, "", True)


def test_signals_say_what_they_show(town: Town) -> None:
    link = next(m.link for m in town.network.movements_from(EAST[0]) if m.to_edge == EAST[1])
    phases = town.signals["n11"].phases
    green = next(k for k, p in enumerate(phases) if p.state[link] in "gG" and p.duration_s > 5)
    lines = ("expect always ego.signal(n11) is green", f"expect always signal(n11) is phase_{green}")
    bundle = town.bundle(
        [town.ego(EAST, 20.0, speed=0.0)], end_s=1.0, expects=expects(*lines), signals=(("n11", f"phase_{green}", 0.0),)
    )
    assert [e.held for e in run(bundle, Cruise()).expectations] == [True, True]
    other = next(k for k, p in enumerate(phases) if p.state[link] == "r" and p.duration_s > 1)
    bundle = town.bundle(
        [town.ego(EAST, 20.0, speed=0.0)], end_s=1.0, expects=expects(*lines), signals=(("n11", f"phase_{other}", 0.0),)
    )
    assert [e.held for e in run(bundle, Cruise()).expectations] == [False, False]


def test_a_trigger_waits_for_the_whole_time(town: Town) -> None:
    model = parse(
        "foresee 1\n\nscenario s {\n"
        "  when car.speed > 1 m/s and time > 0.5 s for 1 s { car stops for 0.5 s; wait 1 s\n"
        "    then { car changes speed to 5 m/s; then when car.speed > 4 m/s for 0.5 s { car stops } } }\n"
        "  when next time < 1 s or time > 2 s { car ignores priority }\n}\n",
        "s.foresee",
    ).model
    assert isinstance(model, Scenario)

    car = town.vehicle("car", ("n11_n21", "n21_n31"), 5.0, speed=6.0, cruise=6.0)
    bundle = town.bundle([town.ego(STANDS, 10.0, speed=0.0), car], end_s=12.0, clip=True, whens=model.all(When))
    trace = run(bundle, Cruise()).trace
    steps = [(e.what, e.time_s) for e in trace.events if e.detail.get("index") == 0]
    # `time > 0.5 s` holds from 0.55 s on, for 1 s at 1.55 s
    assert ("trigger", 1.55) in steps
    then = next(t for what, t in steps if what == "then")
    stop = next(e.time_s for e in trace.events if e.what == "complete" and e.detail["where"] == [0])
    wait = next(e.time_s for e in trace.events if e.what == "complete" and e.detail["where"] == [1])
    assert wait == 2.55
    assert then == max(stop, wait)
    last = [e for e in trace.events if e.what == "then"][1]
    assert last.time_s == pytest.approx(
        next(e.time_s for e in trace.events if e.what == "holds" and e.detail["where"] == [2, 1]) + 0.5
    )
    # the other is true from the first frame on: it fires once it has been false
    assert [e.time_s for e in trace.events if e.what == "trigger" and e.detail["index"] == 1] == [2.05]


def test_an_every_that_fires_again_starts_its_sequence_anew(town: Town) -> None:
    model = parse(
        "foresee 1\n\nscenario s {\n"
        "  when every time > 0.5 s and time < 1 s or time > 2 s { wait 2 s; then { car stops } }\n}\n",
        "s.foresee",
    ).model
    assert isinstance(model, Scenario)

    car = town.vehicle("car", ("n11_n21", "n21_n31"), 5.0, speed=6.0, cruise=6.0)
    bundle = town.bundle([town.ego(STANDS, 10.0, speed=0.0), car], end_s=5.0, clip=True, whens=model.all(When))
    events = run(bundle, Cruise()).trace.events
    assert [e.time_s for e in events if e.what == "trigger"] == [0.55, 2.05]
    assert [e.time_s for e in events if e.what == "stops"] == [4.05]  # 2 s after the second time, not the first
