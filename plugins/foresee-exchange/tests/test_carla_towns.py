"""The paper's 120 routes and three more towns, from CARLA's own files (skipped where they are not)."""

from __future__ import annotations

import cmath
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from corpus.carla_towns import (
    MAPS,
    cases_of,
    drive_alone,
    import_town,
    passages,
    with_signals_off,
    without_traffic,
)
from foresee_exchange.carla.files import CarlaRoute, read_routes
from foresee_exchange.carla.ways import Way, way_between

from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.foreign.networks import foreign_net
from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.nets.net_reader import read_network
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.routing import RouteError
from foresee_dsl.exchange.outcome import Imported
from foresee_dsl.language.document import TestCase

FAMILIES = {
    "Town10HD": {"3": 16, "4": 46, "7": 19, "8": 19, "9": 20},
    "Town01": {"3": 6, "4": 48, "7": 24, "8": 24, "9": 24},
    "Town02": {"3": 6, "4": 33, "7": 16, "8": 16, "9": 16},
    "Town03": {"3": 23, "4": 144, "7": 48, "8": 30, "9": 34},
}
DISTINCT = {"Town10HD": 85, "Town01": 78, "Town02": 54, "Town03": 214}


def routes_of(carla: Path, town: str) -> list[CarlaRoute]:
    return [route for file in sorted(carla.glob(f"routes/*/{town}_*.xml")) for route in read_routes(file, Counter())]


def ways(network: RoadNetwork, routes: list[CarlaRoute], *, flip: bool = True) -> list[Way]:
    """The ways of the routes whose places are within half a metre of a lane."""

    def pose(place: Pose) -> Pose:
        return place if flip else Pose(place.x, -place.y, -place.heading_rad)

    found = []
    for route in routes:
        try:
            way = way_between(network, pose(route.start), pose(route.end))
        except RouteError:
            continue
        if max(way.start.off_m, way.end.off_m) < 0.5:
            found.append(way)
    return found


@pytest.fixture(scope="module")
def town_imported(carla: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], tuple[Imported, Path]]:
    """Import a town, once: what the import reports, and its folder."""

    @cache
    def imported(town: str) -> tuple[Imported, Path]:
        out = tmp_path_factory.mktemp(town) / "out"
        return import_town(carla, town, out), out

    return imported


@pytest.fixture(scope="module")
def cases(town_imported: Callable[[str], tuple[Imported, Path]]) -> dict[str, list[TestCase]]:
    return cases_of(town_imported("Town10HD")[1])


@pytest.fixture(scope="module")
def bundles(cases: dict[str, list[TestCase]]) -> dict[str, list[SumoBundle]]:
    return {family: [compile_test_case(without_traffic(case)) for case in group] for family, group in cases.items()}


@pytest.mark.parametrize("town", ["Town10HD", "Town01", "Town02", pytest.param("Town03", marks=pytest.mark.slow)])
def test_every_route_of_a_town_becomes_a_case(
    carla: Path, town_imported: Callable[[str], tuple[Imported, Path]], town: str
) -> None:
    done, out = town_imported(town)
    assert done.taken == {f"routes of family {family}": count for family, count in FAMILIES[town].items()}
    assert done.cases == sum(FAMILIES[town].values())
    assert {f: len(group) for f, group in cases_of(out).items()} == FAMILIES[town]
    assert (out / Path(MAPS[town]).name).exists()
    assert len({(route.start, route.end) for route in routes_of(carla, town)}) == DISTINCT[town]


def test_every_waypoint_of_town10_is_on_a_lane_and_the_flip_matters(carla: Path) -> None:
    network = read_network(foreign_net(carla / "maps" / MAPS["Town10HD"]))
    routes = routes_of(carla, "Town10HD")
    found = ways(network, routes)
    assert len(found) == 120
    assert max(max(way.start.off_m, way.end.off_m) for way in found) < 0.1
    assert sum(way.start.lane.internal or way.end.lane.internal for way in found) == 74
    assert len(ways(network, routes, flip=False)) <= 15


def test_starts_and_goals_are_carlas(carla: Path, bundles: dict[str, list[SumoBundle]]) -> None:
    places = {(r.family, r.id): r for r in routes_of(carla, "Town10HD")}
    for family, group in bundles.items():
        for bundle in group:
            route = places[family, bundle.name.rpartition("_")[2]]
            ego = bundle.scene.actors[0]
            assert ego.line is not None
            front = cmath.rect(ego.model.length_m / 2, ego.heading_rad)  # CARLA says where the middle is
            assert abs(complex(ego.x - route.start.x, ego.y - route.start.y) - front) < 0.1
            x, y, _ = ego.line.at(bundle.scene.goal_s)
            assert abs(complex(x - route.end.x, y - route.end.y)) < 3.6  # at most a lane beside
            assert 70 <= bundle.scene.goal_s - bundle.scene.start_s <= 190


def test_what_lies_on_the_ways(bundles: dict[str, list[SumoBundle]]) -> None:
    over = {family: [passages(bundle) for bundle in group] for family, group in bundles.items()}
    assert all(any(p.signal for p in way) for family in "789" for way in over[family])
    assert not any(p.signal for way in over["3"] for p in way)
    assert sum(any(p.turn == "left" for p in way) for way in over["8"]) >= 17
    assert sum(any(p.turn == "right" for p in way) for way in over["9"]) >= 18


def test_limits_are_the_maps(bundles: dict[str, list[SumoBundle]]) -> None:
    line = bundles["3"][0].scene.actors[0].line
    assert line is not None
    limits = {round(limit, 2) for limit in line.limits}
    assert 13.89 not in limits
    assert min(limits) > 5


def test_routes_are_driven_to_their_goal_alone(
    cases: dict[str, list[TestCase]], bundles: dict[str, list[SumoBundle]], tmp_path: Path
) -> None:
    """Every eighth; `python -m corpus.carla_towns` drives all."""
    off = with_signals_off(bundles["3"][0].net_file, tmp_path / "off.net.xml")
    chosen = [case for group in cases.values() for case in group][::8]
    verdicts = {case.id: drive_alone(case, off).verdict for case in chosen}
    assert set(verdicts.values()) == {"pass"}, verdicts


def test_the_cases_are_no_copies(cases: dict[str, list[TestCase]]) -> None:
    assert len({case.meaning for group in cases.values() for case in group}) == 120


def test_town10_has_stages_named_by_where_traffic_comes_from(bundles: dict[str, list[SumoBundle]]) -> None:
    signals = bundles["7"][0].signals
    assert signals["189"].stages == ("ew_go", "ns_go")
    assert {len(signal.stages) for signal in signals.values()} == {2}
    for group in bundles.values():
        for bundle in group:
            for junction, stage, elapsed in bundle.scene.signals:
                bundle.signals[junction].phase_at(stage, elapsed)
