"""Runs and behaviour as OpenSCENARIO: valid, with the right places and times, and the same after the way back."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from foresee_exchange.openscenario.reading import importer as openscenario_import
from foresee_exchange.openscenario.writing import exporter as openscenario_export
from foresee_exchange.openscenario.writing.behaviour import waypoints
from foresee_exchange.openscenario.writing.exporter import recorded_groups
from foresee_exchange.openscenario.writing.library import library
from typer.testing import CliRunner

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.cli import app
from foresee_dsl.compile import compile_test_case
from foresee_dsl.exchange.outcome import ExchangeError
from foresee_dsl.language.model import Mutant, Origin
from foresee_dsl.language.project.loading import load_test_case
from foresee_dsl.simulate.trace import HEADING, STEP_S, Trace, X, Y
from tests.support.openscenario_checker import issues
from tests.support.openscenario_files import XODR

CROSSING = """foresee 1

scenario crossroads {
  network {
    junction middle at (0 m, 0 m) signals {
      stage through for 20 s green [west]
      stage side for 8 s green [south]
    }
    junction west_end at (-120 m, 5 m)
    junction east_end at (120 m, 0 m)
    junction south_end at (10 m, -120 m)
    road west from west_end to middle { lanes 2; sidewalk 2 m }
    road east from middle to east_end { lanes 2; sidewalk 2 m }
    road south from south_end to middle { sidewalk 2 m }
  }

  weather rain 0.4, wetness 0.5

  ego: car.sedan {
    route from west straight over middle
    start at 20 m along ego.route
    start speed 36 km/h
  }
  vehicle turner: van.delivery {
    route from south right over middle
    start at 90 m along south
    start speed 5 m/s
    ignores priority
  }
  vehicle lead: van.delivery {
    route from west straight over middle
    start at 60 m along ego.route
    start speed 8 m/s
    speed 8 m/s
  }
  bicycle cyclist: bicycle.city {
    path [(-60 m, -6 m), (-30 m, -6 m), (-20 m, -3 m)]
    delay 1 s
  }
  pedestrian walker: pedestrian.elderly {
    path [(40 m, -8 m), (40 m, 8 m)]
  }
  obstacle crate: obstacle.parked_car {
    start at (60 m, -8 m)
  }

  signal middle stage side elapsed 5 s

  when ego.eta(middle) < 4 s {
    walker starts
  }
  when distance(ego, lead) < 40 m and not lead.speed < 2 m/s {
    lead changes speed to 5 m/s over 1 s
    then {
      lead changes lane left
    }
  }

  expect never collision(ego)
  end after 7 s
}
"""


ON_A_MAP = """foresee 1

scenario on_a_map {
  use network "straight.xodr"

  ego: car.sedan {
    route ["-1"]
    start at (100 m, -1.75 m)
    start speed 10 m/s
  }

  end after 2 s
}
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("export") / "crossroads.foresee"
    file.write_text(CROSSING)
    return file


@pytest.fixture(scope="module")
def trace(scenario: Path) -> Trace:
    return run_test_case(load_test_case(scenario), "idm", 0).trace


@pytest.fixture(scope="module")
def exported(scenario: Path) -> Path:
    openscenario_export.run(str(scenario), out=scenario.parent / "out", driver="idm")
    return scenario.parent / "out" / "crossroads.xosc"


def test_the_checker_finds_nothing_and_would_find_something(exported: Path, tmp_path: Path) -> None:
    assert issues(exported, tmp_path) == []
    broken = tmp_path / "broken.xosc"
    broken.write_text(exported.read_text().replace('vehicleCategory="van"', 'vehicleCategory="boat"'))
    assert any("boat" in issue or "schema" in issue for issue in issues(broken, tmp_path))


def test_every_vertex_is_where_the_actor_was_then(exported: Path, trace: Trace) -> None:
    root = ElementTree.parse(exported).getroot()
    centre = {}
    for entity in root.iterfind("Entities/ScenarioObject"):
        box = entity.find("*/BoundingBox/Center")
        centre[entity.get("name")] = float(box.get("x"))
    assert set(centre) == {info.id for info in trace.actors}
    assert centre["ego"] == pytest.approx(4.75 / 2 - 1.05, abs=1e-6)  # the rear axle is 1.05 m before the bumper
    assert centre["walker"] == centre["crate"] == 0
    seen = {}
    for group in root.iter("ManeuverGroup"):
        name = group.find("Actors/EntityRef").get("entityRef")
        k = trace.index(name)
        for vertex in group.iter("Vertex"):
            at = vertex.find("Position/WorldPosition")
            x, y, h = (float(at.get(key)) for key in "xyh")
            frame = trace.frame_at(float(vertex.get("time")))
            assert float(vertex.get("time")) == pytest.approx(frame * STEP_S, abs=1e-6)
            here = x + centre[name] * math.cos(h), y + centre[name] * math.sin(h)
            assert here == pytest.approx(tuple(trace.states[frame, k, :2]), abs=1e-3)
            seen[name] = seen.get(name, 0) + 1
    assert set(seen) == {"ego", "turner", "lead", "cyclist", "walker"}
    assert seen["ego"] == trace.frames
    assert seen["cyclist"] < trace.frames - 15  # it stands for a second: two vertices are enough


def test_who_comes_later_or_leaves_is_added_and_deleted(scenario: Path, trace: Trace) -> None:
    states = trace.states.copy()
    states[:40, trace.index("lead")] = np.nan
    states[100:, trace.index("cyclist")] = np.nan
    cut = replace(trace, states=states)
    specs = {actor.id: actor.model for actor in compile_test_case(load_test_case(scenario)).scene.actors}
    told = {}
    for group in recorded_groups(cut, specs):
        element = group.get_element()
        events = [
            (event.get("name"), float(event.find(".//SimulationTimeCondition").get("value")))
            for event in element.iter("Event")
        ]
        told[element.find("Actors/EntityRef").get("entityRef")] = events
    assert told["lead"] == [("lead_comes", 2.0), ("lead_goes", 2.0)]
    assert told["cyclist"] == [("cyclist_goes", 0.0), ("cyclist_leaves", 5.0)]
    assert told["turner"] == [("turner_goes", 0.0)]


def test_signals_show_what_they_showed(exported: Path) -> None:
    root = ElementTree.parse(exported).getroot()
    (controller,) = root.iterfind("RoadNetwork/TrafficSignals/TrafficSignalController")
    phases = [(phase.get("name"), float(phase.get("duration"))) for phase in controller.iterfind("Phase")]
    assert phases == [("side_1", 3.0), ("side_2", 3.0), ("side_3", 2.0)]  # 5 s of 8 are over; amber, all red: 8 s > 7 s
    heads = {signal.get("id") for signal in ElementTree.parse(exported.with_suffix(".xodr")).iter("signal")}
    shown = [{s.get("trafficSignalId"): s.get("state") for s in p} for p in controller.iterfind("Phase")]
    assert all(set(states) <= heads for states in shown)
    assert [sorted(set(states.values())) for states in shown] == [["green", "red"], ["red", "yellow"], ["red"]]


def test_the_same_run_gives_the_same_bytes(scenario: Path, exported: Path, tmp_path: Path) -> None:
    openscenario_export.run(str(scenario), out=tmp_path, driver="idm")
    for name in ("crossroads.xosc", "crossroads.xodr"):
        assert (tmp_path / name).read_bytes() == (exported.parent / name).read_bytes()


def test_the_way_back_keeps_entities_times_and_places(scenario: Path, exported: Path, trace: Trace) -> None:
    out = exported.parent / "back"
    done = openscenario_import.run(exported, out=out)
    assert done.left_out == {"programs of signals": 1}
    before = compile_test_case(load_test_case(scenario)).scene
    back = load_test_case(out / "crossroads.foresee")
    scene = compile_test_case(back).scene
    assert [(a.id, a.model) for a in scene.actors] == [(a.id, a.model) for a in before.actors]
    assert (scene.rain, scene.friction, scene.end_s) == pytest.approx((before.rain, before.friction, trace.duration_s))

    again = run_test_case(back, "idm", 0).trace
    for k, info in enumerate(trace.actors):
        assert again.actors[k].id == info.id
        was, now = trace.states[:, k], again.states[:, k]
        assert np.hypot(now[0, X] - was[0, X], now[0, Y] - was[0, Y]) < 1e-3
        assert abs(math.remainder(now[0, HEADING] - was[0, HEADING], math.tau)) < 1e-3
    # The turner goes by the limits of whoever follows a path: acceleration, and bends on a wet road.
    for name, limit_m in (("turner", 1.0), ("lead", 0.1), ("cyclist", 0.1), ("walker", 0.1)):
        k, frames = trace.index(name), min(trace.frames, again.frames)
        off = np.hypot(*(trace.states[:frames, k, :2] - again.states[:frames, k, :2]).T)
        assert off.max() < limit_m, name


def test_the_map_is_where_the_net_is(scenario: Path, exported: Path) -> None:
    """Lanes of the map, read back, lie on those of the net that was driven on."""
    from foresee_dsl.compile.foreign.networks import foreign_net
    from foresee_dsl.compile.nets.net_reader import read_network

    ours = compile_test_case(load_test_case(scenario)).network
    theirs = read_network(foreign_net(exported.with_suffix(".xodr")))
    lanes = [lane for edge in ours.edges.values() for lane in edge.for_kind("car")]
    assert len(lanes) == 10
    for lane in lanes:
        x, y, heading = lane.line.at(lane.line.length_m / 2)
        near = theirs.nearest_lane(x, y, heading)
        assert near is not None
        assert abs(near.lateral_m) < 0.02


def test_lanes_for_buses_and_bicycles_have_opendrives_types_and_bus_stops_are_counted(tmp_path: Path) -> None:
    """netconvert 1.28 writes the types of the net, which OpenDRIVE does not know."""
    road = "road west from west_end to middle { lanes 2; "
    text = CROSSING.replace(road, road + "bus_lane 3 m; cycle_track 2 m; ")
    text = text.replace("  }\n\n  weather", "    stop market on west at 90 m length 12 m bay 3 m\n  }\n\n  weather")
    (file := tmp_path / "crossroads.foresee").write_text(text)
    done = openscenario_export.run(str(file), out=tmp_path, driver="idm")
    assert done.left_out == {"bus stops (of a bay, its lane for buses is there)": 1, "expectations": 1}
    lanes = list(ElementTree.parse(tmp_path / "crossroads.xodr").getroot().iter("lane"))
    assert {lane.get("type") for lane in lanes} == {"none", "driving", "bus", "biking", "sidewalk", "restricted"}
    bays = [lane for lane in lanes if lane.get("type") == "bus" and lane.find("width").get("a") == "3.0000"]
    assert len(bays) == 5, "a bus lane on three pieces and on the way back, and a bay"


def test_behaviour_is_told_as_far_as_it_goes(scenario: Path, tmp_path: Path) -> None:
    done = openscenario_export.run(str(scenario), out=tmp_path, driver="idm", behaviour=True)
    file = tmp_path / "crossroads.xosc"
    assert issues(file, tmp_path) == []
    assert done.left_out == {
        "conditions: eta to a junction (timed as in the run)": 1,
        "rules that actors ignore": 1,
        "expectations": 1,
    }
    root = ElementTree.parse(file).getroot()
    events = {event.get("name"): event for event in root.iter("Event")}
    slows, over = events["when_2_lead"], events["when_2_2_lead"]
    conditions = [
        next(iter(c)).find("EntityCondition") for c in slows.iterfind("StartTrigger/ConditionGroup/Condition")
    ]
    assert [next(iter(c)).tag for c in conditions] == ["RelativeDistanceCondition", "SpeedCondition"]
    assert next(iter(conditions[1])).get("rule") == "greaterOrEqual"  # not slower than
    waits = over.find("StartTrigger/ConditionGroup/Condition/ByValueCondition/StoryboardElementStateCondition")
    assert (waits.get("storyboardElementRef"), waits.get("state")) == ("when_2_lead", "completeState")
    assert over.find("Action/PrivateAction/LateralAction/LaneChangeAction") is not None
    assert "ego_cruise" not in events  # its driver decides
    starts = events["when_1_walker"].find(
        "StartTrigger/ConditionGroup/Condition/ByValueCondition/SimulationTimeCondition"
    )
    assert 0 < float(starts.get("value")) < 7

    back = openscenario_import.run(file, out=tmp_path / "back")
    trace = run_test_case(load_test_case(tmp_path / "back" / "crossroads.foresee"), "idm", 0).trace
    assert back.cases == 1
    walker = trace.states[:, trace.index("walker"), Y]
    assert walker[0] == -8
    assert walker[-1] > -7.5  # it has set off


_HELD_UP = """foresee 1

scenario held_up {
  network {
    junction a at (0 m, 0 m)
    junction b at (400 m, 0 m)
    road main from a to b { lanes 1; back 0 }
  }

  ego: car.sedan {
    route [main]
    start at 10 m along main
    start speed 5 m/s
  }
  vehicle fast: car.compact {
    route [main]
    start at 60 m along main
    start speed 12 m/s
    speed 12 m/s
  }
  vehicle slow: van.delivery {
    route [main]
    start at 80 m along main
    start speed 3 m/s
    speed 3 m/s
  }

  end after 8.5 s
}
"""


def test_a_time_to_collision_along_the_road_goes_out_and_comes_back(tmp_path: Path) -> None:
    condition = "ttc_along(fast, slow) < 1.2 s"
    file = tmp_path / "held_up.foresee"
    file.write_text(
        _HELD_UP.replace("  end after", f"  when {condition} {{ slow changes speed to 5 m/s }}\n\n  end after")
    )
    done = openscenario_export.run(str(file), out=tmp_path, driver="idm", behaviour=True)
    assert not done.left_out
    (found,) = ElementTree.parse(tmp_path / "held_up.xosc").getroot().iter("TimeToCollisionCondition")
    asked = {"relativeDistanceType": "longitudinal", "coordinateSystem": "road", "freespace": "true", "value": "1.2"}
    assert asked.items() <= found.attrib.items()
    openscenario_import.run(tmp_path / "held_up.xosc", out=tmp_path / "back")
    assert condition in (tmp_path / "back" / "held_up.foresee").read_text()


def test_an_actor_that_a_player_moves_in_another_way_is_said(tmp_path: Path) -> None:
    """Who is held up here drives on at 12 m/s there: 96 m in 8 s; who holds it up does what is written."""
    (tmp_path / "held_up.foresee").write_text(_HELD_UP)
    done = openscenario_export.run(str(tmp_path / "held_up.foresee"), out=tmp_path, driver="idm", behaviour=True)
    (note,) = [note for note in done.notes if " deviates from this run " in note]
    assert note.startswith("in a player that follows the file exactly, fast deviates from this run by ")
    after_8_s = float(note.partition(" m after 8 s")[0].rpartition(" ")[2])
    trace = run_test_case(load_test_case(tmp_path / "held_up.foresee"), "idm", 0).trace
    ran = trace.states[trace.frame_at(8.0), trace.index("fast"), X] - trace.states[0, trace.index("fast"), X]
    assert after_8_s == pytest.approx(96 - ran, abs=0.1)


def test_an_actor_whose_lane_forks_is_said(tmp_path: Path) -> None:
    """A waypoint names a road: esmini goes on straight in a lane where others_02 goes on in the lane beside it."""
    file = Path(__file__).parents[3] / "scenarios/scenario3/between_parked_cars.foresee"
    done = openscenario_export.run(f"{file}::child_after_ball", out=tmp_path, driver="idm", behaviour=True)
    assert "others_02 can continue on two lanes at park_ash, and the player decides on which of them" in done.notes
    assert sum(" can continue on two lanes " in note for note in done.notes) < done.taken["of class car"] / 2


def test_an_imported_map_is_given_back_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "straight.xodr").write_text(XODR)
    file = tmp_path / "on_a_map.foresee"
    file.write_text(ON_A_MAP)
    arguments = ["export", "openscenario", str(file), "--out", str(tmp_path / "out"), "--driver", "idm", "--json"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["taken"] == {"of class car": 1}
    assert (tmp_path / "out" / "on_a_map.xodr").read_text() == XODR
    openscenario_import.run(tmp_path / "out" / "on_a_map.xosc", out=tmp_path / "back")
    ego = compile_test_case(load_test_case(tmp_path / "back" / "on_a_map.foresee")).scene.ego
    assert (ego.x, ego.y) == pytest.approx((100, -1.75), abs=1e-3)


def test_without_the_package_it_says_what_to_install(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "scenariogeneration", None)
    library.cache_clear()
    with pytest.raises(ExchangeError, match="pip install"):
        openscenario_export.run(str(scenario), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_file_cannot_name_a_program_to_run(scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver that a mutant records is not started where it is a program."""
    origin = Origin(driver="keeper 2 via external:python3 keeper.py")
    mutant = Mutant(name="m", parent="c.foresee", pin="sha256:000000000000", body=(origin,))
    recorded = replace(load_test_case(scenario), mutant=mutant)
    monkeypatch.setattr(openscenario_export, "load_test_case", lambda *_, **__: recorded)
    with pytest.raises(ExchangeError, match="or another driver, with --driver"):
        openscenario_export.run("m.foresee", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_waypoints_lie_outside_of_junctions(scenario: Path) -> None:
    """On the roads inside, which lie over each other, esmini finds another than the one meant, and aborts."""
    line = compile_test_case(load_test_case(str(scenario))).scene.ego.line
    assert line is not None
    inside = [(passage.entry_s, passage.exit_s) for passage in line.passages]
    assert inside
    for start_s, goal_s in ((line.origin_s, line.end_s), (inside[0][0] + 1, line.end_s), (0.0, inside[0][0] + 1)):
        found = waypoints(line, start_s, goal_s)
        assert found == sorted(found) and len(found) > 1
        if goal_s > inside[0][1]:
            assert all(s < begin - 1 or s > end + 1 for s in found for begin, end in inside)
