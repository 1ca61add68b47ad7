"""Scenes: where actors are, and what is said about those that cannot be there."""

import math

import numpy as np
import pytest

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.placement.scene import friction_of
from foresee_dsl.errors import InputError
from tests.support.worlds import EGO, PLAIN, case_of, four_arms, net_of, problems_of, scene_of

LANE = 1.65


def only(scene, name):
    return next(a for a in scene.actors if a.id == name)


def test_the_ego_on_its_route():
    scene = scene_of(EGO)
    ego = scene.ego
    assert (ego.control, ego.route, ego.lane) == ("ego", ("south", "north_back"), "south_1")
    assert (ego.x, ego.y, ego.heading_rad) == pytest.approx((LANE, -90, math.pi / 2))
    assert ego.speed_mps == ego.cruise_mps == pytest.approx(13.89, abs=0.01)
    assert scene.start_s == pytest.approx(30) and scene.goal_s == pytest.approx(235)
    assert (scene.end_s, scene.friction, scene.clip) == (60, 0.9, False)


def test_a_start_is_left_out():
    scene = scene_of("ego: car.sedan { route from south straight over j4 }")
    assert scene.start_s == pytest.approx(scene.ego.model.length_m), "wholly on its first edge"


@pytest.mark.parametrize(
    ("place", "where"),
    [
        ("30 m along south", (LANE, -90)),
        ("30 m along south offset 0.5 m", (LANE - 0.5, -90)),
        ("-40 m along ego.route", None),
        ("(1.7 m, -80 m)", (1.7, -80)),
        ("30 m before j4 on ego.route", (LANE, "entry - 30")),
    ],
)
def test_places_for_the_start(place, where):
    text = f"ego: car.sedan {{\n route from south straight over j4\n start at {place}\n}}"
    if where is None:
        (problem,) = problems_of(text)
        assert problem[:2] == ("ego", "start_at") and "40.0 m before the beginning" in problem[2]
        return
    ego = scene_of(text).ego
    y = ego.line.at(ego.line.passages[0].entry_s - 30)[1] if isinstance(where[1], str) else where[1]
    assert (ego.x, ego.y) == pytest.approx((where[0], y), abs=1e-6)
    assert ego.heading_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("place", ["20 m past j4 on ego.route", "150 m along ego.route"])
def test_who_starts_beside_anothers_route_faces_along_its_own(place):
    start = f"start at {place} offset {2 * LANE} m"
    text = f"vehicle other: car.compact {{\n route from north straight over j4\n {start}\n}}"
    scene = scene_of(EGO + text)
    other = next(actor for actor in scene.actors if actor.id == "other")
    assert other.heading_rad == pytest.approx(-math.pi / 2)
    assert scene.ego.heading_rad == pytest.approx(math.pi / 2)


def test_places_on_the_egos_route_are_measured_from_its_start():
    scene = scene_of(
        EGO
        + "obstacle ahead: obstacle.crate { start at 45 m along ego.route offset -1 m }\n"
        + "obstacle beyond: obstacle.crate { start at 12 m past j4 on ego.route }\n"
    )
    assert (only(scene, "ahead").x, only(scene, "ahead").y) == pytest.approx((LANE + 1, -45))
    exit_y = scene.ego.line.at(scene.ego.line.passages[0].exit_s)[1]
    beyond = only(scene, "beyond")
    assert (beyond.x, beyond.y, beyond.control) == (pytest.approx(LANE), pytest.approx(exit_y + 12), "static")


def test_a_parked_car_stands_with_its_front_at_the_place():
    car = only(scene_of(EGO + "vehicle parked: car.compact { start at 60 m along west }"), "parked")
    assert (car.control, car.x, car.y) == ("static", pytest.approx(-60 - car.model.length_m / 2), pytest.approx(-LANE))


def test_walkers_follow_their_path_and_wait_for_their_trigger():
    scene = scene_of(
        EGO
        + "pedestrian walker: pedestrian.adult { path [(6 m, -30 m), (-6 m, -30 m)] }\n"
        + "bicycle rider: bicycle.city {\n path [40 m along ego.route offset -3 m, (-6 m, -50 m)]\n}\n"
        + "when ego.eta(j4) < 4 s {\n walker starts\n}"
    )
    walker, rider = only(scene, "walker"), only(scene, "rider")
    assert (walker.control, walker.waits, walker.speed_mps) == ("path", True, 0)
    assert (walker.x, walker.y, walker.heading_rad) == pytest.approx((6, -30, math.pi))
    assert walker.cruise_mps == pytest.approx(1.3)
    assert np.allclose(rider.path, [(LANE + 3, -50), (-6, -50)])
    assert rider.speed_mps == rider.cruise_mps == pytest.approx(15 / 3.6) and not rider.waits


def test_a_path_along_a_crossing_obeys_its_signal():
    crossing = next(iter(read_network(net_of(PLAIN)).crossings.values()))
    (x0, y0), (x1, y1) = crossing.lane.shape[0], crossing.lane.shape[-1]

    def stops(beside_m):
        path = f"[({x0} m, {y0 + beside_m} m), ({x1} m, {y1 + beside_m} m)]"
        return only(scene_of(f"{EGO}pedestrian a: pedestrian.adult {{ path {path} }}"), "a").walk_stops

    assert stops(0.0) == ((0.0, pytest.approx(math.hypot(x1 - x0, y1 - y0)), "j4", crossing.link),)
    assert stops(0.5) == (), "who crosses beside it looks at no light"


def test_an_exact_state_is_kept():
    text = (
        "ego: car.sedan at (1.700 m, -40.000 m) heading 91 deg speed 9 m/s acceleration 0.5 m/s^2 steer 2 deg {\n"
        " route [south, north_back]\n speed 40 km/h\n}\n"
        "pedestrian walker: pedestrian.adult at (3 m, -20 m) heading 180 deg speed 1.2 m/s {\n"
        " path [(6 m, -20 m), (-6 m, -20 m)]\n moving 3 m\n}\n"
        "vehicle parked: car.compact at (-20 m, -5 m) heading 0 deg speed 0 m/s\n"
    )
    scene = scene_of(text)
    ego, walker, parked = scene.actors
    assert (ego.x, ego.y, ego.speed_mps, ego.acceleration_mps2) == (1.7, -40.0, 9.0, 0.5)
    assert (math.degrees(ego.heading_rad), math.degrees(ego.steer_rad)) == pytest.approx((91, 2))
    assert ego.lane == "south_1" and scene.start_s == pytest.approx(80, abs=0.01)
    assert (walker.x, walker.y, walker.along_m, walker.speed_mps) == (3.0, -20.0, 3.0, 1.2)
    assert parked.x == pytest.approx(-20 - parked.model.length_m / 2), "a state says where the front is"


def test_a_state_inside_the_junction_finds_its_lane():
    line = scene_of("ego: car.sedan { route from south left over j4 }").ego.line
    x, y, heading = line.at(line.passages[0].entry_s + 4)
    at = f"at ({x:.3f} m, {y:.3f} m) heading {math.degrees(heading):.3f} deg speed 6 m/s"
    scene = scene_of(f"ego: car.sedan {at} {{ route [south, west_back] }}")
    passage = scene.ego.line.passages[0]
    assert scene.ego.lane in passage.movement.via
    assert scene.start_s == pytest.approx(passage.entry_s + 4, abs=0.01)


def test_an_author_may_start_on_a_later_edge():
    ego = scene_of("ego: car.sedan {\n route from south straight over j4\n start at 20 m along north_back\n}").ego
    assert ego.route == ("north_back",) and ego.lane == "north_back_1"


def test_the_start_chooses_the_lane():
    text = "ego: car.sedan {\n route from west straight over j4\n start at 20 m along west offset 3.3 m\n}"
    scene = scene_of(text, four_arms(median=0, via=()))
    assert scene.ego.lane == "west_2" and scene.ego.line.lane_at(scene.start_s) == "west_2"


def test_everything_else_an_actor_says():
    text = EGO + (
        "vehicle runner: car.compact {\n route from west straight over j4\n speed 36 km/h\n start speed 5 m/s\n"
        " ignores signals at j4\n meets ego at j4 after 1.5 s\n timing 0.9\n delay 0.5 s\n"
        " steers 0.2 from 1 s for 2 s\n}\n"
        "weather wetness 0.5\nsignal j4 stage ew_go elapsed 3 s\nend after 20 s"
    )
    scene = scene_of(text)
    runner = only(scene, "runner")
    assert (runner.cruise_mps, runner.timing, runner.delay_s) == (10, 0.9, 0.5)
    assert runner.speed_mps == 0, "it moves off later"
    assert runner.ignores == (("signals", "j4"),) and runner.meets[0].junction == "j4"
    assert (runner.steering.value, runner.steering.from_s, runner.steering.until_s) == (0.2, 1.0, 3.0)
    assert scene.signals == (("j4", "ew_go", 3.0),) and scene.end_s == 20
    assert scene.friction == pytest.approx(friction_of(0.5)) == pytest.approx(0.7)


OBSTACLE = "obstacle box: obstacle.crate { start at (%s m, %s m) }"
RUNNER = "vehicle runner: car.compact {\n%s\n}"


@pytest.mark.parametrize(
    ("text", "actor", "item", "message"),
    [
        (RUNNER % "route from west back over j4", "runner", "route", "vehicles can go"),
        (RUNNER % "route from wets straight over j4", "runner", "route", "no road or edge called wets"),
        (RUNNER % "route from west straight over j4\nstart at 400 m along west", "runner", "start_at", "is only"),
        (RUNNER % "route from west straight over j4\nstart at 20 m along wset", "runner", "start_at", "called wset"),
        (RUNNER % "route from west straight over j4\nstart at 20 m along east", "runner", "start_at", "off its route"),
        (RUNNER % "route from west straight over j4\nstart at (-60 m, 30 m)", "runner", "start_at", "off its route"),
        (RUNNER % "start at 50 m past j4 on nobody.route", "runner", "start_at", "no actor called nobody"),
        (RUNNER % "route from west straight over j4\nspeed 500 km/h", "runner", "speed", "can reach only"),
        (RUNNER % "route from west straight over j4\nstart speed 500 km/h", "runner", "start_speed", "can reach only"),
        (
            RUNNER % "route from south straight over j4\nstart at 33 m along south",
            "runner",
            "start_at",
            "on top of ego",
        ),
        (RUNNER % "route from west straight over j4\nignores signals at j9", "runner", "ignores", "called j9"),
        (OBSTACLE % (60, 60), "box", "start_at", "off the road"),
        ("pedestrian p: pedestrian.adult { path [(6 m, 0 m), (90 m, 90 m)] }", "p", "path", "off the road"),
        ("pedestrian p: pedestrian.adult { route from south straight over j4 }", "p", "route", "cannot follow a route"),
        ("signal j9 stage ns_go elapsed 1 s", "", "signal", "no signal at j9"),
        ("signal j4 stage nsgo elapsed 1 s", "", "signal", "no stage called nsgo"),
        ("when ego.eta(j9) < 4 s {\n ego stops\n}", "", "when", "no junction called j9"),
        (
            RUNNER % "route from south_back" + "\nwhen time > 1 s {\n runner meets ego at j4 after 1 s\n}",
            "",
            "when",
            "runner does not go over it",
        ),
    ],
)
def test_what_cannot_be_is_said(text, actor, item, message):
    found = problems_of(EGO + text)
    assert [(p[0], p[1]) for p in found] == [(actor, item)], found
    assert message in found[0][2]


def test_a_vehicle_off_the_road_is_told_where_the_road_is():
    state = "ego: car.sedan at (40 m, -60 m) heading 90 deg speed 5 m/s { route [south, north_back] }"
    (problem,) = problems_of(state)
    assert "off" in problem[2]


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        ("10 m along south", "behind the ego's start"),
        ("(60 m, 40 m)", "off the ego's route"),
        ("40 m past j9 on ego.route", "no junction called j9"),
        ("400 m along ego.route", "after the end of the route"),
    ],
)
def test_goals_must_be_ahead_on_the_route(goal, message):
    (problem,) = problems_of(EGO.replace("}", f" goal {goal}\n}}"))
    assert problem[:2] == ("ego", "goal") and message in problem[2]


def test_all_mistakes_are_said_at_once():
    found = problems_of(EGO + RUNNER % "route from wets straight over j4" + "\n" + OBSTACLE % (60, 60))
    assert {p[0] for p in found} == {"runner", "box"}


def test_starts_that_depend_on_each_other_are_refused():
    a = "vehicle a: car.compact {\n route from west straight over j4\n start at 5 m along b.route\n}\n"
    b = "vehicle b: car.compact {\n route from west straight over j4\n start at 5 m along a.route\n}\n"
    (found,) = problems_of(EGO + a + b)
    assert "refer to each other in a circle: a from b from a" in found[2]


def test_a_start_that_is_impossible_is_said_once():
    b = "vehicle b: car.compact {\n route from west straight over j4\n start at 9000 m along b.route\n}\n"
    a = b.replace("b:", "a:").replace("9000 m", "5 m")
    condition = "expect never ego within 5 m of 5 m along b.route\n"
    (found,) = problems_of(EGO + a + b + condition)
    assert found[:2] == ("b", "start_at") and "after the end" in found[2]


def test_compiling_shares_what_is_equal_and_points_at_mistakes():
    first, second = compile_test_case(case_of(EGO)), compile_test_case(case_of(EGO))
    assert first.network is second.network and first.key == second.key
    assert first.scene.ego.line is second.scene.ego.line
    assert first.types_file.read_bytes() == second.types_file.read_bytes()
    with pytest.raises(InputError) as found:
        compile_test_case(case_of(EGO + OBSTACLE % (60, 60)))
    (diagnostic,) = found.value.diagnostics
    assert diagnostic.source_line == OBSTACLE % (60, 60) and diagnostic.code == "FS253"
