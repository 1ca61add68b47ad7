"""Where actors are relative to each other, to lanes and to what hides them: in conditions, in places, and in clips."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from foresee_dsl.campaign.driving import DriverSetup, run_test_case
from foresee_dsl.campaign.steps.clip import measure_clip
from foresee_dsl.campaign.steps.forecast import clip_around
from foresee_dsl.compile import compile_test_case
from foresee_dsl.errors import InputError
from foresee_dsl.forecast.protocol import RiskyPoint
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import When
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_model
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.results.verdict import RunResult
from foresee_dsl.simulate.trace import HEADING, X, Y

HEAD = """foresee 1

scenario where {
  network {
    junction west at (0 m, 0 m)
    junction east at (400 m, 0 m)
    road street from west to east { lanes 2; speed 50 km/h; sidewalk 2 m; parking 2.2 m }
  }

"""
ACTORS = """
  vehicle last: car.compact {
    route [street]
    start at 6 m behind van
    start speed 36 km/h
    speed 36 km/h
  }
  ego: car.sedan {
    route [street]
    start at 100 m along street
    start speed 36 km/h
    speed 36 km/h
    goal 250 m ahead of ego
  }
  vehicle van: van.delivery {
    route [street]
    start at beside ego left 2.4 m
    start speed 54 km/h
    speed 54 km/h
  }
  vehicle lead: car.compact {
    route [street]
    start at 40 m ahead of ego
    start speed 18 km/h
    speed 18 km/h
  }
  vehicle oncoming: car.suv {
    route [street_back]
    start at 150 m along street_back
    start speed 36 km/h
  }
  obstacle parked: obstacle.parked_van {
    start at 60 m ahead of ego offset -2.8 m
  }
  pedestrian walker: pedestrian.child {
    path [2 m ahead of parked offset -1 m, 2 m ahead of parked offset 9 m]
    speed 1.2 m/s
  }

  when passed: van ahead of lead { van changes lane right }
  when near: ego within 1 m of 17 m behind lead for 0.2 s { oncoming stops for 0.5 s }
  when seen: ego sees walker { walker changes speed to 1.4 m/s }
  when stepped: walker in lane of ego and not ego ahead of parked { walker stops }
  when every gaining: relative_speed(ego, lead) > 4 m/s and overlap(ego, lead) > -20 m { lead changes speed to 20 km/h }
"""


def text(*lines: str, actors: str = ACTORS) -> str:
    return "\n".join((HEAD + actors, *(f"  {line}" for line in lines), "  end after 7 s", "}", ""))


def at_once(condition: str) -> str:
    return f"expect eventually within 0 s {condition}"


JUDGED = (
    "lead ahead of ego",
    "ego behind lead",
    "overlap(ego, lead) < 0 m",
    "van ahead of ego",
    "overlap(ego, van) > 0 m",
    "lateral(ego, van) > 0 m",
    "lateral(ego, lead) <= 0 m",
    "oncoming ahead of ego",
    "ttc_along(ego, lead) < 9 s",
    "ttc_along(last, van) < 9 s",
    "ttc_along(ego, van) <= 0 s",
    "ttc_along(ego, oncoming) < 9 s",
    "relative_speed(ego, oncoming) > 0 m/s",
    "relative_speed(ego, van) > 0 m/s",
    "ego.offset > -0.5 m",
    "van.offset < 1 m",
    "ego in lane 1",
    "van in lane 1 of street",
    "van in lane 2 of street",
    "lead in lane of ego",
    "ego in lane of lead",
    "van in lane of ego",
    "oncoming in lane of ego",
    "walker in lane of ego",
    "walker in sight of ego",
    "walker in sight of oncoming",
    "ego sees lead",
    "ego sees walker",
    "ego within 0.5 m of the place of ego",
    "lead within 0.5 m of 40 m ahead of ego",
    "van within 0.5 m of beside ego left 2.4 m",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("where")


@pytest.fixture(scope="module")
def driven(folder: Path) -> tuple[TestCase, RunResult]:
    file = folder / "where.foresee"
    file.write_text(text(*map(at_once, JUDGED)))
    case = load_test_case(str(file))
    return case, run_test_case(case, "idm", 0)


def test_what_is_judged_at_the_first_frame(driven: tuple[TestCase, RunResult]) -> None:
    result = driven[1]
    found = dict(zip(JUDGED, result.expectations, strict=True))
    not_so = {"van ahead of ego", "relative_speed(ego, van) > 0 m/s", "van in lane 1 of street", "van in lane of ego"}
    not_so |= {
        "ttc_along(last, van) < 9 s",
        "oncoming in lane of ego",
        "walker in lane of ego",
        "walker in sight of ego",
        "ego sees walker",
    }
    assert {c for c, e in found.items() if not e.held} == not_so
    sizes = {a.id: (a.length_m, a.width_m) for a in result.trace.actors}
    gap = 40.0 - sizes["lead"][0]
    for condition in ("lead ahead of ego", "ego behind lead", "overlap(ego, lead) < 0 m"):
        assert found[condition].margin == pytest.approx(gap, abs=0.01)
        assert found[condition].unit == "m"
    beside = 2.4 - sizes["van"][1] / 2  # from the ego's side to the van's middle it is 2.4 m
    assert found["lateral(ego, van) > 0 m"].margin == pytest.approx(beside, abs=0.01)
    assert found["lateral(ego, lead) <= 0 m"].margin == 0
    # the van's front is level with the ego's middle
    assert found["overlap(ego, van) > 0 m"].margin == pytest.approx(sizes["ego"][0] / 2, abs=0.01)
    assert found["ttc_along(ego, lead) < 9 s"].margin == pytest.approx(9 - gap / 5, abs=0.05)  # 36 and 18 km/h
    assert found["ttc_along(ego, van) <= 0 s"].margin == 0
    assert found["relative_speed(ego, oncoming) > 0 m/s"].margin == pytest.approx(20.0, abs=0.2)
    assert found["relative_speed(ego, van) > 0 m/s"].margin == pytest.approx(-5.0, abs=0.2)
    assert found["ego.offset > -0.5 m"].margin == pytest.approx(0.5, abs=0.01)
    middle = sizes["ego"][1] / 2 + 2.4 - 3.3  # to the left of the left lane's middle
    assert found["van.offset < 1 m"].margin == pytest.approx(1 - middle, abs=0.01)
    assert found["ego in lane 1"].margin == pytest.approx(1.65, abs=0.01)
    assert found["van in lane 2 of street"].margin == pytest.approx(1.65 - middle, abs=0.01)
    assert found["van in lane of ego"].margin == pytest.approx(1.65 - middle - 3.3, abs=0.01)
    assert found["ego sees lead"].margin is None
    assert found["lead within 0.5 m of 40 m ahead of ego"].margin == pytest.approx(0.5, abs=0.01)


def test_starts_are_counted_from_where_the_other_starts_in_any_order(driven: tuple[TestCase, RunResult]) -> None:
    placed = {a.id: a for a in compile_test_case(driven[0]).scene.actors}
    assert placed["lead"].x - placed["ego"].x == pytest.approx(40.0)
    assert placed["van"].y - placed["ego"].y == pytest.approx(2.4 + placed["ego"].model.width_m / 2)
    assert placed["van"].x == pytest.approx(placed["ego"].x - placed["ego"].model.length_m / 2)
    assert placed["last"].x == pytest.approx(placed["van"].x - placed["van"].model.length_m - 6.0)
    assert placed["last"].lane == placed["van"].lane != placed["ego"].lane
    assert placed["parked"].x == pytest.approx(placed["ego"].x + 60.0)
    assert placed["walker"].path[0][0] == pytest.approx(placed["parked"].x + placed["parked"].model.length_m / 2 + 2.0)


def test_triggers_fire_when_the_trace_says_so(driven: tuple[TestCase, RunResult]) -> None:
    _, result = driven
    trace, whens = result.trace, [w.name for w in driven[0].scenario.all(When)]
    fired = {whens[e.detail["index"]]: e.time_s for e in reversed(trace.events) if e.what == "trigger"}
    x = {a.id: trace.states[:, k, X] for k, a in enumerate(trace.actors)}
    length = {a.id: a.length_m for a in trace.actors}
    beyond = x["van"] - length["van"] / 2 >= x["lead"] + length["lead"] / 2
    assert fired["passed"] == pytest.approx(trace.time_s[np.argmax(beyond)])
    assert set(fired) == set(whens)
    walker = trace.index("walker")
    ego = trace.states[trace.frame_at(fired["stepped"]), 0]
    assert abs(trace.states[trace.frame_at(fired["stepped"]), walker, Y] - ego[Y]) <= 1.66


@pytest.mark.parametrize("at_s", [0.75, 2.5])
def test_a_clip_goes_on_with_the_same_conditions(driven: tuple[TestCase, RunResult], folder: Path, at_s: float) -> None:
    case, result = driven
    trace = result.trace
    point = RiskyPoint(1, trace.frame_at(at_s), at_s, "", "none", float("nan"), float("nan"), 0.0, "a test")
    file = folder / f"clip_{round(at_s * 100)}.foresee"
    made = clip_around(case, trace, point, file, before_s=0.0, after_s=4.0)
    assert parse(print_model(made), str(file)).model == made
    _, _, run, found = measure_clip(made, case, trace, file, DriverSetup("idm"))
    assert found.largest_others_m < 0.011  # of the four decimals of a clip
    later = [e for e in trace.events if e.what == "trigger" and at_s < e.time_s <= at_s + 4.0]
    assert [round(e.time_s + at_s, 2) for e in run.trace.events if e.what == "trigger" and e.time_s > 0] == [
        round(e.time_s, 2) for e in later
    ]


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        (
            {"a": "5 m ahead of b", "b": "5 m behind c", "c": "9 m behind a"},
            "refer to each other in a circle: a from b from c from a",
        ),
        ({"a": "5 m ahead of a"}, "the place of a refers to a itself"),
        ({"a": "20 m behind b", "b": "5 m along street"}, "before the beginning of the route of b"),
        ({"a": "400 m ahead of b", "b": "5 m along street"}, "after the end of the route of b"),
        ({"a": "9 m ahead of b", "b": "500 m along street"}, "street is only 400.0 m long"),
        (
            {"a": "9 m ahead of cars_02"},
            "cars_02 belongs to the background traffic, which is placed after all other actors",
        ),
    ],
)
def test_impossible_starts_are_said_once(tmp_path: Path, starts: dict[str, str], message: str) -> None:
    actors = "".join(
        f"  vehicle {name}: car.compact {{\n    route [street]\n    start at {place}\n  }}\n"
        for name, place in starts.items()
    )
    ego = "  ego: car.sedan {\n    route [street]\n    start at 200 m along street\n  }\n"
    traffic = "  traffic cars {\n    count 2\n    models [car.compact]\n    within 90 m of ego.route\n    seed 1\n  }\n"
    file = tmp_path / "s.foresee"
    file.write_text(text(actors=ego + actors + (traffic if "cars" in message else "")))
    with pytest.raises(InputError, match=message) as raised:
        compile_test_case(load_test_case(str(file)))
    (only,) = raised.value.diagnostics
    assert only.code == "FS252"
    assert only.span is not None


def test_a_pedestrian_behind_a_parked_van_is_in_sight_of_who_looks_from_the_other_side(
    driven: tuple[TestCase, RunResult],
) -> None:
    found = {c: e.held for c, e in zip(JUDGED, driven[1].expectations, strict=True)}
    assert found["walker in sight of oncoming"]
    assert not found["walker in sight of ego"]
    headings = driven[1].trace.states[0, :, HEADING]
    assert abs(headings[0]) < 0.01
